"""Magnitudes of the catalogue's effects, the states that effects own, and what wrong sensors read.

How effects act on the motion is the car's own (`car.single_track.motion_with_effects`).
"""

from collections import namedtuple
from typing import TYPE_CHECKING, Any, NamedTuple

from drift_drake.car.effects.installed import installed_effects
from drift_drake.car.effects.joined import joined_physics
from drift_drake.car.scalar import jitable

INSTALLED_STATES = tuple(name for name, effect in installed_effects().items() if effect.rate)
HEADED = any("psi" in effect.needs for effect in installed_effects().values() if effect.force)


class Effects(NamedTuple):
    """Magnitudes of all effects, in the units of `catalogue.CATALOGUE`; zero switches an effect off.

    Those that other packages install are fields too, behind these.
    """

    friction_level: Any = 0.0
    front_rear_friction_split: Any = 0.0
    front_stiffness_error: Any = 0.0
    rear_stiffness_error: Any = 0.0
    tyre_relaxation: Any = 0.0
    sliding_friction_drop: Any = 0.0
    tyre_thermal_fade: Any = 0.0
    longitudinal_load_transfer: Any = 0.0
    lateral_load_transfer: Any = 0.0
    mass_error: Any = 0.0
    yaw_inertia_error: Any = 0.0
    cg_shift: Any = 0.0
    steering_lag: Any = 0.0
    steering_delay: Any = 0.0
    steering_rate_limit: Any = 0.0
    steering_offset: Any = 0.0
    torque_lag: Any = 0.0
    torque_gain_error: Any = 0.0
    drivetrain_inertia_error: Any = 0.0
    drivetrain_friction: Any = 0.0
    aero_drag: Any = 0.0
    rolling_resistance: Any = 0.0
    road_grade: Any = 0.0
    differential_yaw_moment: Any = 0.0
    gyro_bias: Any = 0.0
    sideslip_bias: Any = 0.0
    wheel_radius_error: Any = 0.0
    sensor_latency: Any = 0.0
    steering_ratio_error: Any = 0.0
    gyro_gain_error: Any = 0.0
    speed_gain_error: Any = 0.0
    road_bank: Any = 0.0
    command_clock_error: Any = 0.0
    longitudinal_stiffness_error: Any = 0.0


class Memory(NamedTuple):
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


def _longer(record: Any, more: tuple[str, ...]) -> Any:
    """A named tuple with further fields behind its own, all zero by default."""
    fields = (*record._fields, *more)
    return namedtuple(record.__name__, fields, defaults=(0.0,) * len(fields), module=__name__)


if not TYPE_CHECKING and installed_effects():
    Effects = _longer(Effects, tuple(installed_effects()))
    Memory = _longer(Memory, INSTALLED_STATES)

COUNT = len(Effects._fields)
MEMORIES = len(Memory._fields)
NO_MEMORY = Memory()

installed_actuation, installed_force, installed_reading, installed_rates, installed_starts = joined_physics(
    Effects._fields, Memory._fields
)


@jitable
def measured(r: Any, v: Any, beta: Any, omega_r: Any, q: Effects) -> tuple[Any, Any, Any, Any]:
    """What wrong sensors read for the yaw rate, speed, sideslip and rim speed, latency aside."""
    r_error, beta_error, rim_error = installed_reading(r, beta, omega_r, q)
    by_r, by_v, by_beta, by_rim = reading_gains(q)
    return (by_r * r + q.gyro_bias + r_error, by_v * v, by_beta * beta + q.sideslip_bias + beta_error,
            by_rim * omega_r + rim_error)  # fmt: skip


@jitable
def unbiased(r: Any, v: Any, beta: Any, omega_r: Any, q: Effects) -> tuple[Any, Any, Any, Any]:
    """What readings (yaw rate, speed, sideslip, rim speed) stand for: `measured` the other way, to first order."""
    r_error, beta_error, rim_error = installed_reading(r, beta, omega_r, q)
    by_r, by_v, by_beta, by_rim = reading_gains(q)
    return ((r - q.gyro_bias - r_error) / by_r, v / by_v, (beta - q.sideslip_bias - beta_error) / by_beta,
            (omega_r - rim_error) / by_rim)  # fmt: skip


@jitable
def reading_gains(q: Effects) -> tuple[Any, Any, Any, Any]:
    """What readings of the yaw rate, speed, sideslip and rim speed change by with what they are of."""
    return 1.0 + q.gyro_gain_error, 1.0 + q.speed_gain_error, 1.0, 1.0 + q.wheel_radius_error


@jitable
def depends_on_heading(q: Effects) -> bool:
    """Whether the motion depends on the heading."""
    return HEADED or q.road_grade != 0.0


def combined(first: Effects, second: Effects) -> Effects:
    """Both sets of effects on one car: what both have adds up."""
    return Effects(*(a + b for a, b in zip(first, second, strict=True)))


def magnitudes_of(effects: Effects) -> dict[str, float]:
    """The effects that are there, by name: what `make_effects` makes them from."""
    return {name: float(value) for name, value in effects._asdict().items() if value != 0.0}


def make_effects(magnitudes: dict[str, float]) -> Effects:
    """Effects from a name-to-magnitude mapping.

    Raises:
        ValueError: a name that the catalogue does not have; the message lists the names.
    """
    unknown = sorted(set(magnitudes) - set(Effects._fields))
    if unknown:
        raise ValueError(f"unknown effect {', '.join(unknown)}; the catalogue has {', '.join(Effects._fields)}")
    return Effects(**{name: float(value) for name, value in magnitudes.items()})
