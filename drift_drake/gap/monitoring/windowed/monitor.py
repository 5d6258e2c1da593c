"""The monitor of a car that was calibrated by prediction: a row in, with each window of predictions a verdict out."""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from drift_drake.car.log.plausible import ABSURD
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.windows import (
    HORIZONS,
    PREDICTED,
    SETTLING,
    SMOOTHING,
    WindowedRun,
    rows_between_starts,
    run_errors,
    run_errors_of,
    smoothed,
)
from drift_drake.gap.monitoring.events import SIGNALS, SoFar, no_verdict, nothing_seen
from drift_drake.gap.monitoring.evidence import EvidenceProblem
from drift_drake.gap.monitoring.history import History, no_history, of_parts, older_than, since, until, with_block
from drift_drake.gap.monitoring.monitor import FORGETTING, SPIN
from drift_drake.gap.monitoring.windowed.null import Null, as_before, capped, known_after, verdict_of, whitened_after
from drift_drake.gap.monitoring.windowed.sums import (
    KnownDriving,
    Projection,
    WindowSums,
    features,
    no_windows,
    sums_of,
    unlike,
    weight_of,
    weighted,
)

BEHIND = 1.0  # [s] before a window's start that actuators and internal states settle in
JUMP = 12.0  # scales of the shortest horizon that a reading is off both of its neighbours, to be none
READ = [CHANNELS.index(name) for name in PREDICTED]
SPEED, RIM, HEADING = (PREDICTED.index(name) for name in ("v", "omega_r", "psi"))
LATCHED = 0.99  # of the alarm's probability of none, that it stays below until the car is as before


class Rows(NamedTuple):
    """The newest rows last; those that have not been filled yet are zero."""

    filled: np.ndarray  # [] rows
    y: np.ndarray  # [rows, PREDICTED] as measured
    command: np.ndarray  # [rows, 2] delta [rad], tau [N m]
    bank: np.ndarray  # [rows] of the road [rad]
    bad: np.ndarray  # [rows] 1 where a reading is missing


def no_rows(period: float, stride: float) -> Rows:
    """Empty rows for a window of horizons `stride` [s] apart, and what is before it; period: of rows [s]."""
    n = round(BEHIND / period) + (HORIZONS + 1) * max(round(stride / period), 1) + 1
    return Rows(np.zeros(()), np.zeros((n, len(PREDICTED))), np.zeros((n, 2)), np.zeros(n), np.zeros(n))


def with_row(rows: Rows, y: np.ndarray, command: np.ndarray, bank: float, bad: bool) -> Rows:
    """The rows after one more: y [PREDICTED]; bad: a reading is missing, those of the row before stand for it."""
    news = (y, command, bank, float(bad))
    moved = (np.concatenate([old[1:], np.asarray(new)[None]]) for old, new in zip(rows[1:], news, strict=True))
    return Rows(np.minimum(rows.filled + 1.0, len(rows.y)), *moved)


def newest_window(rows: Rows, used: np.ndarray, period: float, stride: float, scales: np.ndarray) -> WindowedRun | None:
    """The window that ends at the newest row; None where its rows are too few, or a reading in them is missing.

    Args:
        used: [PREDICTED] channels that are measured; scales: [PREDICTED] of errors at the shortest horizon.
    """
    n, step = int(rows.filled), max(round(stride / period), 1)
    start = n - 1 - HORIZONS * step
    if start < round(SETTLING / period):
        return None
    y, command, bank = (a[-n:].copy() for a in rows[1:4])
    bad = (rows.bad[-n:] > 0.0) | jumps(y, scales)
    if np.any(bad[max(start - round(SMOOTHING * stride / period), 0) :]):
        return None
    y[bad] = y[np.maximum.accumulate(np.where(bad, 0, np.arange(n)))][bad]
    if not used[RIM]:
        y[:, RIM] = y[:, SPEED]
    if used[HEADING]:
        y[:, HEADING] = np.unwrap(y[:, HEADING])
    else:
        y[:, HEADING] = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:, 0] + y[:-1, 0]) * period)])
    start_y = smoothed(y, period, stride)
    return WindowedRun(
        "newest", period, y, start_y, np.ascontiguousarray(command[:, 0]), np.ascontiguousarray(command[:, 1]),
        np.array([start]), stride, False, used, "newest", bank if np.any(bank) else None, not used[RIM],
    )  # fmt: skip


