"""What recordings hold, read once and kept: topics of those last looked at, summaries and thumbnails of all."""

import dataclasses
import threading
from collections import OrderedDict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError
from drift_drake.view.pages.charts import decimated

if TYPE_CHECKING:  # slow to import: the workbench opens before they are
    from drift_drake.gap.logs.importing.excerpt import Excerpt
    from drift_drake.gap.logs.importing.formats.topics import Topic
    from drift_drake.gap.logs.importing.look import Look

KEPT = 2  # recordings whose columns stay in memory
MOST_THUMBS = 60
POINTS = 120  # of a thumbnail, across
GAP = 5.0  # usual steps of a clock


@dataclasses.dataclass(frozen=True)
class Thumb:
    """A column's course in a small picture: points [n] of equal spacing, NaN where nothing was read."""

    column: str
    unit: str
    low: float | None
    high: float | None
    values: list[float | None]


@dataclasses.dataclass(frozen=True)
class Summary:
    """A recording: what it holds, its gaps by topic, thumbnails; or why it cannot be read."""

    refused: str
    found: "Look | None" = None
    gaps: dict[str, int] = dataclasses.field(default_factory=dict)
    thumbs: list[Thumb] = dataclasses.field(default_factory=list)


class Recordings:
    """Recordings of a folder as they were read last."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._lock = folder, threading.Lock()
        self._topics: OrderedDict[tuple[str, int, int], list[Topic]] = OrderedDict()
        self._summaries: dict[tuple[str, int, int], Summary] = {}
        self._excerpts: OrderedDict[tuple[object, ...], Excerpt] = OrderedDict()

    def topics(self, name: str) -> "list[Topic]":
        """What a recording holds; raises InvalidRecordingError where it cannot be read."""
        from drift_drake.gap.logs.importing.recording import topics_of

        key = self._key(name)
        with self._lock:
            if key not in self._topics:
                self._topics[key] = topics_of(self._folder / name)
                while len(self._topics) > KEPT:
                    self._topics.popitem(last=False)
            self._topics.move_to_end(key)
            return self._topics[key]

    def excerpt(self, name: str, *part: float) -> "Excerpt":
        """What is looked at of a recording at once (`importing.excerpt`); part: length, start, end [s]."""
        from drift_drake.gap.logs.importing.excerpt import excerpt

        key = *self._key(name), *part
        found = self._excerpts.get(key) or excerpt(self.topics(name), *part)
        with self._lock:  # two windows may ask at once
            self._excerpts[key] = found
            while len(self._excerpts) > KEPT:
                self._excerpts.popitem(last=False)
        return found

    def summary(self, name: str) -> Summary:
        """Rates, gaps and thumbnails of a recording."""
        from drift_drake.gap.logs.importing.look import look

        try:
            key = self._key(name)
            if key not in self._summaries:
                topics = self.topics(name)
                self._summaries[key] = _summary(look(self._folder / name, read=topics), topics)
        except DriftDrakeError as error:
            return Summary(str(error).replace(f"{self._folder}/", ""))
        except OSError as error:
            return Summary(f"{name}: cannot be read ({error.strerror})")
        return self._summaries[key]

    def signal(self, name: str, column: str) -> tuple[Array, Array]:
        """A column's readings [n] at times after the recording's first [n] [s] (rows, where there is no clock).

        Raises:
            InvalidRecordingError: it cannot be read; KeyError: it has no such column.
        """
        from drift_drake.gap.logs.importing.clocks import clock_of, numbers_of_column, seconds, with_numbers

        for topic in map(with_numbers, self.topics(name)):
            if column in topic.table:
                values, clock = numbers_of_column(topic, column), clock_of(topic)
                t = np.arange(float(len(values))) if clock is None else seconds(topic, clock)
                there = np.isfinite(t)
                return t[there] - t[there][:1], values[there]
        raise KeyError(column)

    def _key(self, name: str) -> tuple[str, int, int]:
        now = (self._folder / name).stat()
        return name, now.st_mtime_ns, now.st_size


def _summary(found: "Look", topics: "list[Topic]") -> Summary:
    from drift_drake.gap.logs.importing.clocks import clock_of, numbers_of_column, seconds, with_numbers

    gaps, thumbs = {}, []
    for topic, said in zip((with_numbers(one) for one in topics), found.topics, strict=True):
        clock = clock_of(topic)
        steps = np.diff(seconds(topic, clock)) if clock is not None else np.empty(0)
        gaps[topic.name] = int(np.count_nonzero(steps > GAP * np.median(steps))) if len(steps) else 0
        for column in said.columns[:MOST_THUMBS]:
            if column.low is not None and column.name != clock:
                values = numbers_of_column(topic, column.name)
                _, small = decimated(np.arange(float(len(values))), values, POINTS)
                kept = [float(q) if np.isfinite(q) else None for q in small]
                thumbs.append(Thumb(column.name, column.unit, column.low, column.high, kept))
    return Summary("", found, gaps, thumbs)
