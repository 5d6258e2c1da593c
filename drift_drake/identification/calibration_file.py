"""What `drift-drake identify --json` wrote of a car, as `diagnose` wants it: how far to trust its sensors and model."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drift_drake.errors import DriftDrakeError
from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.estimation.freeform import FORCE_CHANNELS
from drift_drake.estimation.normal import Normal, normal_from_data
from drift_drake.estimation.problem import Everyday
from drift_drake.identification.options import LARGEST_SCALE
from drift_drake.plain_files import named_number, read_json


class InvalidCalibrationError(DriftDrakeError, ValueError):
    """A calibration that cannot be used; the message names the file and the remedy."""


@dataclasses.dataclass(frozen=True)
class CarTrust:
    """Factors of the noise and the process, the row weight, and the misfit of every day; or what is normal."""

    noise_scale: float
    process_scale: float
    row_weight: float
    everyday: Everyday | None
    normal: Normal | None = None  # of a car calibrated by prediction, in place of the others

    def options(self) -> dict[str, Any]:
        """As `diagnose` takes them."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "normal"}


def read_trust(path: str | Path) -> CarTrust:
    """Reads them from a calibration's JSON.

    Raises:
        InvalidCalibrationError: unreadable, not JSON, or not what `identify` writes.
    """
    remedy = "write it with 'drift-drake identify --json'"
    data = read_json(path, InvalidCalibrationError, remedy)
    try:
        return trust_of(data)
    except (KeyError, TypeError, AttributeError):
        raise InvalidCalibrationError(f"{path}: no trust, row_weight and everyday of a calibration; {remedy}") from None
    except ValueError as error:
        raise InvalidCalibrationError(f"{path}: {error}; {remedy}") from None


def trust_of(data: Any) -> CarTrust:
    """The same from the JSON's content; KeyError or TypeError where something is missing, ValueError if off."""
    if data.get("normal"):
        return CarTrust(1.0, 1.0, 1.0, None, normal_from_data(data["normal"]))
    everyday = data["everyday"]
    return CarTrust(
        _within("trust.noise", data["trust"]["noise"], LARGEST_SCALE),
        _within("trust.process", data["trust"]["process"], LARGEST_SCALE),
        _within("row_weight", data["row_weight"], 1.0),
        None if everyday is None else _everyday(everyday),
    )


def _everyday(data: Mapping[str, Any]) -> Everyday:
    forces = {
        name: [named_number(f"everyday.forces.{name}", q) for q in data["forces"][name]] for name in FORCE_CHANNELS
    }
    if len({len(weights) for weights in forces.values()}) != 1:
        raise ValueError("everyday.forces has other numbers of weights for one channel than for another")
    offsets = {str(name): named_number(f"everyday.offsets.{name}", q) for name, q in data["offsets"].items()}
    unknown = sorted(set(offsets) - set(CHANNELS)) + sorted(set(data["forces"]) - set(FORCE_CHANNELS))
    if unknown:
        raise ValueError(f"everyday names '{unknown[0][:60]}', which is no channel")
    return Everyday(forces, offsets, _within("everyday.row_weight", data["row_weight"], 1.0))


def _within(name: str, value: Any, high: float) -> float:
    return named_number(name, value, lambda q: 0.0 < q <= high, f", give a number above 0, up to {high:g}")
