"""What these logs can show: for every effect the least magnitude that would be named with 95 % probability.

To first order in the magnitudes, from the day's own drives and the car's own scatter; no truth is needed. An effect is
named when it is ahead of `none` by its prior's disadvantage, and of every other single effect whose magnitude is
fitted to the same scores; the log evidence ahead of a rival that is D nats behind in the mean has variance 2 D.
"""

import dataclasses

import numpy as np

from drift_drake.diagnosis.day_hypotheses import REACH, Search
from drift_drake.estimation.scores import units
from drift_drake.vehicle.catalogue import CATALOGUE

SURE = 1.645  # standard deviations of a one-sided 95 %
RATE_LIMIT, LIMITS = "steering_rate_limit", 12  # of which limits are tried
AGAINST_NONE = 5.5  # [nats] that an effect's prior and the width of its range cost it beside none


@dataclasses.dataclass(frozen=True)
class DetectionLimit:
    """Of one effect."""

    unit: str
    least: float | None  # magnitude; None if none within the practical range (times 1.5) would be named
    taken_for: str  # the hypothesis that is hardest to tell it from


def detection_limits(search: Search) -> dict[str, DetectionLimit]:
    """By effect of the search's catalogue."""
    names = list(search.ranges)
    steps = units(names, search.vehicle)
    at_zero = search.scores({})
    slopes = []
    for name, step in zip(names, steps, strict=True):
        # From a magnitude that acts: a rate limit's derivative at zero is none.
        slopes.append((search.scores({name: float(step)}) - at_zero) / step)
    whitened = np.array(slopes) @ np.linalg.cholesky(search.scatter.inverse + 1e-300 * np.eye(len(at_zero)))
    size = np.sqrt(np.maximum(np.sum(whitened**2, axis=1), 1e-300))
    cosine = whitened @ whitened.T / np.outer(size, size)
    beside_none = SURE + np.sqrt(SURE**2 + 2.0 * AGAINST_NONE)
    beside_rival = 2.0 * SURE
    out = {}
    for i, name in enumerate(names):
        apart = size[i] * np.sqrt(np.maximum(1.0 - cosine[i] ** 2, 1e-12))
        apart[i] = np.inf
        needs = [beside_none / size[i], *(beside_rival / apart)]
        hardest = int(np.argmax(needs))
        least = max(needs[hardest], search.ranges[name].least)
        reach = REACH * max(abs(q) for q in CATALOGUE[name].range_for(search.vehicle))
        rival = "none" if hardest == 0 else names[hardest - 1]
        out[name] = DetectionLimit(CATALOGUE[name].unit, float(least) if least <= reach else None, rival)
    if RATE_LIMIT in out:
        out[RATE_LIMIT] = rate_limit(search, at_zero, float(beside_none))
    return out


def rate_limit(search: Search, at_zero: np.ndarray, needed: float) -> DetectionLimit:
    """The highest limit [rad/s] that would be named: a limit acts the more the lower it is."""
    r = search.ranges[RATE_LIMIT]
    for limit in np.linspace(r.high, r.least, LIMITS):
        x = search.scores({RATE_LIMIT: float(limit)}) - at_zero
        if np.sqrt(2.0 * float(search.nats(x))) >= needed:
            return DetectionLimit(CATALOGUE[RATE_LIMIT].unit, float(limit), "none")
    return DetectionLimit(CATALOGUE[RATE_LIMIT].unit, None, "none")
