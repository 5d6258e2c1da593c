"""A drive watched row by row, from its log: the function behind `drift-drake watch`."""

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.car.foreign.simulator import SimulatorConstants
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.given_vehicle import GivenVehicle, Vehicle, on_one_track, vehicle_given
from drift_drake.car.log.table import InvalidLogError, Run, read_run
from drift_drake.car.parameters import InvalidVehicleError
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.standard_output import Progress
from drift_drake.gap.estimation.prior import REACH, SURE
from drift_drake.gap.monitoring.baselines import Baseline, OfPrediction, baseline_given, calibrated_watcher
from drift_drake.gap.monitoring.events import SoFar, Watcher
from drift_drake.gap.monitoring.evidence import FALSE_ALARMS, HAZARD, NONE_OF_THE_CATALOGUE, EvidenceProblem, alarm_at
from drift_drake.gap.monitoring.watch import Row, VerdictAt, monitor_of, rows_of, watched
from drift_drake.gap.monitoring.windowed.baseline import with_errors_ahead
from drift_drake.gap.monitoring.windowed.monitor import WindowMonitor
from drift_drake.gap.watching.diagnosed import Diagnosing, diagnosing, with_diagnoses
from drift_drake.gap.watching.follow import Tail, as_rows, growing_rows, head_of, on_the_clock

SAID = tuple(name for name, effect in CATALOGUE.items() if effect.watched)  # whose limits are put into words
Event = dict[str, Any]
MOST_ALARMS = 60.0  # [1/h] that can be asked for
OF_A_CHANGE = ("change", "cause", "over")


def amplitude_shown(problem: EvidenceProblem, shown: np.ndarray, block: float, alarm: float) -> np.ndarray:
    """Amplitude [n] of each node from which on a change would be reported with 95 %.

    Args:
        shown: standard deviations that amplitudes of one shift the scores by [n]; block: between verdicts [s];
        alarm: probability of none below which a change is reported.
    """
    odds = np.log(HAZARD * block * (1.0 - NONE_OF_THE_CATALOGUE)) + problem.log_prior
    nats = np.log((1.0 - alarm) / alarm) - odds + 0.5 * np.log1p((shown * problem.deviation) ** 2)
    return np.asarray((SURE + np.sqrt(SURE**2 + 2.0 * np.maximum(nats, 0.0))) / np.maximum(shown, 1e-12))


def least_shown(problem: EvidenceProblem, shown: np.ndarray, block: float, alarm: float) -> dict[str, float | None]:
    """By effect the magnitude from which on a change would be reported, the more harmful sign's; of a rate limit the
    highest. None where it is beyond what is believed possible."""
    amplitude = amplitude_shown(problem, shown, block, alarm)
    out: dict[str, float | None] = {}
    for name in problem.names:
        own = [(node, float(amplitude[i])) for i, node in enumerate(problem.nodes) if node.name == name]
        found = [node.magnitude / q if name in LIMITS else node.magnitude * q for node, q in own]
        if name in LIMITS:
            found = [q for q, (node, _) in zip(found, own, strict=True) if q >= min(n.magnitude for n, _ in own)]
            out[name] = max(found, default=None)
            continue
        least = min(found, key=lambda q: q if name == "friction_level" else abs(q))
        least = min((q for q in found if q < 0.0), default=least, key=abs) if name == "friction_level" else least
        most = max(abs(node.magnitude) for node, _ in own)
        out[name] = least if abs(least) <= 2.0 * REACH * most else None
    return out


def limits_sentence(limits: Mapping[str, float | None]) -> str:
    """The limits in words; empty where none could be shown."""
    known = [f"{name} {q:.2g}{CATALOGUE[name].suffix}" for name in SAID if (q := limits.get(name)) is not None]
    hidden = [name for name in SAID if name in limits and limits[name] is None]
    parts = [f"a change would have been reported from {', '.join(known)} on"] if known else []
    parts += [f"none of {', '.join(hidden)} could have been seen"] if hidden else []
    return "; ".join(parts)


