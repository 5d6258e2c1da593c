"""The same run several times over: it counts once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.log.table import Run
from drift_drake.gap.logs.noise import step

ALIKE, COARSEST = 1e-3, 0.02  # of a column's range that rounding may move a reading by, at least and at most
ROUNDED = 0.6  # of a step of the coarser numbers, that rounding may
COMPARED = ("r", "v", "delta_cmd", "omega_r", "ay", "beta")
LEAST = 0.02  # [1] of speed and [rad/s] that a run has to vary by, to be distinguished from another that does nothing


def without_repeated(runs: Sequence[Run]) -> tuple[list[Run], list[str]]:
    """The runs without those that are rows of another one, and a sentence on these."""
    order = sorted(range(len(runs)), key=lambda i: (-len(runs[i]), i))
    columns = [compared_columns(run) for run in runs]
    kept: list[int] = []
    same: dict[int, list[int]] = {}
    for i in order:
        whole = next((k for k in kept if is_part(columns[i], columns[k])), None)
        if whole is None:
            kept.append(i)
        else:
            same.setdefault(whole, []).append(i)
    sentences = [
        f"{', '.join(runs[i].name for i in sorted(parts))} {'is' if len(parts) == 1 else 'are'} rows of "
        f"{runs[whole].name} once more: counted once"
        for whole, parts in sorted(same.items())
    ]
    return [runs[i] for i in sorted(kept)], sentences


class ComparedColumns(NamedTuple):
    """Columns of a run that are compared."""

    values: np.ndarray  # [COMPARED, rows], NaN where there are none
    there: np.ndarray  # [COMPARED] bool
    ranges: np.ndarray  # [COMPARED]
    steps: np.ndarray  # [COMPARED] that they are rounded to


def compared_columns(run: Run) -> ComparedColumns:
    """Of one run, once: steps take long."""
    columns = [run.column(name) for name in COMPARED]
    values = np.stack([np.full(len(run), np.nan) if column is None else np.asarray(column) for column in columns])
    steps = [0.0 if column is None else step(np.asarray(column)) for column in columns]
    there = np.array([column is not None for column in columns])
    return ComparedColumns(values, there, np.ptp(values, axis=1), np.array(steps))


def is_part(one: ComparedColumns, other: ComparedColumns) -> bool:
    """Whether all rows of a run are rows of another one, in order: whenever, and rounded differently."""
    rows, both = one.values.shape[1], one.there & other.there
    if rows > other.values.shape[1] or max(one.ranges[both][:2]) < LEAST:
        return False
    a, b, close = one.values[both], other.values[both], np.maximum(other.ranges[both], 1e-9)
    rounding = np.maximum(one.steps, other.steps)[both]
    close *= np.clip(ROUNDED * rounding / close, ALIKE, COARSEST)
    middle = rows // 2
    at = b[:, middle : middle + b.shape[1] - rows + 1]
    starts = np.flatnonzero(np.all(np.abs(at - a[:, middle : middle + 1]) <= close[:, None], axis=0))
    return any(np.all(np.abs(b[:, start : start + rows] - a) <= close[:, None]) for start in starts)
