"""What a calibration by prediction keeps for its monitor, beyond its baseline's residuals: its driving, and its cap."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import kind_of
from drift_drake.car.log.driving import slowest
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import CarParameters
from drift_drake.common.plain_files import number
from drift_drake.common.standard_output import Progress
from drift_drake.gap.estimation.effort import affordable, counted
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.windows import PREDICTED, WindowedRun, errors_of_all
from drift_drake.gap.monitoring.bank import effect_nodes
from drift_drake.gap.monitoring.events import InvalidBaselineScoresError
from drift_drake.gap.monitoring.evidence import FALSE_ALARMS, alarm_at, evidence_problem
from drift_drake.gap.monitoring.history import of_parts
from drift_drake.gap.monitoring.watch import rows_of
from drift_drake.gap.monitoring.windowed.monitor import WindowMonitor
from drift_drake.gap.monitoring.windowed.null import distance, null_of
from drift_drake.gap.monitoring.windowed.sums import (
    FEATURES,
    KnownDriving,
    Projection,
    WindowSums,
    familiar_of,
    features,
    no_windows,
    sums_of,
    weighted,
    weights_left_out,
)
from drift_drake.gap.monitoring.windowed.temperature import LEAST, temperature_of

AHEAD = 500  # windows of a whole log that are predicted together
MOST = 700  # windows of a calibration, of each recording as many, whose scores are looked at
TYPICAL = 0.75  # quantile of these distances, beyond which a window counts less
COLUMNS = tuple(PREDICTED)
LARGEST = 1e6


@dataclasses.dataclass(frozen=True)
class WindowBaseline:
    """Of a car calibrated by prediction, relative to its `Normal`."""

    period: float  # [s] of the logs
    columns: tuple[str, ...]  # that they have, of `COLUMNS`
    cap: float  # `Null.cap`
    temperature: float  # `Null.temperature`
    familiar: KnownDriving

    def as_data(self) -> dict[str, Any]:
        """Plain data, the inverse of `window_baseline_of`."""
        return {
            "period": self.period, "columns": list(self.columns), "cap": self.cap,
            "temperature": self.temperature,
            "points": np.round(self.familiar.points, 4).tolist(), "size": self.familiar.size.tolist(),
            "limit": self.familiar.limit, "errors": np.round(self.familiar.errors, 4).tolist(),
        }  # fmt: skip


def window_baseline_of(data: Mapping[str, Any]) -> WindowBaseline:
    """What `WindowBaseline.as_data` wrote; KeyError, TypeError or ValueError where it is not that."""
    columns = tuple(str(name) for name in data["columns"])
    if not set(columns) <= set(COLUMNS) or not {"r", "v", "beta"} <= set(columns):
        raise ValueError(f"columns must be of {', '.join(COLUMNS)}, with r, v and beta")
    points, size, errors = (np.array(data[key], dtype=float) for key in ("points", "size", "errors"))
    if points.ndim != 2 or points.shape[1] != len(FEATURES) or size.shape != (len(FEATURES),) or not len(points):
        raise ValueError(f"points must hold {len(FEATURES)} numbers each")
    if not (np.all(np.abs(points) < LARGEST) and np.all(size > 0.0) and np.all(size < LARGEST)):
        raise ValueError("points and size must be finite numbers")
    if errors.shape != (len(points),) or not (np.all(errors >= 0.0) and np.all(errors < LARGEST)):
        raise ValueError("errors must be a number of each of the points, at least 0")
    cap, temperature, limit = (
        number(data[key], lambda q: 0.0 < q < LARGEST) for key in ("cap", "temperature", "limit")
    )
    return WindowBaseline(
        number(data["period"], lambda q: 0.0 < q < 1.0),
        columns,
        cap,
        temperature,
        KnownDriving(points, size, limit, errors),
    )


def learn_window_baseline(runs: Sequence[Run], vehicle: CarParameters, own: Effects, normal: Normal) -> WindowBaseline:
    """What a monitor needs of a calibration's own logs.

    Raises:
        InvalidLogError: no torque commands, or no window of predictions.
    """
    if any(run.tau_cmd is None or run.beta is None for run in runs):
        raise InvalidLogError("a monitor by windows needs the columns tau_cmd and beta")
    columns = tuple(name for name in COLUMNS if all(run.column(name) is not None for run in runs))
    anywhere = KnownDriving(np.zeros((1, len(FEATURES))), np.ones(len(FEATURES)), np.inf, np.ones(1))
    everywhere = WindowBaseline(runs[0].period, columns, np.inf, LEAST, anywhere)
    monitor = window_monitor(everywhere, normal, vehicle, own)
    windows = [some for some in (windows_of(monitor, run) for run in runs) if some]
    if not windows:
        raise InvalidLogError("no window of predictions can be judged")
    driving = [np.array([features(window) for window in some]) for some in windows]
    first = max(affordable(vehicle.constants(), [one for some in windows for one in some], MOST) // len(windows), 1)
    sums = [sums_of_all(monitor, some[:first]) for some in windows]
    errors = relative_errors([distances_of(monitor, some) for some in sums], [len(some) for some in windows])
    familiar = familiar_of(driving, errors)
    weights = weights_left_out(familiar, [part[:first] for part in driving], [part[:first] for part in errors])
    sums = [[weighted(one, w) for one, w in zip(some, by, strict=True)] for some, by in zip(sums, weights, strict=True)]
    cap = float(np.quantile(np.concatenate([distances_of(monitor, some) for some in sums]), TYPICAL))
    null = monitor.null._replace(cap=cap)
    return dataclasses.replace(everywhere, cap=cap, temperature=temperature_of(monitor.problem, null, sums),
                               familiar=familiar)  # fmt: skip


def relative_errors(distances: Sequence[np.ndarray], counts: Sequence[int]) -> list[np.ndarray]:
    """Squared distances of each recording's first windows over their median, and 1 for the others: `counts` of each."""
    median = max(float(np.median(np.concatenate(distances))), 1e-9)
    return [np.concatenate([some / median, np.ones(n - len(some))])
            for some, n in zip(distances, counts, strict=True)]  # fmt: skip


