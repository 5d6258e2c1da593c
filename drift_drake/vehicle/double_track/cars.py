"""Four double-track cars of different kinds; plausible figures, no measured vehicles."""

import dataclasses

from drift_drake.vehicle.double_track.parameters import DoubleTrackParameters, TireParameters


def _roadster() -> DoubleTrackParameters:
    """A light car with narrow tyres, low and stiff."""
    tire = TireParameters(lateral_stiffness=6.2e4, longitudinal_stiffness=8.0e4, stiffest_load=5500.0,
                          lateral_friction=1.0, longitudinal_friction=1.04, nominal_load=2500.0, load_sensitivity=0.1,
                          shape=1.4, curvature=-0.2, lateral_relaxation=0.25, longitudinal_relaxation=0.12)  # fmt: skip
    return DoubleTrackParameters(
        mass=1030.0, yaw_inertia=1220.0, roll_inertia=270.0, front_axle_distance=1.19, rear_axle_distance=1.12,
        front_track=1.41, rear_track=1.43, cg_height=0.46, front_roll_center=0.06, rear_roll_center=0.09,
        front_unsprung_mass=60.0, rear_unsprung_mass=64.0, front_roll_stiffness=34e3, rear_roll_stiffness=21e3,
        roll_damping=2300.0, load_time=0.025, wheel_radius=0.293, wheel_inertia=0.75, rear_axle_inertia=9.0,
        gear_ratio=8.4, ackermann=0.8, steering_compliance=1.5e-6, aero_drag=0.38, rolling_resistance=0.011,
        front_tire=tire, rear_tire=tire,
    )  # fmt: skip


def _rear_engined() -> DoubleTrackParameters:
    """Three fifths of the weight at the rear, on wider tyres there."""
    front = TireParameters(lateral_stiffness=8.4e4, longitudinal_stiffness=1.0e5, stiffest_load=7000.0,
                           lateral_friction=1.12, longitudinal_friction=1.16, nominal_load=3200.0,
                           load_sensitivity=0.14, shape=1.45, lateral_relaxation=0.3)  # fmt: skip
    rear = TireParameters(lateral_stiffness=1.55e5, longitudinal_stiffness=1.8e5, stiffest_load=10500.0,
                          lateral_friction=1.14, longitudinal_friction=1.2, nominal_load=4700.0,
                          load_sensitivity=0.14, shape=1.4, lateral_relaxation=0.4)  # fmt: skip
    return DoubleTrackParameters(
        mass=1490.0, yaw_inertia=2050.0, roll_inertia=460.0, front_axle_distance=1.47, rear_axle_distance=0.98,
        front_track=1.55, rear_track=1.54, cg_height=0.47, front_roll_center=0.03, rear_roll_center=0.09,
        front_roll_stiffness=62e3, rear_roll_stiffness=38e3, roll_damping=4600.0, rear_axle_inertia=24.0,
        gear_ratio=9.8, wheel_radius=0.345, ackermann=0.4, steering_compliance=0.8e-6, aero_drag=0.4,
        front_tire=front, rear_tire=rear,
    )  # fmt: skip


def _saloon() -> DoubleTrackParameters:
    """A heavy car on soft springs and soft, slow tyres of little friction."""
    tire = TireParameters(lateral_stiffness=9.4e4, longitudinal_stiffness=1.2e5, stiffest_load=10500.0,
                          lateral_friction=0.88, longitudinal_friction=0.95, nominal_load=4800.0,
                          load_sensitivity=0.18, shape=1.25, curvature=-0.8, lateral_relaxation=0.6,
                          longitudinal_relaxation=0.22)  # fmt: skip
    return DoubleTrackParameters(
        mass=1890.0, yaw_inertia=3250.0, roll_inertia=780.0, front_axle_distance=1.38, rear_axle_distance=1.5,
        front_track=1.58, rear_track=1.59, cg_height=0.57, front_roll_center=0.08, rear_roll_center=0.14,
        front_unsprung_mass=100.0, rear_unsprung_mass=110.0, front_roll_stiffness=46e3, rear_roll_stiffness=27e3,
        roll_damping=4200.0, load_time=0.04, wheel_radius=0.33, rear_axle_inertia=26.0, gear_ratio=11.5,
        ackermann=0.6, steering_compliance=2.2e-6, aero_drag=0.45, rolling_resistance=0.014,
        front_tire=tire, rear_tire=dataclasses.replace(tire, lateral_stiffness=1.15e5),
    )  # fmt: skip


CARS = {
    "coupe": DoubleTrackParameters(),
    "roadster": _roadster(),
    "rear_engined": _rear_engined(),
    "saloon": _saloon(),
}
