"""Readings of any clock on the log's rows."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PERIOD = 0.01  # [s] of the log


def rows_between(start: float, end: float) -> Array:
    """The log's times [s] from start to end: whole multiples of its period."""
    first, last = int(np.ceil(start / PERIOD - 1e-6)), int(np.floor(end / PERIOD + 1e-6))
    return np.asarray(np.arange(first, last + 1) * PERIOD, dtype=float)


def resample(rows: Array, t: Array, values: Array, between: str = "linear") -> Array:
    """Values read at times t [s] on the log's rows [s]: on a line between two readings, or held until the next."""
    if between == "hold":
        return np.asarray(values[np.clip(np.searchsorted(t, rows, side="right") - 1, 0, len(t) - 1)])
    return np.asarray(np.interp(rows, t, values))
