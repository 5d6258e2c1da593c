"""Delay, false alarms and isolation of every method, from what it said of drives with and without a change."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drift_drake.gap.monitoring.events import persists
from drift_drake.gap.monitoring.evidence import ALARM, NAMED
from drift_drake.gap.monitoring.monitor import BLOCK
from experiments.made import tabulated

METHODS = ("monitor", "chi_square", "cumulative_sum", "augmented", "learnt")
NAMING = {"monitor": "leading", "augmented": "augmented_leading"}  # methods that say which effect it is
ISOLATED_AFTER = 3.0  # [s] after a change
LIVES = 2.0  # [s] within which alarms are one


@dataclasses.dataclass(frozen=True)
class Score:
    """Of one method on one plant's drives; what does not name a cause is right about none."""

    changed: int
    minutes: float  # of driving without a change
    false_alarms_per_10_minutes: float
    detected: float  # share of the changes
    delay: float  # [s] in the median of those detected
    isolation: float  # share of the changes whose leading cause after 3 s is the right one
    isolation_at_end: float  # the same at the end of the drive
    named: int  # changes of which a cause is named, see `named_at`
    named_right: int  # of which the cause that is named first is the right one
    naming_delay: float  # [s] in the median of all changes, named or not
    probability: float  # mean probability of the true cause after 3 s (the monitor's alone)


def suspicion(result: Mapping[str, Any], method: str) -> np.ndarray:
    """A method's statistic, larger for a change."""
    values = 1.0 - np.array(result["none"]) if method == "monitor" else np.array(result[method])
    return np.asarray(values, dtype=float)


def before(result: Mapping[str, Any]) -> np.ndarray:
    """Verdicts before the change (all, where there is none)."""
    return np.asarray(np.array(result["t"]) <= result["truth"].get("onset", np.inf))


def threshold(results: Sequence[Mapping[str, Any]], method: str) -> float:
    """That no drive of the tuning seeds reaches without a change; the monitor's is fixed."""
    if method == "monitor":
        return 1.0 - ALARM
    return float(max(suspicion(r, method)[before(r)].max(initial=0.0) for r in results))


def episodes(t: np.ndarray, alarm: np.ndarray) -> int:
    """Alarms that are apart."""
    times = t[alarm]
    return int(len(times) > 0) + int(np.count_nonzero(np.diff(times) > LIVES))


def named_at(t: np.ndarray, leading: np.ndarray, sure: np.ndarray) -> tuple[float, str]:
    """The first cause that is sure in enough verdicts in a row to be reported (`monitoring.monitor`), and when [s]."""
    count, before = 0, ""
    for now, name, is_sure in zip(t, leading, sure, strict=True):
        count = (count * (name == before) + 1) if is_sure else 0
        before = name
        if count >= persists(name, BLOCK):
            return float(now), str(name)
    return np.inf, ""


def score(results: Sequence[Mapping[str, Any]], method: str, limit: float) -> Score:
    """The score of a method with its threshold."""
    minutes, alarms = 0.0, 0
    delays, namings, first, right, right_at_end, probability = [], [], [], [], [], []
    for r in results:
        t, s, calm = np.array(r["t"]), suspicion(r, method), before(r)
        alarms += episodes(t[calm], s[calm] > limit)
        minutes += float(t[calm][-1]) / 60.0
        if not r["truth"]:
            continue
        onset, name = r["truth"]["onset"], r["truth"]["effect"]
        late = np.flatnonzero(~calm & (s > limit))
        delays.append(t[late[0]] - onset if len(late) else np.inf)
        leading = np.array(r[NAMING[method]]) if method in NAMING else np.full(len(t), "")
        sure = s > limit
        if method == "monitor":
            sure &= np.array(r["leading_probability"]) >= NAMED
        at, cause = named_at(t[~calm], leading[~calm], sure[~calm]) if method in NAMING else (np.inf, "")
        namings.append(at - onset)
        first.append(cause == name)
        after = int(np.searchsorted(t, onset + ISOLATED_AFTER)) - 1
        leads = (leading == name) & (s > limit)
        right.append(leads[after])
        right_at_end.append(leads[-1])
        probability.append(r["true"][after] if method == "monitor" else np.nan)
    found = np.isfinite(delays)
    return Score(
        len(delays), minutes, 10.0 * alarms / minutes, float(np.mean(found)), _median(np.array(delays)[found]),
        float(np.mean(right)), float(np.mean(right_at_end)), int(np.isfinite(namings).sum()), int(np.sum(first)),
        _median(np.array(namings)), float(np.mean(probability)),
    )  # fmt: skip


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if len(values) else np.inf


def table(scores: Mapping[str, Score]) -> str:
    """Scores as a Markdown table."""
    head = ("method", "false alarms / 10 min", "detected", "delay [s]", "right at 3 s", "right at the end", "named",
            "named after [s]")  # fmt: skip
    rows = []
    for method, s in scores.items():
        shares = [f"{s.false_alarms_per_10_minutes:.1f}", f"{s.detected:.0%}", _seconds(s.delay)]
        naming = ["-"] * 4
        if method in NAMING:
            counts = [f"{round(share * s.changed)} of {s.changed}" for share in (s.isolation, s.isolation_at_end)]
            naming = [*counts, f"{s.named}, {s.named_right} right", _seconds(s.naming_delay)]
        rows.append([method, *shares, *naming])
    return "\n".join(tabulated(head, rows))


def _seconds(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "-"
