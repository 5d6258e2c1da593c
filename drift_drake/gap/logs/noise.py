"""The white noise on a signal, the step of its numbers and their wraps, from the signal alone."""

import math

import numpy as np

DIFFERENCES = 4  # order of the differences: motion at 100 Hz is smooth to them, white noise is not
CLIP = 4.0  # standard deviations beyond which a difference is the car's jerk, not noise
SHARE_OF_RANGE = 1e-4  # of what a channel covers, below which a step is that of its text or converter
SHARE_OF_NOISE = 0.6  # the noise that is seen, in steps, below which the step makes it
ON_STEPS = 0.99  # of the values that lie on multiples of the step
OFF = 0.1  # of a step that a value may lie off it
FAR = 30.0  # robust deviations of a fourth difference, beyond which a jump or a spike is in it
WRAP = 0.6  # of a channel's range that a wrap jumps over
FEWEST_WRAPS = 2
SAME = 0.1  # of their size by which wraps differ
LONGEST_SPIKE = 5  # rows; a wrap lasts longer
ISOLATED = 0.7  # of the wraps that do
BETWEEN = 0.1  # of the rows that lie in the middle half of a channel's range
CONTINUES = 3.0  # times the usual step, that is left of a wrap's once it is undone
MOST_OUT = 0.1  # of the rows: more are no jumps


def fourth_differences(values: np.ndarray) -> tuple[np.ndarray, float]:
    """Fourth differences of a signal [n] about their median, and their robust standard deviation."""
    fourth = np.diff(values, n=DIFFERENCES)
    fourth = fourth - np.median(fourth)
    return fourth, float(np.median(np.abs(fourth))) / 0.6744897501960817


def white_noise_level(values: np.ndarray) -> float:
    """Standard deviation of the white noise on a smooth signal [n], robust against jumps.

    From the fourth differences: the noise's variance is multiplied by the sum of the squared binomial coefficients
    (70), a smooth motion's fourth difference is far smaller. Differences beyond `CLIP` deviations are left out.
    """
    fourth, spread = fourth_differences(values)
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
    """Whether the step (`size`) of the signal [n] is large relative to noise: its errors are then no white noise."""
    if size <= SHARE_OF_RANGE * float(np.ptp(np.quantile(values, [0.01, 0.99]))):
        return False
    return white_noise_level(values) < SHARE_OF_NOISE * size


def noise_of(size: float) -> float:
    """Standard deviation of the error that rounding to steps of this size makes: a floor for the noise."""
    return size / math.sqrt(12.0)


def without_jumps(values: np.ndarray) -> np.ndarray:
    """The readings [n], NaN where there are none, without spikes (NaN there) and wraps (continued): for its noise."""
    seen = np.flatnonzero(np.isfinite(values))
    readings = np.array(values[seen], dtype=float)
    wrap = wrap_size(readings)
    if wrap is not None:
        readings = np.unwrap(readings, period=wrap)
    fourth = np.diff(readings, n=DIFFERENCES)
    spread = float(np.median(np.abs(fourth - np.median(fourth)))) / 0.6744897501960817 if len(fourth) else 0.0
    far = np.flatnonzero(np.abs(fourth) > FAR * spread) if spread > 0.0 else np.empty(0, dtype=int)
    # A single row's spike is in five differences, the middle one the largest.
    out = np.unique(far + DIFFERENCES // 2)
    if len(out) <= MOST_OUT * len(readings):
        readings[out] = np.nan
    cleaned = np.full(len(values), np.nan)
    cleaned[seen] = readings
    return cleaned


def wrap_size(values: np.ndarray) -> float | None:
    """What a channel [n] jumps by, up and down, each time that it leaves its recorder's range; None where it does not.

    Wraps jump over most of the channel's range, all by one size, and the channel goes on from there.
    """
    steps = np.diff(values)
    reach = float(np.ptp(values)) if len(values) else 0.0
    jumps = np.flatnonzero(np.abs(steps) > WRAP * reach)
    if len(jumps) < FEWEST_WRAPS or reach == 0.0:
        return None
    # Less what the channel moved by itself.
    calm = np.where(np.abs(steps) > WRAP * reach, 0.0, steps)
    own = 0.5 * (calm[np.maximum(jumps - 1, 0)] + calm[np.minimum(jumps + 1, len(steps) - 1)])
    sizes = np.abs(steps[jumps] - own)
    size = float(np.median(sizes))
    if np.any(np.abs(sizes - size) > SAME * size) or len({bool(up) for up in steps[jumps] > 0.0}) < 2:
        return None
    # A switched signal is hardly ever between its levels.
    middle = 0.5 * (float(np.max(values)) + float(np.min(values)))
    if float(np.mean(np.abs(values - middle) < 0.25 * reach)) < BETWEEN:
        return None
    # A spike goes back at once, and a switched signal rests on either side: a wrap moves on, and is smooth without.
    smooth = np.abs(np.diff(np.unwrap(values, period=size)))
    usual = float(np.quantile(np.abs(np.delete(steps, jumps)), 0.99)) if len(steps) > len(jumps) else 0.0
    # Noise makes some wraps go to and fro; of spikes every second jump does.
    gone = float(np.mean(np.diff(jumps) > LONGEST_SPIKE))
    return size if gone > ISOLATED and usual > 0.0 and float(np.max(smooth[jumps])) < CONTINUES * usual else None
