"""What our effects make of a car's parameters, each a function of the value and all magnitudes (`Effect.changes`).

Effects of other packages change parameters of a simulator alone; on our cars they act by their functions.
"""

from collections.abc import Callable, Mapping
from typing import Any

from drift_drake.car.effects.catalogue import OWN
from drift_drake.car.scalar import jitable

Function = Callable[[Any, Any], Any]


def _changed(meaning: str) -> Function:
    """One change after the other, in the catalogue's order."""
    total = jitable(lambda value, _: value)
    for place, effect in enumerate(OWN.values()):  # the catalogue begins with them
        for change in effect.changes:
            if change.meaning == meaning:
                total = jitable((_times if change.relative else _plus)(total, place, change.sign))
    return total


def _times(before: Function, place: int, sign: float) -> Function:
    return lambda value, q: before(value, q) * (1.0 + sign * q[place])


def _plus(before: Function, place: int, sign: float) -> Function:
    return lambda value, q: before(value, q) + sign * q[place]


mass, yaw_inertia, rear_axle_inertia = map(_changed, ("mass", "yaw_inertia", "rear_axle_inertia"))
front_axle_distance, rear_axle_distance = map(_changed, ("front_axle_distance", "rear_axle_distance"))
friction, front_friction, rear_friction = map(_changed, ("friction", "front_friction", "rear_friction"))
front_stiffness, rear_stiffness = map(_changed, ("front_stiffness", "rear_stiffness"))
longitudinal_stiffness, tyre_relaxation = map(_changed, ("longitudinal_stiffness", "tyre_relaxation"))


@jitable
def gear_ratio(value: Any, q: Any) -> Any:
    return value * (1.0 + q.torque_gain_error)


@jitable
def aero_drag(value: Any, q: Any) -> Any:
    return value + q.aero_drag


@jitable
def rolling_resistance(value: Any, q: Any) -> Any:
    return value + q.rolling_resistance


def constants_changed(constants: type, changes: Mapping[str, Function]) -> Function:
    """`changed_constants(p, q)` of a named tuple of numbers: the fields with these changes, the others as they are.

    Written out, since in compiled code a tuple has no `_replace`.
    """
    fields: tuple[str, ...] = getattr(constants, "_fields", ())
    values = ", ".join(f"{name}_(p.{name}, q)" if name in changes else f"p.{name}" for name in fields)
    known: dict[str, Any] = {f"{name}_": change for name, change in changes.items()} | {"made": constants}
    exec(f"def changed_constants(p, q):\n    return made({values})", known)
    return jitable(known["changed_constants"])
