"""`drift-drake fleet`: many cars and days at once; what all cars have, what one has, what a day brought."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from drift_drake.car.given_vehicle import GivenVehicle, on_one_track, vehicle_given
from drift_drake.car.log.table import InvalidLogError, run_paths
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.executors import ExecutorConfig
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import said_to, write_results, write_text

if TYPE_CHECKING:
    from drift_drake.gap.monitoring.fleet_days import FleetDay


@dataclasses.dataclass(frozen=True)
class Fleet:
    """Find what is missing from a fleet's simulator: for all cars, for single cars, on single days.

    drift-drake fleet logs --vehicle car.yaml --page fleet.html

    LOGS holds a folder for each car, and in it runs (run_0.csv, ...) or a folder of runs for each day. Days follow each
    other in the order of their names.
    """

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOGS")]
    """Folder with a folder of each car."""
    vehicle: Path
    """Vehicle file of the simulator, for all cars (YAML)."""
    calibration: Path | None = None
    """What 'identify --json' wrote with the vehicle file, so that its baseline residuals are no effect."""
    json: Path | None = None
    """Where to write what was found, as JSON (-: standard output)."""
    page: Path | None = None
    """Where to write a page of it: a table of cars and days for each effect (HTML)."""
    workers: int = 2
    """Processes."""
    scheduler: str | None = None
    """Address of a Dask scheduler (tcp://HOST:8786) whose workers do the work and see the same logs."""


def run_fleet(command: Fleet) -> None:
    given = vehicle_given(command.vehicle)
    if command.workers < 1:
        raise InvalidOptionError(f"--workers {command.workers}: give 1 or more")
    folders = day_folders(command.folder)
    logs = [path for folder in folders.values() for path in run_paths(folder)]
    inputs = [command.vehicle, *logs, *([command.calibration] if command.calibration else [])]
    try_outputs({"--json": command.json, "--page": command.page}, inputs)
    with ended_at_once():
        from drift_drake.gap.monitoring.baselines import OfPrediction, baseline_given
        from drift_drake.gap.monitoring.fleet import fleet_findings
        from drift_drake.gap.monitoring.fleet_days import Judge, days_of, shared_columns
        from drift_drake.gap.monitoring.fleet_page import lines, page
        from drift_drake.gap.monitoring.watch import WATCHED

    baseline = baseline_given(command.calibration) if command.calibration else None
    if not isinstance(baseline, OfPrediction):
        car = on_one_track(given, command.vehicle)
        given = GivenVehicle(car.parameters, car.effects)
        if car.remark:
            print(f"warning: {car.remark}", file=sys.stderr)
    used = shared_columns(folders)
    left = [name for name in WATCHED if name not in used]
    if left and baseline is None:
        print(f"left out, since not every run has it: {', '.join(left)}", file=sys.stderr)
    here = command.scheduler is None
    run_on = ExecutorConfig("processes" if here else "dask", command.workers, command.scheduler)
    judge = Judge(given, used, baseline)
    days = days_of(folders, judge, None if here and command.workers == 1 else run_on)
    found = fleet_findings(judge.problem(), usable_days(command.folder, days))
    print("\n".join(lines(found)), file=said_to(command.json))
    write_results(command.json, found)
    if command.page is not None:
        write_text(command.page, page(found, command.folder, command.vehicle))
        print(f"{command.page}: cars, days and effects", file=said_to(command.json))


def usable_days(folder: Path, days: Sequence["FleetDay"]) -> list["FleetDay"]:
    """The days that can be judged, the others are reported; raises InvalidLogError where there is none."""
    kept = [day for day in days if len(day.w)]
    why = "less than 2 s can be judged: at rest, nearly so, sideways, or harder than calibrated"
    if not kept:
        raise InvalidLogError(f"{folder}: of each day {why}; give days of driving")
    if others := [f"{day.car}/{day.name}" for day in days if not len(day.w)]:
        print(f"left out, since {why}: {', '.join(others)}", file=sys.stderr)
    return kept


def day_folders(folder: Path) -> dict[tuple[str, str], Path]:
    """Folders of runs by (car, day); raises InvalidLogError where there are none."""
    if not folder.is_dir():
        raise InvalidLogError(f"{folder}: no such folder; a fleet is a folder of cars, which are folders of runs")
    out = {}
    for car in sorted(path for path in folder.iterdir() if path.is_dir()):
        if run_paths(car):
            out[car.name, "runs"] = car
        for day in sorted(path for path in car.iterdir() if path.is_dir()):
            if run_paths(day):
                out[car.name, day.name] = day
    if not out:
        raise InvalidLogError(f"{folder}: holds no cars; give a folder of cars, which are folders of runs (run_0.csv)")
    return out
