"""A vehicle as a function is given it: a vehicle file's path, its parameters, or parameters and effects."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from drift_drake.car.car_file import car_of_data
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import KINDS_BY_KEY, kind_of
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.parameters import CarParameters, InvalidVehicleError, VehicleParameters, vehicle_data
from drift_drake.car.vehicle_file import effects_of, kept_single_track, tolerances_in

GivenEffects = Effects | Mapping[str, float]
Vehicle = str | Path | CarParameters | tuple[CarParameters, GivenEffects]

CARS: Any = (VehicleParameters, *(kind.parameters for kind in KINDS_BY_KEY.values()), SimulatorCar)


class GivenVehicle(NamedTuple):
    """Parameters, effects, the names of those tolerances that the vehicle file states, and, of another car, the single-
    track one that the file keeps with it."""

    parameters: CarParameters
    effects: Effects
    tolerances: frozenset[str] = frozenset()
    single_track: tuple[VehicleParameters, Effects] | None = None


class OnOneTrack(NamedTuple):
    """A single-track car, its effects, and what is to be said where it stands for another."""

    parameters: VehicleParameters
    effects: Effects
    remark: str = ""


def vehicle_given(vehicle: Vehicle) -> GivenVehicle:
    """The car of a vehicle file, or as it is given.

    Raises:
        InvalidVehicleError: the file cannot be used, or what was given is no vehicle.
    """
    if isinstance(vehicle, str | Path):
        data = vehicle_data(vehicle)
        kept = kept_single_track(data, vehicle)
        return GivenVehicle(*car_of_data(data, vehicle), tolerances_in(data, vehicle), kept)
    if isinstance(vehicle, CARS):
        return GivenVehicle(vehicle, Effects())
    if isinstance(vehicle, tuple) and len(vehicle) == 2 and isinstance(vehicle[0], CARS):
        return GivenVehicle(vehicle[0], effects_given(vehicle[1]))
    raise InvalidVehicleError(
        f"vehicle: {type(vehicle).__name__} is none; give a vehicle file's path, VehicleParameters, "
        "DoubleTrackParameters, or both parameters and effects"
    )


def label_of(car: CarParameters) -> str:
    """What a car of this kind is called."""
    return str(kind_of(car.constants()).label)


def single_track_of(car: CarParameters) -> VehicleParameters:
    """The car where only a single-track one will do.

    Raises:
        InvalidVehicleError: it is another.
    """
    if not isinstance(car, VehicleParameters):
        raise InvalidVehicleError(
            f"the vehicle is a {label_of(car)}, of which this asks too much; calibrate it by prediction "
            "('drift-drake identify --json CAR.json') and give --calibration CAR.json, or give a single-track one"
        )
    return car


def on_one_track(given: GivenVehicle, source: str | Path = "vehicle") -> OnOneTrack:
    """The car where only a single-track one will do: of another the one that is kept with it.

    Raises:
        InvalidVehicleError: names `source` and the remedy.
    """
    if isinstance(given.parameters, VehicleParameters):
        return OnOneTrack(given.parameters, given.effects)
    if given.single_track is not None:
        label = label_of(given.parameters)
        remark = f"the car is a {label}: this uses the single-track car that was calibrated on the same logs"
        return OnOneTrack(*given.single_track, remark)
    raise InvalidVehicleError(
        f"{source}: holds a {label_of(given.parameters)}, and no single-track car with it, which this needs; give the "
        "file that 'drift-drake identify --car auto' or '--car single-track' writes of the same logs"
    )


def effects_given(effects: GivenEffects | None) -> Effects:
    """Effects as they are, or magnitudes by name; None for none.

    Raises:
        InvalidVehicleError: names the effect and the remedy.
    """
    if isinstance(effects, Effects):
        return effects
    if effects is not None and not isinstance(effects, Mapping):
        raise InvalidVehicleError(f"effects: {type(effects).__name__} holds no effects; give magnitudes by name")
    return effects_of(dict(effects or {}), "effects")
