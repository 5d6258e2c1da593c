"""A double-track car in a file: its parameters under `double_track:`, and its effects, as YAML."""

import dataclasses
from pathlib import Path
from typing import Any

import yaml

from drift_drake.car.double_track.motion import check_supported
from drift_drake.car.double_track.parameters import DoubleTrackParameters, TireParameters
from drift_drake.car.effects.magnitudes import Effects, magnitudes_of
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters, as_number, check_keys, vehicle_data
from drift_drake.car.vehicle_file import DOUBLE_TRACK, check_effects, check_plausible, effects_of, read_vehicle
from drift_drake.common.safe_files import write_text

TIRES = ("front_tire", "rear_tire")


def write_double_track(path: str | Path, car: DoubleTrackParameters, effects: Effects = Effects()) -> None:
    """Writes a file that `read_double_track` reads back; effects of zero magnitude are left out."""
    magnitudes = magnitudes_of(effects)
    data = {DOUBLE_TRACK: double_track_dict(car)} | ({"effects": magnitudes} if magnitudes else {})
    write_text(path, yaml.safe_dump(data, sort_keys=False))


def holds_double_track(path: str | Path) -> bool:
    """Whether a vehicle file is one of a double-track car."""
    data = vehicle_data(path)
    return isinstance(data, dict) and DOUBLE_TRACK in data


def read_either(path: str | Path) -> tuple[VehicleParameters | DoubleTrackParameters, Effects]:
    """The car of a vehicle file, of one track or two, and its effects; raises InvalidVehicleError."""
    return read_double_track(path) if holds_double_track(path) else read_vehicle(path)


def read_double_track(path: str | Path) -> tuple[DoubleTrackParameters, Effects]:
    """The car and its effects.

    Raises:
        InvalidVehicleError: names the file, the key and the remedy.
    """
    data = vehicle_data(path)
    if not isinstance(data, dict) or DOUBLE_TRACK not in data:
        raise InvalidVehicleError(f"{path}: no double-track car; write its parameters under '{DOUBLE_TRACK}:'")
    check_keys(str(path), "", data, {DOUBLE_TRACK, "effects"})
    effects = effects_of(data.get("effects"), str(path))
    car = double_track_from_dict(data[DOUBLE_TRACK], f"{path}: {DOUBLE_TRACK}")
    check_plausible(car.single_track(), str(path))
    check_effects(effects, car.single_track(), str(path))
    check_supported(effects, str(path))
    return car, effects


def double_track_dict(car: DoubleTrackParameters) -> dict[str, Any]:
    """Plain data, the inverse of `double_track_from_dict`."""
    return {
        name: {key: float(number) for key, number in value.items()} if isinstance(value, dict) else float(value)
        for name, value in dataclasses.asdict(car).items()
    }


def double_track_from_dict(data: Any, source: str) -> DoubleTrackParameters:
    """The car of plain data; every parameter must be there, none may be unknown.

    Raises:
        InvalidVehicleError: names `source`, the key and the remedy.
    """
    parts = {name: data.get(name) for name in TIRES} if isinstance(data, dict) else {"": data}
    for name, part in ({"": data} | parts).items():
        if not isinstance(part, dict):
            raise InvalidVehicleError(f"{source}: '{name or DOUBLE_TRACK}' must hold 'name: value' lines")
        known = {field.name for field in dataclasses.fields(TireParameters if name else DoubleTrackParameters)}
        check_keys(source, f"{name}." if name else "", part, known, known)
    parsed: dict[str, Any] = {key: as_number(value) for key, value in data.items() if key not in TIRES}
    place = ""
    try:
        for name in TIRES:
            place = f"{name}."
            parsed[name] = TireParameters(**{key: as_number(value) for key, value in data[name].items()})
        place = ""
        return DoubleTrackParameters(**parsed)
    except InvalidVehicleError as error:
        raise InvalidVehicleError(f"{source}: {place}{error}") from None
