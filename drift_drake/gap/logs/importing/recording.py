"""A recorder's table as the mapping reads it: clocks in seconds, signals in SI and ISO 8855, each on its own clock."""

import dataclasses
import difflib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from drift_drake.car.log.numbers import MEASURABLE, as_numbers
from drift_drake.car.log.plausible import ABSURD, LARGEST
from drift_drake.common.apart import read_guarded
from drift_drake.common.arrays import Array
from drift_drake.common.units import PACKED, unit_of
from drift_drake.gap.logs.importing.clocks import own_name, packed_doubts
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError, read_topics
from drift_drake.gap.logs.importing.formats.times import clock_seconds
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.handedness import is_compass, passes_north
from drift_drake.gap.logs.importing.known import POSITION
from drift_drake.gap.logs.importing.mapping import Clock, RecorderMapping, Signal
from drift_drake.gap.logs.importing.names import stated_unit
from drift_drake.gap.logs.importing.position import projected
from drift_drake.gap.logs.wording.conversion import dimension, dimensions_of, factor, to_iso8855

Rows = NDArray[np.int64]

WRAPPED = ("psi", "beta", "course")  # angles that a recorder may report modulo a turn
MOST_LISTED = 40  # columns in a message
MOST_BAD = 0.02  # share of a column's readings: more are no slips, and the column is refused
SHOWN = 3  # rows named in a sentence
LONGEST_STEP = 0.2  # [s] between readings that a run bridges


@dataclasses.dataclass(frozen=True)
class Readings:
    """The ticks of one clock: times [n] [s], the rows of their topic, and the signals read then [n]."""

    t: Array
    rows: Rows
    signals: dict[str, Array]
    topic: str = ""

    @property
    def period(self) -> float:
        """Median time between readings [s]."""
        return float(np.median(np.diff(self.t[_read_rows(self.signals, len(self.t))])))

    def seen(self, name: str) -> tuple[Array, Array]:
        """Times and values of a signal where it was read."""
        there = np.isfinite(self.signals[name])
        return self.t[there], self.signals[name][there]


@dataclasses.dataclass(frozen=True)
class Recording:
    """All readings of a file, by clock, the log's clock first. Missing readings are NaN."""

    name: str
    clocks: dict[str, Readings]
    remarks: list[str] = dataclasses.field(default_factory=list)


def read_recording(
    path: str | Path, mapping: RecorderMapping, databases: Sequence[str | Path] = (),
    topics: Sequence[Topic] | None = None,
) -> Recording:  # fmt: skip
    """Reads a recorder's file; a reading that cannot be one is left out and reported.

    topics: what the file holds, where it has been read already.

    Raises:
        InvalidRecordingError: unreadable or empty, a column is missing or is no numbers, a clock that does not advance.
    """
    path = Path(path)
    topics = topics_of(path, databases) if topics is None else topics
    clocks, remarks = {}, []
    for name, clock in mapping.clocks.items():
        read_by = (signal.column for signal in mapping.signals.values() if signal.clock == name)
        topic = _topic_of(path, topics, clock.column if clock.rate is None else next(read_by))
        t, rows, wrong = _ticks(path, clock, topic)
        remarks += wrong
        values = {}
        for key, signal in mapping.signals.items():
            if signal.clock == name:
                values[key], wrong = _signal(path, topics, topic, key, signal, rows, t, mapping.frame)
                remarks += wrong
        if set(values) >= POSITION:
            values["x"], values["y"] = projected(path, values.pop("latitude"), values.pop("longitude"))
        if name == mapping.first_clock:  # keeps its blank rows: by them others' rows have a time
            clocks[name] = Readings(t, rows, values, topic.name)
            _read_together(path, name, clocks[name])
        else:
            there = _read_rows(values, len(t))
            values = {key: signal[there] for key, signal in values.items()}
            clocks[name] = Readings(t[there], rows[there], values, topic.name)
    return Recording(path.stem, clocks, remarks)


def _read_rows(signals: Mapping[str, Array], count: int) -> NDArray[np.bool_]:
    """Which of a clock's ticks [n] are readings: those with a value; of a clock without signals all."""
    if not signals:
        return np.ones(count, dtype=bool)
    return np.asarray(np.any([np.isfinite(values) for values in signals.values()], axis=0))


def _read_together(path: Path, clock: str, readings: Readings) -> None:
    """Refuses signals of the log's clock that are read in rows of their own, each often enough."""
    seen = {name: np.isfinite(values) for name, values in readings.signals.items()}
    common = readings.t[np.all(list(seen.values()), axis=0)] if seen else readings.t
    if 2 * len(common) > len(readings.t):
        return
    if len(common) > 1 and np.median(np.diff(common)) <= LONGEST_STEP:
        return
    if all(np.count_nonzero(at) > 1 and np.median(np.diff(readings.t[at])) <= LONGEST_STEP for at in seen.values()):
        first, *others = seen
        raise InvalidRecordingError(
            f"{path}: {', '.join(others)} and {first} are read in rows of their own; give each a clock with the same "
            f"column of times, as 'import --look' does ('clock: {clock}_{others[-1]}')"
        )