@dataclasses.dataclass(frozen=True)
class WatchedDrive:
    """What has changed during a drive: events in the order of time, and how much could be judged [s]."""

    events: list[Event]
    monitor: Watcher
    seen: SoFar
    t: float  # of the last verdict [s]

    @property
    def judged(self) -> float:
        """Time that could be judged [s]."""
        return float(self.seen.time[0])

    @property
    def not_judged(self) -> float:
        """Time that was driven harder than the calibration was [s]."""
        return float(self.seen.time[1])

    @property
    def limits(self) -> dict[str, float | None]:
        """By effect the magnitude from which on the drive would have shown a change (`least_shown`)."""
        return least_shown(self.monitor.problem, self.seen.shown, self.monitor.block, self.monitor.alarm)

    def sentence(self) -> str:
        """That nothing has changed, or that nothing could be judged; empty where there are changes."""
        if any(event["event"] in OF_A_CHANGE for event in self.events):
            return ""
        harder = f"; {self.not_judged:.3g} s were driven harder than calibrated" if self.not_judged else ""
        if self.judged > 0.0:
            could = limits_sentence(self.limits)
            least = f"; {could}" if could else ""
            return f"nothing has changed in the {self.judged:.3g} s that could be judged{least}{harder}"
        return f"no row can be judged: {self.monitor.judges()}; watch a drive{harder}"

    def summary(self) -> Event:
        """The same as plain data, as the last event."""
        limits = {name: q if q is None else float(f"{q:.3g}") for name, q in self.limits.items()}
        return {"t": self.t, "event": "end", "judged": round(self.judged, 3), "not_judged": round(self.not_judged, 3),
                "would_show": limits}  # fmt: skip


class Part(NamedTuple):
    """What is watched by one monitor from its start: a log, or what has come of one until it was cut or replaced."""

    monitor: Watcher
    rows: Iterator[Row]

    def verdicts(self, diagnosed: Diagnosing) -> Iterator[VerdictAt]:
        """What the monitor says; of a car that was calibrated by prediction, what a diagnosis says of a change too."""
        verdicts, windowed = watched(self.monitor, self.rows), isinstance(self.monitor, WindowMonitor)
        return with_diagnoses(verdicts, diagnosed) if windowed and not _simulated(self.monitor) else verdicts


def watch(
    log: str | Path | Run, vehicle: Vehicle, calibration: Any = None, *, follow: bool = False, idle: float = 0.0,
    page: str | Path | None = None, tell: Callable[[list[Event]], None] | None = None,
    false_alarms_per_hour: float = FALSE_ALARMS, say: Callable[[str], None] = lambda _: None,
    progress: Progress = lambda _stage, _share: None,
) -> WatchedDrive:  # fmt: skip
    """Watches a drive row by row: since when the car differs from its simulator, and which effect explains it.

    Examples:
        >>> seen = watch("logs/monday/run_0.csv", "car.yaml")  # doctest: +SKIP
        >>> print(seen.events or seen.sentence())  # doctest: +SKIP

    Args:
        log: a run's file, or a run; with torque commands;
        vehicle: vehicle file's path, parameters, or (parameters, effects): what the simulator believes of the car;
        calibration: what `identify` found of this car, or its JSON's path, so that its baseline is no change; a car
            that was calibrated by prediction is judged by its windows, and the rows since a change are diagnosed
            (`diagnosed`), but of a simulator of yours; any other car is judged by a bank of filters;
        follow: wait for further rows of a file (CSV) that is still being written, or not there yet; a file that is cut
            or replaced is watched anew; idle: end after so many seconds [s] without one, 0: never;
        page: where to draw signals and probabilities and list the events (HTML);
        tell: called with new events as they come; false_alarms_per_hour [1/h]: that are allowed in the mean;
        say: called with what is waited for; progress: called with a stage and the share done where a simulator of yours
            predicts the log.

    Raises:
        InvalidLogError: the log cannot be watched; InvalidVehicleError: of the vehicle;
        InvalidBaselineScoresError, InvalidCalibrationError: of the calibration; InvalidOptionError: a run cannot be
            followed, or the rate is none; OutputError: the page cannot be written; SimulatorError: of a simulator.
    """
    if not 0.0 < false_alarms_per_hour <= MOST_ALARMS:
        raise InvalidOptionError(f"false_alarms_per_hour {false_alarms_per_hour:g}: give a rate up to {MOST_ALARMS:g}")
    given = vehicle_given(vehicle)
    baseline = None if calibration is None else baseline_given(calibration)
    tail = Tail(Path(log), idle, say) if follow and isinstance(log, str | Path) else None
    events, found, name = list[Event](), None, log.name if isinstance(log, Run) else str(log)

    def report(new: list[Event]) -> None:
        events.extend(new)
        if new and tell is not None:
            tell(new)

    def monitor_for(run: Run) -> Watcher:
        return _monitor(run, given, baseline, false_alarms_per_hour, say)

    for part in _parts(log, follow, tail, monitor_for, progress):
        if found is not None and tail is not None:
            report([{"t": 0.0, "event": "anew", "why": tail.last_end}])
        verdicts = part.verdicts(diagnosing(log, vehicle, calibration, tail))
        if page is not None:
            from drift_drake.gap.watching.live_page import shown_while  # jinja2 is slow to import

            verdicts = shown_while(verdicts, Path(page), name, part.monitor.labels, follow)
        found = WatchedDrive(events, part.monitor, part.monitor.start().seen, 0.0)
        for now in verdicts:
            found = dataclasses.replace(found, seen=now.seen, t=now.t)
            report(now.events)
    if found is None:
        raise InvalidLogError(f"{name}: has no rows; follow a log that is being written")
    return found


