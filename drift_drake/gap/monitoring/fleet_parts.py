"""One effect over a table of cars and days: what all cars have, what one car has, and what a day brings to all.

A two-way model of a day's magnitude: a level and a drift from the first to the last day that all cars share, a level
and a drift of each car's own beyond these, what a day brings to all cars, and a rest. Cars, days and rest are drawn
from normal distributions whose widths are integrated over (compare Gelman and Hill 2007, chapter 13). So what is seen
on few cars, or on no common day, has a wide interval.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.gap.estimation.prior import TWO_SIDED, Interval

WIDTHS = (0.003, 0.03, 0.1, 0.3, 1.0)  # of cars, cars' drifts, days and rest, over the believable width: as likely each


class Parts(NamedTuple):
    """Of one effect's magnitude, each beyond those before it; drifts from the first day to the last."""

    common: Interval | None  # of all cars, midway; None of one car, whose own it may be
    drift: Interval | None  # that all cars share; None of one car or one day
    cars: dict[str, Interval]  # a car's own, midway
    drifts: dict[str, Interval]  # a car's own
    days: dict[str, Interval]  # of all cars that drove on a day


def parts_of(
    values: np.ndarray, variances: np.ndarray, cars: Sequence[str], days: Sequence[str], width: float
) -> Parts:
    """The parts of an effect's magnitudes on a table of cars and days.

    Args:
        values, variances: [cars, days], NaN where a car did not drive; cars, days: names, days in the order of time;
        width: standard deviation that a magnitude is believed to have.
    """
    at, day = np.nonzero(np.isfinite(values))
    y, v = values[at, day] / width, variances[at, day] / width**2
    time = day / max(len(days) - 1, 1) - 0.5 * (len(days) > 1)
    of_car, of_day = np.eye(len(cars))[at], np.eye(len(days))[day]
    x = np.column_stack([np.ones(len(y)), time, of_car, of_car * time[:, None], of_day])
    alone = len(set(at)) < 2
    sizes = (1, 1, len(cars), len(cars), len(days))
    # Known to be zero: nothing shows it.
    known = (alone, alone or len(days) < 2, False, len(days) < 2, alone or len(days) < 2)
    kept = np.repeat([not zero for zero in known], sizes)
    found, spread = _posterior(x[:, kept], y, v, [n for n, zero in zip(sizes, known, strict=True) if not zero],
                               shared=0 if alone else 2 - known[1])  # fmt: skip
    mean, deviation = np.zeros((2, sum(sizes)))
    mean[kept], deviation[kept] = width * found, width * spread
    ends = [
        Interval(q, q - TWO_SIDED * d, q + TWO_SIDED * d)
        for q, d in zip(mean.tolist(), deviation.tolist(), strict=True)
    ]
    first = np.cumsum([0, *sizes])
    own, own_drift, by_day = (ends[a:b] for a, b in itertools.pairwise(first[2:]))
    return Parts(
        None if known[0] else ends[0], None if known[1] else ends[1], dict(zip(cars, own, strict=True)),
        {} if known[3] else dict(zip(cars, own_drift, strict=True)),
        {} if known[4] else dict(zip(days, by_day, strict=True)),
    )  # fmt: skip


def _posterior(
    x: np.ndarray, y: np.ndarray, v: np.ndarray, sizes: Sequence[int], shared: int
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation [p] of coefficients of y = x c + noise, over all widths of their groups and the rest.

    Args:
        x: [n, p]; v: variances of y that are known [n]; sizes: of the groups, the first `shared` of width one.
    """
    weights, means, squares = list[float](), list[np.ndarray](), list[np.ndarray]()
    for rest in WIDTHS:
        noise = v + rest**2
        information, score = x.T @ (x / noise[:, None]), x.T @ (y / noise)
        for widths in itertools.product(WIDTHS, repeat=len(sizes) - shared):
            prior = np.repeat([*np.ones(shared), *widths], sizes)
            root = np.linalg.cholesky(information + np.diag(prior**-2.0))
            inverse = np.linalg.inv(root)
            mean = inverse.T @ (inverse @ score)
            weights.append(0.5 * float(score @ mean - np.sum(np.log(noise))) - float(np.sum(np.log(prior)))
                           - float(np.sum(np.log(np.diag(root)))) - 0.5 * float(y @ (y / noise)))  # fmt: skip
            means.append(mean)
            squares.append(mean**2 + np.sum(inverse**2, axis=0))
    share = np.exp(np.array(weights) - max(weights))
    share /= share.sum()
    mean = share @ np.array(means)
    return mean, np.sqrt(np.maximum(share @ np.array(squares) - mean**2, 0.0))
