"""Faults as systems: between sensors, controller, actuator and car, each on a schedule."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, DiscreteValues, LeafSystem, OutputPort

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import MEASURED_STATE, NoiseLevels
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_update
from drift_drake.drive.loop.faults import ACTUATOR_KINDS, PLAN_KINDS, SENSOR_KINDS, SOLVER_KINDS, Fault

USUAL = NoiseLevels()  # of a channel that holds its value
STICKING = {"steering_stuck": 0, "torque_stuck": 1}  # and the command's channel


class SensorFaults(LeafSystem):
    """Spoils the measured state on a schedule.

    Input port: measured_state [7]. Output port: measured_state [7], as the controller gets it.
    State in the Context, each `period`: the last readings, newest first; the reading that a freeze repeats.
    """

    def __init__(self, faults: Sequence[Fault], period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._faults = [fault for fault in faults if fault.kind in SENSOR_KINDS]
        self._period = period
        late = [fault.size for fault in self._faults if fault.kind in ("delay", "jitter")]
        self._depth = max([1, *(round(size / period) for size in late)])
        size = len(MEASURED_STATE)
        self._measured = self.DeclareVectorInputPort("measured_state", size)
        self._past = self.DeclareDiscreteState(np.full(self._depth * size, np.nan))
        self._held = self.DeclareDiscreteState(np.full(size, np.nan))
        declare_update(self, period, self._update)
        declare_output(self, "faulted_state", size, self._faulted)

    def _faulted(self, context: Context) -> Array:
        t, x = context.get_time(), np.array(self._measured.Eval(context))
        for fault in self._faults:
            if not fault.active(t):
                continue
            i = MEASURED_STATE.index(fault.channel)
            if fault.kind == "dropout":
                x[:] = np.nan
            elif fault.kind == "nan":
                x[i] = np.nan
            elif fault.kind == "freeze":
                held = context.get_discrete_state(self._held).value()
                x = np.array(held) if np.isfinite(held).any() else x
            elif fault.kind == "hold":  # its noise moves on, so that nothing looks frozen
                held = context.get_discrete_state(self._held).value()[i]
                noise = getattr(USUAL, fault.channel) * np.random.default_rng(round(t / self._period)).normal()
                x[i] = held + noise if np.isfinite(held) else x[i]
            elif fault.kind == "drift":
                x[i] += fault.size * (t - fault.start)
            elif fault.kind in ("delay", "jitter"):
                past = context.get_discrete_state(self._past).value().reshape(self._depth, -1)
                back = max(round(fault.size / self._period), 1)
                if fault.kind == "jitter":  # the same delays in each run
                    back = int(np.random.default_rng(round(t / self._period)).integers(back + 1))
                x = np.array(past[back - 1]) if back else x
            else:
                x[i] += fault.size
        return x

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        x = self._measured.Eval(context)
        past = context.get_discrete_state(self._past).value()
        discrete.set_value(self._past, np.concatenate([x, past[: -len(x)]]))
        t, held = context.get_time(), context.get_discrete_state(self._held).value()
        frozen = any(fault.kind in ("freeze", "hold") and fault.active(t) for fault in self._faults)
        if not frozen or not np.isfinite(held).any():  # the first reading of all may be the one that is repeated
            discrete.set_value(self._held, x)


class PlanFaults(LeafSystem):
    """Loses plans, hands them on late, or with the times of a clock that is wrong, on a schedule.

    Input port: plan [size], NaN in its first number where there is none. Output port: plan [size].
    State in the Context, each `period`: the last plans, newest first.
    """

    def __init__(self, size: int, faults: Sequence[Fault], period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._faults = [fault for fault in faults if fault.kind in PLAN_KINDS]
        self._period = period
        late = [fault.size for fault in self._faults if fault.kind == "late_plans"]
        self._depth = max([1, *(round(delay / period) for delay in late)])
        self._port = self.DeclareVectorInputPort("plan", size)
        self._past = self.DeclareDiscreteState(np.full(self._depth * size, np.nan))
        declare_update(self, period, self._update)
        declare_output(self, "faulted_plan", size, self._faulted)

    def _faulted(self, context: Context) -> Array:
        t, plan = context.get_time(), np.array(self._port.Eval(context))
        for fault in self._faults:
            if not fault.active(t):
                continue
            if fault.kind == "lost_plans":
                plan[:] = np.nan
            elif fault.kind == "clock_drift":
                plan[0] += fault.size * (t - fault.start)
            else:
                past = context.get_discrete_state(self._past).value().reshape(self._depth, -1)
                plan = np.array(past[max(round(fault.size / self._period), 1) - 1])
        return plan

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        plan, past = self._port.Eval(context), context.get_discrete_state(self._past).value()
        discrete.set_value(self._past, np.concatenate([plan, past[: -len(plan)]]))


class SolverFaults(LeafSystem):
    """Gives the controller no reading on a schedule, so that its solver fails while all else goes on.

    Input port: measured_state [7]. Output port: measured_state [7], NaN while a fault acts. No state.
    """

    def __init__(self, faults: Sequence[Fault]) -> None:
        LeafSystem.__init__(self)
        self._faults = [fault for fault in faults if fault.kind in SOLVER_KINDS]
        self._port = self.DeclareVectorInputPort("measured_state", len(MEASURED_STATE))
        declare_output(self, "faulted_state", len(MEASURED_STATE), self._faulted)

    def _faulted(self, context: Context) -> Array:
        fails = any(fault.active(context.get_time()) for fault in self._faults)
        return np.full(len(MEASURED_STATE), np.nan) if fails else self._port.Eval(context)


class ActuatorFaults(LeafSystem):
    """Passes on a share of the command's range, or what an actuator does that sticks or is lost, on a schedule.

    Input port: command [2]. Output port: command [2], as the car gets it.
    State in the Context, each `period`: the command that the car last got, which an actuator that sticks keeps.
    """

    def __init__(self, faults: Sequence[Fault], parameters: VehicleParameters, period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._faults = [fault for fault in faults if fault.kind in ACTUATOR_KINDS]
        self._low, self._high = parameters.command_limits()
        self._port = self.DeclareVectorInputPort("command", 2)
        self._held = self.DeclareDiscreteState(np.full(2, np.nan))
        declare_update(self, period, self._update)
        declare_output(self, "faulted_command", 2, self._passed_on)

    def _passed_on(self, context: Context) -> Array:
        active = [fault for fault in self._faults if fault.active(context.get_time())]
        left = min([1.0, *(fault.size for fault in active if fault.kind == "saturated")])
        command = np.clip(self._port.Eval(context), left * self._low, left * self._high)
        held = context.get_discrete_state(self._held).value()
        for fault in active:
            if fault.kind == "torque_lost":
                command[1] = 0.0
            elif fault.kind in STICKING and np.isfinite(held).all():
                command[STICKING[fault.kind]] = held[STICKING[fault.kind]]
        return command

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        discrete.set_value(self._held, self._passed_on(context))


class FaultPoints:
    """Where faults enter a diagram: each method gives the port, or that of a system of faults put behind it.

    Args:
        period: of the systems that remember what passed [s].
    """

    def __init__(self, builder: DiagramBuilder, faults: Sequence[Fault], period: float) -> None:
        self._builder, self._faults, self._period = builder, faults, period

    def sensors(self, port: OutputPort) -> OutputPort:
        """Behind the measured state."""
        return self._behind(port, "sensor_faults", SENSOR_KINDS, lambda: SensorFaults(self._faults, self._period))

    def plans(self, port: OutputPort) -> OutputPort:
        """Behind the controller's plans."""
        return self._behind(
            port, "plan_faults", PLAN_KINDS, lambda: PlanFaults(port.size(), self._faults, self._period)
        )

    def solver(self, port: OutputPort) -> OutputPort:
        """Behind the measured state that the controller alone gets."""
        return self._behind(port, "solver_faults", SOLVER_KINDS, lambda: SolverFaults(self._faults))

    def actuators(self, port: OutputPort, parameters: VehicleParameters) -> OutputPort:
        """Behind the command."""
        return self._behind(
            port, "actuator_faults", ACTUATOR_KINDS, lambda: ActuatorFaults(self._faults, parameters, self._period)
        )

    def _behind(
        self, port: OutputPort, name: str, kinds: Mapping[str, float], system: Callable[[], LeafSystem]
    ) -> OutputPort:
        if not any(fault.kind in kinds for fault in self._faults):
            return port
        added = self._builder.AddNamedSystem(name, system())
        self._builder.Connect(port, added.get_input_port())
        return added.get_output_port()
