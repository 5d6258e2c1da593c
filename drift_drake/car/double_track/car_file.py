"""A double-track car in a file: its parameters under `double_track:`, and its effects, as YAML."""

import dataclasses
from pathlib import Path
from typing import Any

from drift_drake.car.double_track.motion import check_supported
from drift_drake.car.double_track.parameters import DoubleTrackParameters, TireParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import (
    InvalidVehicleError,
    Tolerance,
    as_number,
    check_keys,
    vehicle_data,
)
from drift_drake.car.vehicle_file import DOUBLE_TRACK, check_effects, check_plausible, effects_of

TIRES = ("front_tire", "rear_tire")


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


def double_track_from_dict(data: Any, source: str) -> DoubleTrackParameters:
    """The car of plain data; every parameter must be there, none may be unknown.

    Raises:
        InvalidVehicleError: names `source`, the key and the remedy.
    """
    parts = {name: data.get(name) for name in TIRES} if isinstance(data, dict) else {"": data}
    stated = data.get("tolerance", {}) if isinstance(data, dict) else {}
    for name, part in ({"": data} | parts | {"tolerance": stated}).items():
        if not isinstance(part, dict):
            raise InvalidVehicleError(f"{source}: '{name or DOUBLE_TRACK}' must hold 'name: value' lines")
        kind = {"": DoubleTrackParameters, "tolerance": Tolerance}.get(name, TireParameters)
        known = {field.name for field in dataclasses.fields(kind)}
        required = set[str]() if name == "tolerance" else known - {"tolerance"}
        check_keys(source, f"{name}." if name else "", part, known, required)
    parsed: dict[str, Any] = {key: as_number(value) for key, value in data.items() if key not in (*TIRES, "tolerance")}
    place = ""
    try:
        for name in TIRES:
            place = f"{name}."
            parsed[name] = TireParameters(**{key: as_number(value) for key, value in data[name].items()})
        place = ""
        parsed["tolerance"] = Tolerance(**{key: as_number(value) for key, value in stated.items()})
        return DoubleTrackParameters(**parsed)
    except InvalidVehicleError as error:
        raise InvalidVehicleError(f"{source}: {place}{error}") from None
