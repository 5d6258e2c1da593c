"""95 % intervals of shares, and of statistics over cases or over vehicles."""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import binomtest

RESAMPLES = 2000  # of the bootstrap


def binomial(hits: int, count: int, method: Literal["exact", "wilson"] = "exact") -> tuple[float, float, float]:
    """A share with its interval, exact (Clopper and Pearson 1934) or Wilson's (1927); of nothing NaN, 0 and 1."""
    if count == 0:
        return float("nan"), 0.0, 1.0
    test = binomtest(hits, count)
    low, high = test.proportion_ci(0.95, method)
    return float(test.statistic), float(low), float(high)


def bootstrap(
    values: NDArray[Any] | Sequence[float], statistic: Callable[[NDArray[Any]], NDArray[Any]]
) -> tuple[float, float]:
    """Percentile interval of a statistic of cases that are drawn anew.

    Args:
        values: [cases, ...]; statistic: of draws [RESAMPLES, cases, ...], one each.
    """
    values = np.asarray(values)
    draws = values[np.random.default_rng(0).integers(0, len(values), (RESAMPLES, len(values)))]
    low, high = np.quantile(statistic(draws), [0.025, 0.975])
    return float(low), float(high)


def by_vehicle(runs: pd.DataFrame, column: str, statistic: Callable[[np.ndarray], float]) -> tuple[float, float]:
    """Interval of a statistic of a column by the cluster bootstrap over the column `vehicle` (Davison and Hinkley 1997,
    section 3.8), replayed from a fixed seed: a vehicle's attempts hang together, so vehicles are drawn, not runs."""
    groups = [group.to_numpy(dtype=float) for _, group in runs.groupby("vehicle")[column]]
    rng = np.random.default_rng(0)

    @cache  # of few vehicles the same ones are drawn many times
    def of_vehicles(*drawn: int) -> float:
        return statistic(np.concatenate([groups[i] for i in drawn]))

    draws = [of_vehicles(*np.sort(rng.integers(0, len(groups), len(groups)))) for _ in range(RESAMPLES)]
    # Members of the sample: none can be interpolated where some are infinite.
    low, high = np.quantile(draws, [0.025, 0.975], method="nearest")
    return float(low), float(high)


def share_by_vehicle(runs: pd.DataFrame, flag: str) -> tuple[float, float]:
    """Interval of the share of runs with a flag.

    Over vehicles; exact where each has one attempt, and where all vehicles' shares are equal, of which resampling says
    nothing: then vehicles are counted.
    """
    shares = runs.groupby("vehicle")[flag].mean()
    if shares.isin((0.0, 1.0)).all():
        _, low, high = binomial(int(shares.sum()), len(shares))
        return low, high
    return by_vehicle(runs, flag, lambda values: float(np.mean(values)))
