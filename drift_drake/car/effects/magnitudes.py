"""Magnitudes of the catalogue's effects, the states that effects own, and what wrong sensors read.

How effects act on the motion is the car's own (`car.single_track.motion_with_effects`).
"""

from collections import namedtuple
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

from drift_drake.car.effects.catalogue import CATALOGUE, HEADED
from drift_drake.car.effects.installed import installed_effects
from drift_drake.car.effects.joined import joined_physics, or_there, over, plus
from drift_drake.car.effects.record import READ
from drift_drake.car.scalar import jitable

INSTALLED_STATES = tuple(name for name, effect in installed_effects().items() if effect.rate)


if TYPE_CHECKING:

    class Effects(tuple[Any, ...]):
        """Magnitudes of all effects by name, in the units of `CATALOGUE` and in its order; zero switches one off.

        Examples:
            >>> Effects(steering_lag=0.1)._replace(aero_drag=0.7).aero_drag
            0.7
        """

        _fields: ClassVar[tuple[str, ...]]

        def __new__(cls, *magnitudes: Any, **by_name: Any) -> Self: ...
        def __getattr__(self, name: str) -> Any: ...
        def _replace(self, **changes: Any) -> Self: ...
        def _asdict(self) -> dict[str, Any]: ...
else:
    Effects = namedtuple("Effects", CATALOGUE, defaults=(0.0,) * len(CATALOGUE), module=__name__)


class InternalStates(NamedTuple):
    """States that effects own; as a value or as a time derivative.

    Those of effects that other packages install are fields too, behind these, by the names of the effects.
    """

    steering: Any = 0.0  # [rad] road-wheel angle before the offset
    torque: Any = 0.0  # [N m] engine
    front_slip: Any = 0.0  # [-] lateral slip that makes the force
    rear_slip: Any = 0.0  # [-]
    front_heat: Any = 0.0  # [-]
    rear_heat: Any = 0.0  # [-]
    a_x: Any = 0.0  # [m/s^2] filtered
    a_y: Any = 0.0  # [m/s^2] filtered


if not TYPE_CHECKING and INSTALLED_STATES:
    InternalStates = namedtuple("InternalStates", (*InternalStates._fields, *INSTALLED_STATES),
                                defaults=(0.0,) * (len(InternalStates._fields) + len(INSTALLED_STATES)),
                                module=__name__)  # fmt: skip

COUNT = len(Effects._fields)
INTERNAL_COUNT = len(InternalStates._fields)
NO_INTERNAL_STATES = InternalStates()
NOT_ON_FOUR_WHEELS = (*(n for n, e in CATALOGUE.items() if e.double_track == "nothing"), *INSTALLED_STATES)
"""Effects that complete a single-track car and mean nothing on one with four wheels: this has load transfer, sliding
and a differential of its own; and those of other packages that have a state, which is none of such a car's."""


physics = joined_physics(Effects._fields, InternalStates._fields)
actuation_of, reading_errors, internal_rates, internal_starts, with_forces, with_double_track_forces = physics
depends_on_heading = over(map(Effects._fields.index, sorted(HEADED)), False, or_there)
_by_r, _by_v, _by_beta, _by_rim = (
    over([i for i, effect in enumerate(CATALOGUE.values()) if effect.scales == name], 0.0, plus) for name in READ
)


@jitable
def reading_gains(q: Effects) -> tuple[Any, Any, Any, Any]:
    """What readings of the yaw rate, speed, sideslip and rim speed change by with what they are of."""
    return 1.0 + _by_r(q), 1.0 + _by_v(q), 1.0 + _by_beta(q), 1.0 + _by_rim(q)


@jitable
def measured(r: Any, v: Any, beta: Any, omega_r: Any, q: Effects) -> tuple[Any, Any, Any, Any]:
    """What wrong sensors read for the yaw rate, speed, sideslip and rim speed, latency aside."""
    r_error, beta_error, rim_error = reading_errors(r, beta, omega_r, q)
    by_r, by_v, by_beta, by_rim = reading_gains(q)
    return by_r * r + r_error, by_v * v, by_beta * beta + beta_error, by_rim * omega_r + rim_error


@jitable
def unbiased(r: Any, v: Any, beta: Any, omega_r: Any, q: Effects) -> tuple[Any, Any, Any, Any]:
    """What readings (yaw rate, speed, sideslip, rim speed) stand for: `measured` the other way, to first order."""
    r_error, beta_error, rim_error = reading_errors(r, beta, omega_r, q)
    by_r, by_v, by_beta, by_rim = reading_gains(q)
    return (r - r_error) / by_r, v / by_v, (beta - beta_error) / by_beta, (omega_r - rim_error) / by_rim


def combined(first: Effects, second: Effects) -> Effects:
    """Both sets of effects on one car: what both have adds up."""
    return Effects(*(a + b for a, b in zip(first, second, strict=True)))


def magnitudes_of(effects: Effects) -> dict[str, float]:
    """The effects that are there, by name: what `make_effects` makes them from."""
    return {name: float(value) for name, value in effects._asdict().items() if value != 0.0}


def make_effects(magnitudes: dict[str, float]) -> Effects:
    """Effects from magnitudes by name, each in its unit of the catalogue [CATALOGUE[name].unit].

    Raises:
        ValueError: a name that the catalogue does not have; the message lists the names.

    Examples:
        >>> make_effects({"steering_lag": 0.1}).steering_lag
        0.1
    """
    unknown = sorted(set(magnitudes) - set(Effects._fields))
    if unknown:
        raise ValueError(f"unknown effect {', '.join(unknown)}; the catalogue has {', '.join(Effects._fields)}")
    return Effects(**{name: float(value) for name, value in magnitudes.items()})
