"""The double-track car that a vehicle file makes likely: a first guess of what the file says nothing of.

Lengths, loads and stiffnesses of the shipped coupe, scaled to the car's wheelbase and mass (moments as mass times
length, times as the square root of the length); its tyres have the file's stiffnesses and friction at the static loads.
"""

import dataclasses
import math

from drift_drake.car.double_track.parameters import DoubleTrackParameters, TireParameters
from drift_drake.car.double_track.tyres import friction_at, stiffness_per_load
from drift_drake.car.parameters import VehicleParameters

COUPE = DoubleTrackParameters()
SHARED = ("mass", "yaw_inertia", "front_axle_distance", "rear_axle_distance", "wheel_radius", "gear_ratio",
          "rear_axle_inertia", "gravity", "steering_limit", "torque_min", "torque_max")  # fmt: skip


def nearest_double_track(vehicle: VehicleParameters) -> DoubleTrackParameters:
    """A double-track car whose `single_track` is the vehicle, and the shipped coupe in all that it says nothing of.

    Drag and rolling resistance, which a single-track vehicle file has as effects, are zero.
    """
    wheelbase = vehicle.front_axle_distance + vehicle.rear_axle_distance
    longer = wheelbase / (COUPE.front_axle_distance + COUPE.rear_axle_distance)
    heavier = vehicle.mass / COUPE.mass
    scales = {
        "roll_inertia": heavier * longer**2, "front_track": longer, "rear_track": longer, "cg_height": longer,
        "front_roll_center": longer, "rear_roll_center": longer, "front_unsprung_mass": heavier,
        "rear_unsprung_mass": heavier, "front_roll_stiffness": heavier * longer,
        "rear_roll_stiffness": heavier * longer, "roll_damping": heavier * longer**1.5, "load_time": math.sqrt(longer),
        "wheel_inertia": vehicle.rear_axle_inertia / COUPE.rear_axle_inertia, "steering_compliance": 1.0 / heavier,
    }  # fmt: skip
    wheel = 0.5 * vehicle.mass * vehicle.gravity / wheelbase  # its static load over the other axle's distance
    front, rear = wheel * vehicle.rear_axle_distance, wheel * vehicle.front_axle_distance

    def tire(first: TireParameters, load: float, stiffness: float) -> TireParameters:
        sized = dataclasses.replace(
            first,
            stiffest_load=heavier * first.stiffest_load,
            nominal_load=heavier * first.nominal_load,
            lateral_relaxation=longer * first.lateral_relaxation,
            longitudinal_relaxation=longer * first.longitudinal_relaxation,
        )
        return _at_load(sized, load, stiffness, vehicle.friction)

    return COUPE.replace(
        **{name: getattr(vehicle, name) for name in SHARED},
        **{name: scale * getattr(COUPE, name) for name, scale in scales.items()},
        tolerance=vehicle.tolerance,
        aero_drag=0.0,
        rolling_resistance=0.0,
        front_tire=tire(COUPE.front_tire, front, 0.5 * vehicle.front_stiffness),
        rear_tire=tire(COUPE.rear_tire, rear, 0.5 * vehicle.rear_stiffness),
    )


def _at_load(tire: TireParameters, load: float, stiffness: float, friction: float) -> TireParameters:
    """The tyre with this lateral stiffness [N per unit slip] and friction [-] at a load [N]."""
    stiffer = stiffness / (load * stiffness_per_load(tire.lateral_stiffness, load, tire.stiffest_load))
    grippier = friction / float(friction_at(tire.lateral_friction, load, tire.constants()))
    return dataclasses.replace(
        tire,
        lateral_stiffness=stiffer * tire.lateral_stiffness,
        longitudinal_stiffness=stiffer * tire.longitudinal_stiffness,
        lateral_friction=grippier * tire.lateral_friction,
        longitudinal_friction=grippier * tire.longitudinal_friction,
    )
