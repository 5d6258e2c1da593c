"""What observes the car besides the controller: the learnt model's adapter, and a model's own states."""

from typing import NamedTuple

from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort, System

from drift_drake.car.step_model import StepModel
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.hybrid_step import HybridStepModel
from drift_drake.drive.mpc.controller import Controller, MpcController
from drift_drake.drive.mpc.tightening import LaneTightening


def lane_tightening(kappa: float, adapter: BayesianAdapter | None) -> LaneTightening | None:
    """What narrows the lane by `kappa` standard deviations of the adapter's belief; None where it is not narrowed.

    Raises:
        ValueError: a tightened lane without an adapter, or with that of a hybrid model.
    """
    if kappa <= 0.0:
        return None
    if adapter is None:
        raise ValueError("the lane is tightened by an adapter's belief; give an adapter too (perhaps a frozen one)")
    if adapter.car is not None:
        raise ValueError("the lane is not tightened for a hybrid model; leave control.tightening at 0")
    return LaneTightening(adapter.model.sigma, kappa)


class Learners(NamedTuple):
    """A controller's model and what learns it while it drives."""

    model: StepModel | None
    adapter: BayesianAdapter | None
    tightening: LaneTightening | None

    @property
    def car(self) -> StepModel | None:
        """The model without what is learnt."""
        return self.model.car if isinstance(self.model, HybridStepModel) else self.model

    @property
    def theta_size(self) -> int:
        """Length of what the adapter gives the model; 0 without one."""
        return 0 if self.adapter is None else self.adapter.GetOutputPort("parameters").size()

    def connect(
        self,
        builder: DiagramBuilder,
        controller: MpcController,
        measured_state: OutputPort,
        command: OutputPort,
        theta: OutputPort | None,
        trusted: OutputPort | None = None,
    ) -> None:
        """Adds the adapter, whose belief the controller plans with, and the observer.

        Args:
            theta: what a correction gives the model, if there is one; trusted: of the monitor, if the adapter is to
                forget what it learnt of another car.

        Raises:
            ValueError: nothing forgets.
        """
        if trusted is not None and self.adapter is None:
            raise ValueError("it is an adapter that forgets; give one, or another policy than forget")
        if theta is not None:
            builder.Connect(theta, controller.GetInputPort("theta"))
        if self.adapter is not None:
            builder.AddNamedSystem("adapter", self.adapter)
            builder.Connect(measured_state, self.adapter.GetInputPort("measured_state"))
            builder.Connect(command, self.adapter.GetInputPort("command"))
            self._connect_belief(builder, controller, self.adapter)
            if trusted is not None:
                builder.Connect(trusted, self.adapter.GetInputPort("trusted"))
        ports = {"measured_state": measured_state, "command": command, "theta": theta}
        self._connect_observer(builder, controller, ports)

    def _connect_belief(self, builder: DiagramBuilder, controller: MpcController, adapter: BayesianAdapter) -> None:
        builder.Connect(adapter.GetOutputPort("parameters"), controller.GetInputPort("theta"))
        if self.tightening is not None:
            covariance = adapter.GetOutputPort("posterior_covariance")
            builder.Connect(covariance, controller.GetInputPort("posterior_covariance"))

    def _connect_observer(
        self, builder: DiagramBuilder, controller: MpcController, ports: dict[str, OutputPort | None]
    ) -> None:
        """Adds the observer of the model's own states, for a model that has any; `ports`: that it may ask for."""
        observer: LeafSystem | None
        if self.adapter is not None:
            observer = self.adapter.observer(controller.period)
        else:
            observer = None if self.model is None else self.model.observer(controller.period)
        if observer is None:
            return
        builder.AddNamedSystem("observer", observer)
        for name, port in ports.items():
            if port is not None and observer.HasInputPort(name):
                builder.Connect(port, observer.GetInputPort(name))
        internal = observer.get_output_port()
        if self.adapter is not None:
            builder.Connect(internal, self.adapter.GetInputPort("lagged_command"))
            internal = self.adapter.GetOutputPort("internal_states")
        builder.Connect(internal, controller.GetInputPort("internal_states"))


def check_planner(learners: Learners, controller: Controller | System | None) -> None:
    """Raises ValueError unless one thing alone plans: a model (with its adapter or without) or a controller."""
    if (learners.model is None) == (controller is None):
        raise ValueError("give a model for the predictive controller, or a controller of your own, and not both")
    if controller is not None and learners.adapter is not None:
        raise ValueError("an adapter learns the predictive controller's model; a controller of your own has none")
    car = learners.model.car if isinstance(learners.model, HybridStepModel) else None
    if learners.adapter is not None and learners.adapter.car is not car:
        raise ValueError(
            "the adapter is of another car than the model: give both the same, BayesianAdapter(.., car=car)"
        )
