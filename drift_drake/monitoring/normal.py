"""What is normal for a car that the simulator's equations do not follow exactly: how scores scatter on its own logs.

Scores of white innovations have the information as covariance. A real car's scatter more, and not in every direction
alike: what they scatter beyond, by roots of information, is the excess that widens the monitor's scores wherever it
judges (compare `estimation.scores`, which does the same for a diagnosis of another day).
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.logs.table import Run
from drift_drake.monitoring.history import Sums, no_sums
from drift_drake.monitoring.monitor import Monitor, row_taken
from drift_drake.monitoring.watch import rows_of

BLOCK = 2.0  # [s]
SHRUNK, SHRUNK_AT = 0.3, 24  # towards a diagonal, with so many blocks
OTHER_DRIVES = 4.0  # by how much scores scatter more on other drives than between blocks of those that were learnt from
LEAST = 4  # blocks


def block_sums(monitor: Monitor, run: Run) -> list[Sums]:
    """Sums of the full blocks of a run."""
    state, out = monitor.start(), list[Sums]()
    for row in rows_of(run):
        state = row_taken(monitor, state, row.y, row.command)
        if state.block.rows * monitor.bank.period >= BLOCK:
            out.append(state.block)
            state = state._replace(block=no_sums(len(monitor.problem.nodes)))
    return out


def excess_of(blocks: Sequence[Sums]) -> np.ndarray:
    """Covariance [n, n] of blocks' scores beyond their information, by roots of information; symmetric, none below 0.

    Raises:
        ValueError: too few blocks.
    """
    if len(blocks) < LEAST:
        raise ValueError(f"{len(blocks)} blocks; give at least {LEAST * BLOCK:g} s of normal driving")
    root = np.sqrt([np.maximum(np.diag(block.information), 1e-12) for block in blocks])
    score = np.array([block.score for block in blocks]) / root
    white = np.mean([block.information / np.outer(r, r) for block, r in zip(blocks, root, strict=True)], axis=0)
    found = score.T @ score / len(blocks)
    shrink = min(SHRUNK * SHRUNK_AT / len(blocks), 0.9)
    found = (1.0 - shrink) * found + shrink * np.diag(np.diag(found))
    values, vectors = np.linalg.eigh(found - white)
    return np.asarray(OTHER_DRIVES * (vectors * np.maximum(values, 0.0)) @ vectors.T)


def with_normal(monitor: Monitor, runs: Sequence[Run]) -> Monitor:
    """The monitor of a car whose normal drives are `runs`."""
    blocks = [block for run in runs for block in block_sums(monitor, run)]
    return dataclasses.replace(monitor, problem=monitor.problem._replace(excess=excess_of(blocks)))
