"""The days of a fleet as sums of scores, a day a job."""

import functools
from collections.abc import Mapping
from pathlib import Path

from drift_drake.logs.table import read_case
from drift_drake.monitoring.evidence import Problem
from drift_drake.monitoring.fleet import Day
from drift_drake.monitoring.history import Sums, no_sums
from drift_drake.monitoring.normal import block_sums
from drift_drake.monitoring.watch import monitor_of
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.workers import worker_processes

Folders = Mapping[tuple[str, str], Path]


def day_sums(folder: Path, vehicle: VehicleParameters, own: Effects) -> Sums:
    """Sums over all runs of a day."""
    runs = read_case(folder)
    monitor = monitor_of(runs[0], vehicle, own)
    total = no_sums(len(monitor.problem.nodes))
    for run in runs:
        for block in block_sums(monitor, run):
            total = Sums(*(a + b for a, b in zip(total, block, strict=True)))
    return total


def days_of(folders: Folders, vehicle: VehicleParameters, own: Effects, workers: int) -> list[Day]:
    """All days, on so many processes."""
    job = functools.partial(day_sums, vehicle=vehicle, own=own)
    if workers == 1:
        sums = [job(path) for path in folders.values()]
    else:
        with worker_processes(workers) as pool:
            sums = list(pool.map(job, folders.values()))
    return [Day(car, day, total) for (car, day), total in zip(folders, sums, strict=True)]


def problem_of(folders: Folders, vehicle: VehicleParameters, own: Effects) -> Problem:
    """What is judged, from the columns of the first day."""
    return monitor_of(read_case(next(iter(folders.values())))[0], vehicle, own).problem
