"""The baseline of a monitored car: of windows where it was calibrated by prediction, else of a bank of filters.

A bank's is how scores scatter on the car's own logs, since the equations do not follow it exactly.
Scores of white innovations have the information as covariance. A real car's scatter more, and not in every direction
alike: what they scatter beyond, by roots of information, is the excess that widens the monitor's scores wherever it
judges (compare `gap.estimation.scores`, which does the same for a diagnosis of a change).
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.given_vehicle import GivenVehicle, single_track_of
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.car.sensors import NoiseLevels
from drift_drake.common.plain_files import number, read_json
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.normal import Normal, normal_from_data
from drift_drake.gap.monitoring.events import InvalidBaselineScoresError, Watcher
from drift_drake.gap.monitoring.evidence import ALARM, FALSE_ALARMS, Sums, alarm_at, no_sums
from drift_drake.gap.monitoring.monitor import Monitor, make_monitor, row_taken
from drift_drake.gap.monitoring.watch import WATCHED, monitor_of, rows_of
from drift_drake.gap.monitoring.windowed.baseline import (
    WindowBaseline,
    learn_window_baseline,
    window_baseline_of,
    window_monitor,
)

BLOCK = 2.0  # [s]
SHRUNK, SHRUNK_AT = 0.3, 24  # towards a diagonal, with so many blocks
OTHER_DRIVES = 4.0  # by how much scores scatter more on other drives than between blocks of those that were learnt from
LEAST = 4  # blocks
SAME_PERIOD = 0.02  # relative: scores of other rates scatter otherwise
SAME_MAGNITUDE = 0.01
LARGEST = 1e9
REMEDY = "write it with 'drift-drake identify --json'"


def block_sums(monitor: Monitor, run: Run) -> list[Sums]:
    """Sums of the full blocks of a run."""
    state, out = monitor.start(), list[Sums]()
    for row in rows_of(run):
        state = row_taken(monitor, state, row.y, row.command, row.road)
        if state.block.rows * monitor.bank.period >= BLOCK:
            out.append(state.block)
            state = state._replace(block=no_sums(len(monitor.problem.nodes)))
    return out


def excess_of(blocks: Sequence[Sums]) -> np.ndarray:
    """Covariance [n, n] of blocks' scores beyond their information, by roots of information; symmetric, none below 0.

    Raises:
        ValueError: too few blocks.
    """
    if len(blocks) < LEAST:
        raise ValueError(f"{len(blocks)} blocks; give at least {LEAST * BLOCK:g} s of normal driving")
    root = np.sqrt([np.maximum(np.diag(block.information), 1e-12) for block in blocks])
    score = np.array([block.score for block in blocks]) / root
    white = np.mean([block.information / np.outer(r, r) for block, r in zip(blocks, root, strict=True)], axis=0)
    found = score.T @ score / len(blocks)
    shrink = min(SHRUNK * SHRUNK_AT / len(blocks), 0.9)
    found = (1.0 - shrink) * found + shrink * np.diag(np.diag(found))
    values, vectors = np.linalg.eigh(found - white)
    return np.asarray(OTHER_DRIVES * (vectors * np.maximum(values, 0.0)) @ vectors.T)


def with_baseline_scores(monitor: Monitor, runs: Sequence[Run]) -> Monitor:
    """The monitor of a car whose normal drives are `runs`."""
    blocks = [block for run in runs for block in block_sums(monitor, run)]
    return dataclasses.replace(monitor, problem=monitor.problem._replace(excess=excess_of(blocks)))


@dataclasses.dataclass(frozen=True)
class BaselineScores:
    """How a car's scores scatter on normal drives beyond white innovations, and what they were made with."""

    period: float  # [s] of the logs
    noise: dict[str, float]  # of the channels, by name
    nodes: tuple[tuple[str, float], ...]  # the bank's cars: what they have, at which magnitude
    excess: np.ndarray  # [n, n] `evidence.Problem.excess`

    def as_data(self) -> dict[str, Any]:
        """Plain data, the inverse of `scores_from_data`."""
        return dataclasses.asdict(self) | {
            "nodes": [list(node) for node in self.nodes],
            "excess": np.round(self.excess, 6).tolist(),
        }


def learn_baseline_scores(runs: Sequence[Run], vehicle: VehicleParameters, own: Effects) -> BaselineScores:
    """The baseline of a car's scores, from logs of its own.

    Raises:
        InvalidLogError: no torque commands; ValueError: too little driving.
    """
    monitor = monitor_of(runs[0], vehicle, own)
    levels = {name: float(np.sqrt(monitor.bank.noise[i])) for i, name in enumerate(CHANNELS) if monitor.used[i]}
    return BaselineScores(runs[0].period, levels, nodes_of(monitor), with_baseline_scores(monitor, runs).problem.excess)


def calibrated_monitor(
    scores: BaselineScores, run: Run, vehicle: VehicleParameters, own: Effects, alarm: float = ALARM
) -> Monitor:
    """The monitor of a calibrated car for a log of the same columns and rate.

    Raises:
        InvalidLogError: the log lacks a column of the calibration's logs, or has another rate;
        InvalidBaselineScoresError: the vehicle is not the one that was calibrated.
    """
    check_like(run, tuple(scores.noise), scores.period)
    monitor = make_monitor(vehicle, own, list(scores.noise), run.period, NoiseLevels(**scores.noise))
    (names, magnitudes), (own_names, own_magnitudes) = (zip(*n, strict=True) for n in (scores.nodes, nodes_of(monitor)))
    # A vehicle file rounds.
    if names != own_names or not np.allclose(own_magnitudes, magnitudes, rtol=SAME_MAGNITUDE, atol=0.0):
        raise InvalidBaselineScoresError(
            "the calibration's normal scores are of another vehicle file; give the two that one 'identify' wrote"
        )
    return dataclasses.replace(monitor, problem=monitor.problem._replace(excess=scores.excess), alarm=alarm)


