"""Single readings that cannot be right (text, absurd numbers, times out of order): left out, with a sentence."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from drift_drake.logs.importing.formats.files import InvalidRecordingError
from drift_drake.logs.plausible import ABSURD, LARGEST

Array = NDArray[np.float64]

MOST = 0.02  # share of a column's readings: more are no slips, and the column is refused
SHOWN = 3  # rows named in a sentence


def numbers_of(path: Path, values: "pd.Series[Any]") -> tuple[Array, dict[int, str]]:
    """A column as numbers [n] (NaN: no reading), and by row what stood where no number was.

    Raises:
        InvalidRecordingError: more than a few readings are no numbers.
    """
    numbers = pd.to_numeric(values, errors="coerce")
    text = np.flatnonzero(numbers.isna() & values.notna())
    if len(text) > max(1, MOST * len(values)):
        row = int(text[0])
        raise InvalidRecordingError(
            f"{path}: column '{values.name}' holds {values.iloc[row]!r} in row {row + 2}, and no number in "
            f"{len(text)} of {len(values)} rows; numbers or nothing belong there"
        )
    out = np.array(numbers, dtype=float)
    infinite = np.flatnonzero(np.isinf(out))
    out[infinite] = np.nan
    return out, {int(row): repr(values.iloc[row]) for row in [*text, *infinite]}


def without_absurd(name: str, values: Array) -> tuple[Array, NDArray[np.int64]]:
    """Values [SI] without single ones that no car has in any unit, and where those were."""
    there = np.isfinite(values)
    if name not in {"r", *LARGEST}:
        return values, np.empty(0, dtype=np.int64)
    absurd = np.flatnonzero(there & (np.abs(np.where(there, values, 0.0)) > ABSURD))
    if len(absurd) > max(1, MOST * np.count_nonzero(there)):
        return values, np.empty(0, dtype=np.int64)  # another unit, or no such quantity: for the checks to say
    return np.where(np.isin(np.arange(len(values)), absurd), np.nan, values), absurd


def without_glitches(t: Array) -> tuple[NDArray[np.int64], list[int]]:
    """Ticks to keep of times [n], and those to leave out so that the rest advances; all kept where they are many."""
    kept = list(range(len(t)))
    dropped: list[int] = []
    for _ in range(max(1, round(MOST * len(t)))):
        times = t[kept]
        back = np.flatnonzero(np.diff(times) < 0.0)
        if not len(back):
            return np.array(kept, dtype=np.int64), dropped
        i = int(back[0])
        late_fits = i + 2 >= len(times) or times[i + 2] >= times[i]
        dropped.append(kept.pop(i + 1 if late_fits else i))
    if len(dropped) and np.any(np.diff(t[kept]) < 0.0):
        return np.arange(len(t)), []
    return np.array(kept, dtype=np.int64), dropped


def left_out(column: str, bad: Mapping[int, str], rows: NDArray[np.int64], t: Array) -> list[str]:
    """A sentence on the readings of a column that were left out, with their times.

    Args:
        bad: what stood there, by row of the topic; rows, t: the rows of the clock's ticks, and their times [s].
    """
    if not bad:
        return []
    times = np.interp(sorted(bad), rows, t - t[0])
    shown = [f"{bad[row]} at {time:.3f} s" for row, time in zip(sorted(bad)[:SHOWN], times, strict=False)]
    more = f" and {len(bad) - SHOWN} more" if len(bad) > SHOWN else ""
    count = "a reading was" if len(bad) == 1 else f"{len(bad)} readings were"
    return [f"{count} left out of '{column}': {', '.join(shown)}{more} after the first reading."]
