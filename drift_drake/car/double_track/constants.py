"""A double-track car's numbers, in the form that its equations and compiled code read."""

from typing import Any, NamedTuple

from drift_drake.car.double_track.tyres import TireConstants, friction_at, stiffness_per_load
from drift_drake.car.effects import changed
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.scalar import jitable, loaded_tuple


class DoubleTrackConstants(NamedTuple):
    """In SI, in the form that compiled code takes; `parameters.DoubleTrackParameters` says what each is."""

    mass: Any
    yaw_inertia: Any
    roll_inertia: Any
    front_axle_distance: Any
    rear_axle_distance: Any
    front_track: Any
    rear_track: Any
    cg_height: Any
    front_roll_center: Any
    rear_roll_center: Any
    front_unsprung_mass: Any
    rear_unsprung_mass: Any
    front_roll_stiffness: Any
    rear_roll_stiffness: Any
    roll_damping: Any
    load_time: Any
    wheel_radius: Any
    wheel_inertia: Any
    rear_axle_inertia: Any
    gear_ratio: Any
    differential_preload: Any
    differential_share: Any
    ackermann: Any
    steering_compliance: Any
    aero_drag: Any
    rolling_resistance: Any
    gravity: Any
    front_tire: TireConstants
    rear_tire: TireConstants

    @property
    def friction(self) -> float:
        """Lateral friction [-] at the static loads, the mean of both axles."""
        return 0.5 * sum(float(friction_at(tire.lateral_friction, load, tire)) for load, tire in self._static())

    @property
    def front_stiffness(self) -> float:
        """Lateral stiffness [N per unit slip] of the front axle at the static loads."""
        return self._stiffness()[0]

    @property
    def rear_stiffness(self) -> float:
        """The same of the rear axle."""
        return self._stiffness()[1]

    def _stiffness(self) -> list[float]:
        return [2.0 * load * float(stiffness_per_load(tire.lateral_stiffness, load, tire.stiffest_load))
                for load, tire in self._static()]  # fmt: skip

    def _static(self) -> list[tuple[float, TireConstants]]:
        """Static load [N] and tyre of one front and one rear wheel."""
        load = 0.5 * self.mass * self.gravity / (self.front_axle_distance + self.rear_axle_distance)
        return [(load * self.rear_axle_distance, self.front_tire), (load * self.front_axle_distance, self.rear_tire)]


NUMBERS, TIRE = len(DoubleTrackConstants._fields) - 2, len(TireConstants._fields)  # of the car but its tyres; of each
REAR = NUMBERS + TIRE


def flattened(p: DoubleTrackConstants) -> tuple[Any, ...]:
    """All numbers of a car in one row."""
    return (*p[:NUMBERS], *p.front_tire, *p.rear_tire)


@jitable
def unflattened(values: Any, like: Any = 0.0) -> DoubleTrackConstants:
    """The car of a row of numbers, the inverse of `flattened`; where `like` is `lanes`, that many cars of a flat array
    (`scalar.loaded_tuple`)."""
    front = TireConstants(*loaded_tuple(values, NUMBERS, TIRE, like))
    rear = TireConstants(*loaded_tuple(values, REAR, TIRE, like))
    return DoubleTrackConstants(*(loaded_tuple(values, 0, NUMBERS, like) + (front, rear)))  # noqa: RUF005 (for numba)


@jitable
def changed_tire(tire: TireConstants, stiffness: Any, friction: Any, relaxation: Any) -> TireConstants:
    """A tyre with stiffnesses and frictions times a factor, and a longer lateral relaxation [m]."""
    return TireConstants(
        tire.lateral_stiffness * stiffness,
        tire.longitudinal_stiffness * stiffness,
        tire.stiffest_load,
        tire.lateral_friction * friction,
        tire.longitudinal_friction * friction,
        tire.nominal_load,
        tire.load_sensitivity,
        tire.shape,
        tire.curvature,
        tire.lateral_relaxation + relaxation,
        tire.longitudinal_relaxation,
    )


@jitable
def changed_constants(p: DoubleTrackConstants, q: Effects) -> DoubleTrackConstants:
    """The car with the effects that only change parameters. Added mass is on the springs, at the centre of gravity.

    `wheel_radius_error` is not one of them: as in the catalogue, it is the measured rim speed that is wrong.
    """
    front_stiffness, rear_stiffness = changed.front_stiffness(1.0, q), changed.rear_stiffness(1.0, q)
    front_friction, rear_friction = changed.front_friction(1.0, q), changed.rear_friction(1.0, q)
    return DoubleTrackConstants(
        changed.mass(p.mass, q),
        changed.yaw_inertia(p.yaw_inertia, q),
        p.roll_inertia,
        changed.front_axle_distance(p.front_axle_distance, q),
        changed.rear_axle_distance(p.rear_axle_distance, q),
        p.front_track,
        p.rear_track,
        p.cg_height,
        p.front_roll_center,
        p.rear_roll_center,
        p.front_unsprung_mass,
        p.rear_unsprung_mass,
        p.front_roll_stiffness,
        p.rear_roll_stiffness,
        p.roll_damping,
        p.load_time,
        p.wheel_radius,
        p.wheel_inertia,
        changed.rear_axle_inertia(p.rear_axle_inertia, q),
        p.gear_ratio * (1.0 + q.torque_gain_error),
        p.differential_preload,
        p.differential_share,
        p.ackermann,
        p.steering_compliance,
        p.aero_drag + q.aero_drag,
        p.rolling_resistance + q.rolling_resistance,
        p.gravity,
        changed_tire(p.front_tire, front_stiffness, front_friction, q.tyre_relaxation),
        changed_tire(p.rear_tire, rear_stiffness, rear_friction, q.tyre_relaxation),
    )
