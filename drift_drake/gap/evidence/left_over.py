"""What a hypothesis leaves over: the evidence that something else is there too, and what it is most like.

Two ways in which a gap may be unknown: it acts like an effect in part of the driving only or like something that no
effect is like (`gap.estimation.partial`), or scores lie further off than they scatter, in any direction. Both are
integrated over their size.
"""

from typing import NamedTuple

import numpy as np

from drift_drake.gap.estimation.baseline import Scatter
from drift_drake.gap.estimation.partial import Partial, partial_effects
from drift_drake.gap.evidence.constants import OF_NOISE, OF_PARTIAL, SIZES, WIDER


class LeftOver(NamedTuple):
    """Left over by a hypothesis."""

    gain: np.ndarray | float  # [K] log evidence of something else being there too, over that of nothing else
    like: Partial  # what it is most like


def left_over(scores: np.ndarray, scatter: Scatter, names: tuple[str, ...], slopes: np.ndarray) -> LeftOver:
    """What scores under a hypothesis leave over.

    Args:
        scores: less their normal mean [m]; scatter: of the day, at the hypothesis' car; names: of the effects whose
            scores come first; slopes: derivatives of the scores by the hypothesis' magnitudes [m, k].
    """
    there = partial_effects(names)
    directions = scatter.information[:, len(names) : len(names) + len(there)]
    anything = widened((scores @ scatter.inverses) @ scores, len(scores))
    by_direction = along(scores, scatter.inverses, directions, slopes)
    both = np.logaddexp(np.log(OF_PARTIAL) + log_mean(by_direction, 1), np.log(1.0 - OF_PARTIAL) + anything)
    return LeftOver(both, there[int(np.argmax(by_direction[scatter.main]))])


def along(scores: np.ndarray, weight: np.ndarray, directions: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Log evidence [..., p] that scores [m] hold something along each of the directions [m, p], whatever its size.

    Args:
        weight: inverse covariances of the scores [..., m, m]; slopes: what is free anyway [m, k].
    """
    if slopes.shape[1]:
        bent = weight @ slopes
        weight = weight - bent @ np.linalg.pinv(slopes.T @ bent) @ np.swapaxes(bent, -1, -2)
    bent = weight @ directions
    size, there = np.sum(directions * bent, axis=-2), scores @ bent
    return log_mean(np.array([
        0.5 * there**2 * tau**2 / (1.0 + tau**2 * size) - 0.5 * np.log1p(tau**2 * size) for tau in SIZES
    ]), 0)  # fmt: skip


def with_noise(gain: np.ndarray | float, noise: float | None) -> np.ndarray | float:
    """Log evidence of something else being there too, which may have changed the noise on readings.

    Args:
        gain: of the scores (`LeftOver.gain`); noise: log evidence of changed noise; None where it is not judged.
    """
    if noise is None:
        return gain
    there = np.log(0.5 * OF_NOISE) + noise + np.logaddexp(0.0, gain)
    return np.asarray(np.logaddexp(np.log(1.0 - OF_NOISE) + gain, there))


def widened(squared: np.ndarray | float, count: int) -> np.ndarray:
    """Log evidence of scores that scatter more than is normal, over that of normal ones.

    Args:
        squared: distances of the scores from normal, squared [...]; count: of the scores.
    """
    each = 0.5 * np.asarray(squared)[..., None] * (1.0 - 1.0 / WIDER) - 0.5 * count * np.log(WIDER)
    return log_mean(each, -1)


def log_mean(values: np.ndarray, axis: int) -> np.ndarray:
    """Logarithm of the mean of exponentials along an axis."""
    top = values.max(axis=axis, keepdims=True)
    return np.asarray(np.squeeze(top, axis) + np.log(np.mean(np.exp(values - top), axis=axis)))
