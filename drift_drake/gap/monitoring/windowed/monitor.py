"""The monitor of a car that was calibrated by prediction: a row in, with each window of predictions a verdict out."""

import dataclasses
from typing import NamedTuple

import numpy as np

from drift_drake.car.log.plausible import ABSURD
from drift_drake.gap.estimation.baseline import slipping_in
from drift_drake.gap.estimation.windows import PREDICTED, WindowedRun, rows_between_starts, run_errors
from drift_drake.gap.monitoring.events import SIGNALS, SoFar, nothing_seen
from drift_drake.gap.monitoring.evidence import EvidenceProblem, labels
from drift_drake.gap.monitoring.history import History, no_history, of_parts, older_than, since, until, with_block
from drift_drake.gap.monitoring.monitor import FORGETTING, SPIN
from drift_drake.gap.monitoring.windowed.familiar import KnownDriving, unlike
from drift_drake.gap.monitoring.windowed.judge import as_before, verdict_of
from drift_drake.gap.monitoring.windowed.null import Null, capped, known_after, whitened_after
from drift_drake.gap.monitoring.windowed.rows import READ, Rows, newest_window, no_rows, with_row
from drift_drake.gap.monitoring.windowed.sums import Projection, WindowSums, features, no_windows, sums_of

LATCHED = 0.99  # of the alarm's probability of none, that it stays below until the car is as before


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
    stride: float  # [s] between horizons
    slipping: float  # of the baseline, mean
    slowest: float  # [m/s] below which the equations are not judged
    alarm: float  # probability of none below which a change is reported
    least: float  # mean time between false alarms that is asked for [s]

    @property
    def block(self) -> float:
        """Between verdicts [s]."""
        return self.null.seconds

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the posterior's entries: none, the effects, unknown."""
        return labels(self.problem)

    def start(self) -> WindowState:
        """Before the first row."""
        p = np.zeros(len(self.labels) + 4)
        p[0], p[-4:] = 1.0, np.nan
        n = len(self.problem.nodes)
        history = no_history(no_windows(len(self.projection.names), n))
        return WindowState(np.zeros(2), no_rows(self.period, self.stride), history, nothing_seen(n), p)

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
        waited, window = state.clock[0] + 1.0, None
        if waited >= rows_between_starts(self.stride, self.period):
            window = newest_window(rows, self.used, self.period, self.stride, self.projection.scales[0])
        if window is not None and not self._holds(window):
            window = None
        return state._replace(clock=np.array([0.0 if window else waited, state.clock[1]]), rows=rows), window

    def slipping_of(self, window: WindowedRun) -> float:
        """How much more the tyres slip along a window than the baseline's did, as a logarithm."""
        return float(slipping_in([window])[0]) - self.slipping

    def _holds(self, window: WindowedRun) -> bool:
        """Whether the equations hold along a window."""
        along = window.y[window.starts[0] :]
        v, beta = along[:, PREDICTED.index("v")], along[:, PREDICTED.index("beta")]
        return bool(v.min() > self.slowest and np.abs(beta).max() < SPIN)

    def _closed(self, state: WindowState, window: WindowedRun, t: float) -> WindowState:
        """A window is complete: it joins the history, which is judged anew, if such driving is known."""
        e = run_errors(window, self.projection.constants, self.projection.own)
        signals = np.stack([window.y[-1], window.y[-1] - e[0, -1]])[:, : len(SIGNALS)]
        why = unlike(self.familiar, features(window))
        judged, not_judged, row, _ = state.seen.time
        if why is not None:
            time = np.array([judged, not_judged + self.block, row + self.block, float(why)])
            return state._replace(seen=SoFar(time, state.seen.shown, signals))
        edge = state.clock[1]
        one = sums_of(self.projection, window, e, self.slipping_of(window))
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
        values = np.concatenate([p, [verdict.magnitude, verdict.low, verdict.high, t - verdict.age]])
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
            f"windows of {5 * self.stride:.2g} s are judged, above {self.slowest:.2g} m/s, below {SPIN:g} rad of "
            "sideslip and in driving that the calibration had"
        )
