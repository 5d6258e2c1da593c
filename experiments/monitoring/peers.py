"""What people use to watch a car, over the same filter: alarms on innovations, and a filter for each effect.

Each gives one number a row, which is an alarm above a threshold; the filters also say which effect it is.
"""

import numpy as np
from scipy.signal import lfilter

WINDOW = 50  # rows of the chi-square test's window: 0.5 s
DRIFT = 0.25  # of the innovations' mean square, that the cumulative sum forgives
WANDER = 0.02  # amplitude per root row that an augmented state wanders by


def chi_square(nu: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Mean square of the innovations [rows, 9] over a window [rows]."""
    squares = np.mean(nu[:, used] ** 2, axis=1)
    return np.asarray(lfilter(np.full(WINDOW, 1.0 / WINDOW), 1.0, squares))


def cumulative_sum(nu: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Page's cumulative sum of the innovations' mean square beyond one [rows]."""
    out, total = np.zeros(len(nu)), 0.0
    for k, square in enumerate(np.mean(nu[:, used] ** 2, axis=1)):
        total = max(total + min(square, 100.0) - 1.0 - DRIFT, 0.0)
        out[k] = total
    return out


def augmented_filters(nu: np.ndarray, signatures: np.ndarray) -> np.ndarray:
    """For each node an extended Kalman filter with its amplitude as a further state that wanders.

    The amplitude apart from the car's states (Friedland's separated form of the augmented filter, 1969).

    Args:
        nu: innovations [rows, channels]; signatures [rows, n, channels].

    Returns:
        Amplitudes in their standard deviations [rows, n].
    """
    n = signatures.shape[1]
    amplitude, variance = np.zeros(n), np.ones(n)
    out = np.zeros((len(nu), n))
    for k in range(len(nu)):
        variance = variance + WANDER**2
        g = signatures[k]
        for c in range(g.shape[1]):  # one channel after the other: their noise is independent
            s = g[:, c] ** 2 * variance + 1.0
            gain = variance * g[:, c] / s
            amplitude = amplitude + gain * (np.clip(nu[k, c], -8.0, 8.0) - g[:, c] * amplitude)
            variance = variance / s
        out[k] = np.abs(amplitude) / np.sqrt(variance)
    return out
