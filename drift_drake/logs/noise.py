"""The white noise on a signal, and the step of its numbers, from the signal alone."""

import math

import numpy as np

DIFFERENCES = 4  # order of the differences: motion at 100 Hz is smooth to them, white noise is not
CLIP = 4.0  # standard deviations beyond which a difference is the car's jerk, not noise
SHARE_OF_RANGE = 1e-4  # of what a channel covers, below which a step is that of its text or converter
SHARE_OF_NOISE = 0.6  # the noise that is seen, in steps, below which the step makes it
ON_STEPS = 0.99  # of the values that lie on multiples of the step
OFF = 0.1  # of a step that a value may lie off it


def white_noise_level(values: np.ndarray) -> float:
    """Standard deviation of the white noise on a smooth signal [n], robust against jumps.

    From the fourth differences: the noise's variance is multiplied by the sum of the squared binomial coefficients
    (70), a smooth motion's fourth difference is far smaller. Differences beyond `CLIP` deviations are left out.
    """
    fourth = np.diff(values, n=DIFFERENCES)
    fourth = fourth - np.median(fourth)
    spread = float(np.median(np.abs(fourth))) / 0.6744897501960817
    kept = fourth[np.abs(fourth) <= CLIP * spread]
    return float(np.sqrt(np.mean(kept**2) / 70.0)) if len(kept) else 0.0


def step(values: np.ndarray) -> float:
    """The step that the numbers [n] are multiples of, apart by a common offset; zero where they are of none."""
    distinct = np.unique(values)
    if len(distinct) < 3:
        return 0.0
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 1e-9 * float(np.max(np.abs(distinct)))]
    if not len(gaps):
        return 0.0
    size = float(np.min(gaps))
    for most in (3.0, 30.0):  # short gaps say how many steps the longer ones have
        short = gaps[gaps < most * size]
        size = float(np.sum(short) / np.sum(np.round(short / size)))
    off = (distinct - distinct[len(distinct) // 2]) / size
    return size if float(np.mean(np.abs(off - np.round(off)) < OFF)) >= ON_STEPS else 0.0


def coarse(values: np.ndarray, size: float) -> bool:
    """Whether the step (`size`) of the signal [n] is large beside its noise, so that its errors are no white noise."""
    if size <= SHARE_OF_RANGE * float(np.ptp(np.quantile(values, [0.01, 0.99]))):
        return False
    return white_noise_level(values) < SHARE_OF_NOISE * size


def noise_of(size: float) -> float:
    """Standard deviation of the error that rounding to steps of this size makes: a floor for the noise."""
    return size / math.sqrt(12.0)