def windows_of(monitor: WindowMonitor, run: Run) -> list[WindowedRun]:
    """The windows of a run that a monitor would judge."""
    return list(windows_by_time(monitor, run).values())


def windows_by_time(monitor: WindowMonitor, run: Run) -> dict[float, WindowedRun]:
    """The same by the time of their last row [s]."""
    state, out = monitor.start(), dict[float, WindowedRun]()
    for row in rows_of(run):
        state, window = monitor.with_row(state, row.y, row.command, row.road)
        if window is not None:
            out[row.t] = window
    return out


def sums_of_all(monitor: WindowMonitor, windows: Sequence[WindowedRun]) -> list[WindowSums]:
    """The sums of each of a drive's windows."""
    errors = errors_at_once(monitor, windows)
    return [sums_of(monitor.projection, one, *found) for one, found in zip(windows, errors, strict=True)]


def errors_at_once(monitor: WindowMonitor, windows: Sequence[WindowedRun]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Errors of each window, of the calibrated car [1, HORIZONS, channels] and of `Projection.cars` [cars, ...]."""
    if not windows:
        return []
    p = monitor.projection
    found = np.stack(errors_of_all(windows, [p.car(), *p.cars()]))
    return [(found[:1, i], found[1:, i]) for i in range(len(windows))]


def with_errors_ahead(monitor: WindowMonitor, run: Run, progress: Progress = lambda _stage, _share: None
                      ) -> WindowMonitor:  # fmt: skip
    """The monitor for a whole log, whose windows are predicted together: a simulator answers many for little more."""
    windows, errors = windows_by_time(monitor, run), list[tuple[np.ndarray, np.ndarray]]()
    ordered = list(windows.values())
    with counted(progress, monitor.projection.constants) as shown:
        for first in range(0, len(ordered), AHEAD):
            shown("predicting the whole log", first / len(ordered))
            errors += errors_at_once(monitor, ordered[first : first + AHEAD])
        shown("done", 1.0)
    return dataclasses.replace(monitor, ahead=dict(zip(windows, errors, strict=True)))


def distances_of(monitor: WindowMonitor, sums: Sequence[WindowSums]) -> np.ndarray:
    """Squared distances [windows] of a drive's windows from normal, per score, each given those before."""
    p, out = monitor.projection, list[float]()
    older = no_windows(len(p.normal.names), len(p.nodes))
    for one in sums:
        out.append(distance(monitor.null, older, one))
        older = of_parts(older, one, by=np.add)
    return np.array(out)


def window_monitor(
    baseline: WindowBaseline, normal: Normal, vehicle: CarParameters, own: Effects,
    false_alarms: float = FALSE_ALARMS,
) -> WindowMonitor:  # fmt: skip
    """The monitor of a car calibrated by prediction; false_alarms: that are allowed [1/h].

    Raises:
        InvalidBaselineScoresError: the calibration is of another kind of car.
    """
    constants = vehicle.constants()
    if tuple(kind_of(constants).deviations) != normal.of_kind:
        raise InvalidBaselineScoresError(
            "the calibration is of another kind of car (single-track, double-track, brush, a simulator) than the "
            "vehicle file; give the two that one 'identify' wrote"
        )
    single = vehicle.single_track()
    nodes = [node for name in normal.names for node in effect_nodes(name, single)]
    return WindowMonitor(
        Projection(constants, own, normal, nodes), null_of(normal, baseline.cap, baseline.temperature),
        baseline.familiar,
        evidence_problem(nodes, np.zeros(len(nodes))), np.array([name in baseline.columns for name in PREDICTED]),
        baseline.period, slowest(single), alarm_at(false_alarms),
        3600.0 / false_alarms,
    )  # fmt: skip
