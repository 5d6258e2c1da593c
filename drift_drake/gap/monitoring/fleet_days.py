"""Scores of all runs of a day of a fleet's car, by a bank of filters or by windows of prediction."""

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from drift_drake.car.given_vehicle import GivenVehicle
from drift_drake.car.log.table import InvalidLogError, Run, case_paths, read_case, read_run
from drift_drake.common.executors import ExecutorConfig, results_of
from drift_drake.gap.monitoring.baselines import Baseline, OfPrediction, block_sums, calibrated_watcher
from drift_drake.gap.monitoring.events import Watcher
from drift_drake.gap.monitoring.evidence import EvidenceProblem, no_sums, whitened
from drift_drake.gap.monitoring.history import of_parts
from drift_drake.gap.monitoring.monitor import Monitor, make_monitor
from drift_drake.gap.monitoring.watch import WATCHED, monitor_of
from drift_drake.gap.monitoring.windowed.baseline import sums_of_all, window_monitor, windows_of
from drift_drake.gap.monitoring.windowed.monitor import WindowMonitor
from drift_drake.gap.monitoring.windowed.null import whitened_after
from drift_drake.gap.monitoring.windowed.sums import WindowSums, features, unlike

Folders = Mapping[tuple[str, str], Path]  # of cars and days


class FleetDay(NamedTuple):
    """A car's day: whitened scores [s], and their mean [s, K] by the nodes' amplitudes; empty where none counts."""

    car: str
    name: str
    w: np.ndarray
    m: np.ndarray


class Judge(NamedTuple):
    """The simulator's vehicle, the same for all cars, and its baseline where it was calibrated."""

    given: GivenVehicle
    used: tuple[str, ...]  # measured columns
    baseline: Baseline | None = None

    def problem(self) -> EvidenceProblem:
        """The nodes of a day's scores."""
        if isinstance(self.baseline, OfPrediction):
            return window_monitor(*self.baseline, self.given.parameters, self.given.effects).problem
        return make_monitor(self.given.parameters.single_track(), self.given.effects, self.used).problem

    def monitor(self, run: Run) -> Watcher:
        """What judges a run, at its own rate and with its own noise."""
        if self.baseline is not None:
            return calibrated_watcher(self.baseline, run, self.given)
        return monitor_of(run, self.given.parameters.single_track(), self.given.effects, self.used)


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


def day_scores(folder: Path, judge: Judge) -> tuple[np.ndarray, np.ndarray]:
    """Scores of a day and their mean, as a `FleetDay` has them."""
    runs = [(judge.monitor(run), run) for run in read_case(folder)]
    monitor = runs[0][0]
    if isinstance(monitor, WindowMonitor):
        windows = [one for by, run in runs if isinstance(by, WindowMonitor) for one in known_sums(by, run)]
        if windows:
            known = monitor.null.mean, monitor.null.covariance
            return whitened_after(monitor.null, known, of_parts(*windows, by=lambda *parts: np.sum(parts, axis=0)))
    else:
        blocks = [block for by, run in runs if isinstance(by, Monitor) for block in block_sums(by, run)]
        if blocks:
            sums = of_parts(*blocks, by=lambda *parts: np.sum(parts, axis=0)[None])
            w, m = whitened(monitor.problem, sums, no_sums(len(monitor.problem.nodes), 1))
            return w[0], m[0]
    return np.zeros(0), np.zeros((0, len(monitor.problem.nodes)))


def known_sums(monitor: WindowMonitor, run: Run) -> list[WindowSums]:
    """The sums of a run's windows, of driving that the calibration knows."""
    windows = [one for one in windows_of(monitor, run) if unlike(monitor.familiar, features(one)) is None]
    return sums_of_all(monitor, windows)


def days_of(folders: Folders, judge: Judge, run_on: ExecutorConfig | None = None) -> list[FleetDay]:
    """All days; workers, on other machines perhaps, read the same folders. Without them, one after another."""
    job, paths = functools.partial(day_scores, judge=judge), list(folders.values())
    scores = [job(path) for path in paths] if run_on is None else results_of(run_on, job, paths, "day")
    return [FleetDay(car, day, *found) for (car, day), found in zip(folders, scores, strict=True)]
