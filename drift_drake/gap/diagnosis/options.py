"""What is refused of a diagnosis's options, before anything slow is imported or read."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import OPTIONAL, ROAD, InvalidLogError
from drift_drake.car.parameters import InvalidVehicleError
from drift_drake.common.errors import InvalidOptionError, meant
from drift_drake.common.plain_files import check_file
from drift_drake.gap.estimation.usable import PIECE
from drift_drake.gap.identification.options import LARGEST_SCALE


def check_options(
    catalogue: Sequence[str], without: Sequence[str], every: int, most_seconds: float, workers: int
) -> None:
    """Sees that options can be used, before anything is read.

    Raises:
        InvalidOptionError, InvalidLogError, InvalidVehicleError: names the option and the remedy.
    """
    if workers < 1:
        raise InvalidOptionError(f"--workers {workers}: give 1 or more")
    if not most_seconds >= PIECE:
        raise InvalidOptionError(f"--most-seconds {most_seconds:g}: give {PIECE:g} or more")
    for name in without:
        if name not in (*OPTIONAL, *ROAD):
            raise InvalidLogError(f"--without {name}: not a column that can be left out; {meant(name, OPTIONAL)}")
    if every < 1:
        raise InvalidLogError(f"--every {every}: give 1 or more")
    for name in catalogue:
        if name not in CATALOGUE:
            raise InvalidVehicleError(f"unknown effect {name}; {meant(name, CATALOGUE)}")
    if not catalogue:
        raise InvalidVehicleError("there is no effect to consider; name some of the catalogue")


LEAST_ALARMS, USUAL_ALARMS, MOST_ALARMS = 0.001, 0.05, 0.2  # rates of false alarms


def check_trust(
    calibration: Any, process_scale: float, noise_scale: float, tempering: float, false_alarms: float | None = None
) -> None:
    """Sees that the factors, or the calibration's path, can be used.

    Raises:
        InvalidOptionError: both are given, a factor is out of range, or there is no such file.
    """
    if calibration is not None:
        if (noise_scale, process_scale, tempering) != (1.0, 1.0, 1.0):
            raise InvalidOptionError(
                "--calibration has the scales and the likelihood tempering exponent; give it or them, not both"
            )
        if isinstance(calibration, str | Path):
            check_file(Path(calibration), InvalidOptionError, "write it with 'drift-drake identify --json'")
    if not 0.0 < tempering <= 1.0:
        raise InvalidOptionError(f"--tempering {tempering:g}: give a number above 0, up to 1")
    if not all(0.0 < factor <= LARGEST_SCALE for factor in (noise_scale, process_scale)):
        raise InvalidOptionError(f"--noise-scale and --process-scale are factors above 0, up to {LARGEST_SCALE:g}")
    if false_alarms is not None and not LEAST_ALARMS <= false_alarms <= MOST_ALARMS:
        raise InvalidOptionError(
            f"--false-alarms {false_alarms:g}: give a rate from {LEAST_ALARMS:g} to {MOST_ALARMS:g}"
        )