def _monitor(
    run: Run, given: GivenVehicle, baseline: Baseline | None, false_alarms: float, say: Callable[[str], None]
) -> Watcher:
    """The monitor for a log; a bank of filters takes the single-track car that is kept with a double-track one."""
    if isinstance(baseline, OfPrediction):
        return calibrated_watcher(baseline, run, given, false_alarms)
    if baseline is None and isinstance(given.parameters, SimulatorCar):
        raise InvalidVehicleError(
            f"{run.name}: the vehicle is a simulator of yours, which is watched with its calibration alone; give the "
            "JSON file that 'drift-drake identify' wrote of it with --calibration"
        )
    car = on_one_track(given)
    if car.remark:
        say(f"warning: {car.remark}")
    if baseline is not None:
        return calibrated_watcher(baseline, run, GivenVehicle(car.parameters, car.effects), false_alarms)
    monitor = monitor_of(run, car.parameters, car.effects)
    return dataclasses.replace(monitor, alarm=alarm_at(false_alarms))


def _simulated(monitor: Watcher) -> TypeGuard[WindowMonitor]:
    """Whether it predicts by a simulator of the user's, which is slow."""
    return isinstance(monitor, WindowMonitor) and isinstance(monitor.projection.constants, SimulatorConstants)


def _parts(
    log: str | Path | Run, follow: bool, tail: Tail | None, monitor_for: Callable[[Run], Watcher], progress: Progress
) -> Iterator[Part]:
    """A log, or in turn what comes of one that is cut or replaced while it is followed."""

    def whole(run: Run) -> Part:
        monitor = monitor_for(run)
        if _simulated(monitor):
            monitor = with_errors_ahead(monitor, run, progress)
        return Part(monitor, rows_of(run))

    if isinstance(log, Run):
        if follow:
            raise InvalidOptionError("follow: a run has all of its rows; give the path of a file that grows")
        yield whole(log)
        return
    if not isinstance(log, str | Path):
        raise InvalidLogError(f"log: {type(log).__name__} is none; give a run's path or a Run")
    if tail is None:
        yield whole(read_run(Path(log)))
        return
    while True:
        coming = growing_rows(tail.path, tail.lines())
        try:
            head, first = head_of(tail.path, coming)
        except InvalidLogError:
            if not tail.ended:
                raise
            continue  # it was cut or replaced before there was enough of it
        yield Part(monitor_for(head), as_rows(itertools.chain(first, on_the_clock(tail.path, coming, head))))
        if not tail.ended:
            return
