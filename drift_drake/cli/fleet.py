"""`drift-drake fleet`: many cars and days at once; what all cars have, what one has, what a day brought."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from drift_drake.car.given_vehicle import on_one_track, vehicle_given
from drift_drake.car.log.table import InvalidLogError, run_paths
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.executors import ExecutorConfig
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import try_outputs, write_figure
from drift_drake.common.standard_output import said_to, write_results

if TYPE_CHECKING:
    from drift_drake.gap.monitoring import fleet
    from drift_drake.gap.monitoring.fleet import FleetDay


@dataclasses.dataclass(frozen=True)
class Fleet:
    """Find what is missing from a fleet's simulator: for all cars, for single cars, on single days.

    drift-drake fleet logs --vehicle car.yaml --picture fleet.png

    LOGS holds a folder for each car, and in it runs (run_0.csv, ...) or a folder of runs for each day.
    """

    folder: tyro.conf.Positional[Path]
    """Folder of cars."""
    vehicle: Path
    """What the simulator believes of every car (YAML)."""
    json: Path | None = None
    """Where to write what was found, as JSON (-: standard output)."""
    picture: Path | None = None
    """Where to draw it: cars by effects (PNG)."""
    workers: int = 2
    """Processes."""
    scheduler: str | None = None
    """Address of a Dask scheduler (tcp://HOST:8786) whose workers do the work and see the same logs."""


def run_fleet(command: Fleet) -> None:
    vehicle, own, remark = on_one_track(vehicle_given(command.vehicle), command.vehicle)
    if remark:
        print(f"warning: {remark}", file=sys.stderr)
    if command.workers < 1:
        raise InvalidOptionError(f"--workers {command.workers}: give 1 or more")
    folders = day_folders(command.folder)
    logs = [path for folder in folders.values() for path in run_paths(folder)]
    try_outputs({"--json": command.json, "--picture": command.picture}, [command.vehicle, *logs])
    with ended_at_once():
        from drift_drake.gap.monitoring.fleet import (
            days_of,
            draw_fleet,
            evidence_problem_of,
            fleet_findings,
            shared_columns,
        )
        from drift_drake.gap.monitoring.watch import WATCHED

    used = shared_columns(folders)
    if left := [name for name in WATCHED if name not in used]:
        print(f"left out, since not every run has it: {', '.join(left)}", file=sys.stderr)
    here = command.scheduler is None
    run_on = ExecutorConfig("processes" if here else "dask", command.workers, command.scheduler)
    days = days_of(folders, vehicle, own, used, None if here and command.workers == 1 else run_on)
    found = fleet_findings(evidence_problem_of(vehicle, own, used), usable_days(command.folder, days))
    print("\n".join(lines(found)), file=said_to(command.json))
    write_results(command.json, found)
    if command.picture is not None:
        write_figure(draw_fleet(found), command.picture)
        print(f"{command.picture}: cars by effects", file=said_to(command.json))


def usable_days(folder: Path, days: Sequence["FleetDay"]) -> list["FleetDay"]:
    """The days that can be judged, the others are reported; raises InvalidLogError where there is none."""
    kept = [day for day in days if day.sums.rows > 0.0]
    why = "less than 2 s can be judged: at rest, nearly so, or sideways"
    if not kept:
        raise InvalidLogError(f"{folder}: of each day {why}; give days of driving")
    if others := [f"{day.car}/{day.name}" for day in days if not day.sums.rows > 0.0]:
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


def lines(found: "fleet.FleetFindings") -> Sequence[str]:
    from drift_drake.car.effects.catalogue import CATALOGUE

    out = [f"{len(found.cars)} cars, {found.days} days"]
    for term in sorted(found.terms, key=lambda t: (("fleet", "car", "day").index(t.level), t.owner, -t.probability)):
        size = f"{term.magnitude:+.3g}{CATALOGUE[term.effect].suffix} (95 %: {term.low:.3g} to {term.high:.3g})"
        owner = "all cars" if term.level == "fleet" else term.owner
        out.append(f"  {owner}: {term.effect} {size}, probability {term.probability:.2f}")
    if not found.terms:
        out.append("  nothing is missing from the simulator")
    out += [f"  outlier: {day}, {z:.1f} standard deviations beyond these effects" for day, z in found.outliers.items()]
    return out
