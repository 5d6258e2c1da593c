"""The offset between two clocks from one motion that both saw."""

from typing import NamedTuple

import numpy as np

from drift_drake.common.arrays import Array

GRID = 0.01  # [s] of the search
BLOCK = 1.0  # [s] within which errors may be correlated
FEWEST_READINGS = 20  # readings


class ClockOffset(NamedTuple):
    """What to add to a clock [s] to read the reference's, its standard deviation [s], the correlation coefficient
    there, and the gain of the signal on the reference."""

    offset: float
    std: float
    correlation: float
    gain: float


def estimate_offset(t: Array, z: Array, t_ref: Array, ref: Array, start: float, search: float) -> ClockOffset:
    """The offset between two clocks from one motion that both saw: z(t) is then most like gain * ref(t + offset).

    By least squares with a constant. The standard deviation is that of a nonlinear least squares with errors
    correlated within blocks of 1 s (or shorter ones, where less than ten would fit), so it holds for coloured noise and
    for a reference that is not quite alike.

    Args:
        t, z: clock [s] and signal [n], as sparse as they come; t_ref, ref: the reference [m], dense; start: of the
            search [s]; search: how far from it [s].

    Raises:
        ValueError: too few readings within the reference, no variation, or the best fit lies at the search's end.
    """
    inside = (t + start - search >= t_ref[0]) & (t + start + search <= t_ref[-1])
    t, z = t[inside], z[inside]
    if len(t) < FEWEST_READINGS:
        raise ValueError(f"{len(t)} readings lie {search:g} s within the reference; {FEWEST_READINGS} are needed")
    if np.ptp(z) == 0.0 or np.ptp(ref) == 0.0:
        raise ValueError("a signal that stands still says nothing of its clock")

    def fit(offset: float) -> tuple[float, float, Array]:
        expected = np.interp(t + offset, t_ref, ref)
        centred, about = expected - expected.mean(), z - z.mean()
        gain = float(centred @ about / max(centred @ centred, 1e-300))
        return float(np.sum((about - gain * centred) ** 2)), gain, about - gain * centred

    offsets = start + np.arange(-search, search + 0.5 * GRID, GRID)
    costs = np.array([fit(offset)[0] for offset in offsets])
    best = int(np.argmin(costs))
    if best in (0, len(offsets) - 1):
        raise ValueError(f"no best offset within {search:g} s")
    slope = np.gradient(ref, t_ref)
    offset = float(offsets[best])
    for _ in range(20):
        _, gain, residual = fit(offset)
        sensitivity = gain * np.interp(t + offset, t_ref, slope)
        sensitivity = sensitivity - sensitivity.mean()
        information = float(sensitivity @ sensitivity)
        step = float(sensitivity @ residual) / information
        offset += float(np.clip(step, -GRID, GRID))
        if abs(step) < 1e-6:
            break
    cost, gain, residual = fit(offset)
    width = min(BLOCK, (t[-1] - t[0]) / 10.0)
    blocks = np.unique(np.floor((t - t[0]) / width), return_inverse=True)[1]
    scores = np.bincount(blocks, weights=sensitivity * residual)
    count = len(scores)
    std = float(np.sqrt(np.sum(scores**2) * count / max(count - 1, 1)) / information)
    correlation = float(np.sign(gain) * np.sqrt(max(0.0, 1.0 - cost / float(np.sum((z - z.mean()) ** 2)))))
    return ClockOffset(offset, std, correlation, gain)
