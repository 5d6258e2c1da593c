"""What goes wrong in a loop, and when; `fault_systems` does it.

A fault is written KIND:START:DURATION[:SIZE[:CHANNEL]], such as dropout:2.0:0.5 or spike:3:0.02:1e6:r.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

from pydrake.systems.framework import Context

from drift_drake.car.effects.catalogue import OFF_THE_MOTION
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.path_plant import PathPlant
from drift_drake.car.sensors import MEASURED_STATE
from drift_drake.car.single_track.motion_with_effects import road_wheel
from drift_drake.car.vehicle_file import check_effects
from drift_drake.common.errors import InvalidOptionError

SENSOR_KINDS = {  # and the default size of each
    "dropout": 0.0,  # no reading at all (NaN)
    "nan": 0.0,  # NaN in the channel
    "freeze": 0.0,  # the reading of the start is repeated
    "spike": 1e6,  # added to the channel
    "bias": 0.1,  # added to the channel
    "delay": 0.1,  # [s] that readings are late by
    "jitter": 0.05,  # [s] that readings are late by at most, another delay each period
    "hold": 0.0,  # the channel stays at its value of the start, with its usual noise
    "drift": 0.5,  # added to the channel each second
}
SOLVER_KINDS = {
    "solver_failure": 0.0,  # the controller gets nothing to plan from
}
PLAN_KINDS = {
    "lost_plans": 0.0,  # none arrives
    "late_plans": 0.1,  # [s] that they arrive late by
    "clock_drift": 0.1,  # by which share the clock of the plans' times runs fast
}
ACTUATOR_KINDS = {
    "saturated": 0.5,  # the share of the command's range that is left
    "steering_stuck": 0.0,  # the steering stays where it is
    "torque_stuck": 0.0,  # the torque stays what it is
    "torque_lost": 0.0,  # no torque at all
}
PLANT_KINDS = {
    "friction_patch": -0.3,  # of the friction, which is 1 + size times what it was
}
KINDS = SENSOR_KINDS | SOLVER_KINDS | PLAN_KINDS | ACTUATOR_KINDS | PLANT_KINDS
EDGE = 1e-9  # [s] by which a fault's edges and Drake's event times may differ through rounding
LONGEST = 10.0  # [s] of a delay

_DELAY = (1e-9, LONGEST, f"a delay above 0, up to {LONGEST:g} s")
_SIZES = {  # (lowest, highest, in words)
    "delay": _DELAY,
    "jitter": _DELAY,
    "late_plans": _DELAY,
    "clock_drift": (-0.9, 10.0, "a share of -0.9 to 10 by which the clock runs fast"),
    "saturated": (0.0, 1.0, "the share of the command's range that is left, 0 to 1"),
    "friction_patch": (-0.95, 2.0, "a change of friction of -0.95 to 2"),
}


@dataclasses.dataclass(frozen=True)
class Fault:
    """What goes wrong from `start` for `duration` [s]."""

    kind: str
    start: float
    duration: float
    size: float
    channel: str = "v"  # of the measured state, for those kinds that concern one

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InvalidOptionError(f"fault '{self.kind[:60]}' is unknown; give one of {', '.join(KINDS)}")
        if self.channel not in MEASURED_STATE:
            raise InvalidOptionError(
                f"fault {self.kind}: '{self.channel[:60]}' is no channel; give one of {', '.join(MEASURED_STATE)}"
            )
        if not 0.0 <= self.start < math.inf or not 0.0 < self.duration < math.inf:
            raise InvalidOptionError(f"fault {self.kind}: give a start of 0 s or more and a duration above 0 s")
        low, high, words = _SIZES.get(self.kind, (-math.inf, math.inf, "a finite size"))
        if not math.isfinite(self.size) or not low <= self.size <= high:
            raise InvalidOptionError(f"fault {self.kind}: give {words}")

    def active(self, t: float) -> bool:
        """Whether it acts at a time [s]."""
        return self.start - EDGE <= t < self.start + self.duration - EDGE


def parse_fault(text: str) -> Fault:
    """A fault as it is written; raises InvalidOptionError, which says how that is."""
    kind, *rest = text.split(":")
    try:
        numbers = [float(number) for number in rest[:3]]
    except ValueError:
        numbers = []
    if not 2 <= len(rest) <= 4 or len(numbers) < 2:
        raise InvalidOptionError(f"'{text[:60]}' is no fault; write KIND:START:DURATION[:SIZE[:CHANNEL]]")
    size = numbers[2] if len(numbers) > 2 else KINDS.get(kind, 0.0)
    return Fault(kind, numbers[0], numbers[1], size, *rest[3:])


def patches(faults: Sequence[Fault]) -> list[Fault]:
    """Those that are patches of another friction."""
    return [fault for fault in faults if fault.kind in PLANT_KINDS]


def patch_friction(t: float, faults: Sequence[Fault]) -> float:
    """Share of the friction that patches leave at a time [s]."""
    return math.prod(1.0 + fault.size for fault in patches(faults) if fault.active(t))


class Change(NamedTuple):
    """When, and to what."""

    time: float  # [s]
    effects: Effects  # from then on; those outside the plant (delays, sensors' errors) stay as they are


def check_change(change: Change, parameters: VehicleParameters, before: Effects, has_internal_states: bool) -> None:
    """Sees that a plant can make a change.

    Args:
        before: the effects that the car was built with; has_internal_states: whether its plant has the effects' states.

    Raises:
        ValueError: the car was built without effects, or the change is none that it can make.
    """
    if not has_internal_states:
        raise ValueError("a car built without effects cannot change; build it with those that it begins with")
    if not 0.0 <= change.time < math.inf:
        raise InvalidOptionError(f"the change at {change.time:g} s: give a time of 0 s or more")
    check_effects(change.effects, parameters, "the change")
    for name in OFF_THE_MOTION:
        old, new = getattr(before, name), getattr(change.effects, name)
        if old != new:
            raise InvalidOptionError(
                f"the change of {name} from {old:g} to {new:g} would do nothing: it acts outside the plant; build the "
                "car with it"
            )


def with_patches(change: Change | None, effects: Effects, faults: Sequence[Fault]) -> list[Change]:
    """All that a plant with these effects becomes, in the order of time: by a change, and on patches of the road."""
    times = {edge for fault in patches(faults) for edge in (fault.start, fault.start + fault.duration)}
    if change is not None:
        times.add(change.time)
    changes = []
    for t in sorted(times):
        now = effects if change is None or t < change.time else change.effects
        friction = patch_friction(t, faults) * (1.0 + now.friction_level) - 1.0
        changes.append(Change(t, now._replace(friction_level=friction)))
    return changes


def make_change(change: Change, plant: PathPlant, context: Context, command: Sequence[float]) -> None:
    """Makes a plant the other car, in its Context; actuators that begin to lag do so from the command in force [2]."""
    parameter = context.get_mutable_numeric_parameter(1)
    before = Effects(*parameter.CopyToVector())
    parameter.SetFromVector(change.effects)
    state, names = context.get_mutable_continuous_state_vector(), plant.state_names
    lagged = (before.steering_lag + before.steering_rate_limit, before.torque_lag)
    followed = (road_wheel(command[0], before), command[1])
    for name, value, lag in zip(("steering", "torque"), followed, lagged, strict=True):
        if lag == 0.0:
            state.SetAtIndex(names.index(name), float(value))
