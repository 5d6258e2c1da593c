"""How much wider intervals are than those of white innovations: the scatter of the score over blocks of time.

Smoothed sensors and what the model lacks make innovations that hang together for long; their score then scatters more
from block to block than the information matrix says (the sandwich of Huber 1967, over blocks as in Liu and Singh 1992).
"""

from collections.abc import Sequence

import numpy as np

from drift_drake.estimation.derivatives import Derivatives
from drift_drake.estimation.run_data import RunData

SHORT_BLOCK = 1.0  # [s]
BLOCKS = 24  # that the longer ones leave of all runs


def block_lengths(runs: Sequence[RunData]) -> list[int]:
    """Rows of a short and of a longer block."""
    period = runs[0].period
    duration = sum(int(np.sum(run.counted)) for run in runs) * period
    return [max(round(block / period), 1) for block in (SHORT_BLOCK, max(duration / BLOCKS, SHORT_BLOCK))]


def squared_influence(
    run: RunData, own: np.ndarray, columns: np.ndarray, e: np.ndarray, covariance: np.ndarray, lengths: Sequence[int]
) -> np.ndarray:
    """Squares, summed over the blocks of one run, of what each block moves the parameters by [lengths, n].

    Args:
        own: derivatives of the run's innovations that count by the parameters in `columns` [count, columns]; e: those
            innovations [count]; covariance: of all parameters [n, n].
    """
    score = (own * e[:, None]).reshape(np.sum(run.counted), np.sum(run.used), -1).sum(axis=1)
    influence = score @ covariance[columns]
    if not len(influence):
        return np.zeros((len(lengths), len(covariance)))
    sums = [np.add.reduceat(influence, np.arange(0, len(influence), length)) for length in lengths]
    return np.array([np.sum(part**2, axis=0) for part in sums])


def deviation_factors(covariance: np.ndarray, information: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Factors of at least one [n] on the standard deviations of the parameters.

    What a prior alone holds is not widened: only what the logs tell is told less well.

    Args:
        covariance: without this [n, n]; information: J'J of the logs [n, n]; squares: `squared_influence` of all runs.
    """
    variance = np.diag(covariance)
    unseen = np.maximum(variance - np.diag(covariance @ information @ covariance), 0.0)
    return np.asarray(np.maximum(np.sqrt((unseen + squares.max(axis=0)) / variance), 1.0))


def widening(runs: Sequence[RunData], jacobian: Derivatives, e: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """The same from derivatives of all runs.

    Args:
        jacobian: of the whitened innovations that count; e: those [count]; covariance: without this [n, n].
    """
    parts = zip(runs, jacobian.blocks, jacobian.columns, jacobian.by_run(e), strict=True)
    lengths = block_lengths(runs)
    squares = sum(squared_influence(*part, covariance, lengths) for part in parts)
    return deviation_factors(covariance, jacobian.information, np.asarray(squares))
