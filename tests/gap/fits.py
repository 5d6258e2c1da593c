"""Fits of one hypothesis from a start, for tests that need one."""

from collections.abc import Sequence

import numpy as np

from drift_drake.gap.estimation.fit import Fit, conclude, minimise
from drift_drake.gap.estimation.problem import Problem


def fit(problem: Problem, names: Sequence[str], theta: np.ndarray, iterations: int = 6) -> Fit:
    """The fit of a hypothesis."""
    return conclude(problem, names, minimise(problem, names, theta, iterations))
