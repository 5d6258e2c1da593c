"""What `drift-drake identify --json` wrote of a car, as `diagnose` wants it: how far to trust its sensors and model."""

import dataclasses
import json
from pathlib import Path
from typing import Any

from drift_drake.errors import DriftDrakeError
from drift_drake.estimation.problem import Everyday
from drift_drake.estimation.scores import Normal, normal_from_data


class InvalidCalibrationError(DriftDrakeError, ValueError):
    """A calibration that cannot be used; the message names the file and the mend."""


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
    mend = "write it with 'drift-drake identify --json'"
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidCalibrationError(f"{path}: cannot be read ({error.strerror}); {mend}") from None
    except ValueError:
        raise InvalidCalibrationError(f"{path}: not JSON; {mend}") from None
    try:
        return trust_of(data)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InvalidCalibrationError(f"{path}: no trust, row_weight and everyday of a calibration; {mend}") from None


def trust_of(data: Any) -> CarTrust:
    """The same from the JSON's content; KeyError or TypeError where something is missing."""
    if data.get("normal"):
        return CarTrust(1.0, 1.0, 1.0, None, normal_from_data(data["normal"]))
    everyday = data["everyday"]
    return CarTrust(
        float(data["trust"]["noise"]),
        float(data["trust"]["process"]),
        float(data["row_weight"]),
        Everyday(everyday["forces"], everyday["offsets"], float(everyday["row_weight"])) if everyday else None,
    )