def topics_of(path: Path, databases: Sequence[str | Path] = ()) -> list[Topic]:
    """All topics of a recorder's file, read in a process of its own where it is no text of moderate size.

    Raises:
        InvalidRecordingError: it cannot be read; reading it crashes, or takes too much memory or time.
    """
    return read_guarded(read_topics, path, InvalidRecordingError, tuple(databases))


def _topic_of(path: Path, topics: Sequence[Topic], column: str) -> Topic:
    """The topic that holds a column, named in full or, where that is unique, without the topic's name."""
    found = [topic for topic in topics if _full_name(topic, column)]
    exact = [topic for topic in found if column in topic.table]
    if len(exact or found) == 1:
        return (exact or found)[0]
    names = [str(name) for topic in topics for name in topic.table]
    unread = [
        reason for topic in topics for name, reason in topic.left_out.items() if column in (name, name.split(".")[-1])
    ]
    if unread and not found:
        raise InvalidRecordingError(
            f"{path}: column '{column}' holds no numbers ({unread[0]}); take it out of the mapping"
        )
    if found:
        raise InvalidRecordingError(
            f"{path}: column '{column}' is in several topics; write "
            + " or ".join(str(_full_name(topic, column)) for topic in found)
        )
    close = difflib.get_close_matches(column, names, 3)
    meant = f"did you mean {' or '.join(close)}? Its" if close else "its"
    listed = ", ".join(names[:MOST_LISTED]) + (", ..." if len(names) > MOST_LISTED else "")
    raise InvalidRecordingError(f"{path}: missing column '{column}'; {meant} columns are {listed}")


def _full_name(topic: Topic, column: str) -> str | None:
    if column in topic.table:
        return column
    full = f"{topic.name}.{column}"
    return full if topic.name and full in topic.table else None


def _signal(
    path: Path, topics: Sequence[Topic], of_clock: Topic, key: str, signal: Signal, rows: Rows, t: Array, frame: str
) -> tuple[Array, list[str]]:
    """Values [n] of a signal at its clock's ticks (NaN: no reading), and sentences on what was left out."""
    topic = of_clock if _full_name(of_clock, signal.column) else _topic_of(path, topics, signal.column)
    if topic is not of_clock and (topic.name or of_clock.name):
        raise InvalidRecordingError(
            f"{path}: column '{signal.column}' is in {topic.name or 'the file'}, and its clock '{signal.clock}' in "
            f"{of_clock.name or 'the file'}; give it a clock of its own topic"
        )
    column = str(_full_name(topic, signal.column))
    numbers, bad = numbers_of(path, topic.table[column], topic.first_line)
    values, absurd = without_absurd(key, _si(key, signal, numbers[rows], frame))
    if not np.any(np.isfinite(values)):
        raise InvalidRecordingError(f"{path}: column '{signal.column}' holds no readings; take it out of the mapping")
    reported = {int(row): found for row, found in bad.items()} | {
        int(rows[row]): f"{numbers[rows[row]]:g}" for row in absurd
    }
    doubts = contradicted(topic, column, signal.unit, f"signals.{key}.unit") if signal.scale == 1.0 else []
    if (signal.frame or frame) == "iso8855" and signal.sign == 1.0 and key in ("psi", "course"):
        name, degrees = own_name(topic, column), unit_of(signal.unit) == unit_of("deg")
        if is_compass(name, numbers[rows], degrees, key == "course"):
            sure = key == "psi" or passes_north(numbers[rows], degrees)
            said = "is a compass' heading, clockwise:" if sure else "may be a compass' heading: if it is clockwise,"
            doubts.append(f"'{column}' {said} it, and what turns with it, needs 'frame: ned'.")
    return values, doubts + left_out(signal.column, reported, rows, t)


def contradicted(topic: Topic, column: str, unit: str, key: str) -> list[str]:
    """A sentence where the file states another unit of a column than the mapping."""
    kind = dimension(unit)
    if kind is None:
        return []
    _, stated = stated_unit(column, topic.units.get(column, ""), kind)
    same = unit_of(stated.text, (kind,)) if stated is not None else None
    if stated is None or (same is not None and np.isclose(same.factor, factor(unit, (kind,)), rtol=1e-3)):
        return []
    if same is None and not (stated.sure and unit_of(stated.text)):
        return []
    if not stated.sure and re.search(r"[a-z][A-Z]$", column):  # the G of `axG` may be the centre of gravity
        return []
    return [f"the file states '{stated.text}' for column '{column}', and {key} is '{unit}': see which is right."]


