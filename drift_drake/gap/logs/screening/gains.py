"""The gain between two signals that should be equal, as an interval that holds whatever the noise of either.

The regression of one signal on the other gives a gain that the other's noise makes too small; the regression the other
way round, one that is too large. The true gain lies between the two (Frisch's bounds), each with its standard error
from blocks of neighbouring windows, so that coloured noise and unmodelled motion widen the interval. What the nuisances
explain may have another form, which widens it too: little where they do, by much where little else is left.
"""

import dataclasses
from typing import Any

import numpy as np

ERRORS = 1e-4  # chance that one side of an interval misses: many relations of many logs are asked
FEWEST_BLOCKS = 6
TRIMMED = 4.0  # robust standard deviations of a residual, beyond which a window is left out
TRIMS = 3  # passes
SINGULAR = 1e8  # condition number of what is left without a block
SMALLEST = 1e-6  # share of a signal's square that is left without a block
FEWEST_TELLING = 2.0  # blocks, as which those count that hold most of a signal
FORM = 0.1  # of what nuisances explain, that it may be off by


@dataclasses.dataclass(frozen=True)
class Bounds:
    """What a number is, between two others that it hardly lies outside of."""

    low: float
    middle: float
    high: float

    def beyond(self, value: float, margin: float) -> bool:
        """Whether it differs from the value by more than the margin, for certain."""
        return self.low > value + margin or self.high < value - margin

    def over(self, other: float) -> "Bounds":
        """Divided by a number."""
        ends = sorted((self.low / other, self.high / other))
        return Bounds(ends[0], self.middle / other, ends[1])


def gain(
    measured: np.ndarray, expected: np.ndarray, others: np.ndarray, blocks: np.ndarray, least: float = 0.6
) -> Bounds | None:
    """The factor on `expected` that gives `measured`, up to a constant and the nuisances; None where too unlike.

    Args:
        measured, expected: [windows]; others: nuisances [windows, n]; blocks: label of each window's block [windows];
            least: correlation of what the nuisances leave of both, below which nothing is stated.
    """
    design = np.column_stack([np.ones(len(measured)), others])
    kept = np.isfinite(measured) & np.isfinite(expected) & np.isfinite(design).all(axis=1)
    for _ in range(TRIMS):
        parts = _rest(design[kept], measured[kept]), _rest(design[kept], expected[kept])
        if not _enough(blocks[kept], design.shape[1] + 1) or min(np.ptp(part) for part in parts) < 1e-12:
            return None
        m, e = parts
        rest = m - (e @ m) / (e @ e) * e
        spread = float(np.median(np.abs(rest))) / 0.6745
        good = np.abs(rest) <= TRIMMED * max(spread, 1e-12)
        if good.all():
            break
        kept[np.flatnonzero(kept)[~good]] = False
    m, e = _rest(design[kept], measured[kept]), _rest(design[kept], expected[kept])
    likeness = float(m @ e / np.sqrt((m @ m) * (e @ e)))
    if likeness < least or _telling(e, blocks[kept]) < FEWEST_TELLING:
        return None
    count, used = blocks[kept], design.shape[1] + 1
    low, low_std = _slope(m, e, count, used)
    back, back_std = _slope(e, m, count, used)
    wide = _quantile(count, used)
    at_most = back - wide * back_std
    if at_most <= 0.0:
        return None
    middle = float(np.sqrt(low / back))
    shape = FORM * _spread(design[kept], (measured - middle * expected)[kept]) / float(np.std(e))
    return Bounds(low - wide * low_std - shape, middle, 1.0 / at_most + shape)


def mean(values: np.ndarray, blocks: np.ndarray) -> Bounds | None:
    """The mean of values [windows], without the few that lie far off."""
    kept = np.isfinite(values)
    values, blocks = values[kept], blocks[kept]
    if not _enough(blocks, 1):
        return None
    middle = float(np.median(values))
    spread = float(np.median(np.abs(values - middle))) / 0.6745
    good = np.abs(values - middle) <= TRIMMED * max(spread, 1e-12)
    values, blocks = values[good], blocks[good]
    if not _enough(blocks, 1):
        return None
    middle = float(np.mean(values))
    scores = np.bincount(np.unique(blocks, return_inverse=True)[1], weights=values - middle)
    std = float(np.sqrt(_inflated(np.sum(scores**2), len(scores), 1))) / len(values)
    half = _quantile(blocks, 1) * std
    return Bounds(middle - half, middle, middle + half)


