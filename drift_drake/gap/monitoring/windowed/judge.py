"""Sequential evidence from windows: whether the car has changed, since when, by what; and whether it is as before.

Both are statistics of Shiryaev and Roberts, sums over onsets of likelihood ratios, whose threshold is the mean time
between false alarms that is asked for (`evidence.alarm_at`): the one of a change against none, the other of none
against the change that the windows before an end show.
"""

import numpy as np
from scipy.special import logsumexp

from drift_drake.gap.monitoring.evidence import (
    HAZARD,
    TRUSTED,
    EvidenceProblem,
    Verdict,
    amplitudes,
    concluded,
    nothing_seen,
    squares,
)
from drift_drake.gap.monitoring.history import History, newest, of_parts, since, until
from drift_drake.gap.monitoring.windowed.null import Null, known_after, whitened, whitened_after
from drift_drake.gap.monitoring.windowed.sums import WindowSums


def verdict_of(problem: EvidenceProblem, null: Null, history: History[WindowSums]) -> Verdict:
    """The posterior at the end of a history of windows."""
    ages, recent = since(history)
    if not len(ages):
        return nothing_seen(problem)
    return judged(problem, null, ages, *whitened(null, recent, until(history)))


def judged(problem: EvidenceProblem, null: Null, ages: np.ndarray, w: np.ndarray, m: np.ndarray) -> Verdict:
    """The posterior from whitened scores w [a, n] of each age [windows], and their mean m [a, n, K] by amplitudes."""
    begun = np.log(HAZARD * np.diff(ages, prepend=0.0) * null.seconds)
    return concluded(problem, w, m, begun, ages, null.seconds)


def as_before(
    problem: EvidenceProblem, null: Null, history: History[WindowSums], edge: float, least: float
) -> tuple[History[WindowSums], Verdict] | None:
    """The history since a change has ended, and the verdict on it; None while it has not.

    Args:
        edge: age [windows] of the change; least: mean time between such reports of a car that is still changed [s].
    """
    ages, recent = since(history)
    at = int(np.argmin(np.abs(ages - edge)))
    older = of_parts(until(history), by=lambda a: a[at])
    known = known_after(null, older)
    ratios = np.full(at, -np.inf)
    for i in range(at):
        now, changed = of_parts(recent, by=lambda a, i=i: a[i]), of_parts(recent, by=lambda a, i=i: a[at] - a[i])
        if now.windows >= 1.0 and changed.windows >= 1.0:
            ratios[i] = -log_ratio(problem, *whitened_after(null, known, changed), *whitened_after(null, known, now))
    spans = np.diff(ages[:at], prepend=0.0) * null.seconds
    if not at or logsumexp(np.log(spans) + ratios) < np.log(least):
        return None
    ended = newest(history, float(ages[int(np.argmax(np.log(spans) + ratios))]), edge)
    verdict = verdict_of(problem, null, ended)
    return (ended, verdict) if verdict.probabilities[0] >= TRUSTED else None


def log_ratio(problem: EvidenceProblem, w_then: np.ndarray, m_then: np.ndarray, w: np.ndarray, m: np.ndarray) -> float:
    """Log likelihood ratio of windows under the change that earlier ones show best, against none.

    Args:
        w_then, m_then: whitened scores [n] of the earlier ones and their mean by amplitudes [n, K]; w, m: of the later.
    """
    factors, amplitude, precision = (
        part[0] for part in amplitudes(problem, squares(m_then[None]), (w_then @ m_then)[None])
    )
    k = int(np.argmax(factors + problem.log_prior))
    q, p = amplitude[k], precision[k]
    a, b = m[:, k] @ m[:, k], m[:, k] @ w
    return float(0.5 * (b + q * p) ** 2 / (a + p) - 0.5 * q**2 * p - 0.5 * np.log1p(a / p))
