"""A double-track car in a file: its parameters under `double_track:`, and its effects, as YAML."""

import math
from typing import Any

from drift_drake.car.double_track.motion import check_supported
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import InvalidVehicleError, check_keys, read_plain
from drift_drake.car.vehicle_file import (
    DOUBLE_TRACK,
    SINGLE_TRACK,
    check_effects,
    check_plausible,
    effects_of,
    kept_single_track,
    slowest_driven,
)

TIRES = ("front_tire", "rear_tire")
WHEELBASES = {  # of a vehicle, least and most
    "front_track": (0.1, 3.0), "rear_track": (0.1, 3.0), "cg_height": (0.0, 2.0), "front_roll_center": (0.0, 1.0),
    "rear_roll_center": (0.0, 1.0),
}  # fmt: skip
MOST_TIMES = 10.0  # the weight or torque that drag and differential are held against
FASTEST_SETTLING = 1e5  # [1/s]; the coupe's rear rims have 5e3 at their slowest
FAST = 30.0  # [m/s] at which tyres roll through their relaxation


def double_track_of_data(data: Any, source: str) -> tuple[DoubleTrackParameters, Effects]:
    """The car and its effects, of what a file holds that has `double_track:`.

    Raises:
        InvalidVehicleError: names `source`, the key and the remedy.
    """
    check_keys(source, "", data, {DOUBLE_TRACK, SINGLE_TRACK, "effects"})
    kept_single_track(data, source)
    effects = effects_of(data.get("effects"), source)
    car = double_track_from_dict(data[DOUBLE_TRACK], f"{source}: {DOUBLE_TRACK}")
    check_plausible(car.single_track(), source)
    check_effects(effects, car.single_track(), source)
    check_supported(effects, source)
    check_proportions(car, source)
    check_settling(car, source)
    return car, effects


def check_proportions(car: DoubleTrackParameters, source: str) -> None:
    """Sees that lengths are some vehicle's of this wheelbase, and drag and differential of this weight.

    Raises:
        InvalidVehicleError: names `source`, the parameter and the range.
    """
    wheelbase = car.front_axle_distance + car.rear_axle_distance
    for name, (low, high) in WHEELBASES.items():
        if not low * wheelbase <= getattr(car, name) <= high * wheelbase:
            raise InvalidVehicleError(
                f"{source}: {name} is {getattr(car, name):g} m; no vehicle's of this wheelbase is outside "
                f"{low * wheelbase:.2g} to {high * wheelbase:.2g} m"
            )
    weight = car.mass * car.gravity
    for name, share, words in (
        ("aero_drag", car.aero_drag * FAST**2 / weight, f"the weight at {FAST:g} m/s"),
        (
            "differential_preload",
            car.differential_preload / (weight * car.wheel_radius),
            "the weight times wheel_radius",
        ),
        ("differential_share", car.differential_share, "the axle's torque"),
    ):
        if share > MOST_TIMES:
            raise InvalidVehicleError(
                f"{source}: {name} is {getattr(car, name):g}, {share:.3g} times {words}; no vehicle's is more than "
                f"{MOST_TIMES:g} times"
            )


def check_settling(car: DoubleTrackParameters, source: str) -> None:
    """Sees that an integrator can follow what settles fastest: tyres, springs, dampers, wheel loads, rims.

    Raises:
        InvalidVehicleError: names `source`, the parameter and how fast it settles.
    """
    c = car.constants()
    stiffness = max(c.front_tire.longitudinal_stiffness, c.rear_tire.longitudinal_stiffness)
    rates = {
        "roll_damping": c.roll_damping / c.roll_inertia,
        "front_roll_stiffness": math.sqrt((c.front_roll_stiffness + c.rear_roll_stiffness) / c.roll_inertia),
        "load_time": 1.0 / c.load_time,
        "wheel_inertia": stiffness * c.wheel_radius**2 / (c.wheel_inertia * slowest_driven(c)),
    }
    yielding = c.steering_compliance * car.front_stiffness  # by which the wheel turns back as its tyre builds force up
    rates["steering_compliance"] = FAST / c.front_tire.lateral_relaxation * yielding
    for tire in TIRES:
        for way in ("lateral_relaxation", "longitudinal_relaxation"):
            rates[f"{tire}.{way}"] = FAST / getattr(getattr(c, tire), way)
    for name, rate in rates.items():
        if rate > FASTEST_SETTLING:
            raise InvalidVehicleError(
                f"{source}: with this {name} the car settles in {1e6 / rate:.2g} microseconds; no vehicle's does in "
                f"less than {1e6 / FASTEST_SETTLING:.0f}"
            )


def double_track_from_dict(data: Any, source: str) -> DoubleTrackParameters:
    """The car of plain data; every parameter but the tolerance must be there (`parameters.read_plain`)."""
    car: DoubleTrackParameters = read_plain(DoubleTrackParameters, data, source)
    return car
