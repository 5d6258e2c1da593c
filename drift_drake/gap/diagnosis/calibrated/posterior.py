"""From hypotheses of a change to probabilities, a verdict, and magnitudes with intervals."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.gap.diagnosis.likelihood.beliefs import (
    LEAST_PROBABILITY,
    MOST_FITTED,
    MOST_UNSEEN,
    Belief,
    Sensing,
    as_data,
)
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.prior import RELATIVE_TO_NONE, RELATIVE_TO_RIVAL, TWO_SIDED, Interval, Range, at_end
from drift_drake.gap.estimation.problem import NUISANCES, PROCESS_NOISE
from drift_drake.gap.estimation.reduction import NOTHING_REMOVED, Reduction
from drift_drake.gap.estimation.windows import PREDICTED
from drift_drake.gap.evidence.constants import OF_SCATTER, STANDS_FOR
from drift_drake.gap.evidence.hypotheses import Hypothesis, integrated
from drift_drake.gap.evidence.posterior import NONE, PosteriorConstants, Ranked, hypothesis_name, log_prior
from drift_drake.gap.evidence.ranking import DayRanked
from drift_drake.gap.evidence.search import Curve, Search

WORTH = 4.0  # [s] of such a car's rows that are worth one independent measurement, between days
PERIOD = 0.01  # [s] of a planned drive's rows


@dataclasses.dataclass(frozen=True)
class DetectionLimit:
    """Of one effect."""

    unit: str
    least: float | None  # magnitude (of a rate limit the highest); None if none within reach would be named
    taken_for: str  # the hypothesis that is hardest to tell it from


@dataclasses.dataclass(frozen=True)
class Shifts:
    """What an effect does to the scores, in standard deviations, over the magnitudes that it may have."""

    name: str
    magnitudes: np.ndarray  # [m]
    at: np.ndarray  # [m, n]


def detection_limits(search: Search, curves: Sequence[Curve]) -> dict[str, DetectionLimit]:
    """By effect the least magnitude that would be named with 95 % probability, from the day's drives and car's scatter.

    An effect is named when its shift of the scores is ahead of `none` by the disadvantage of its prior, and of the
    nearest shift that any other single effect can make; the log evidence ahead of a rival that is D nats behind in the
    mean has variance 2 D.

    Args:
        curves: of every single effect (`Search.curves`).
    """
    root = root_of(search.scatter.inverse)
    at_zero = search.scores({})
    shifts = []
    for curve in curves:
        q, s = curve.fine()
        allowed = search.ranges[curve.name].allows(q)
        shifts.append(Shifts(curve.name, q[allowed], (s[allowed] - at_zero) @ root))
    own = {curve.name: shift for curve, shift in zip(curves, shifts, strict=True) if curve.follows == 0.0}
    return {name: limit_of(own[name], [rival for rival in shifts if rival.name != name]) for name in search.ranges}


def unless_hidden(
    found: DayRanked, shrinks: Reduction, limits: Mapping[str, DetectionLimit], none: Hypothesis
) -> tuple[DayRanked, Reduction]:
    """A verdict and what its cause removes, but of effects that these drives cannot tell from none at any magnitude
    within reach: they neither show nor exclude a gap."""
    named = [limits[name] for name in found.leading.names if found.verdict == "effect"]
    if not named or any(limit.least is not None or limit.taken_for != NONE for limit in named):
        return found, shrinks
    open_yet = dataclasses.replace(found, verdict=NONE, leading=none, decision="undecided", something_else=0.0)
    return open_yet, NOTHING_REMOVED


def root_of(inverse: np.ndarray) -> np.ndarray:
    """Root R [n, n] of an inverse covariance R R'; zero in directions that rounding leaves without a sign.

    Scores that a day's driving does not move scatter by nothing, and their inverse covariance is no longer positive.
    What an effect does in such a direction is not seen.
    """
    size = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    values, vectors = np.linalg.eigh(0.5 * (inverse + inverse.T) / np.outer(size, size))
    kept = np.sqrt(np.where(values > len(values) * np.finfo(float).eps * values[-1], values, 0.0))
    return np.asarray(size[:, None] * vectors * kept)


def limit_of(effect: Shifts, rivals: Sequence[Shifts]) -> DetectionLimit:
    """The magnitude from which on an effect would be named: the larger one, where its signs differ."""
    margins = [np.linalg.norm(effect.at, axis=1) / RELATIVE_TO_NONE]
    margins += [distances(effect.at, rival.at) / RELATIVE_TO_RIVAL for rival in rivals]
    margin, names = np.array(margins), ["none", *(rival.name for rival in rivals)]
    # In the order in which an effect acts less and less.
    strength = -effect.magnitudes if effect.name in LIMITS else np.abs(effect.magnitudes)
    found: list[tuple[float, int]] = []
    closest = int(np.argmax(strength))
    for side in (effect.magnitudes < 0.0, effect.magnitudes > 0.0):
        at = np.flatnonzero(side)[np.argsort(-strength[side], kind="stable")]
        named = np.concatenate([np.min(margin[:, at], axis=0) >= 1.0, [False]])
        last = int(np.argmin(named)) - 1  # of the strongest ones that are all named
        if last >= 0:
            found.append((float(effect.magnitudes[at[last]]), int(at[min(last + 1, len(at) - 1)])))
    unit = CATALOGUE[effect.name].unit
    if not found:
        return DetectionLimit(unit, None, names[int(np.argmin(margin[:, closest]))])
    least, below = max(found, key=lambda item: abs(item[0]))
    return DetectionLimit(unit, abs(least), names[int(np.argmin(margin[:, below]))])


def distances(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """From each of points [m, n] to the nearest of others [k, n]."""
    squares = np.sum(points**2, axis=1)[:, None] + np.sum(others**2, axis=1)[None, :] - 2.0 * points @ others.T
    return np.asarray(np.sqrt(np.maximum(np.min(squares, axis=1), 0.0)))


def deviation(h: Hypothesis, index: int) -> float:
    """Standard deviation of a magnitude: what the scores leave, and what the magnitude stands for."""
    relative = STANDS_FOR[CATALOGUE[h.names[index]].stage] * abs(float(h.magnitudes[index]))
    return float(np.hypot(OF_SCATTER * np.sqrt(h.covariance[index, index]), relative))


def interval(h: Hypothesis, index: int) -> Interval:
    """95 % interval of a magnitude."""
    q, half = float(h.magnitudes[index]), TWO_SIDED * deviation(h, index)
    low, high = q - half, q + half
    return Interval(q, max(low, 0.0) if not CATALOGUE[h.names[index]].signed else low, high)


def tells_from_zero(h: Hypothesis) -> bool:
    """Whether no magnitude is within the whole scatter of zero."""
    return bool(np.all(np.abs(h.magnitudes) > TWO_SIDED * np.sqrt(np.diag(h.covariance))))


def at_bound(h: Hypothesis, ranges: dict[str, Range]) -> list[str]:
    """Causes whose magnitude is at the end of what is believed possible: it is so much at least."""
    return [name for name, q in zip(h.names, h.magnitudes, strict=True) if at_end(float(q), ranges[name])]


def not_excluded(search: Search, singles: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Single effects that a day's logs do not show, and do not exclude either, with evidence over all magnitudes.

    Their most likely magnitude cannot be distinguished from zero, so that none of them is named; but each may be there,
    and what it is believed to be is part of the probabilities, of `none` and of the ambiguity set.
    """
    curves = {(curve.name, curve.follows): curve for curve in search.curves}
    out = []
    for h in singles:
        if not tells_from_zero(h):
            evidence = evidence_over(curves[h.names[0], h.follows_load], search)
            main = float(evidence[search.scatter.main])
            out.append(dataclasses.replace(h, log_evidence=main, by_factor=evidence - main))
    return out


