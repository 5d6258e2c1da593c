"""What follows the car beside the controller: the learnt model's adapter and detector, and a model's own states."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from drift_drake.control.controller import MpcController
from drift_drake.control.step_model import StepModel
from drift_drake.control.tightening import LaneTightening
from drift_drake.model.adapter import BayesianAdapter
from drift_drake.model.out_of_distribution import OutOfDistributionDetector


def lane_tightening(
    kappa: float, adapter: BayesianAdapter | None, detector: OutOfDistributionDetector | None
) -> LaneTightening | None:
    """What narrows the lane by `kappa` standard deviations of the adapter's belief; None where it is not narrowed.

    Raises:
        ValueError: a detector, or a tightened lane, without an adapter.
    """
    if adapter is None:
        for what, wanted in (("the lane is tightened", kappa > 0.0), ("a detector judges", detector is not None)):
            if wanted:
                raise ValueError(f"{what} by an adapter's belief; give an adapter too (perhaps a frozen one)")
        return None
    return LaneTightening(adapter.model.network, adapter.model.sigma, kappa) if kappa > 0.0 else None


def connect_learners(
    builder: DiagramBuilder,
    controller: MpcController,
    adapter: BayesianAdapter | None,
    detector: OutOfDistributionDetector | None,
    measured_state: OutputPort,
    command: OutputPort,
    tightened: bool,
) -> None:
    """Adds the adapter, whose belief the controller plans with, and the detector, which watches that belief."""
    for name, system in (("adapter", adapter), ("detector", detector)):
        if system is not None:
            builder.AddNamedSystem(name, system)
            builder.Connect(measured_state, system.GetInputPort("measured_state"))
            builder.Connect(command, system.GetInputPort("command"))
    if adapter is None:
        return
    builder.Connect(adapter.GetOutputPort("posterior_mean"), controller.GetInputPort("theta"))
    if tightened:
        covariance = adapter.GetOutputPort("posterior_covariance")
        builder.Connect(covariance, controller.GetInputPort("posterior_covariance"))
    if detector is not None:
        for name in ("posterior_mean", "posterior_covariance"):
            builder.Connect(adapter.GetOutputPort(name), detector.GetInputPort(name))


def connect_observer(
    builder: DiagramBuilder,
    model: StepModel,
    period: float,
    controller: MpcController,
    learners: list[BayesianAdapter | OutOfDistributionDetector | None],
    ports: dict[str, OutputPort | None],
) -> None:
    """Adds the observer of the model's own states, for a model that has any, and connects it.

    Args:
        learners: that take these states too; ports: that the observer may ask for, by name.
    """
    observer = model.observer(period)
    if observer is None:
        return
    builder.AddNamedSystem("observer", observer)
    for name, port in ports.items():
        if port is not None and observer.HasInputPort(name):
            builder.Connect(port, observer.GetInputPort(name))
    builder.Connect(observer.get_output_port(), controller.GetInputPort("memory"))
    for learner in learners:
        if learner is not None:
            builder.Connect(observer.get_output_port(), learner.GetInputPort("lagged_command"))
