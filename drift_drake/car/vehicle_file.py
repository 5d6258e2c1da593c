"""A vehicle file with effects: what the simulator believes of the car, and the effects that a diagnosis added."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects, magnitudes_of, make_effects
from drift_drake.car.equations import KINDS_BY_KEY
from drift_drake.car.parameters import (
    CarParameters,
    Constants,
    InvalidVehicleError,
    VehicleParameters,
    as_number,
    is_number,
    vehicle_data,
)
from drift_drake.car.proportions import slowest_driven
from drift_drake.car.single_track.motion_with_effects import changed_constants
from drift_drake.common.errors import shown
from drift_drake.common.safe_files import write_text

SINGLE_TRACK = "single_track"  # in that file, the single-track car that was calibrated on the same logs
SIMULATOR = "simulator"  # of one that holds a simulator of the user's (`foreign.simulator_car`)
NO_VEHICLE_FILE = (
    "holds a simulator of yours, which 'drift-drake simulator check', 'identify', 'check', 'diagnose', 'apply' and "
    "'replay' take; give a vehicle file here"
)
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
LEAST_FACTOR = 0.05  # of 1 + q that multiplies something, and of the friction that is left
LEAST_ROLLED = 0.05  # of the practical range's low end, of a length that a tyre rolls
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
    """Sees that parameters may be some vehicle's, from a model car of 1.6 kg to a lorry of 40 t.

    Sizes are judged one by one; inertias, stiffnesses and torques as ratios to them. Rates at which rim and body settle
    on the road are bounded, so that an integrator can follow them.

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
                f"{source}: tolerance.{name} is {value:g}; give a standard deviation of {LARGEST_TOLERANCE:g} at most"
            )


def effect_range(name: str, p: VehicleParameters) -> tuple[float, float]:
    """Magnitudes that an effect can have on this vehicle; zero switches an effect off."""
    info = CATALOGUE[name]
    if info.possible:
        return info.possible
    reach = REACH * max(abs(end) for end in info.range_for(p))
    low, high = (-reach if info.signed else 0.0), reach
    if info.factor:
        low = max(low, LEAST_FACTOR - 1.0)
    if info.share:
        high = min(high, 1.0 - LEAST_FACTOR)
    return low, high


def check_effects(effects: Effects | Mapping[str, float], p: VehicleParameters, source: str = "vehicle") -> None:
    """Raises InvalidVehicleError, which names `source`, effect and range, where no vehicle can have the effects."""
    magnitudes = magnitudes_of(effects) if isinstance(effects, Effects) else effects
    for name, q in magnitudes.items():
        low, high = effect_range(name, p)
        if q != 0.0 and not low <= q <= high:
            unit = CATALOGUE[name].suffix
            raise InvalidVehicleError(
                f"{source}: effects.{name} is {q:g}{unit}; no vehicle's is outside {low:g} to {high:g}{unit}"
            )
        if CATALOGUE[name].rolled and 0.0 < q < (least := LEAST_ROLLED * CATALOGUE[name].range_for(p)[0]):
            raise InvalidVehicleError(f"{source}: effects.{name} is below {least:.2g} m; give 0 for none")
    changed = changed_constants(p.constants(), make_effects(dict(magnitudes)))
    least = LEAST_SHARE_OF_WHEELBASE * (p.front_axle_distance + p.rear_axle_distance)
    if min(changed.front_axle_distance, changed.rear_axle_distance) < least:
        raise InvalidVehicleError(
            f"{source}: effects.cg_shift is {changed.front_axle_distance - p.front_axle_distance:g} m, which takes the "
            f"centre of gravity to or over an axle; give one between {least - p.front_axle_distance:.3g} and "
            f"{p.rear_axle_distance - least:.3g} m"
        )
    _check_settling(changed, f"{source} with its effects")


def _check_settling(c: Constants, source: str) -> None:
    """Of a small disturbance at the slowest speed."""
    speed = slowest_driven(c)
    rim = (c.rear_stiffness + c.front_coupling * c.front_stiffness) * c.wheel_radius**2 / (c.rear_axle_inertia * speed)
    turning = c.front_stiffness * c.front_axle_distance**2 + c.rear_stiffness * c.rear_axle_distance**2
    body = max(turning / c.yaw_inertia, (c.front_stiffness + c.rear_stiffness) / c.mass) / speed
    for what, rate in (("rear_axle_inertia, the rim", rim), ("yaw_inertia or mass, the body", body)):
        if rate > FASTEST_SETTLING:
            raise InvalidVehicleError(
                f"{source}: with these stiffnesses and {what} settles on the road in {1e6 / rate:.2g} microseconds; "
                f"no vehicle's does in less than {1e6 / FASTEST_SETTLING:.0f}"
            )


def read_vehicle(path: str | Path) -> tuple[VehicleParameters, Effects]:
    """Parameters and effects of a path's vehicle file; a file without an `effects:` key has none.

    Raises:
        InvalidVehicleError: names the file, the key and the remedy.

    Examples:
        >>> car, effects = read_vehicle("car.yaml")
        >>> car.mass
        1650.0
    """
    return single_track_of_data(vehicle_data(path), str(path))


