"""How much wider intervals are than those of white innovations: the scatter of the score over blocks of time.

Smoothed sensors and what the model lacks make innovations that hang together for long; their score then scatters more
from block to block than the information matrix says (the sandwich of Huber 1967, over blocks as in Liu and Singh 1992).
"""

from collections.abc import Sequence

import numpy as np

from drift_drake.estimation.run_data import RunData

SHORT_BLOCK = 1.0  # [s]
BLOCKS = 24  # that the longer ones leave of all runs


def scores(runs: Sequence[RunData], jacobian: np.ndarray, e: np.ndarray) -> list[np.ndarray]:
    """Derivative of half the squared innovations by the parameters [rows, n], row by row of each run."""
    out, at = [], 0
    for run in runs:
        rows, channels = int(np.sum(run.counted)), int(np.sum(run.used))
        part = slice(at, at + rows * channels)
        out.append((jacobian[part] * e[part, None]).reshape(rows, channels, -1).sum(axis=1))
        at += rows * channels
    return out


def widening(runs: Sequence[RunData], jacobian: np.ndarray, e: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Factors of at least one [n] on the standard deviations of the parameters.

    What a prior alone holds is not widened: only what the logs tell is told less well.

    Args:
        jacobian: of the whitened innovations that count [count, n]; e: those [count]; covariance: without this.
    """
    rows = scores(runs, jacobian, e)
    influence = [part @ covariance for part in rows]
    expected = np.diag(covariance @ (jacobian.T @ jacobian) @ covariance)
    duration = sum(len(part) for part in rows) * runs[0].period
    variance = np.diag(covariance)
    widest = np.ones(len(covariance))
    for block in (SHORT_BLOCK, max(duration / BLOCKS, SHORT_BLOCK)):
        length = max(round(block / runs[0].period), 1)
        sums = [np.add.reduceat(part, np.arange(0, len(part), length)) for part in influence if len(part)]
        found = np.sum(np.concatenate(sums) ** 2, axis=0)
        widest = np.maximum(widest, np.sqrt((np.maximum(variance - expected, 0.0) + found) / variance))
    return widest
