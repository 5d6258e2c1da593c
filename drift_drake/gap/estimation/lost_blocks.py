"""Driving that no prediction follows for seconds: a wheel lifts, a kerb is hit, a car spins.

What a baseline has of it is this car's own. A later log that has as much of it shows no change by that.
"""

import numpy as np
from scipy.special import betaln

from drift_drake.gap.estimation.normal import LOST, capped_squares

FAR = 5.0
"""Root mean square of a block's errors, in robust scales, beyond which its prediction is lost. Most blocks have about
one, those of a van with a lifted wheel 10 to 50 (validation); no other value was tried."""
JEFFREYS = 0.5  # both parameters of the Beta prior of the share of such blocks


def lost_blocks(errors: np.ndarray, offset: np.ndarray, scales: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Blocks [blocks] (bool) whose predictions are lost.

    Args:
        errors: [windows, horizons, channels]; offset, scales: medians and robust scales [horizons, channels];
        block: of each window [windows].
    """
    squares = capped_squares((errors - offset) / scales, LOST).mean(axis=(1, 2))
    return np.asarray(np.bincount(block, squares) / np.bincount(block) > FAR**2)


def as_often(lost: int, blocks: int, baseline_lost: int, baseline_blocks: int) -> bool:
    """Whether a log and its baseline, which has lost blocks, are more probable with one share of these than with two.

    The Bayes factor of two binomial samples (Good 1950), with Jeffreys' prior of each share.
    """
    if not 0 < lost < blocks or not baseline_lost:
        return False
    counts = [(lost, blocks - lost), (baseline_lost, baseline_blocks - baseline_lost)]

    def log_likelihood(one: int, other: int) -> float:
        return float(betaln(JEFFREYS + one, JEFFREYS + other) - betaln(JEFFREYS, JEFFREYS))

    together = log_likelihood(*(sum(parts) for parts in zip(*counts, strict=True)))
    return together > sum(log_likelihood(*count) for count in counts)
