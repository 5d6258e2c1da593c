"""A Drake system of the user's own in place of the predictive controller: readings in, commands out, states its own."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, DiscreteValues, InputPort, LeafSystem, System

from drift_drake.car.single_track.motion import INPUTS, STATES
from drift_drake.common.selector import select_signals
from drift_drake.common.updates import declare_output, declare_update
from drift_drake.drive.mpc.controller import Controller, ControllerSystem, InvalidControllerError, PlanningSystem
from drift_drake.drive.mpc.plan import Plan

MEASURED = len(STATES) + 1  # and the path position


class HeldReading(LeafSystem):
    """Hands readings on, and the last one that there was in place of none, so that no state of a filter is lost.

    Input port: measured_state [7]. Output port: held_state [7]. State in the Context, each `period`: the last reading.
    """

    def __init__(self, period: float) -> None:
        LeafSystem.__init__(self)
        self._port = self.DeclareVectorInputPort("measured_state", MEASURED)
        self._held = self.DeclareDiscreteState(MEASURED)
        declare_update(self, period, self._update)
        declare_output(self, "held_state", MEASURED, self._reading)

    def _reading(self, context: Context) -> Any:
        x = self._port.Eval(context)
        return x if np.isfinite(x).all() else context.get_discrete_state(self._held).value()

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        discrete.set_value(self._held, self._reading(context))


class CommandPlans(PlanningSystem):
    """Samples commands each `period`: plans that hold them, in force `delay` later.

    Where a command is not finite, and where nothing finite is measured, the last plan goes on, and the failure is
    counted.

    Input ports: command [2]; measured_state [7].
    Output ports: plan [1 + 2 (N + 1)]; statistics, `SolveStatistics`. State in the Context: both.
    """

    def __init__(self, horizon: int, period: float, delay: float) -> None:
        super().__init__(horizon, period, delay)
        self._command = self.DeclareVectorInputPort("command", len(INPUTS))

    def _found(self, context: Context) -> tuple[Plan | None, float]:
        command = self._command.Eval(context)
        if not (np.isfinite(command).all() and np.isfinite(self._measured.Eval(context)).all()):
            return None, 0.0
        return Plan(context.get_time() + self._delay, np.tile(command, (self._horizon + 1, 1))), 0.0


class SystemController(Diagram):
    """A user's system with what makes plans of its commands. Its states live in the Context, so that runs replay.

    Input port: measured_state [7]. Output ports: plan, statistics, as those of `ControllerSystem`.

    Args:
        system: one input of 7 numbers (r [rad/s], v [m/s], beta [rad], omega_r [m/s], e [m], dphi [rad], s [m]) or of
            the first 6, and one output (delta [rad], tau [N m]); horizon, period, delay: see `ControllerSystem`.

    Raises:
        InvalidControllerError: it has no such ports.
    """

    def __init__(self, system: System, horizon: int, period: float, delay: float) -> None:
        Diagram.__init__(self)
        check_ports(system)
        builder = DiagramBuilder()
        builder.AddNamedSystem("own", system)
        held = builder.AddNamedSystem("held_reading", HeldReading(period))
        plans = builder.AddNamedSystem("plans", CommandPlans(horizon, period, delay))
        reading, wanted = held.get_output_port(), _input(system)
        if wanted.size() < MEASURED:
            parts = select_signals({"held_state": (*STATES, "s")}, {"state": STATES})
            builder.AddNamedSystem("without_path_position", parts)
            builder.Connect(reading, parts.get_input_port())
            reading = parts.get_output_port()
        builder.Connect(reading, wanted)
        builder.Connect(system.get_output_port(0), plans.GetInputPort("command"))
        measured = builder.ExportInput(held.get_input_port(), "measured_state")
        builder.ConnectInput(measured, plans.GetInputPort("measured_state"))
        for name in ("plan", "statistics"):
            builder.ExportOutput(plans.GetOutputPort(name), name)
        builder.BuildInto(self)


def _input(system: System) -> InputPort:
    return system.get_input_port(0)


def check_ports(system: System) -> None:
    """Sees that a system has one input of 7 or 6 numbers and one output of 2; raises InvalidControllerError."""
    inputs = [system.get_input_port(i).size() for i in range(system.num_input_ports())]
    outputs = [system.get_output_port(i).size() for i in range(system.num_output_ports())]
    if inputs not in ([MEASURED], [len(STATES)]) or outputs != [len(INPUTS)]:
        raise InvalidControllerError(
            f"the controller {type(system).__name__} has inputs of {inputs} and outputs of {outputs} numbers; give it "
            f"one input of {MEASURED} (r, v, beta, omega_r, e, dphi, s) or of the first {len(STATES)}, and one output "
            f"of {len(INPUTS)} (delta [rad], tau [N m])"
        )


OwnController = ControllerSystem | SystemController


def controller_system(controller: Controller | System, horizon: int, period: float, delay: float) -> OwnController:
    """A user's controller, an object with `evaluate` or a Drake system, as a system that plans.

    Raises:
        InvalidControllerError: it is neither, or its ports are of other sizes.
    """
    if isinstance(controller, System):
        return SystemController(controller, horizon, period, delay)
    if isinstance(controller, type) or not callable(getattr(controller, "evaluate", None)):
        what = f"the class {controller.__name__}" if isinstance(controller, type) else type(controller).__name__
        raise InvalidControllerError(
            f"the controller is {what}; give an object with evaluate(x, s, t), or a Drake system from a reading to a "
            "command (docs/how_to/own_controller.md)"
        )
    return ControllerSystem(controller, horizon, period, delay)
