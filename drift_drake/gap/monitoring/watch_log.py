"""A drive watched row by row, from its log: the function behind `drift-drake watch`."""

import dataclasses
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.given_vehicle import Vehicle, single_track_of, vehicle_given
from drift_drake.car.log.table import InvalidLogError, Run, read_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import InvalidOptionError
from drift_drake.gap.monitoring.baseline_scores import (
    BaselineScores,
    baseline_scores_of,
    calibrated_monitor,
    read_baseline_scores,
)
from drift_drake.gap.monitoring.monitor import BLOCK, SPIN, Monitor
from drift_drake.gap.monitoring.watch import (
    Row,
    as_rows,
    growing_lines,
    growing_rows,
    head_of,
    monitor_of,
    on_the_clock,
    rows_of,
    watched,
)

Event = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class WatchedDrive:
    """What has changed during a drive: events in the order of time, and how much could be judged [s]."""

    events: list[Event]
    judged: float
    monitor: Monitor

    def sentence(self) -> str:
        """That nothing has changed, or that nothing could be judged; empty where there are events."""
        if self.events:
            return ""
        if self.judged > 0.0:
            return f"nothing has changed in the {self.judged:.3g} s that could be judged"
        return (
            f"no row can be judged: the equations hold above {self.monitor.slowest:.2g} m/s and below {SPIN:g} rad of "
            "sideslip, and the filter needs a third of a second; watch a drive"
        )


def watch(
    log: str | Path | Run, vehicle: Vehicle, calibration: Any = None, *, follow: bool = False, idle: float = 0.0,
    page: str | Path | None = None, tell: Callable[[list[Event]], None] | None = None,
) -> WatchedDrive:  # fmt: skip
    """Watches a drive row by row: since when the car differs from its simulator, and which effect explains it.

    Examples:
        >>> seen = watch("logs/monday/run_0.csv", "car.yaml")  # doctest: +SKIP
        >>> print(seen.events or seen.sentence())  # doctest: +SKIP

    Args:
        log: a run's file, or a run; with torque commands;
        vehicle: vehicle file's path, parameters, or (parameters, effects): what the simulator believes of the car;
        calibration: what `identify` found of this car, or its JSON's path, so that its baseline is no change;
        follow: wait for further rows of a file (CSV) that is still being written; idle: end after so many seconds [s]
            without one, 0: never;
        page: where to draw the probabilities and list the events (HTML);
        tell: called with new events as they come.

    Raises:
        InvalidLogError: the log cannot be watched; InvalidVehicleError: of the vehicle;
        InvalidBaselineScoresError: of the calibration; InvalidOptionError: a run cannot be followed.
    """
    given, scores = vehicle_given(vehicle), None if calibration is None else _scores(calibration)
    car = single_track_of(given.parameters), given.effects
    monitor, rows, name = _rows(log, car, scores, follow, idle)
    verdicts = watched(monitor, rows)
    if page is not None:
        from drift_drake.gap.monitoring.live_page import shown_while  # jinja2 is slow to import

        verdicts = shown_while(verdicts, Path(page), name, monitor.labels, follow)
    events, judged = list[Event](), 0.0
    for _, _, new in verdicts:
        judged += BLOCK
        events += new
        if new and tell is not None:
            tell(new)
    return WatchedDrive(events, judged, monitor)


def _scores(calibration: Any) -> BaselineScores:
    if isinstance(calibration, str | Path):
        return read_baseline_scores(calibration)
    found = getattr(calibration, "calibration", calibration)  # of an identification
    return baseline_scores_of({"watching": getattr(found, "watching", None)}, "the calibration")


def _rows(
    log: str | Path | Run,
    car: tuple[VehicleParameters, Effects],
    scores: BaselineScores | None,
    follow: bool,
    idle: float,
) -> tuple[Monitor, Iterator[Row], str]:
    """(the monitor for a log, its rows, what it is called)."""

    def monitor_for(run: Run) -> Monitor:
        if scores is None:
            return monitor_of(run, *car)
        return calibrated_monitor(scores, run, *car)

    if isinstance(log, Run):
        if follow:
            raise InvalidOptionError("follow: a run has all of its rows; give the path of a file that grows")
        return monitor_for(log), rows_of(log), log.name
    if not isinstance(log, str | Path):
        raise InvalidLogError(f"log: {type(log).__name__} is none; give a run's path or a Run")
    path = Path(log)
    if not follow:
        run = read_run(path)
        return monitor_for(run), rows_of(run), str(path)
    coming = growing_rows(path, growing_lines(path, idle))
    head, first = head_of(path, coming)
    return monitor_for(head), as_rows(itertools.chain(first, on_the_clock(path, coming, head))), str(path)
