"""A vehicle file with effects: what the simulator believes of the car, and the effects that a diagnosis added."""

from pathlib import Path
from typing import Any

import yaml

from drift_drake.vehicle.effects import Effects, magnitudes_of, make_effects
from drift_drake.vehicle.parameters import InvalidVehicleError, VehicleParameters


def read_vehicle(path: str | Path) -> tuple[VehicleParameters, Effects]:
    """Parameters and effects of a vehicle file; a file without an `effects:` key has none.

    Raises:
        InvalidVehicleError: names the file, the key and the mend.
    """
    try:
        data: Any = yaml.safe_load(Path(path).read_text())
    except (OSError, yaml.YAMLError):
        return VehicleParameters.from_yaml(path), Effects()  # which says what is wrong
    if not isinstance(data, dict) or "effects" not in data:
        return VehicleParameters.from_dict(data, str(path)), Effects()
    magnitudes = data.pop("effects") or {}
    if not isinstance(magnitudes, dict):
        raise InvalidVehicleError(f"{path}: 'effects' must hold 'name: magnitude' lines")
    for name, value in magnitudes.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise InvalidVehicleError(f"{path}: effects.{name} is {value!r}; give its magnitude as a number")
    try:
        effects = make_effects(magnitudes)
    except ValueError as error:
        raise InvalidVehicleError(f"{path}: {error}") from None
    return VehicleParameters.from_dict(data, str(path)), effects


def write_vehicle(path: str | Path, parameters: VehicleParameters, effects: Effects) -> None:
    """Writes a vehicle file that `read_vehicle` reads back; effects of zero magnitude are left out."""
    data = parameters.to_dict()
    magnitudes = magnitudes_of(effects)
    if magnitudes:
        data["effects"] = magnitudes
    Path(path).write_text(yaml.safe_dump(data, sort_keys=False))


def stated_tolerances(path: str | Path) -> frozenset[str]:
    """Names of the tolerances that a vehicle file states; the others have `Tolerance`'s defaults."""
    data: Any = yaml.safe_load(Path(path).read_text())
    return frozenset(str(name) for name in (data.get("tolerance") or {}))
