"""What is reported while a car is watched: a change, its cause, its end, and driving that cannot be judged."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.common.errors import DriftDrakeError, unit_suffix
from drift_drake.gap.evidence.posterior import NONE, UNKNOWN
from drift_drake.gap.monitoring.evidence import NAMED, TRUSTED, EvidenceProblem

PERSISTS, UNKNOWN_PERSISTS = 0.5, 2.0  # [s] that a cause must lead with it: right after a change few fit
RIVALRY = 0.9  # probability of a cause below which its rivals are named
RIVAL = 0.05  # probability from which on one is
OUTSIDE = 1.0  # [s] in a row that cannot be judged, until it is said
SIGNALS = ("r", "v", "beta", "omega_r")


class InvalidBaselineScoresError(DriftDrakeError, ValueError):
    """A calibration that nothing can be watched with; the message names the file and the remedy."""


class SoFar(NamedTuple):
    """What a watch has seen so far, whatever it has reported."""

    time: np.ndarray  # [4] seconds judged; not judged; of these those in a row until now; why (index, `harder`)
    shown: np.ndarray  # [n] standard deviations that a node's amplitude of one would have shifted the scores by
    signals: np.ndarray  # [2, SIGNALS] as measured, and as the simulator predicted them


def nothing_seen(n: int) -> SoFar:
    """Before the first row."""
    return SoFar(np.zeros(4), np.zeros(n), np.full((2, len(SIGNALS)), np.nan))


def no_verdict(labels: tuple[str, ...]) -> np.ndarray:
    """The verdict in a monitor's state (`Verdict.at`) before the first one."""
    return np.concatenate([[1.0], np.zeros(len(labels) - 1), np.full(4, np.nan)])


class Watcher(Protocol):
    """A monitor of either kind: a bank of filters (`monitor`) or windows of predictions (`windowed.monitor`)."""

    @property
    def problem(self) -> EvidenceProblem:
        """Nodes and their prior."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the posterior's entries: none, the effects, unknown."""

    @property
    def period(self) -> float:
        """Between rows [s]."""

    @property
    def block(self) -> float:
        """Between verdicts [s]."""

    @property
    def alarm(self) -> float:
        """Probability of none below which a change is reported."""

    def start(self) -> Any:
        """The state before the first row, a named tuple of arrays with `verdict` and `seen`."""

    def after_row(self, state: Any, y: np.ndarray, command: np.ndarray, t: float, road: float = 0.0) -> Any:
        """The state after one more row, at t [s].

        Args:
            y: measurements [9] (`CHANNELS`), NaN where there is none; command: in force (delta [rad], tau [N m]);
            road: its known bank [rad].
        """

    def at_edge(self, state: Any) -> tuple[np.ndarray, np.ndarray] | None:
        """Whitened scores [s] since the change, and their mean by amplitudes [s, n]; None where there is no change."""

    def judges(self) -> str:
        """Which driving can be judged."""


@dataclasses.dataclass(frozen=True)
class Events:
    """What has been reported: whether there is a change, and which cause; and what is about to be."""

    changed: bool = False
    cause: str | None = None  # that was named
    leading: str = NONE  # of the last report of a change or a cause
    candidate: str | None = None
    count: int = 0  # verdicts in a row that lead with the candidate, which is sure, or what was reported refuted
    outside: bool = False  # whether it is said that the driving cannot be judged

    def after(self, monitor: Watcher, verdict: np.ndarray, t: float) -> tuple["Events", list[dict[str, Any]]]:
        """What has been reported after a verdict (`State.verdict`) at t [s], and what it adds, as plain data."""
        p, new = verdict[:-4], list[dict[str, Any]]()
        now = self
        if now.changed and p[0] >= TRUSTED:
            now, new = Events(outside=self.outside), [{"t": t, "event": "over"}]
        if not now.changed and p[0] < monitor.alarm:
            now = Events(True, leading=monitor.labels[1 + int(np.argmax(p[1:]))], outside=self.outside)
            new.append({"t": t, "event": "change"} | details(monitor, verdict))
        if now.changed:
            leading = 1 + int(np.argmax(p[1:]))
            name, sure = monitor.labels[leading], p[leading] >= NAMED
            refuted = p[monitor.labels.index(now.leading)] < RIVAL
            count = now.count * (name == now.candidate) + 1 if sure or refuted else 0
            now = dataclasses.replace(now, candidate=name, count=count)
            if count >= persists(name, monitor.block) and name != (now.cause if sure else now.leading):
                now = dataclasses.replace(now, cause=name if sure else None, leading=name)
                new.append({"t": t, "event": "cause"} | details(monitor, verdict))
        return now, [{key: rounded(value) for key, value in event.items()} for event in new]

    def after_driving(
        self, seen: SoFar, harder: Callable[[int], str], t: float
    ) -> tuple["Events", list[dict[str, Any]]]:
        """The same after a row that may not be judged; harder: by what a stretch is harder, in words."""
        row = float(seen.time[2])
        if self.outside and row == 0.0:
            return dataclasses.replace(self, outside=False), []
        if self.outside or row < OUTSIDE:
            return self, []
        event = {"t": t, "event": "not_judged", "since": t - row, "harder": harder(int(seen.time[3]))}
        return dataclasses.replace(self, outside=True), [{key: rounded(value) for key, value in event.items()}]


