"""A car of any kind in a file: single-track, double-track, on brush tyres, or a simulator of the user's."""

from pathlib import Path
from typing import Any

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import KINDS_BY_KEY, check_supported
from drift_drake.car.foreign.simulator_car import SimulatorCar, read_simulator
from drift_drake.car.parameters import (
    CarParameters,
    InvalidVehicleError,
    check_keys,
    read_plain,
    vehicle_data,
)
from drift_drake.car.vehicle_file import (
    NO_VEHICLE_FILE,
    SIMULATOR,
    SINGLE_TRACK,
    check_effects,
    check_plausible,
    effects_of,
    kept_single_track,
    key_of,
    single_track_of_data,
)


def read_car(path: str | Path) -> tuple[CarParameters, Effects]:
    """The car of a file and its effects.

    Raises:
        InvalidVehicleError: names the file, the key and the remedy.
    """
    return car_of_data(vehicle_data(path), path)


def car_of_data(data: Any, path: str | Path) -> tuple[CarParameters, Effects]:
    """`read_car` of what the file holds."""
    if isinstance(data, dict) and SIMULATOR in data:
        car = read_simulator(data, path)
        effects = effects_of(data.get("effects"), str(path))
        check_plausible(car.single_track(), str(path))
        check_effects(effects, car.single_track(), str(path))
        for name, why in car.simulator.lacking.items():
            if getattr(effects, name) != 0.0:
                raise InvalidVehicleError(f"{path}: effects.{name}: the simulator cannot have it ({why}); leave it out")
        return car, effects
    key = key_of(data)
    return _with_own_states(data, key, str(path)) if key else single_track_of_data(data, str(path))


def _with_own_states(data: Any, key: str, source: str) -> tuple[CarParameters, Effects]:
    """The car of a kind with states of its own, and its effects; every parameter but the tolerance must be there."""
    kind = KINDS_BY_KEY[key]
    check_keys(source, "", data, {key, SINGLE_TRACK, "effects"})
    kept_single_track(data, source)
    effects = effects_of(data.get("effects"), source)
    car = read_plain(kind.parameters, data[key], f"{source}: {key}")
    check_plausible(car.single_track(), source)
    check_effects(effects, car.single_track(), source)
    check_supported(car.constants(), effects, source)
    kind.check(car, source)
    return car, effects


def plant_of(car: CarParameters, source: str | Path = "the vehicle") -> CarParameters:
    """The car where it has to be a Drake plant; raises InvalidVehicleError, which names `source`."""
    if isinstance(car, SimulatorCar):
        raise InvalidVehicleError(f"{source}: {NO_VEHICLE_FILE}")
    return car


def read_plant(path: str | Path) -> tuple[CarParameters, Effects]:
    """`read_car`, `plant_of`."""
    car, effects = read_car(path)
    return plant_of(car, path), effects


def read_simulator_car(path: str | Path) -> SimulatorCar:
    """The simulator of a simulator file; raises InvalidVehicleError where it holds another car."""
    car, _ = read_car(path)
    if not isinstance(car, SimulatorCar):
        raise InvalidVehicleError(f"{path}: holds a vehicle file; give one with '{SIMULATOR}:' here")
    return car
