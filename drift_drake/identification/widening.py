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


def scores(runs: Sequence[RunData], jacobian: Derivatives, e: np.ndarray) -> list[np.ndarray]:
    """Derivative of half the squared innovations by the parameters [rows, columns], row by row of each run."""
    parts = zip(runs, jacobian.blocks, jacobian.by_run(e), strict=True)
    return [
        (block * part[:, None]).reshape(np.sum(run.counted), np.sum(run.used), -1).sum(axis=1)
        for run, block, part in parts
    ]


def widening(runs: Sequence[RunData], jacobian: Derivatives, e: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Factors of at least one [n] on the standard deviations of the parameters.

    What a prior alone holds is not widened: only what the logs tell is told less well.

    Args:
        jacobian: of the whitened innovations that count; e: those [count]; covariance: without this [n, n].
    """
    rows = scores(runs, jacobian, e)
    influence = [part @ covariance[columns] for part, columns in zip(rows, jacobian.columns, strict=True)]
    expected = np.diag(covariance @ jacobian.information @ covariance)
    duration = sum(len(part) for part in rows) * runs[0].period
    variance = np.diag(covariance)
    widest = np.ones(len(covariance))
    for block in (SHORT_BLOCK, max(duration / BLOCKS, SHORT_BLOCK)):
        length = max(round(block / runs[0].period), 1)
        sums = [np.add.reduceat(part, np.arange(0, len(part), length)) for part in influence if len(part)]
        found = np.sum(np.concatenate(sums) ** 2, axis=0)
        widest = np.maximum(widest, np.sqrt((np.maximum(variance - expected, 0.0) + found) / variance))
    return widest