def evidence_over(curve: Curve, search: Search) -> np.ndarray:
    """Log evidence of one effect at each of the factors [K], integrated over the magnitudes that would be a gap.

    The likelihood is not a bell within bounds here, as Laplace's approximation takes it to be.
    """
    return integrated(*curve.fine(), search.ranges[curve.name], search.scatter)


def change_beliefs(
    search: Search, found: Ranked[Hypothesis], hypotheses: Sequence[Hypothesis], limits: Mapping[str, DetectionLimit],
    constants: PosteriorConstants,
) -> dict[str, Any]:  # fmt: skip
    """The sensors and the hypotheses as plain data; empty where no torque is logged.

    A row is noisy by the calibrated car's own errors a tenth of a second ahead, and weighs what independent ones are
    worth, between days.
    """
    runs = search.day.runs
    if any(run.fed for run in runs):
        return {}
    measured = np.all([run.used for run in runs], axis=0)
    noise, used = np.ones(len(CHANNELS)), np.zeros(len(CHANNELS), dtype=bool)
    for i, name in enumerate(PREDICTED):
        at = CHANNELS.index(name)
        used[at] = measured[i]
        noise[at] = search.normal.scales[0, i] if measured[i] else 1.0
    by_name = {hypothesis_name(h.names): h for h in hypotheses}
    leading = hypothesis_name(found.leading.names)
    known = [name for name in found.probabilities if name in by_name][:MOST_FITTED]
    beliefs = [
        belief(h.names, found.probabilities[name], h.magnitudes, [deviation(h, i) for i in range(len(h.names))])
        for name in known
        for h in [by_name[name]]
        if found.probabilities[name] >= LEAST_PROBABILITY or name == leading
    ]
    if not found.leading.names:
        likely = max(found.probabilities.get("none", 0.0), LEAST_PROBABILITY)
        odds = float(np.exp(log_prior(1, len(search.ranges), constants) - log_prior(0, len(search.ranges), constants)))
        there = [b.name for b in beliefs]
        unseen = [name for name in hidden(search, limits)[:MOST_UNSEEN] if name not in there]
        beliefs += [unseen_belief(search, name, likely * odds) for name in unseen]
    tempering = PERIOD / WORTH
    return as_data(Sensing(noise, used, PROCESS_NOISE**2, tempering, search.day.own), beliefs)


def hidden(search: Search, limits: Mapping[str, DetectionLimit]) -> list[str]:
    """Effects that the logs could not have shown within their practical range, the most usual first."""

    def usual(name: str) -> float:
        return max(abs(q) for q in CATALOGUE[name].range_for(search.vehicle))

    names = [name for name, limit in limits.items() if limit.least is None or limit.least > usual(name)]
    return sorted(names, key=lambda name: -CATALOGUE[name].daily)


def belief(names: tuple[str, ...], probability: float, magnitudes: ArrayLike, deviations: Sequence[float]) -> Belief:
    """One hypothesis: the calibrated car's own parameters within their tolerances, and the magnitudes."""
    theta, root = np.append(np.zeros(len(NUISANCES)), magnitudes), np.diag([*np.ones(len(NUISANCES)), *deviations])
    return Belief(names, probability, theta, root)


def unseen_belief(search: Search, name: str, probability: float) -> Belief:
    """An effect of half its practical range, which went unseen."""
    low, high = search.ranges[name].usual
    size = 0.5 * max(abs(low), abs(high))
    magnitude = max(size, search.ranges[name].least) * (1.0 if high >= -low else -1.0)
    return belief((name,), probability, [magnitude], [0.5 * size])