def jumps(y: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Which rows [n] (bool) hold a reading that is far off both of its neighbours; y [n, PREDICTED]."""
    out, turn = np.zeros(len(y), dtype=bool), 2.0 * np.pi
    before, after = y[1:-1] - y[:-2], y[1:-1] - y[2:]
    for step in (before, after):
        step[:, HEADING] -= turn * np.round(step[:, HEADING] / turn)
    far = JUMP * scales
    out[1:-1] = np.any((before * after > 0.0) & (np.abs(before) > far) & (np.abs(after) > far), axis=1)
    return out


class WindowState(NamedTuple):
    """What is carried from row to row."""

    clock: np.ndarray  # [2] rows since the last window; age of a reported change [windows], 0: none
    rows: Rows
    history: History[WindowSums]
    seen: SoFar
    verdict: np.ndarray  # posterior; magnitude and interval of the leading effect; time of the change [s]


@dataclasses.dataclass(frozen=True)
class WindowMonitor:
    """What does not change during a drive."""

    projection: Projection
    null: Null
    familiar: KnownDriving
    problem: EvidenceProblem
    used: np.ndarray  # [PREDICTED] channels that are measured
    period: float  # [s] between rows
    slowest: float  # [m/s] below which the equations are not judged
    alarm: float  # probability of none below which a change is reported
    least: float  # mean time between false alarms that is asked for [s]
    ahead: Mapping[float, tuple[np.ndarray, np.ndarray]] = dataclasses.field(default_factory=dict, repr=False)
    """Errors of windows that were predicted ahead (`baseline.with_errors_ahead`), by the time of their last row [s]: of
    the car [1, HORIZONS, channels], and [cars, HORIZONS, channels] of each of `Projection.cars`."""

    @property
    def block(self) -> float:
        """Between verdicts [s]."""
        return self.null.seconds

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the posterior's entries: none, the effects, unknown."""
        return self.problem.labels

    def start(self) -> WindowState:
        """Before the first row."""
        n, normal = len(self.problem.nodes), self.projection.normal
        history, rows = no_history(no_windows(len(normal.names), n)), no_rows(self.period, normal.stride)
        return WindowState(np.zeros(2), rows, history, nothing_seen(n), no_verdict(self.labels))

    def after_row(
        self, state: WindowState, y: np.ndarray, command: np.ndarray, t: float, road: float = 0.0
    ) -> WindowState:
        """See `events.Watcher`."""
        state, window = self.with_row(state, y, command, road)
        return state if window is None else self._closed(state, window, t)

    def with_row(
        self, state: WindowState, y: np.ndarray, command: np.ndarray, road: float
    ) -> tuple[WindowState, WindowedRun | None]:
        """The state with one more row, and the window that is complete with it, if there is one."""
        reading, bad = y[READ], ~(np.abs(y[READ]) < ABSURD) & self.used
        given = bool((np.abs(command) < ABSURD).all())
        last = state.rows.y[-1], state.rows.command[-1]
        rows = with_row(
            state.rows, np.where(self.used & ~bad, reading, last[0]), np.where(given, command, last[1]), road,
            bool(bad.any()) or not given,
        )  # fmt: skip
        waited, window, normal = state.clock[0] + 1.0, None, self.projection.normal
        if waited >= rows_between_starts(normal.stride, self.period):
            window = newest_window(rows, self.used, self.period, normal.stride, normal.scales[0])
        if window is not None and not self._holds(window):
            window = None
        return state._replace(clock=np.array([0.0 if window else waited, state.clock[1]]), rows=rows), window

    def _holds(self, window: WindowedRun) -> bool:
        """Whether the equations hold along a window."""
        along = window.y[window.starts[0] :]
        v, beta = along[:, PREDICTED.index("v")], along[:, PREDICTED.index("beta")]
        return bool(v.min() > self.slowest and np.abs(beta).max() < SPIN)

    def _closed(self, state: WindowState, window: WindowedRun, t: float) -> WindowState:
        """A window is complete: it joins the history, which is judged anew, if such driving is known."""
        known = self.ahead.get(t)
        e = run_errors(window, *self.projection.car()) if known is None else known[0]
        signals = np.stack([window.y[-1], window.y[-1] - e[0, -1]])[:, : len(SIGNALS)]
        driving = features(window)
        why = unlike(self.familiar, driving)
        judged, not_judged, row, _ = state.seen.time
        if why is not None:
            time = np.array([judged, not_judged + self.block, row + self.block, float(why)])
            return state._replace(seen=SoFar(time, state.seen.shown, signals))
        edge = state.clock[1]
        with_effects = run_errors_of(window, self.projection.cars())[:, 0] if known is None else known[1]
        one = weighted(sums_of(self.projection, window, e, with_effects), weight_of(self.familiar, driving))
        one = capped(self.null, older_than(state.history, edge), one)
        history = with_block(state.history, one, FORGETTING, edge)
        verdict = verdict_of(self.problem, self.null, history)
        shown = np.maximum(state.seen.shown, verdict.shown)
        p, edge = verdict.probabilities.copy(), verdict.edge if edge > 0.0 else 0.0
        if state.clock[1] > 0.0:
            ended = as_before(self.problem, self.null, history, edge, self.least)
            if ended is not None:
                history, verdict = ended
                p, edge = verdict.probabilities, 0.0
            elif p[0] > LATCHED * self.alarm:
                p[1:] *= (1.0 - LATCHED * self.alarm) / (1.0 - p[0])
                p[0] = LATCHED * self.alarm
        elif p[0] < self.alarm:
            edge = verdict.edge
        values = verdict._replace(probabilities=p).at(t)
        seen = SoFar(np.array([judged + self.block, not_judged, 0.0, 0.0]), shown, signals)
        return WindowState(np.array([0.0, edge]), state.rows, history, seen, values)

    def at_edge(self, state: WindowState) -> tuple[np.ndarray, np.ndarray] | None:
        """See `events.Watcher`."""
        ages, recent = since(state.history)
        if state.clock[1] == 0.0 or not len(ages):
            return None
        i = int(np.argmin(np.abs(ages - state.clock[1])))
        now, older = (of_parts(sums, by=lambda a: a[i]) for sums in (recent, until(state.history)))
        return whitened_after(self.null, known_after(self.null, older), now)

    def judges(self) -> str:
        """See `events.Watcher`."""
        return (
            f"windows of {5 * self.projection.normal.stride:.2g} s are judged, above {self.slowest:.2g} m/s, below "
            f"{SPIN:g} rad of sideslip and in driving that the calibration had"
        )
