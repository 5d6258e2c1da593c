"""The numbers that the double-track equations of motion read, and what effects of the catalogue change in them."""

from typing import Any, NamedTuple

from drift_drake.vehicle.double_track.tires import TireConstants
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.scalar import jitable


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
    ackermann: Any
    steering_compliance: Any
    aero_drag: Any
    rolling_resistance: Any
    gravity: Any
    front_tire: TireConstants
    rear_tire: TireConstants


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
    friction = 1.0 + q.friction_level
    front_friction = friction * (1.0 + q.front_rear_friction_split)
    rear_friction = friction * (1.0 - q.front_rear_friction_split)
    return DoubleTrackConstants(
        p.mass * (1.0 + q.mass_error),
        p.yaw_inertia * (1.0 + q.yaw_inertia_error),
        p.roll_inertia,
        p.front_axle_distance + q.cg_shift,
        p.rear_axle_distance - q.cg_shift,
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
        p.rear_axle_inertia * (1.0 + q.drivetrain_inertia_error),
        p.gear_ratio * (1.0 + q.torque_gain_error),
        p.ackermann,
        p.steering_compliance,
        p.aero_drag + q.aero_drag,
        p.rolling_resistance + q.rolling_resistance,
        p.gravity,
        changed_tire(p.front_tire, 1.0 + q.front_stiffness_error, front_friction, q.tyre_relaxation),
        changed_tire(p.rear_tire, 1.0 + q.rear_stiffness_error, rear_friction, q.tyre_relaxation),
    )
