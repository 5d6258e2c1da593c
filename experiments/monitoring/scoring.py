"""Delay, false alarms and isolation of every method, from what it said of drives with and without a change."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drift_drake.monitoring.renewal import ALARM, NAMED

METHODS = ("monitor", "chi_square", "cumulative_sum", "augmented", "learnt")
NAMING = {"monitor": "leading", "augmented": "augmented_leading"}  # methods that say which effect it is
ISOLATED_AFTER = 3.0  # [s] after a change
LIVES = 2.0  # [s] within which alarms are one


@dataclasses.dataclass(frozen=True)
class Score:
    """Of one method on one plant's drives."""

    changed: int
    minutes: float  # of driving without a change
    false_alarms_per_10_minutes: float
    detected: float  # share of the changes
    delay: float  # [s] in the median of those detected
    named: float  # share of the changes named right at some time
    naming_delay: float  # [s] in the median of those
    isolation: float  # share of the changes whose leading cause after 3 s is the right one
    sure: int  # changes of which a cause has a probability of at least 0.8 then (the monitor's alone)
    sure_and_right: int
    probability: float  # mean probability of the true cause then (the monitor's alone)


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


def score(results: Sequence[Mapping[str, Any]], method: str, limit: float) -> Score:
    """The score of a method with its threshold."""
    minutes, alarms = 0.0, 0
    delays, namings, right, sure_then, probability = [], [], [], [], []
    for r in results:
        t, s, calm = np.array(r["t"]), suspicion(r, method), before(r)
        alarms += episodes(t[calm], s[calm] > limit)
        minutes += float(t[calm][-1]) / 60.0
        if not r["truth"]:
            continue
        onset, name = r["truth"]["onset"], r["truth"]["effect"]
        late = np.flatnonzero(~calm & (s > limit))
        delays.append(t[late[0]] - onset if len(late) else np.inf)
        after = int(np.searchsorted(t, onset + ISOLATED_AFTER)) - 1
        leading = np.array(r[NAMING[method]]) if method in NAMING else np.full(len(t), "")
        sure = np.array(r["true"]) >= NAMED if method == "monitor" else (leading == name) & (s > limit)
        names = np.flatnonzero(~calm & sure)
        namings.append(t[names[0]] - onset if len(names) else np.inf)
        right.append(bool(leading[after] == name and s[after] > limit))
        sure_then.append(method == "monitor" and r["leading_probability"][after] >= NAMED and s[after] > limit)
        probability.append(r["true"][after] if method == "monitor" else np.nan)
    found, named = np.isfinite(delays), np.isfinite(namings)
    return Score(
        len(delays), minutes, 10.0 * alarms / minutes, float(np.mean(found)), _median(np.array(delays)[found]),
        float(np.mean(named)), _median(np.array(namings)[named]), float(np.mean(right)),
        int(np.sum(sure_then)), int(np.sum(np.logical_and(sure_then, right))), float(np.mean(probability)),
    )  # fmt: skip


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if len(values) else np.inf


def table(scores: Mapping[str, Score]) -> str:
    """Scores as a Markdown table."""
    head = ("method", "false alarms / 10 min", "detected", "delay [s]", "named right", "after [s]", "right at 3 s",
            "of those sure")  # fmt: skip
    lines = [f"| {' | '.join(head)} |", "| --- " * len(head) + "|"]
    for name, s in scores.items():
        naming = [f"{s.named:.0%}", f"{s.naming_delay:.1f}", f"{s.isolation:.0%}"] if name in NAMING else ["-"] * 3
        naming.append(f"{s.sure_and_right} of {s.sure}" if name == "monitor" else "-")
        cells = [name, f"{s.false_alarms_per_10_minutes:.1f}", f"{s.detected:.0%}", f"{s.delay:.1f}", *naming]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
