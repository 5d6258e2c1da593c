"""What recordings left out of a baseline show: how far they lie from what the others predict, and what that says.

Of the scale of the scatter within a recording, and of the factor on what the equations lack from stretch to stretch.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from drift_drake.gap.estimation.baseline import Known, Scatter, Spread, Stretches, known_from, known_without, predicted
from drift_drake.gap.estimation.prediction_constants import (
    FACTOR_SPREAD,
    FACTORS,
    FROM_LEFT_OUT,
    ODD,
    SCALE,
    SCALE_WORTH,
)

TINY = 1e-9  # squared distance, below which recordings are all the same
SCALES = np.geomspace(0.03, 10.0, 12)  # of the scatter, at which factors are compared
MOST = 30  # stretches that are left out then


class LeftOut(NamedTuple):
    """A part of a baseline, and what the others tell of the car."""

    stretches: Stretches
    known: Known
    model: Spread

    def at(self, scale: float, factors: Sequence[float] | np.ndarray = (1.0,), main: int = 0) -> Scatter:
        """How its scores scatter, at a scale, and at factors relative to its model's (`predicted`)."""
        return predicted(self.stretches, self.known, [self.model.times(factor) for factor in factors], scale, main)

    def scores(self, scatter: Scatter) -> np.ndarray:
        """Its scores less what the others predict [m]."""
        return np.asarray(self.stretches.scores.sum(axis=0) - scatter.mean)

    @property
    def distance(self) -> float:
        """Squared distance of its scores from what the others predict, per score, at a scale of one."""
        scatter = self.at(1.0)
        x = self.scores(scatter)
        return float(x @ scatter.inverse @ x / len(x))

    def log_density(self, scale: float) -> float:
        """Of its scores, but for a constant, at a scale."""
        scatter = self.at(scale)
        x = self.scores(scatter)
        return float(-0.5 * x @ scatter.inverse @ x - 0.5 * np.linalg.slogdet(scatter.covariance)[1])


def left_out(stretches: Stretches, model: Spread, prior: np.ndarray) -> list[LeftOut]:
    """Each recording and what the others tell, to first order; stretches where there is but one recording."""
    part = stretches.recording if len(np.unique(stretches.recording)) > 1 else np.arange(len(stretches.blocks))
    return apart(stretches, model, prior, part) if len(np.unique(part)) > 1 else []


def apart(stretches: Stretches, model: Spread, prior: np.ndarray, part: np.ndarray, most: int = 2**31) -> list[LeftOut]:
    """Parts of stretches, each with what all others tell; part: of each stretch [K]; most: of them, evenly chosen."""
    parts = np.unique(part)
    each = [part == k for k in parts[:: -(-len(parts) // most)]]
    known = known_without(stretches, model, prior, each)
    return [LeftOut(stretches.kept(mask), of_others, model) for mask, of_others in zip(each, known, strict=True)]


def scale_of(distances: np.ndarray) -> float:
    """Scale of the scatter of another recording: what recordings left out show, and what is known of other cars.

    Args:
        distances: of each that was left out (`LeftOut.distance`) [K].
    """
    if not len(distances):
        return SCALE
    seen = np.log(np.maximum(FROM_LEFT_OUT * distances, TINY))
    middle = np.median(seen)
    seen = np.clip(seen, middle - np.log(ODD), middle + np.log(ODD))
    return float(np.exp((SCALE_WORTH * np.log(SCALE) + np.sum(seen)) / (SCALE_WORTH + len(seen))))


class OfBaseline(NamedTuple):
    """What a baseline shows of how its car's scores scatter."""

    known: Known
    factors: np.ndarray  # log probabilities of the factors [K]
    scale: float
    left_out: list[LeftOut]  # at the most probable factor


def learnt_from(stretches: Stretches, model: Spread, prior: np.ndarray) -> OfBaseline:
    """What stretches show at the most probable factor; prior: standard deviations [m] of a car's deviations."""
    factors = factors_of(stretches, model, prior)
    main = model.times(FACTORS[int(np.argmax(factors))])
    parts = left_out(stretches, main, prior)
    scale = scale_of(np.array([part.distance for part in parts]))
    return OfBaseline(known_from(stretches, main, prior), factors, scale, parts)


def factors_of(stretches: Stretches, model: Spread, prior: np.ndarray) -> np.ndarray:
    """Log probabilities of the factors [K], by the likelihood of stretches left out, each at its most likely scale.

    A factor that is smaller than the most likely one loses what it is less likely by. A larger one does not: stretches
    of the same kinds of driving show too little of what other driving would.
    """
    each, likely = np.arange(len(stretches.blocks)), np.zeros(len(FACTORS))
    for i, factor in enumerate(FACTORS if len(each) > 1 else ()):
        parts = apart(stretches, model.times(factor), prior, each, MOST)
        likely[i] = max(sum(part.log_density(scale) for part in parts) for scale in SCALES)
    best = int(np.argmax(likely))
    factors = np.where(np.arange(len(FACTORS)) < best, likely - likely[best], 0.0)
    factors = factors - 0.5 * (np.log(FACTORS) / FACTOR_SPREAD) ** 2
    return np.asarray(factors - logsumexp(factors))
