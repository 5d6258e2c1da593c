"""The part of a long recording in which most moves, which is enough to compare its columns by."""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pandas.api.types import is_numeric_dtype

from drift_drake.common.arrays import Array
from drift_drake.gap.logs.importing.clocks import by_clock, clock_of, numbers_of_column, seconds, with_numbers
from drift_drake.gap.logs.importing.formats.topics import Topic

BIN = 10.0  # [s] within which a column varies


class Excerpt(NamedTuple):
    """A part of a recording: from `start` to `end` after its first reading [s] (endless: all); cut: whether the topics
    have its rows alone, as they do where each has one clock."""

    topics: list[Topic]
    start: float
    end: float
    cut: bool

    @property
    def own(self) -> tuple[float, float]:
        """The part's start and end after the topics' first reading [s]."""
        return (0.0, math.inf) if self.cut else (self.start, self.end)


def excerpt(topics: Sequence[Topic], length: float, start: float = 0.0, end: float = math.inf) -> Excerpt:
    """The `length` seconds between `start` and `end` in which the columns of numbers vary most.

    Args:
        length, start, end: [s], the latter after the recording's first reading.
    """
    read = [with_numbers(topic) for topic in topics]
    clocks = [clock_of(topic) for topic in read]
    times = [seconds(topic, clock) for topic, clock in zip(read, clocks, strict=True) if clock is not None]
    if len(times) < len(read) or any(len(by_clock(topic)) > 1 or not np.isfinite(t).any()
                                     for topic, t in zip(read, times, strict=True)):  # fmt: skip
        return Excerpt(list(topics), start, min(end, start + length), cut=False)
    first = [float(np.nanmin(t)) for t in times]
    last = max(float(np.nanmax(t)) - a for t, a in zip(times, first, strict=True))
    # Clocks that begin at about the same time count alike.
    times = [t - (first[0] if abs(a - first[0]) < last else a) for t, a in zip(times, first, strict=True)]
    end = min(end, last)
    if start <= 0.0 and last <= min(end, length):
        return Excerpt(list(topics), 0.0, math.inf, cut=False)
    if end - start > length:
        begins = np.arange(start, end - length + 0.5 * BIN, BIN)
        start = float(begins[np.argmax(_moved(read, times, begins, length))])
        end = start + length
    kept = [_cut(topic, (t >= start) & (t <= end)) for topic, t in zip(topics, times, strict=True)]
    return Excerpt(kept, start, end, cut=True)


def _moved(topics: Sequence[Topic], times: Sequence[Array], begins: Array, length: float) -> Array:
    """How much all columns vary within the parts that begin there [n]: the mean of their shares of the whole."""
    found = np.zeros(len(begins))
    for topic, t in zip(topics, times, strict=True):
        there = np.isfinite(t) & (t >= begins[0])
        places = ((t[there] - begins[0]) / BIN).astype(np.int64)
        for column in map(str, topic.table.columns):
            if is_numeric_dtype(topic.table[column]):
                within = _variation(places, numbers_of_column(topic, column)[there])
                summed = np.concatenate([[0.0], np.cumsum(within)])
                last = np.minimum(np.arange(len(begins)) + round(length / BIN), len(within))
                found += summed[last] - summed[np.minimum(np.arange(len(begins)), len(within))]
    return found


def _variation(places: NDArray[np.int64], values: Array) -> Array:
    """Standard deviation within each bin [n], of which the sum is one (none where a column stands still)."""
    seen = np.isfinite(values)
    if not seen.any():
        return np.zeros(1)
    at, q = places[seen], values[seen] - np.mean(values[seen])
    count = np.maximum(np.bincount(at), 1)
    variance = np.bincount(at, q * q) / count - (np.bincount(at, q) / count) ** 2
    size = np.sqrt(np.maximum(variance, 0.0))
    total = float(np.sum(size))
    return np.asarray(size / total if total > 0.0 else size)


def _cut(topic: Topic, kept: NDArray[np.bool_]) -> Topic:
    rows = np.flatnonzero(kept)
    part = slice(int(rows[0]), int(rows[-1]) + 1) if len(rows) else slice(0, 0)
    return dataclasses.replace(topic, table=topic.table.iloc[part].copy(), first_line=topic.first_line + part.start)