def single_track_of_data(data: Any, source: str) -> tuple[VehicleParameters, Effects]:
    """`read_vehicle` of what a file holds; errors name `source`."""
    if kind := key_of(data):
        raise InvalidVehicleError(
            f"{source}: holds a {kind.replace('_', '-')} car, which 'drift-drake identify', 'check', 'diagnose', "
            "'apply', 'replay', 'drive', 'choose', 'plan-next' and 'watch' take; give a single-track vehicle file here "
            "('identify --car single-track' writes one)"
        )
    if isinstance(data, dict) and SIMULATOR in data:
        raise InvalidVehicleError(f"{source}: {NO_VEHICLE_FILE}")
    effects = effects_of(data.get("effects") if isinstance(data, dict) else None, source)
    own = {name: value for name, value in data.items() if name != "effects"} if isinstance(data, dict) else data
    parameters = VehicleParameters.from_dict(own, source)
    check_plausible(parameters, source)
    check_effects(effects, parameters, source)
    return parameters, effects


def key_of(data: Any) -> str:
    """The key that says of which other kind the car of a file is; empty of a single-track car or a simulator."""
    return next((key for key in KINDS_BY_KEY if isinstance(data, dict) and key in data), "")


def effects_of(magnitudes: Any, source: str) -> Effects:
    """The effects that a file names under `effects:`; none where it has no such key.

    Raises:
        InvalidVehicleError: names `source`, the key and the remedy.
    """
    if not isinstance(magnitudes or {}, dict):
        raise InvalidVehicleError(f"{source}: 'effects' must hold 'name: magnitude' lines")
    numbers = {str(name): as_number(value) for name, value in (magnitudes or {}).items()}
    for name, value in numbers.items():
        if not is_number(value):
            raise InvalidVehicleError(
                f"{source}: effects.{name[:60]} is {shown(value)}; give its magnitude as a finite number"
            )
    try:
        return make_effects(numbers)
    except ValueError as error:
        raise InvalidVehicleError(f"{source}: {error}") from None


def kept_single_track(data: Any, source: str | Path) -> tuple[VehicleParameters, Effects] | None:
    """The single-track car that another car's file holds, too; None without one.

    Raises:
        InvalidVehicleError: it is none.
    """
    part = data.get(SINGLE_TRACK) if key_of(data) else None
    return None if part is None else single_track_of_data(part, f"{source}: {SINGLE_TRACK}")


def write_vehicle(
    path: str | Path,
    parameters: CarParameters,
    effects: Effects = Effects(),
    single_track: tuple[VehicleParameters, Effects] | None = None,
) -> None:
    """Writes a vehicle file (YAML, SI units) that is read back to the same car; effects of zero magnitude are left out.

    Args:
        path: of the file; parameters: of a car of any kind, without effects; effects: magnitudes;
        single_track: to be kept with another car, the one that was calibrated on the same logs.

    Raises:
        OutputError: the file cannot be written.

    Examples:
        >>> write_vehicle("mine.yaml", car.replace(mass=1210.0), make_effects({"aero_drag": 0.7}))
    """
    kept = {SINGLE_TRACK: _plain(*single_track)} if single_track else {}
    write_text(path, yaml.safe_dump(_plain(parameters, effects) | kept, sort_keys=False))


def vehicle_hash(parameters: CarParameters, effects: Effects) -> str:
    """SHA-256 of a vehicle file's numbers: the same however they are laid out and commented.

    Of a simulator of the user's, of the file that it is in, too (`SimulatorCar.source_hash`).
    """
    numbers = json.dumps(_numbers(_plain(parameters, effects)), sort_keys=True)
    return hashlib.sha256((numbers + getattr(parameters, "source_hash", "")).encode()).hexdigest()


def _plain(parameters: CarParameters, effects: Effects) -> dict[str, Any]:
    data = parameters.to_dict()
    magnitudes = magnitudes_of(effects)
    return data | ({"effects": magnitudes} if magnitudes else {})


def _numbers(data: Any) -> Any:
    """With all numbers as floats: 1500 and 1500.0 are the same."""
    if isinstance(data, dict):
        return {key: _numbers(value) for key, value in data.items()}
    return [_numbers(value) for value in data] if isinstance(data, list) else float(data) if is_number(data) else data


def stated_tolerances(path: str | Path) -> frozenset[str]:
    """Names of the tolerances that a vehicle file states; the others have `Tolerance`'s defaults."""
    return tolerances_in(vehicle_data(path), path)


def tolerances_in(data: Any, path: str | Path) -> frozenset[str]:
    """`stated_tolerances` of what the file holds that a car was read from."""
    part = data.get(key_of(data), data.get("car", data))
    if isinstance(part, str):  # a simulator file may name the vehicle file of its car
        return stated_tolerances(Path(path).parent / part)
    return frozenset(str(name) for name in (part.get("tolerance") or {}))
