"""Which parameters and effects a vehicle can have: the wide ranges beyond which a number is an error of the file.

From a model car of 1.6 kg to a lorry of 40 t. Sizes are judged one by one; inertias, stiffnesses and torques as ratios
to them, since what is too much for the one is little for the other; effects as multiples of the catalogue's ranges.
Rates at which rim and body settle on the road are bounded, effects included, so that an integrator can follow them.
"""

import math
from collections.abc import Mapping

from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.effects import Effects, changed_constants, magnitudes_of, make_effects
from drift_drake.vehicle.parameters import Constants, InvalidVehicleError, VehicleParameters

SLOWEST = 0.6  # [1] of sqrt(g wheelbase)
SIZES = {  # SI
    "mass": (0.05, 1e5),
    "front_axle_distance": (0.01, 20.0),
    "rear_axle_distance": (0.01, 20.0),
    "wheel_radius": (0.003, 3.0),
    "gear_ratio": (0.01, 1e3),
    "friction": (0.02, 10.0),
    "gravity": (0.5, 30.0),
}
LARGEST_TOLERANCE = 10.0
REACH = 5.0  # times the larger end of the catalogue's range for a vehicle of this size
LEAST_FACTOR = 0.05  # of an effect that multiplies a parameter by 1 + q
FACTORS = (
    "friction_level", "front_rear_friction_split", "front_stiffness_error", "rear_stiffness_error", "mass_error",
    "yaw_inertia_error", "torque_gain_error", "drivetrain_inertia_error", "wheel_radius_error")  # fmt: skip
SHARES = ("sliding_friction_drop", "lateral_load_transfer", "front_rear_friction_split")  # that leave some friction
FASTEST_STEERING, SLOWEST_STEERING = 100.0, 0.01  # [rad/s]
FASTEST_SETTLING = 2e4  # [1/s]; the reference car's rim has 400, its body 30
LEAST_SHARE_OF_WHEELBASE = 0.02  # by which the centre of gravity stays between the axles


def ratios(p: VehicleParameters) -> dict[str, tuple[float, float, float, str]]:
    """(value, lowest, highest, in words) by parameter, of what is judged relative to the vehicle's size."""
    weight, torque = p.mass * p.gravity, p.mass * p.gravity * p.wheel_radius / p.gear_ratio
    return {
        "yaw_inertia": (
            p.yaw_inertia / (p.mass * p.front_axle_distance * p.rear_axle_distance), 0.02, 50.0,
            "mass * front_axle_distance * rear_axle_distance",
        ),
        "rear_axle_inertia": (p.rear_axle_inertia / (p.mass * p.wheel_radius**2), 1e-3, 10.0, "mass * wheel_radius^2"),
        "front_stiffness": (p.front_stiffness / weight, 0.1, 300.0, "the weight"),
        "rear_stiffness": (p.rear_stiffness / weight, 0.1, 300.0, "the weight"),
        "torque_max": (abs(p.torque_max) / torque, 0.0, 100.0, "the torque of an acceleration of 1 g"),
        "torque_min": (abs(p.torque_min) / torque, 0.0, 100.0, "the torque of an acceleration of 1 g"),
    }  # fmt: skip


def check_plausible(p: VehicleParameters, source: str = "vehicle") -> None:
    """Sees that parameters may be some vehicle's.

    Raises:
        InvalidVehicleError: names `source`, the parameter and the range.
    """
    for name, (low, high) in SIZES.items():
        value = getattr(p, name)
        if not low <= value <= high:
            raise InvalidVehicleError(f"{source}: {name} is {value:g}; no vehicle's is outside {low:g} to {high:g}")
    for name, (ratio, low, high, words) in ratios(p).items():
        if not low <= ratio <= high:
            raise InvalidVehicleError(
                f"{source}: {name} is {getattr(p, name):g}, {ratio:.3g} times {words}; no vehicle's is outside "
                f"{low:g} to {high:g} times"
            )
    _check_settling(p.constants(), source)
    for name, value in vars(p.tolerance).items():
        if value > LARGEST_TOLERANCE:
            raise InvalidVehicleError(
                f"{source}: tolerance.{name} is {value:g}; give a standard deviation below {LARGEST_TOLERANCE:g}"
            )


def effect_range(name: str, p: VehicleParameters) -> tuple[float, float]:
    """Magnitudes that an effect can have on this vehicle; zero switches an effect off."""
    if name == "steering_rate_limit":
        return SLOWEST_STEERING, FASTEST_STEERING
    info = CATALOGUE[name]
    reach = REACH * max(abs(end) for end in info.range_for(p))
    low, high = (-reach if info.signed else 0.0), reach
    if name in FACTORS:
        low = max(low, LEAST_FACTOR - 1.0)
    if name in SHARES:
        high = min(high, 1.0 - LEAST_FACTOR)
    return low, high


def check_effects(effects: Effects | Mapping[str, float], p: VehicleParameters, source: str = "vehicle") -> None:
    """Sees that effects may be a vehicle's.

    Raises:
        InvalidVehicleError: names `source`, the effect and the range.
    """
    magnitudes = magnitudes_of(effects) if isinstance(effects, Effects) else effects
    for name, q in magnitudes.items():
        low, high = effect_range(name, p)
        if q != 0.0 and not low <= q <= high:
            unit = CATALOGUE[name].suffix
            raise InvalidVehicleError(
                f"{source}: effects.{name} is {q:g}{unit}; no vehicle's is outside {low:g} to {high:g}{unit}"
            )
    if 0.0 < magnitudes.get("tyre_relaxation", 0.0) < (least := 0.05 * CATALOGUE["tyre_relaxation"].range_for(p)[0]):
        raise InvalidVehicleError(f"{source}: effects.tyre_relaxation is below {least:.2g} m; give 0 for none")
    least = LEAST_SHARE_OF_WHEELBASE * (p.front_axle_distance + p.rear_axle_distance)
    shift = magnitudes.get("cg_shift", 0.0)
    if min(p.front_axle_distance + shift, p.rear_axle_distance - shift) < least:
        raise InvalidVehicleError(
            f"{source}: effects.cg_shift is {shift:g} m, which takes the centre of gravity to or over an axle; "
            f"give one between {least - p.front_axle_distance:.3g} and {p.rear_axle_distance - least:.3g} m"
        )
    _check_settling(changed_constants(p.constants(), make_effects(dict(magnitudes))), f"{source} with its effects")


def _check_settling(c: Constants, source: str) -> None:
    """Of a small disturbance at the slowest speed that counts as driving (`logs.driving.slowest`)."""
    speed = SLOWEST * math.sqrt(c.gravity * (c.front_axle_distance + c.rear_axle_distance))
    rim = (c.rear_stiffness + c.front_coupling * c.front_stiffness) * c.wheel_radius**2 / (c.rear_axle_inertia * speed)
    turning = c.front_stiffness * c.front_axle_distance**2 + c.rear_stiffness * c.rear_axle_distance**2
    body = max(turning / c.yaw_inertia, (c.front_stiffness + c.rear_stiffness) / c.mass) / speed
    for what, rate in (("rear_axle_inertia, the rim", rim), ("yaw_inertia or mass, the body", body)):
        if rate > FASTEST_SETTLING:
            raise InvalidVehicleError(
                f"{source}: with these stiffnesses and {what} settles on the road in {1e6 / rate:.2g} microseconds; "
                f"no vehicle's does in less than {1e6 / FASTEST_SETTLING:.0f}"
            )