def _ticks(path: Path, clock: Clock, topic: Topic) -> tuple[Array, Rows, list[str]]:
    if clock.rate is not None:
        rows = np.arange(len(topic.table))
        return rows / clock.rate, rows, []
    name = _full_name(topic, clock.column)
    numbers, bad = numbers_of(path, topic.table[name], topic.first_line)
    t = clock_seconds(numbers, clock.unit)
    running = np.isfinite(t)
    if clock.blank is not None:
        running &= numbers != clock.blank
    rows = np.flatnonzero(running)
    kept, backwards = without_glitches(t[rows])
    jumped = {int(rows[row]): f"a time out of order ({numbers[rows[row]]:.10g})" for row in backwards}
    rows = rows[kept]
    rows = rows[np.diff(t[rows], prepend=np.nan) != 0.0]
    t = t[rows]
    if len(t) < 2:
        raise InvalidRecordingError(f"{path}: the clock '{clock.column}' never advances; name the column of times")
    back = np.flatnonzero(np.diff(t) < 0.0)
    if len(back):
        row = int(rows[back[0] + 1])
        raise InvalidRecordingError(
            f"{path}: the clock '{clock.column}' goes backwards in row {row + topic.first_line} "
            f"(by {t[back[0]] - t[back[0] + 1]:g} s); sort the rows or split the file there"
        )
    sentences = left_out(clock.column, bad | jumped, rows, t)
    if clock.unit in PACKED:
        return (regular_times(t) if clock.regular else t), rows, sentences
    sentences += packed_doubts(clock.column, numbers)
    sentences += contradicted(topic, str(name), clock.unit, "its clock's unit")
    return (regular_times(t) if clock.regular else t), rows, sentences


def regular_times(t: Array) -> Array:
    """Times of readings taken at a fixed rate, from jittering times of arrival: whole periods on a fitted line."""
    counts = np.cumsum(np.maximum(1.0, np.round(np.diff(t, prepend=t[0]) / np.median(np.diff(t)))))
    slope, start = np.polyfit(counts - counts[0], t - t[0], 1)
    return np.asarray(t[0] + start + slope * (counts - counts[0]))


def _si(name: str, signal: Signal, values: Array, frame: str) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):  # damaged files hold signalling NaN
        values = values * factor(signal.unit, dimensions_of(name)) * (signal.radius or 1.0)
    if name in WRAPPED:
        seen = np.isfinite(values)
        values[seen] = np.unwrap(values[seen])
    values = to_iso8855(name, signal.sign * signal.scale * values, signal.frame or frame)
    return np.asarray(values + signal.offset)


def numbers_of(path: Path, values: "pd.Series[Any]", first_line: int = 2) -> tuple[Array, dict[int, str]]:
    """A column as numbers [n] (NaN: no reading), and by row what stood where no number was.

    Args:
        first_line: of the file, where its rows begin.

    Raises:
        InvalidRecordingError: more than a few readings are no numbers.
    """
    numbers = as_numbers(values)
    text = np.flatnonzero(numbers.isna() & values.notna())
    if len(text) > max(1, MOST_BAD * len(values)):
        row = int(text[0])
        raise InvalidRecordingError(
            f"{path}: column '{values.name}' holds {values.iloc[row]!r} in row {row + first_line}, and no number in "
            f"{len(text)} of {len(values)} rows; numbers or nothing belong there"
        )
    out = np.array(numbers, dtype=float)
    infinite = np.flatnonzero(np.abs(out) > MEASURABLE)
    out[infinite] = np.nan
    return out, {int(row): repr(values.iloc[row]) for row in [*text, *infinite]}


def without_absurd(name: str, values: Array) -> tuple[Array, NDArray[np.int64]]:
    """Values [SI] without single ones that no car has in any unit, and where those were."""
    there = np.isfinite(values)
    if name not in {"r", *LARGEST}:
        return values, np.empty(0, dtype=np.int64)
    absurd = np.flatnonzero(there & (np.abs(np.where(there, values, 0.0)) > ABSURD))
    if len(absurd) > max(1, MOST_BAD * np.count_nonzero(there)):
        return values, np.empty(0, dtype=np.int64)  # another unit, or no such quantity: for the checks to say
    return np.where(np.isin(np.arange(len(values)), absurd), np.nan, values), absurd


def without_glitches(t: Array) -> tuple[NDArray[np.int64], list[int]]:
    """Ticks to keep of times [n], and those to leave out so that the rest advances; all kept where they are many."""
    kept = list(range(len(t)))
    dropped: list[int] = []
    for _ in range(max(1, round(MOST_BAD * len(t)))):
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
