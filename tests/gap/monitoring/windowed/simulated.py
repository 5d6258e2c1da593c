"""Scores of windows that are white noise about what a change makes of them, and their null distribution."""

import numpy as np

from drift_drake.gap.estimation.baseline import Spread
from drift_drake.gap.monitoring.bank import Node
from drift_drake.gap.monitoring.windowed.null import Null
from drift_drake.gap.monitoring.windowed.sums import WindowSums

N = 3
NODES = (Node("steering_lag", 0.1, 1.0, 0.6), Node("gyro_bias", 0.02, 0.0, 2.0, True), Node("aero_drag", 1.0, 0.0, 2.0))
INFORMATION = np.array([2.0, 1.0, 0.5])  # of a window
SECONDS = 0.2  # that a window stands for
PER_BLOCK = 10.0  # windows


def null_of_white_scores(cap: float = np.inf) -> Null:
    """Of scores that are as white as their information says, of a car that is known exactly."""
    block = PER_BLOCK * INFORMATION
    spread = Spread(np.diag(block), block, 1.0, 10**6, np.zeros(N), np.zeros(N))
    return Null(spread, np.zeros(N), 1e-9 * np.eye(N), 1.0, SECONDS, cap, 1.0)


def window(rng: np.random.Generator, amplitudes: np.ndarray) -> WindowSums:
    """One window of a car that has the nodes with these amplitudes [N]."""
    information = np.diag(INFORMATION)
    score = rng.normal(size=N) * np.sqrt(INFORMATION) + information @ amplitudes
    return WindowSums(np.ones(()), np.zeros(()), score, information, -information)
