"""A vehicle as a function is given it: a vehicle file's path, its parameters, or parameters and effects."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.car.vehicle_file import effects_of, read_vehicle, stated_tolerances

GivenEffects = Effects | Mapping[str, float]
Vehicle = str | Path | VehicleParameters | tuple[VehicleParameters, GivenEffects]


class GivenVehicle(NamedTuple):
    """Parameters, effects, and the names of those tolerances that the vehicle file states."""

    parameters: VehicleParameters
    effects: Effects
    tolerances: frozenset[str] = frozenset()


def vehicle_given(vehicle: Vehicle) -> GivenVehicle:
    """The car of a vehicle file, or as it is given.

    Raises:
        InvalidVehicleError: the file cannot be used, or what was given is no vehicle.
    """
    if isinstance(vehicle, str | Path):
        return GivenVehicle(*read_vehicle(vehicle), stated_tolerances(vehicle))
    if isinstance(vehicle, VehicleParameters):
        return GivenVehicle(vehicle, Effects())
    if isinstance(vehicle, tuple) and len(vehicle) == 2 and isinstance(vehicle[0], VehicleParameters):
        return GivenVehicle(vehicle[0], effects_given(vehicle[1]))
    raise InvalidVehicleError(
        f"vehicle: {type(vehicle).__name__} is none; give a vehicle file's path, VehicleParameters, or both parameters "
        "and effects"
    )


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
