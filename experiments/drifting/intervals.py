"""95 % intervals of figures over vehicles: a vehicle's attempts hang together, so vehicles are drawn, not runs."""

from collections.abc import Callable

import numpy as np
import pandas as pd
from scipy.stats import binomtest

RESAMPLES = 2000


def by_vehicle(runs: pd.DataFrame, column: str, statistic: Callable[[np.ndarray], float]) -> tuple[float, float]:
    """95 % interval of a statistic of a column by the cluster bootstrap over the column `vehicle` (Davison and Hinkley
    1997, section 3.8), replayed from a fixed seed."""
    groups = [group.to_numpy(dtype=float) for _, group in runs.groupby("vehicle")[column]]
    rng = np.random.default_rng(0)
    draws = [statistic(np.concatenate([groups[i] for i in rng.integers(0, len(groups), len(groups))]))
             for _ in range(RESAMPLES)]  # fmt: skip
    # Members of the sample: none can be interpolated where some are infinite.
    low, high = np.quantile(draws, [0.025, 0.975], method="nearest")
    return float(low), float(high)


def share_interval(runs: pd.DataFrame, flag: str) -> tuple[float, float]:
    """95 % interval of the share of runs with a flag.

    Over vehicles; exact (Clopper and Pearson 1934) where each has one attempt, and where all vehicles' shares are
    equal, of which resampling says nothing: then vehicles are counted.
    """
    shares = runs.groupby("vehicle")[flag].mean()
    if shares.isin((0.0, 1.0)).all():
        interval = binomtest(int(shares.sum()), len(shares)).proportion_ci(0.95, "exact")
        return float(interval.low), float(interval.high)
    return by_vehicle(runs, flag, lambda values: float(np.mean(values)))
