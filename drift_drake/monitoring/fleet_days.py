"""The days of a fleet as sums of scores, a day a job."""

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path

from drift_drake.executors import ExecutorConfig, results_of
from drift_drake.logs.table import InvalidLogError, case_paths, read_case, read_run
from drift_drake.monitoring.evidence import EvidenceProblem
from drift_drake.monitoring.fleet import FleetDay
from drift_drake.monitoring.history import Sums, no_sums
from drift_drake.monitoring.monitor import make_monitor
from drift_drake.monitoring.normal import block_sums
from drift_drake.monitoring.watch import WATCHED, monitor_of
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters

Folders = Mapping[tuple[str, str], Path]


def shared_columns(folders: Folders) -> tuple[str, ...]:
    """The measured columns that all runs of a fleet have: days are compared by what the same columns show.

    Raises:
        InvalidLogError: a run cannot be used, or has no torque commands.
    """
    shared = list(WATCHED)
    for folder in folders.values():
        for path in case_paths(folder):
            run = read_run(path)
            if run.tau_cmd is None:
                raise InvalidLogError(f"{path}: has no column tau_cmd, without which no run can be judged; add it")
            shared = [name for name in shared if run.column(name) is not None]
    return tuple(shared)


def day_sums(folder: Path, vehicle: VehicleParameters, own: Effects, used: Sequence[str]) -> Sums:
    """Sums over all runs of a day, each at its own rate and with its own noise."""
    total = no_sums(len(evidence_problem_of(vehicle, own, used).nodes))
    for run in read_case(folder):
        for block in block_sums(monitor_of(run, vehicle, own, used), run):
            total = Sums(*(a + b for a, b in zip(total, block, strict=True)))
    return total


def days_of(
    folders: Folders, vehicle: VehicleParameters, own: Effects, used: Sequence[str],
    run_on: ExecutorConfig | None = None,
) -> list[FleetDay]:  # fmt: skip
    """All days; workers, on other machines perhaps, read the same folders. Without them, one after another."""
    job, paths = functools.partial(day_sums, vehicle=vehicle, own=own, used=used), list(folders.values())
    sums = [job(path) for path in paths] if run_on is None else results_of(run_on, job, paths, "day")
    return [FleetDay(car, day, total) for (car, day), total in zip(folders, sums, strict=True)]


def evidence_problem_of(vehicle: VehicleParameters, own: Effects, used: Sequence[str]) -> EvidenceProblem:
    """What is judged of days with these measured columns."""
    return make_monitor(vehicle, own, used).problem
