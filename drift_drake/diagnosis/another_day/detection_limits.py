"""What these logs can show: for every effect the least magnitude that would be named with 95 % probability.

From the day's own drives and the car's own scatter; no truth is needed. An effect shifts the scores along its curve
(`day_hypotheses.Curve`). It is named when that shift is ahead of `none` by the disadvantage of its prior, and of the
nearest shift that any other single effect can make; the log evidence ahead of a rival that is D nats behind in the
mean has variance 2 D.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.diagnosis.another_day.hypotheses import Curve, Search
from drift_drake.diagnosis.shared.ranges import BESIDE_NONE, BESIDE_RIVAL, RATE_LIMIT
from drift_drake.vehicle.catalogue import CATALOGUE


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
    """By effect of the search's catalogue.

    Args:
        curves: of every single effect (`Search.curves`).
    """
    root = np.linalg.cholesky(search.scatter.inverse + 1e-300 * np.eye(len(search.scatter.inverse)))
    at_zero = search.scores({})
    shifts = []
    for curve in curves:
        q, s = curve.fine()
        allowed = search.ranges[curve.name].allows(q)
        shifts.append(Shifts(curve.name, q[allowed], (s[allowed] - at_zero) @ root))
    own = {curve.name: shift for curve, shift in zip(curves, shifts, strict=True) if curve.follows == 0.0}
    return {name: limit_of(own[name], [rival for rival in shifts if rival.name != name]) for name in search.ranges}


def limit_of(effect: Shifts, rivals: Sequence[Shifts]) -> DetectionLimit:
    """The magnitude from which on an effect would be named: the larger one, where its signs differ."""
    margins = [np.linalg.norm(effect.at, axis=1) / BESIDE_NONE]
    margins += [distances(effect.at, rival.at) / BESIDE_RIVAL for rival in rivals]
    margin, names = np.array(margins), ["none", *(rival.name for rival in rivals)]
    # In the order in which an effect acts less and less.
    strength = -effect.magnitudes if effect.name == RATE_LIMIT else np.abs(effect.magnitudes)
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