def coefficients(design: np.ndarray, values: np.ndarray, blocks: np.ndarray) -> list[Bounds] | None:
    """Of a least-squares fit of values [windows] by the design's columns [windows, n], with errors from blocks."""
    kept = np.isfinite(values) & np.isfinite(design).all(axis=1)
    for _ in range(TRIMS):
        if not _enough(blocks[kept], design.shape[1]):
            return None
        scale = np.sqrt(np.mean(design[kept] ** 2, axis=0))
        if np.any(scale < 1e-12) or np.linalg.cond(design[kept] / scale) > 1e3:
            return None
        found, *_ = np.linalg.lstsq(design[kept], values[kept], rcond=None)
        rest = values[kept] - design[kept] @ found
        good = np.abs(rest) <= TRIMMED * max(float(np.median(np.abs(rest))) / 0.6745, 1e-12)
        if good.all():
            break
        kept[np.flatnonzero(kept)[~good]] = False
    part = design[kept]
    found, *_ = np.linalg.lstsq(part, values[kept], rcond=None)
    std = _left_out_std(part, values[kept], found, blocks[kept])
    if std is None:
        return None
    half = _quantile(blocks[kept], part.shape[1]) * std
    return [Bounds(float(q - h), float(q), float(q + h)) for q, h in zip(found, half, strict=True)]


def _rest(design: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What the design's columns [n, k] leave of values [n]."""
    found, *_ = np.linalg.lstsq(design, values, rcond=None)
    return np.asarray(values - design @ found)


def _left_out_std(design: np.ndarray, values: np.ndarray, found: np.ndarray, blocks: np.ndarray) -> np.ndarray | None:
    """Standard errors of the coefficients found, by leaving each block out (jackknife); None where one of them alone
    tells a coefficient."""
    label = np.unique(blocks, return_inverse=True)[1]
    order = np.argsort(label, kind="stable")
    part, starts = design[order], np.flatnonzero(np.diff(label[order], prepend=-1))
    squares = np.add.reduceat(part[:, :, None] * part[:, None, :], starts)
    products = np.add.reduceat(part * values[order][:, None], starts)
    without = np.sum(squares, axis=0) - squares
    size = np.sqrt(np.diagonal(np.sum(squares, axis=0)))
    if np.any(np.linalg.cond(without / np.outer(size, size)) > SINGULAR):
        return None
    moved = np.linalg.solve(without, (np.sum(products, axis=0) - products)[:, :, None])[:, :, 0] - found
    return np.asarray(np.sqrt((1.0 - 1.0 / len(starts)) * np.sum(moved**2, axis=0)))


def _spread(design: np.ndarray, values: np.ndarray) -> float:
    """Standard deviation of what the design's columns [n, k] explain of values [n]."""
    found, *_ = np.linalg.lstsq(design, values, rcond=None)
    return float(np.std(design @ found))


def _enough(blocks: np.ndarray, used: int) -> bool:
    return len(np.unique(blocks)) >= FEWEST_BLOCKS + used and len(blocks) > 2 * used


def _telling(signal: np.ndarray, blocks: np.ndarray) -> float:
    """How many blocks of equal size would hold as much of the signal [n] as those that hold most of it."""
    squares = np.bincount(np.unique(blocks, return_inverse=True)[1], weights=signal**2)
    return float(np.sum(squares) ** 2 / np.sum(squares**2))


def _slope(values: np.ndarray, of: np.ndarray, blocks: np.ndarray, used: int) -> tuple[float, float]:
    """Regression of values on `of` (both [n] without mean), and its standard error from blocks."""
    square = float(of @ of)
    slope = float(of @ values) / square
    label = np.unique(blocks, return_inverse=True)[1]
    scores: np.ndarray = np.bincount(label, weights=of * (values - slope * of))
    rest = 1.0 - np.bincount(label, weights=of * of) / square  # where one block is most of all, it fits itself
    scores = scores / np.maximum(rest, SMALLEST)
    return slope, float(np.sqrt(_inflated(np.sum(scores**2), len(scores), used))) / square


def _inflated(squares: Any, count: int, used: int) -> Any:
    """For the degrees of freedom that the fit has taken from its residuals."""
    return squares * count / max(count - used, 1)


def _quantile(blocks: np.ndarray, used: int) -> float:
    """Of Student's distribution: standard errors to an interval's end."""
    from scipy.special import stdtrit  # slow to import

    return -float(stdtrit(max(len(np.unique(blocks)) - used, 1), ERRORS))
