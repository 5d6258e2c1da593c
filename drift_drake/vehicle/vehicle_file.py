"""A vehicle file with effects: what the simulator believes of the car, and the effects that a diagnosis added."""

import hashlib
import json
from pathlib import Path
from typing import Any

import yaml

from drift_drake.errors import shown
from drift_drake.safe_files import write_text
from drift_drake.vehicle.effects import Effects, magnitudes_of, make_effects
from drift_drake.vehicle.parameters import InvalidVehicleError, VehicleParameters, as_number, is_number, vehicle_data
from drift_drake.vehicle.plausible import check_effects, check_plausible


def read_vehicle(path: str | Path) -> tuple[VehicleParameters, Effects]:
    """Parameters and effects of a vehicle file; a file without an `effects:` key has none.

    Raises:
        InvalidVehicleError: names the file, the key and the remedy.
    """
    data: Any = vehicle_data(path)
    magnitudes = data.pop("effects", None) or {} if isinstance(data, dict) else {}
    if not isinstance(magnitudes, dict):
        raise InvalidVehicleError(f"{path}: 'effects' must hold 'name: magnitude' lines")
    numbers = {str(name): as_number(value) for name, value in magnitudes.items()}
    for name, value in numbers.items():
        if not is_number(value):
            raise InvalidVehicleError(
                f"{path}: effects.{name[:60]} is {shown(value)}; give its magnitude as a finite number"
            )
    try:
        effects = make_effects(numbers)
    except ValueError as error:
        raise InvalidVehicleError(f"{path}: {error}") from None
    parameters = VehicleParameters.from_dict(data, str(path))
    check_plausible(parameters, str(path))
    check_effects(effects, parameters, str(path))
    return parameters, effects


def write_vehicle(
    path: str | Path,
    parameters: VehicleParameters,
    effects: Effects = Effects(),  # noqa: B008 (immutable)
) -> None:
    """Writes a vehicle file that `read_vehicle` reads back; effects of zero magnitude are left out."""
    write_text(path, yaml.safe_dump(_plain(parameters, effects), sort_keys=False))


def vehicle_hash(parameters: VehicleParameters, effects: Effects) -> str:
    """SHA-256 of a vehicle file's numbers: the same however they are laid out and commented."""
    return hashlib.sha256(json.dumps(_numbers(_plain(parameters, effects)), sort_keys=True).encode()).hexdigest()


def _plain(parameters: VehicleParameters, effects: Effects) -> dict[str, Any]:
    data = parameters.to_dict()
    magnitudes = magnitudes_of(effects)
    return data | ({"effects": magnitudes} if magnitudes else {})


def _numbers(data: dict[str, Any]) -> dict[str, Any]:
    """With all numbers as floats: 1500 and 1500.0 are the same."""
    return {
        key: _numbers(value) if isinstance(value, dict) else value if isinstance(value, str) else float(value)
        for key, value in data.items()
    }


def stated_tolerances(path: str | Path) -> frozenset[str]:
    """Names of the tolerances that a vehicle file states; the others have `Tolerance`'s defaults."""
    data: Any = vehicle_data(path)
    return frozenset(str(name) for name in (data.get("tolerance") or {}))
