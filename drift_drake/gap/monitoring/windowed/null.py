"""How the scores of a drive's newest windows scatter while nothing has changed, and the evidence that the car has.

The null distribution is the car's own (`gap.estimation.baseline`), which `diagnose` judges a day by: the scores of a
stretch are -I d + n, d what the car deviates by today, n the scatter of blocks and what the equations ask for otherwise
from stretch to stretch. What a drive's earlier windows show of d is taken off the later ones.

That the car has changed, and that it is as before, are asked by statistics of Shiryaev and Roberts, sums over onsets of
likelihood ratios, whose threshold is the mean time between false alarms that is asked for (`evidence.alarm_at`): the
one of a change against none, the other of none against the change that the windows before an end show.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.special import logsumexp

from drift_drake.gap.estimation.baseline import Spread, spread_of
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prediction_constants import FACTORS
from drift_drake.gap.estimation.scores import BLOCK
from drift_drake.gap.estimation.windows import START_EVERY
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
from drift_drake.gap.monitoring.windowed.sums import WindowSums

BURST = 3.0  # [s] over which what the equations lack at the limit hangs together
BURSTS = 3.0
"""By how much what tyres and body seem to be worth deviates more in a burst than on the mean of a stretch of a day."""
TINY = 1e-9  # of the mean variance of scores, that a direction without any gets


class Null(NamedTuple):
    """The null distribution of the effects' scores, n of them."""

    spread: Spread
    mean: np.ndarray  # [n] of what the car deviates by, in units
    covariance: np.ndarray  # [n, n] of that
    scale: float  # of the scatter of blocks
    seconds: float  # that a window stands for
    cap: float  # squared distance of one window's scores from normal, per score, beyond which they count less
    temperature: float  # of all evidence: what equations lack has heavier tails than a normal distribution


def null_of(normal: Normal, cap: float, temperature: float) -> Null:
    """The null distribution of a car calibrated by prediction.

    Partial effects' scores are left out: on a few windows they only add to what scatters.
    """
    n = len(normal.names)
    s = spread_of(normal, normal.names, normal.least_deviations, len(normal.of_kind)).times(FACTORS[normal.main])
    of_effects = s._replace(covariance=s.covariance[:n, :n], information=s.information[:n], stretch=s.stretch[:n],
                            recording=s.recording[:n])  # fmt: skip
    open_yet = normal.scale * normal.left_open[:n, :n] + np.diag(of_effects.recording)
    seconds = START_EVERY * normal.stride
    return Null(of_effects, normal.expected[:n], open_yet, normal.scale, seconds, cap, temperature)


def noise_of(null: Null, sums: WindowSums) -> np.ndarray:
    """Covariance [n, n] of the scores of windows that follow each other, whatever the car deviates by."""
    seconds = float(sums.windows) * null.seconds
    information, bursts = sums.information, max(round(seconds / BURST), 1)
    harder = null.scale * np.exp(float(sums.slipping) / float(sums.windows))
    by_burst = (information * (BURSTS**2 * null.spread.stretch)) @ information / bursts
    return np.asarray(by_burst + harder * null.spread.of_blocks(information, seconds / BLOCK))


def known_after(null: Null, older: WindowSums) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of what the car deviates by, once windows have shown some of it."""
    if older.windows < 1.0:
        return null.mean, null.covariance
    across = older.information @ null.covariance
    total = cho_factor(_regular(across @ older.information + noise_of(null, older)))
    off = older.score + older.information @ null.mean
    return null.mean - across.T @ cho_solve(total, off), null.covariance - across.T @ cho_solve(total, across)


def whitened_after(
    null: Null, known: tuple[np.ndarray, np.ndarray], recent: WindowSums
) -> tuple[np.ndarray, np.ndarray]:
    """Whitened scores w [n] of windows, and their mean m [n, K] by the nodes' amplitudes: w = m a + white noise.

    Args:
        known: mean and covariance of what the car deviates by (`known_after`).
    """
    mean, covariance = known
    total = recent.information @ covariance @ recent.information + noise_of(null, recent)
    root = np.linalg.cholesky(_regular(null.temperature * total))
    both = np.column_stack([recent.score + recent.information @ mean, -recent.shift])
    found = solve_triangular(root, both, lower=True, check_finite=False)
    return found[:, 0], found[:, 1:]


def whitened(null: Null, recent: WindowSums, older: WindowSums) -> tuple[np.ndarray, np.ndarray]:
    """The same of several ages [m, n], [m, n, K], the windows since each, given the `older` ones."""
    ages = range(len(recent.windows))
    pairs = ((of_parts(recent, by=lambda a, i=i: a[i]), of_parts(older, by=lambda a, i=i: a[i])) for i in ages)
    found = [whitened_after(null, known_after(null, before), now) for now, before in pairs]
    return np.stack([w for w, _ in found]), np.stack([m for _, m in found])


def distance(null: Null, older: WindowSums, window: WindowSums) -> float:
    """Squared distance of one window's scores from normal, per score, given the windows before it."""
    w, _ = whitened_after(null, known_after(null, older), window)
    return null.temperature * float(w @ w) / len(w)


def capped(null: Null, older: WindowSums, window: WindowSums) -> WindowSums:
    """A window that counts less the further off it is: no single one raises an alarm.

    What equations lack at the limit comes in bursts that a normal distribution does not have.
    """
    share = min(1.0, float(np.sqrt(null.cap / max(distance(null, older, window), 1e-300))))
    count = (window.windows, window.slipping)
    return WindowSums(*count, *(share * part for part in window[2:]))


def _regular(covariance: np.ndarray) -> np.ndarray:
    out = 0.5 * (covariance + covariance.T)
    out[np.diag_indices(len(out))] += TINY * np.trace(out) / len(out) + 1e-300
    return out


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
