"""A car that becomes another one during a run, as on a slippery stretch."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from pydrake.systems.framework import Context

from drift_drake.errors import InvalidOptionError
from drift_drake.simulation.faults import Fault, patch_friction, patches
from drift_drake.vehicle.catalogue import OFF_THE_MOTION
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.path_plant import PathPlant
from drift_drake.vehicle.plausible import check_effects


class Change(NamedTuple):
    """When, and to what."""

    time: float  # [s]
    effects: Effects  # from then on; those outside the plant (delays, sensors' errors) stay as they are


def check_change(change: Change, parameters: VehicleParameters, before: Effects, has_memory: bool) -> None:
    """Sees that a plant can make a change.

    Args:
        before: the effects that the car was built with; has_memory: whether its plant has the effects' states.

    Raises:
        ValueError: the car was built without effects, or the change is none that it can make.
    """
    if not has_memory:
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
    for name, value, lag in zip(("steering", "torque"), command, lagged, strict=True):
        if lag == 0.0:
            state.SetAtIndex(names.index(name), float(value))
