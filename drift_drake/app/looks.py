"""What the pages draw of runs and cars, as the reports do. Slow: called in a thread."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from drift_drake.car.log.table import run_paths
from drift_drake.view.pages.templates import part

DAYS = 8  # of which it is kept how they were driven
if TYPE_CHECKING:  # slow to import: the workbench opens before they are
    from drift_drake.view.pages.driving import Driven
    from drift_drake.view.playback.predicted import Predicted


def driven(folder: Path, vehicle: Path) -> "list[Driven]":
    """How a day's runs were driven, and which parts can be used of a car of that size; kept until a file changes.

    Raises:
        InvalidLogError, InvalidVehicleError: of the files.
    """
    files = [vehicle, *run_paths(folder)]
    return _driven(folder, vehicle, tuple((path, path.stat().st_mtime_ns) for path in files))


@lru_cache(DAYS)
def _driven(folder: Path, vehicle: Path, _files: tuple[tuple[Path, int], ...]) -> "list[Driven]":
    from drift_drake.car.given_vehicle import vehicle_given
    from drift_drake.car.log.table import read_case
    from drift_drake.gap.estimation.driven import all_driven

    return all_driven(read_case(folder), vehicle_given(vehicle).parameters)


def limits(outlook: Mapping[str, list[float | None]], vehicle: Path) -> Markup:
    """Bars of the least magnitudes that a later day would show; raises InvalidVehicleError."""
    from drift_drake.car.given_vehicle import vehicle_given
    from drift_drake.gap.estimation.prior import REACH
    from drift_drake.gap.evidence.limit_rows import outlook_rows

    return part("limit_bars", outlook_rows(outlook, vehicle_given(vehicle).parameters.single_track()), REACH)


def predicted(log: Path, vehicle: Path, corrected: Path) -> "Predicted":
    """A run's commands played to two cars; raises InvalidLogError, InvalidVehicleError."""
    from drift_drake.view.playback.predicted import predicted

    return predicted(log, vehicle, corrected)
