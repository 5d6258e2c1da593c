"""What is normal for a car that the simulator's equations do not follow exactly: how scores scatter on its own logs.

Scores of white innovations have the information as covariance. A real car's scatter more, and not in every direction
alike: what they scatter beyond, by roots of information, is the excess that widens the monitor's scores wherever it
judges (compare `estimation.scores`, which does the same for a diagnosis of another day).
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.logs.plausible import ABSURD
from drift_drake.logs.table import Run
from drift_drake.monitoring import bank as filters
from drift_drake.monitoring.gate import allowance, gated_row
from drift_drake.monitoring.history import Sums, no_sums
from drift_drake.monitoring.monitor import Monitor, lost, row_counts, with_row
from drift_drake.monitoring.watch import rows_of

BLOCK = 2.0  # [s]
SHRUNK, SHRUNK_AT = 0.3, 24  # towards a diagonal, with so many blocks
OTHER_DRIVES = 4.0  # by how much scores scatter more on other drives than between blocks of those that were learnt from
LEAST = 4  # blocks


def block_sums(monitor: Monitor, run: Run) -> list[Sums]:
    """Sums of the full blocks of a run."""
    n, state, out = len(monitor.problem.nodes), filters.make_state(monitor.bank), list[Sums]()
    block, begun, left = no_sums(n), 0, allowance(monitor.bank)  # begun: rows since the bank's first one
    for row in rows_of(run):
        used = monitor.used & (np.abs(row.y) < ABSURD)
        y = np.where(used, row.y, 0.0)
        if begun == 0:
            filters.start_bank(y, used, row.command, monitor.bank, state)
            begun = 1
            continue
        state, e, left = gated_row(monitor.bank, state, left, y, used, row.command)
        if lost(state):
            state, begun, left = filters.make_state(monitor.bank), 0, allowance(monitor.bank)
            continue
        if e is not None and row_counts(monitor, begun, state):
            block = with_row(block, e, used)
        begun += 1
        if block.rows * monitor.bank.period >= BLOCK:
            out, block = [*out, block], no_sums(n)
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
