"""Vehicles to begin a first guess with, one of each size: plausible numbers, of no measured vehicle."""

from drift_drake.car.parameters import VehicleParameters

TEMPLATES = {
    "1:10 model": VehicleParameters(
        mass=2.8, yaw_inertia=0.048, front_axle_distance=0.15, rear_axle_distance=0.17, wheel_radius=0.05,
        rear_axle_inertia=0.0025, gear_ratio=1.0, friction=0.9, front_stiffness=150.0, rear_stiffness=170.0,
        steering_limit=0.45, torque_min=-1.0, torque_max=1.2,
    ),
    "coupe": VehicleParameters(),
    "saloon": VehicleParameters(
        mass=1750.0, yaw_inertia=2950.0, front_axle_distance=1.35, rear_axle_distance=1.45, wheel_radius=0.33,
        rear_axle_inertia=18.0, gear_ratio=11.0, friction=1.0, front_stiffness=1.25e5, rear_stiffness=1.6e5,
        steering_limit=0.62, torque_min=-50.0, torque_max=380.0,
    ),
    "single-seater": VehicleParameters(
        mass=720.0, yaw_inertia=950.0, front_axle_distance=1.65, rear_axle_distance=1.35, wheel_radius=0.33,
        rear_axle_inertia=8.0, gear_ratio=9.0, friction=1.5, front_stiffness=7.0e4, rear_stiffness=1.0e5,
        steering_limit=0.35, torque_min=-40.0, torque_max=350.0,
    ),
    "lorry": VehicleParameters(
        mass=12000.0, yaw_inertia=5.2e4, front_axle_distance=2.6, rear_axle_distance=1.9, wheel_radius=0.5,
        rear_axle_inertia=150.0, gear_ratio=20.0, friction=0.75, front_stiffness=4.2e5, rear_stiffness=7.0e5,
        steering_limit=0.7, torque_min=-400.0, torque_max=1800.0,
    ),
}  # fmt: skip