def persists(name: str, block: float) -> int:
    """Verdicts in a row that a cause must lead with, until it is named."""
    return max(round((UNKNOWN_PERSISTS if name == UNKNOWN else PERSISTS) / block), 1)


def details(monitor: Watcher, verdict: np.ndarray) -> dict[str, Any]:
    """The leading hypothesis that is not none: probability, magnitude, onset."""
    p = verdict[:-4]
    leading = 1 + int(np.argmax(p[1:]))
    name, (*magnitude, onset) = monitor.labels[leading], verdict[-4:]
    others = {monitor.labels[i]: p[i] for i in np.argsort(-p) if i not in (0, leading)}
    return cause_of(name, p[leading], p[0], onset, others, magnitude)


def cause_of(
    name: str, probability: float, none: float, onset: float, others: Mapping[str, float], magnitude: Sequence[float]
) -> dict[str, Any]:
    """A cause as events have it.

    Args:
        others: probabilities of other causes; magnitude: in the effect's unit, with the ends of its 95 % interval.
    """
    out = {"cause": name, "probability": probability, "none": none, "onset": onset}
    if probability < RIVALRY:
        out["rivals"] = {other: rounded(float(p)) for other, p in others.items() if p >= RIVAL}
    if name == UNKNOWN:
        return out
    return out | dict(zip(("magnitude", "low", "high"), magnitude, strict=True)) | {"unit": CATALOGUE[name].unit}


def sentence(event: Mapping[str, Any]) -> str:
    """An event in words."""
    t = f"{event['t']:.1f} s:"
    if event["event"] == "over":
        return f"{t} the car agrees with the simulator again"
    if event["event"] == "anew":
        return f"the log {event['why']}: the watch begins anew"
    if event["event"] == "not_judged":
        return f"{t} not judged since {event['since']:.1f} s: harder than calibrated ({event['harder']})"
    since = f"since {event['onset']:.1f} s"
    if event["event"] == "change":
        return f"{t} the car has changed {since}; the simulator is not valid for it ({_cause(event)})"
    others = f"; or {', '.join(event['or'])}, which would look alike" if event.get("or") else ""
    by = f", by a diagnosis of these {event['diagnosed']:.1f} s" if "diagnosed" in event else ""
    return f"{t} {_cause(event)}, {since}{others}{by}"


def _cause(event: Mapping[str, Any]) -> str:
    if event["cause"] == UNKNOWN:
        return f"unknown cause, probability {event['probability']:.2f}{_rivals(event)}"
    interval = f"95 %: {event['low']:.3g} to {event['high']:.3g}"
    unit = unit_suffix(event["unit"])
    probability = f"probability {event['probability']:.2f}{_rivals(event)}"
    too = "".join(f" and {'an additional fault' if name == UNKNOWN else name}" for name in event.get("with", ()))
    return f"{event['cause']} {event['magnitude']:+.3g}{unit} ({interval}){too}, {probability}"


def _rivals(event: Mapping[str, Any]) -> str:
    rivals = [f"{name} {p:.2f}" for name, p in event.get("rivals", {}).items()]
    return f" ({', '.join(rivals)})" if rivals else ""


def rounded(value: Any) -> Any:
    """A number as an event has it, in six digits; anything else as it is."""
    return float(f"{value:.6g}") if isinstance(value, float) else value
