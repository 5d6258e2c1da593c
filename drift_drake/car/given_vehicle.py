"""A vehicle as a function is given it: a vehicle file's path, its parameters, or parameters and effects."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from drift_drake.car.car_file import car_of_data
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.parameters import CarParameters, InvalidVehicleError, VehicleParameters, vehicle_data
from drift_drake.car.vehicle_file import effects_of, tolerances_in

GivenEffects = Effects | Mapping[str, float]
Vehicle = str | Path | CarParameters | tuple[CarParameters, GivenEffects]


CARS = (VehicleParameters, DoubleTrackParameters, SimulatorCar)


class GivenVehicle(NamedTuple):
    """Parameters, effects, and the names of those tolerances that the vehicle file states."""

    parameters: CarParameters
    effects: Effects
    tolerances: frozenset[str] = frozenset()


def vehicle_given(vehicle: Vehicle) -> GivenVehicle:
    """The car of a vehicle file, or as it is given.

    Raises:
        InvalidVehicleError: the file cannot be used, or what was given is no vehicle.
    """
    if isinstance(vehicle, str | Path):
        data = vehicle_data(vehicle)
        return GivenVehicle(*car_of_data(data, vehicle), tolerances_in(data, vehicle))
    if isinstance(vehicle, CARS):
        return GivenVehicle(vehicle, Effects())
    if isinstance(vehicle, tuple) and len(vehicle) == 2 and isinstance(vehicle[0], CARS):
        return GivenVehicle(vehicle[0], effects_given(vehicle[1]))
    raise InvalidVehicleError(
        f"vehicle: {type(vehicle).__name__} is none; give a vehicle file's path, VehicleParameters, "
        "DoubleTrackParameters, or both parameters and effects"
    )


def single_track_of(car: CarParameters) -> VehicleParameters:
    """The car where only a single-track one will do.

    Raises:
        InvalidVehicleError: it is another.
    """
    if not isinstance(car, VehicleParameters):
        raise InvalidVehicleError(
            f"the vehicle is a {'simulator of yours' if isinstance(car, SimulatorCar) else 'double-track car'}, of "
            "which this asks too much; calibrate it by prediction ('drift-drake identify --json CAR.json') and give "
            "--calibration CAR.json, or give a single-track one"
        )
    return car


def effects_given(effects: GivenEffects | None, source: str = "effects") -> Effects:
    """Effects as they are, or magnitudes by name; None for none.

    Raises:
        InvalidVehicleError: names `source`, the effect and the remedy.
    """
    if isinstance(effects, Effects):
        return effects
    if effects is not None and not isinstance(effects, Mapping):
        raise InvalidVehicleError(f"{source}: {type(effects).__name__} holds no effects; give magnitudes by name")
    return effects_of(dict(effects or {}), source)
