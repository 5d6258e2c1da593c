"""Driving that no prediction follows for seconds: a wheel lifts, a kerb is hit, a car spins.

What a baseline has of it is this car's own. A later log that has as much of it shows no change by that.
"""

import numpy as np
from scipy.special import betaln

from drift_drake.gap.estimation.normal import LOST, capped_squares

FAR = 5.0
"""Root mean square of a block's errors, in robust scales, beyond which its prediction is lost. Most blocks have about
one, those of a van with a lifted wheel 10 to 50 (validation); no other value was tried."""
JEFFREYS = 0.5  # both parameters of the Beta prior of a chance


def lost_blocks(errors: np.ndarray, offset: np.ndarray, scales: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Blocks [blocks] (bool) whose predictions are lost.

    Args:
        errors: [windows, horizons, channels]; offset, scales: medians and robust scales [horizons, channels];
        block: of each window [windows].
    """
    squares = capped_squares((errors - offset) / scales, LOST).mean(axis=(1, 2))
    return np.asarray(np.bincount(block, squares) / np.bincount(block) > FAR**2)


def transitions(lost: np.ndarray, block: np.ndarray, run: np.ndarray) -> np.ndarray:
    """How often followed and lost blocks come after followed ones (first row) and lost ones [2, 2].

    Args:
        lost: [blocks] (bool); block, run: of each window [windows]. A run begins as if after driving that is followed.
    """
    run = run[np.unique(block, return_index=True)[1]]
    before = np.concatenate([[False], lost[:-1] & (run[1:] == run[:-1])])
    return np.array([[np.count_nonzero((before == b) & (lost == now)) for now in (False, True)] for b in (False, True)])


def as_often(counts: np.ndarray, baseline: np.ndarray) -> bool:
    """Whether a log and its baseline, which has lost blocks, are more probable with the same chances of them.

    Lost blocks come in stretches, so that one is little evidence after the one before: the Bayes factor is that of two
    Markov chains of first order against one, with Jeffreys' prior of each row (Good 1950; Anderson and Goodman 1957).

    Args:
        counts, baseline: transitions [2, 2] of the log and of the baseline (`transitions`).
    """
    if not counts[:, 1].any() or not counts[:, 0].any() or not baseline[:, 1].any():
        return False

    def log_likelihood(of: np.ndarray) -> float:
        return float(np.sum(betaln(JEFFREYS + of[:, 0], JEFFREYS + of[:, 1]) - betaln(JEFFREYS, JEFFREYS)))

    return log_likelihood(counts + baseline) > log_likelihood(counts) + log_likelihood(baseline)
