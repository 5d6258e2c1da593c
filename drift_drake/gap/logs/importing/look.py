"""A first look at a recorder's file: its topics, rates and units, and a mapping to begin with, as one YAML text."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drift_drake.car.log.numbers import as_numbers, measured_numbers
from drift_drake.gap.logs.importing.clocks import clock_of, rate_of, seconds, with_numbers
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.guess import NEEDED, guessed_mapping
from drift_drake.gap.logs.importing.known import not_given
from drift_drake.gap.logs.importing.names import is_handwheel
from drift_drake.gap.logs.importing.recording import topics_of

MOST_LISTED = 60


@dataclasses.dataclass(frozen=True)
class Column:
    """A column of a topic: its unit as the file states it, and the least and largest number (None: it has none)."""

    name: str
    unit: str
    low: float | None
    high: float | None


@dataclasses.dataclass(frozen=True)
class TopicSummary:
    """What a topic holds; clock: the column of its times (None: none looks like it), rate [Hz], span [s];
    left_out: what the file holds and cannot be read as numbers, and why."""

    name: str
    rows: int
    clock: str | None
    rate: float | None
    span: float | None
    columns: list[Column]
    left_out: dict[str, str]


@dataclasses.dataclass(frozen=True)
class Look:
    """What a file holds, the mapping guessed from names and numbers, what a log needs that nothing looks like, and
    notes: sentences on what else could have been guessed."""

    file: str
    topics: list[TopicSummary]
    mapping: dict[str, Any]
    missing: list[str]
    notes: list[str]


def look(path: str | Path, databases: Sequence[str | Path] = (), read: Sequence[Topic] | None = None) -> Look:
    """A first look at a recorder's file, with the databases (DBC) of raw CAN frames.

    read: what the file holds, where it has been read already.

    Raises:
        InvalidRecordingError: the file cannot be read, or holds no number.
    """
    held = topics_of(Path(path), databases) if read is None else read
    topics = [with_numbers(topic) for topic in held]
    summaries = [_summary(topic) for topic in topics]
    if all(column.low is None for topic in summaries for column in topic.columns):
        raise InvalidRecordingError(f"{path}: holds no column of numbers; give a recorder's file")
    return Look(Path(path).name, summaries, *guessed_mapping(topics))


def mapping_text(found: Look) -> str:
    """A YAML text: what the file holds in its comments, and below them the guessed mapping."""
    topics, mapping = found.topics, found.mapping
    lines = [f"# {found.file}: {len(topics)} topic{'s' if len(topics) > 1 else ''}"]
    for topic in topics:
        lines += _described(topic)
    lines.append("# A first mapping, guessed from names and numbers: see that columns, units and frame are right.")
    lines.append(
        yaml.safe_dump(mapping, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True).rstrip()
    )
    column = mapping["signals"].get("delta_cmd", {}).get("column", "")
    if is_handwheel(column.rsplit(".", 1)[-1]):
        lines.append("# delta_cmd is the road wheel's angle, and its column looks like the steering wheel's: add")
        lines.append("#   scale: ?  (one over the steering ratio) to its line.")
    lines += [f"# {note}" for note in found.notes]
    if "latitude" in mapping["signals"] and found.missing:
        lines.append(f"# {not_given(found.missing)}")
    for name in found.missing:
        lines.append(f"# Nothing here looks like {name}, which a log needs: add the line below under 'signals'.")
        lines.append(f"#   {name}: {{column: ?, unit: {NEEDED[name]}, clock: {next(iter(mapping['clocks']), '?')}}}")
    return "\n".join(lines) + "\n"


def _summary(topic: Topic) -> TopicSummary:
    clock = clock_of(topic)
    rate = span = None
    if clock is not None:
        t = seconds(topic, clock)
        t = t[np.isfinite(t)]
        rate, span = rate_of(t), float(t[-1] - t[0]) if len(t) else 0.0
    columns = []
    for name in topic.table.columns:
        values = measured_numbers(as_numbers(topic.table[name]))
        seen = values[np.isfinite(values)]
        low, high = (float(np.min(seen)), float(np.max(seen))) if len(seen) else (None, None)
        columns.append(Column(name, topic.units.get(name, ""), low, high))
    return TopicSummary(topic.name, len(topic.table), clock, rate, span, columns, dict(topic.left_out))


def _described(topic: TopicSummary) -> list[str]:
    clock = f"{topic.rate:.4g} Hz, {topic.span:.1f} s by {topic.clock}" if topic.clock else "no clock found"
    if topic.clock and not topic.rate:
        clock = f"no two times by {topic.clock}"
    rows = "1 row" if topic.rows == 1 else f"{topic.rows} rows"
    lines = [f"# {topic.name or 'table'}: {rows}, {clock}"]
    for column in topic.columns[:MOST_LISTED]:
        extent = "no numbers"
        if column.low is not None and column.high is not None:
            digits = 6 if f"{column.low:.6g}" != f"{column.high:.6g}" else 15  # absolute stamps
            extent = f"{column.low:.{digits}g} to {column.high:.{digits}g}"
        lines.append(f"#   {column.name}{f' [{column.unit}]' if column.unit else ''}: {extent}")
    if len(topic.columns) > MOST_LISTED:
        lines.append(f"#   and {len(topic.columns) - MOST_LISTED} more")
    if topic.left_out:
        names = [f"{name} ({why})" for name, why in topic.left_out.items()]
        more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
        lines.append(f"#   left out: {', '.join(names[:MOST_LISTED])}{more}")
    return lines