def check_like(run: Run, columns: Sequence[str], period: float) -> None:
    """Checks that a log has the columns and the rate of a calibration's logs, and torque commands.

    Raises:
        InvalidLogError: it has not.
    """
    missing = [name for name in columns if run.column(name) is None]
    if missing or run.tau_cmd is None:
        lacking = ", ".join([*missing, *(["tau_cmd"] if run.tau_cmd is None else [])])
        raise InvalidLogError(f"{run.name}: has no column {lacking}, which the calibration's logs had; add it")
    if abs(run.period / period - 1.0) > SAME_PERIOD:
        raise InvalidLogError(
            f"{run.name}: a row each {run.period:g} s, the calibration's logs one each {period:g} s; resample it"
        )


def nodes_of(monitor: Monitor) -> tuple[tuple[str, float], ...]:
    """What the bank's cars have."""
    return tuple((node.name, node.magnitude) for node in monitor.problem.nodes)


def scores_from_data(data: Mapping[str, Any]) -> BaselineScores:
    """What `BaselineScores.as_data` wrote; KeyError, TypeError or ValueError where it is not that."""
    unknown = sorted(set(data["noise"]) - set(WATCHED))
    if unknown or not data["noise"]:
        raise ValueError(f"noise must be of {', '.join(WATCHED)}")
    noise = {name: number(value, lambda q: 0.0 < q < LARGEST) for name, value in data["noise"].items()}
    nodes = tuple((str(name), number(magnitude)) for name, magnitude in data["nodes"])
    excess = np.array(data["excess"], dtype=float)
    if not nodes or excess.shape != (len(nodes), len(nodes)) or not np.all(np.abs(excess) < LARGEST):
        raise ValueError(f"excess must hold {len(nodes)} by {len(nodes)} finite numbers")
    if not np.allclose(excess, excess.T) or np.linalg.eigvalsh(excess)[0] < -1e-3 * max(
        float(np.abs(excess).max()), 1.0
    ):
        raise ValueError("excess must be symmetric, without negative directions")
    return BaselineScores(number(data["period"], lambda q: 0.0 < q < 1.0), noise, nodes, excess)


class OfPrediction(NamedTuple):
    """Of a car that was calibrated by prediction."""

    windows: WindowBaseline
    normal: Normal


Baseline = BaselineScores | OfPrediction


def learn_baseline(
    runs: Sequence[Run], vehicle: CarParameters, own: Effects, normal: Normal | None
) -> dict[str, Any] | None:
    """What a calibration keeps for a monitor, as plain data; None where its logs, or its kind of car, give none.

    Args:
        normal: its baseline's residuals, of a car calibrated by prediction.
    """
    try:
        if normal is not None:
            return learn_window_baseline(runs, vehicle, own, normal).as_data()
        return learn_baseline_scores(runs, vehicle, own).as_data() if isinstance(vehicle, VehicleParameters) else None
    except (InvalidLogError, ValueError):  # no torque commands, or too little driving
        return None


def calibrated_watcher(
    baseline: Baseline, run: Run, given: GivenVehicle, false_alarms: float = FALSE_ALARMS
) -> Watcher:
    """The monitor of a calibrated car for a log of the same columns and rate; false_alarms: that are allowed [1/h].

    Raises:
        InvalidLogError: the log lacks a column of the calibration's logs, or has another rate;
        InvalidBaselineScoresError: the vehicle is not the one that was calibrated.
    """
    if isinstance(baseline, OfPrediction):
        check_like(run, baseline.windows.columns, baseline.windows.period)
        return window_monitor(baseline.windows, baseline.normal, given.parameters, given.effects, false_alarms)
    car = single_track_of(given.parameters)
    return calibrated_monitor(baseline, run, car, given.effects, alarm_at(false_alarms))


def baseline_given(calibration: Any) -> Baseline:
    """The baseline of what `identify` found, or of its JSON's path.

    Raises:
        InvalidBaselineScoresError: unreadable, not JSON, without any, or not what `identify` writes.
    """
    if isinstance(calibration, str | Path):
        return baseline_of(read_json(calibration, InvalidBaselineScoresError, REMEDY), calibration)
    found = getattr(calibration, "calibration", calibration)  # of an identification
    normal = getattr(found, "normal", None)
    data = {"watching": getattr(found, "watching", None), "normal": normal and normal.as_data()}
    return baseline_of(data, "the calibration")


def baseline_of(data: Any, path: str | Path) -> Baseline:
    """The same from the JSON's content; `path`: what is named in errors."""
    found = data.get("watching") if isinstance(data, dict) else None
    if found is None:
        raise InvalidBaselineScoresError(
            f"{path}: has no normal scores to watch with: the logs it was made of had no torque commands, or less than "
            f"8 s, or an older version wrote it; {REMEDY}, of logs with the column tau_cmd"
        )
    try:
        if data.get("normal"):
            return OfPrediction(window_baseline_of(found), normal_from_data(data["normal"]))
        return scores_from_data(found)
    except (KeyError, TypeError, AttributeError):
        raise InvalidBaselineScoresError(f"{path}: 'watching' is not what 'identify' writes; {REMEDY}") from None
    except ValueError as error:
        raise InvalidBaselineScoresError(f"{path}: watching: {error}; {REMEDY}") from None
