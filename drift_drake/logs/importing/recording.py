"""A recorder's table as the mapping reads it: clocks in seconds, signals in SI and ISO 8855, each on its own clock."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from drift_drake.logs.importing.frames import to_iso8855
from drift_drake.logs.importing.mapping import Clock, RecorderMapping, Signal
from drift_drake.logs.importing.units import factor
from drift_drake.logs.table import InvalidLogError

Array = NDArray[np.float64]

WRAPPED = ("psi", "beta")  # angles that a recorder may report modulo a turn


class InvalidRecordingError(InvalidLogError):
    """A recording that cannot be used; the message names the file, the place and the mend."""


@dataclasses.dataclass(frozen=True)
class Readings:
    """The ticks of one clock: times [n] [s], the table's rows they stand in, and the signals read then [n]."""

    t: Array
    rows: NDArray[np.int64]
    signals: dict[str, Array]

    @property
    def period(self) -> float:
        """Median time between ticks [s]."""
        return float(np.median(np.diff(self.t)))

    def seen(self, name: str) -> tuple[Array, Array]:
        """Times and values of a signal where it was read."""
        there = np.isfinite(self.signals[name])
        return self.t[there], self.signals[name][there]


@dataclasses.dataclass(frozen=True)
class Recording:
    """All readings of a file, by clock, the log's clock first. Missing readings are NaN."""

    name: str
    clocks: dict[str, Readings]


def read_recording(path: str | Path, mapping: RecorderMapping) -> Recording:
    """Reads a CSV or Parquet file.

    Raises:
        InvalidRecordingError: unreadable or empty, a column is missing or is no numbers, a clock that does not advance.
    """
    path = Path(path)
    table = _table(path)
    wanted = [clock.column for clock in mapping.clocks.values()] + [s.column for s in mapping.signals.values()]
    missing = sorted(set(wanted) - set(table.columns))
    if missing:
        raise InvalidRecordingError(
            f"{path}: missing column '{missing[0]}'; its columns are {', '.join(map(str, table.columns))}"
        )
    columns = {name: _numbers(path, table[name]) for name in set(wanted)}
    clocks = {}
    for name, clock in mapping.clocks.items():
        t, rows = _ticks(path, clock, columns)
        values = {
            key: _si(key, signal, columns[signal.column][rows], mapping.frame)
            for key, signal in mapping.signals.items()
            if signal.clock == name
        }
        clocks[name] = Readings(t, rows, values)
    for key, signal in mapping.signals.items():
        if not np.any(np.isfinite(clocks[signal.clock].signals[key])):
            raise InvalidRecordingError(
                f"{path}: column '{signal.column}' holds no readings; take it out of the mapping"
            )
    return Recording(path.stem, clocks)


def _table(path: Path) -> pd.DataFrame:
    try:
        table = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path, low_memory=False)
    except FileNotFoundError:
        raise InvalidRecordingError(f"{path}: no such file; give recordings as CSV or Parquet") from None
    except pd.errors.EmptyDataError:
        raise InvalidRecordingError(f"{path}: the file is empty; a recording needs a header and rows") from None
    except ImportError:
        raise InvalidRecordingError(
            f"{path}: Parquet needs pyarrow; install it with pip install 'drift_drake[parquet]'"
        ) from None
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise InvalidRecordingError(f"{path}: cannot be read as a table ({reason}); give CSV or Parquet") from None
    table.columns = [str(name).strip() for name in table.columns]
    if len(table) == 0:
        raise InvalidRecordingError(f"{path}: the file has a header and no rows; give a recording with readings")
    return table


def _numbers(path: Path, values: "pd.Series[Any]") -> Array:
    numbers = pd.to_numeric(values, errors="coerce")
    text = np.flatnonzero(numbers.isna() & values.notna())
    if len(text):
        row = int(text[0])
        raise InvalidRecordingError(
            f"{path}: column '{values.name}' holds {values.iloc[row]!r} in row {row + 2}; "
            "numbers or nothing belong there"
        )
    return np.asarray(numbers, dtype=float)


def _ticks(path: Path, clock: Clock, columns: Mapping[str, Array]) -> tuple[Array, NDArray[np.int64]]:
    t = columns[clock.column] * factor(clock.unit)
    running = np.isfinite(t)
    if clock.blank is not None:
        running &= columns[clock.column] != clock.blank
    rows = np.flatnonzero(running)
    rows = rows[np.diff(t[rows], prepend=np.nan) != 0.0]
    t = t[rows]
    if len(t) < 2:
        raise InvalidRecordingError(f"{path}: the clock '{clock.column}' never advances; name the column of times")
    back = np.flatnonzero(np.diff(t) < 0.0)
    if len(back):
        row = int(rows[back[0] + 1])
        raise InvalidRecordingError(
            f"{path}: the clock '{clock.column}' goes backwards in row {row + 2} "
            f"(by {t[back[0]] - t[back[0] + 1]:g} s); sort the rows or split the file there"
        )
    return (regular_times(t) if clock.regular else t), rows


def regular_times(t: Array) -> Array:
    """Times of readings taken at a fixed rate, from jittering times of arrival: whole periods on a fitted line."""
    counts = np.cumsum(np.maximum(1.0, np.round(np.diff(t, prepend=t[0]) / np.median(np.diff(t)))))
    slope, start = np.polyfit(counts - counts[0], t - t[0], 1)
    return np.asarray(t[0] + start + slope * (counts - counts[0]))


def _si(name: str, signal: Signal, values: Array, frame: str) -> Array:
    values = values * factor(signal.unit) * (signal.radius or 1.0)
    if name in WRAPPED:
        seen = np.isfinite(values)
        values[seen] = np.unwrap(values[seen])
    values = to_iso8855(name, signal.sign * signal.scale * values, signal.frame or frame)
    return np.asarray(values + signal.offset)
