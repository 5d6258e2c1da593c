"""Faults as systems: one between sensors and controller, one between plan and actuator, each on a schedule.

A fault is written KIND:START:DURATION[:SIZE[:CHANNEL]], such as dropout:2.0:0.5 or spike:3:0.02:1e6:r.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiagramBuilder, DiscreteValues, LeafSystem, OutputPort

from drift_drake.errors import InvalidOptionError
from drift_drake.simulation.sensors import MEASURED_STATE

Array = NDArray[np.float64]

SENSOR_KINDS = {  # and the default size of each
    "dropout": 0.0,  # no reading at all (NaN)
    "nan": 0.0,  # NaN in the channel
    "freeze": 0.0,  # the reading of the start is repeated
    "spike": 1e6,  # added to the channel
    "bias": 0.1,  # added to the channel
    "delay": 0.1,  # [s] that readings are late by
}
PLAN_KINDS = {
    "lost_plans": 0.0,  # none arrives
    "late_plans": 0.1,  # [s] that they arrive late by
}
EDGE = 1e-9  # [s] by which a fault's edges and Drake's event times may differ through rounding
LONGEST = 10.0  # [s] of a delay


@dataclasses.dataclass(frozen=True)
class Fault:
    """What goes wrong from `start` for `duration` [s]."""

    kind: str
    start: float
    duration: float
    size: float
    channel: str = "v"  # of the measured state, for those kinds that concern one

    def __post_init__(self) -> None:
        known = SENSOR_KINDS | PLAN_KINDS
        if self.kind not in known:
            raise InvalidOptionError(f"fault '{self.kind[:60]}' is unknown; give one of {', '.join(known)}")
        if self.channel not in MEASURED_STATE:
            raise InvalidOptionError(
                f"fault {self.kind}: '{self.channel[:60]}' is no channel; give one of {', '.join(MEASURED_STATE)}"
            )
        if not 0.0 <= self.start < math.inf or not 0.0 < self.duration < math.inf:
            raise InvalidOptionError(f"fault {self.kind}: give a start of 0 s or more and a duration above 0 s")
        late = self.kind in ("delay", "late_plans")
        if not math.isfinite(self.size) or (late and not 0.0 < self.size <= LONGEST):
            size = f"a delay above 0, up to {LONGEST:g} s" if late else "a finite size"
            raise InvalidOptionError(f"fault {self.kind}: give {size}")

    def active(self, t: float) -> bool:
        """Whether it acts at a time [s]."""
        return self.start - EDGE <= t < self.start + self.duration - EDGE


def parse_fault(text: str) -> Fault:
    """A fault as it is written.

    Raises:
        InvalidOptionError: says how it is written.
    """
    kind, *rest = text.split(":")
    try:
        numbers = [float(number) for number in rest[:3]]
    except ValueError:
        numbers = []
    if not 2 <= len(rest) <= 4 or len(numbers) < 2:
        raise InvalidOptionError(f"'{text[:60]}' is no fault; write KIND:START:DURATION[:SIZE[:CHANNEL]]")
    size = numbers[2] if len(numbers) > 2 else (SENSOR_KINDS | PLAN_KINDS).get(kind, 0.0)
    return Fault(kind, numbers[0], numbers[1], size, *rest[3:])


class SensorFaults(LeafSystem):
    """Spoils the measured state on a schedule.

    Input port: measured_state [7]. Output port: measured_state [7], as the controller gets it.
    State in the Context, each `period`: the last readings, newest first; the reading that a freeze repeats.
    """

    def __init__(self, faults: Sequence[Fault], period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._faults = [fault for fault in faults if fault.kind in SENSOR_KINDS]
        self._period = period
        late = [fault.size for fault in self._faults if fault.kind == "delay"]
        self._depth = max([1, *(round(size / period) for size in late)])
        size = len(MEASURED_STATE)
        self._measured = self.DeclareVectorInputPort("measured_state", size)
        self._past = self.DeclareDiscreteState(np.full(self._depth * size, np.nan))
        self._held = self.DeclareDiscreteState(np.full(size, np.nan))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclareVectorOutputPort("faulted_state", size, self._calc)

    def _calc(self, context: Context, output: Any) -> None:
        output.SetFromVector(self._faulted(context))

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
            elif fault.kind == "delay":
                past = context.get_discrete_state(self._past).value().reshape(self._depth, -1)
                x = np.array(past[max(round(fault.size / self._period), 1) - 1])
            else:
                x[i] += fault.size
        return x

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        x = self._measured.Eval(context)
        past = context.get_discrete_state(self._past).value()
        discrete.set_value(self._past, np.concatenate([x, past[: -len(x)]]))
        t = context.get_time()
        if not any(fault.kind == "freeze" and fault.active(t) for fault in self._faults):
            discrete.set_value(self._held, x)


class PlanFaults(LeafSystem):
    """Loses plans, or hands them on late, on a schedule.

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
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclareVectorOutputPort("faulted_plan", size, self._calc)

    def _calc(self, context: Context, output: Any) -> None:
        t, plan = context.get_time(), np.array(self._port.Eval(context))
        for fault in self._faults:
            if not fault.active(t):
                continue
            if fault.kind == "lost_plans":
                plan[:] = np.nan
            else:
                past = context.get_discrete_state(self._past).value().reshape(self._depth, -1)
                plan = np.array(past[max(round(fault.size / self._period), 1) - 1])
        output.SetFromVector(plan)

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        plan, past = self._port.Eval(context), context.get_discrete_state(self._past).value()
        discrete.set_value(self._past, np.concatenate([plan, past[: -len(plan)]]))


def faulted(
    builder: DiagramBuilder, faults: Sequence[Fault], measured: OutputPort, plan: OutputPort, period: float
) -> tuple[OutputPort, OutputPort]:
    """The ports of the measured state and of the plan as they arrive, with a system of faults where there are any."""
    if any(fault.kind in SENSOR_KINDS for fault in faults):
        sensors = builder.AddNamedSystem("sensor_faults", SensorFaults(faults, period))
        builder.Connect(measured, sensors.get_input_port())
        measured = sensors.get_output_port()
    if any(fault.kind in PLAN_KINDS for fault in faults):
        plans = builder.AddNamedSystem("plan_faults", PlanFaults(plan.size(), faults, period))
        builder.Connect(plan, plans.get_input_port())
        plan = plans.get_output_port()
    return measured, plan
