"""The same run several times over: it counts once."""

from collections.abc import Sequence

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
    kept: list[int] = []
    same: dict[int, list[int]] = {}
    for i in order:
        whole = next((k for k in kept if is_part(runs[i], runs[k])), None)
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


def is_part(one: Run, other: Run) -> bool:
    """Whether all rows of a run are rows of another one, in order: whenever, and rounded differently."""
    names = [name for name in COMPARED if one.column(name) is not None and other.column(name) is not None]
    a = np.stack([np.asarray(one.column(name)) for name in names])
    b = np.stack([np.asarray(other.column(name)) for name in names])
    if a.shape[1] > b.shape[1] or max(np.ptp(a[0]), np.ptp(a[1])) < LEAST:
        return False
    close = np.maximum(np.ptp(b, axis=1), 1e-9)
    rounding = np.array([max(step(one), step(other)) for one, other in zip(a, b, strict=True)])
    close *= np.clip(ROUNDED * rounding / close, ALIKE, COARSEST)
    middle = a.shape[1] // 2
    last = b.shape[1] - a.shape[1]
    at = b[:, middle : middle + last + 1]
    starts = np.flatnonzero(np.all(np.abs(at - a[:, middle : middle + 1]) <= close[:, None], axis=0))
    return any(np.all(np.abs(b[:, start : start + a.shape[1]] - a) <= close[:, None]) for start in starts)
