"""What no vehicle has: a car's lengths over its wheelbase, its forces over its weight, and how fast it settles."""

import math
from collections.abc import Mapping
from typing import Any

from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.parameters import InvalidVehicleError

WHEELBASES = {  # of a vehicle, least and most
    "front_track": (0.1, 3.0), "rear_track": (0.1, 3.0), "track": (0.1, 3.0), "cg_height": (0.0, 2.0),
    "front_roll_center": (0.0, 1.0), "rear_roll_center": (0.0, 1.0),
}  # fmt: skip
SLOWEST = 0.6  # [1] of sqrt(g wheelbase)
MOST_TIMES = 10.0  # the weight or torque that drag and differential are held against
FASTEST_SETTLING = 1e5  # [1/s]; the coupe's rear rims have 5e3 at their slowest
FAST = 30.0  # [m/s] at which tyres roll through their relaxation


def slowest_driven(c: Any) -> float:
    """Slowest speed [m/s] that counts as driving (`car.log.driving.slowest`), of a car of these constants."""
    return SLOWEST * math.sqrt(c.gravity * (c.front_axle_distance + c.rear_axle_distance))


def check_double_track(car: DoubleTrackParameters, source: str) -> None:
    """Sees that a double-track car may be some vehicle.

    Raises:
        InvalidVehicleError: names `source`, the parameter and the range.
    """
    check_shares(car, source, {
        "aero_drag": (car.aero_drag * FAST**2, f"the weight at {FAST:g} m/s"),
        "differential_preload": (car.differential_preload / car.wheel_radius, "the weight times wheel_radius"),
        "differential_share": (car.differential_share * car.mass * car.gravity, "the axle's torque"),
    })  # fmt: skip
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
    for tire in ("front_tire", "rear_tire"):
        for way in ("lateral_relaxation", "longitudinal_relaxation"):
            rates[f"{tire}.{way}"] = FAST / getattr(getattr(c, tire), way)
    check_settling(rates, source)


def check_brush(car: BrushParameters, source: str) -> None:
    """Sees that a car on brush tyres may be some vehicle.

    Raises:
        InvalidVehicleError: names `source`, the parameter and the range.
    """
    by_slip = car.lock * FAST / car.wheel_radius
    check_shares(car, source, {
        "aero_drag": (car.aero_drag * FAST**2, f"the weight at {FAST:g} m/s"),
        "lock": (by_slip, f"the weight times wheel_radius at {FAST:g} m/s between the rims"),
        "lock_least": (car.lock_least / car.wheel_radius, "the weight times wheel_radius"),
        "lock_share": (car.lock_share * car.mass * car.gravity, "the axle's torque"),
        "nominal_load": (car.nominal_load, "the weight"),
    })  # fmt: skip
    yields = max(abs(car.front_compliance * car.front_cornering), abs(car.rear_compliance * car.rear_cornering))
    check_settling({"roll_frequency": car.roll_frequency, "roll_damping": car.roll_frequency * car.roll_damping,
                    "pitch_time": 1.0 / car.pitch_time, "relaxation": FAST / car.relaxation,
                    "front_compliance or rear_compliance": FAST / car.relaxation * yields,
                    "vectoring": car.vectoring / car.yaw_inertia}, source)  # fmt: skip


def check_shares(car: Any, source: str, forces: Mapping[str, tuple[float, str]]) -> None:
    """Sees that lengths are some vehicle's of this wheelbase, and forces [N] by parameter of this weight.

    Raises:
        InvalidVehicleError: names `source`, the parameter and the range.
    """
    wheelbase = car.front_axle_distance + car.rear_axle_distance
    for name, (low, high) in WHEELBASES.items():
        if not low * wheelbase <= getattr(car, name, low * wheelbase) <= high * wheelbase:
            raise InvalidVehicleError(
                f"{source}: {name} is {getattr(car, name):g} m; no vehicle's of this wheelbase is outside "
                f"{low * wheelbase:.2g} to {high * wheelbase:.2g} m"
            )
    weight = car.mass * car.gravity
    for name, (force, words) in forces.items():
        if force > MOST_TIMES * weight:
            raise InvalidVehicleError(
                f"{source}: {name} is {getattr(car, name):g}, {force / weight:.3g} times {words}; no vehicle's is more "
                f"than {MOST_TIMES:g} times"
            )


def check_settling(rates: Mapping[str, float], source: str) -> None:
    """Sees that an integrator can follow what settles fastest, by parameter [1/s].

    Raises:
        InvalidVehicleError: names `source`, the parameter and how fast it settles.
    """
    for name, rate in rates.items():
        if rate > FASTEST_SETTLING:
            raise InvalidVehicleError(
                f"{source}: with this {name} the car settles in {1e6 / rate:.2g} microseconds; no vehicle's does in "
                f"less than {1e6 / FASTEST_SETTLING:.0f}"
            )
