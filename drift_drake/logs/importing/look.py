"""A first look at a recorder's file: its topics, rates and units, and a mapping to begin with, as one YAML text."""

import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from drift_drake.logs.importing.formats.files import InvalidRecordingError
from drift_drake.logs.importing.formats.topics import Topic
from drift_drake.logs.importing.recording import topics_of
from drift_drake.logs.importing.units import DIMENSIONS, QUANTITIES, units_of

NAMES = {  # of a quantity: what its column may be called, the best first (on the lower-cased name)
    "x": (r"pos\w*\.x$", r"^(pos_?)?x(_m)?$", r"pos\w*\[0\]$"),
    "y": (r"pos\w*\.y$", r"^(pos_?)?y(_m)?$", r"pos\w*\[1\]$"),
    "r": (r"angular_velocity\.z$", r"twist\.angular\.z$", r"yaw_?rate", r"gyro\w*(\.z|_z|z|\[2\])$", r"(^|[._])r$"),
    "psi": (r"orientation\.yaw$", r"\.yaw$", r"^(psi|heading|yaw(_?angle)?)(_|$)", r"heading", r"psi"),
    "vx": (r"twist\.linear\.x$", r"(^|[._])(vx|v_x|u_x|vel\w*_x)(_|$)", r"velocity(\.x|\[0\])$"),
    "vy": (r"twist\.linear\.y$", r"(^|[._])(vy|v_y|u_y|vel\w*_y)(_|$)", r"velocity(\.y|\[1\])$"),
    "v": (r"(^|[._])(v|speed|velocity|vehiclespeed|vehicle_speed)(_|$)", r"speed", r"velocity"),
    "beta": (r"side_?slip", r"(^|[._])slip_?angle", r"(^|[._])beta(_|$)"),
    "omega_r": (r"omega_r", r"(rear|rl|rr)_?\w*wheel", r"wheel\w*_?speed\w*_?(r|rl|rr|rear)", r"wheel_?speed"),
    "ax": (r"linear_acceleration\.x$", r"acc\w*(\.x|_x|x|\[0\])$", r"(^|[._])ax(_|$)"),
    "ay": (r"linear_acceleration\.y$", r"acc\w*(\.y|_y|y|\[1\])$", r"(^|[._])ay(_|$)"),
    "delta_cmd": (r"steering_?angle\w*$", r"(^|[._])delta(_|$)", r"road_?wheel", r"steer\w*"),
    "tau_cmd": (r"tau(_|$)", r"torque"),
}
WHEEL = r"steering_?wheel|hand_?wheel|swa(_|$)"
TIMES = (r"header\.stamp$", r"(^|[._])(t|time|timestamp|stamp)(_(s|ms|us|ns))?$", r"time|stamp", r"log_time$")
SUFFIXES = {  # of a name: the unit that it says
    r"(deg_?/?p?s|dps)$": "deg/s",
    r"rad_?/?p?s$": "rad/s",
    r"(kmh|kph|km_?/?p?h)$": "km/h",
    r"(mps|m_?/?_s)$": "m/s",
    r"(mps2|m_?/?_s2|m/s\^?2)$": "m/s^2",
    r"_deg$": "deg",
    r"_mm$": "mm",
    r"_cm$": "cm",
    r"(_|\b)g$": "g",
    r"rpm$": "rpm",
}
ALIASES = {"°": "deg", "°/s": "deg/s", "Nm": "N m", "m/s2": "m/s^2", "m/s²": "m/s^2", "kph": "km/h", "1/min": "rpm"}
STEPS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
SLOWEST = 0.5  # [s] between two readings, in the unit of time that is guessed
RATES = 3.0  # a clock is taken to be regular within this factor
LARGEST = {"delta_cmd": 4.0 * np.pi, "beta": np.pi}  # [rad] of a steering wheel, of a spinning car
NEEDED = {"delta_cmd": "rad", "r": "rad/s", "v": "m/s"}
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
    """What a topic holds; clock: the column of its times (None: none looks like it), rate [Hz], span [s]."""

    name: str
    rows: int
    clock: str | None
    rate: float | None
    span: float | None
    columns: list[Column]


@dataclasses.dataclass(frozen=True)
class Look:
    """What a file holds, the mapping guessed from names and numbers, and what a log needs that nothing looks like."""

    file: str
    topics: list[TopicSummary]
    mapping: dict[str, Any]
    missing: list[str]


def look(path: str | Path) -> Look:
    """A first look at a recorder's file.

    Raises:
        InvalidRecordingError: the file cannot be read, or holds no number.
    """
    topics = topics_of(Path(path))
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
    lines.append(yaml.safe_dump(mapping, sort_keys=False, default_flow_style=None, width=120).rstrip())
    column = mapping["signals"].get("delta_cmd", {}).get("column", "")
    if re.search(WHEEL, column.lower()):
        lines.append("# delta_cmd is the road wheel's angle, and its column looks like the steering wheel's: add")
        lines.append("#   scale: ?  (one over the steering ratio) to its line.")
    for name in found.missing:
        lines.append(f"# Nothing here looks like {name}, which a log needs: add the line below under 'signals'.")
        lines.append(f"#   {name}: {{column: ?, unit: {NEEDED[name]}, clock: {next(iter(mapping['clocks']), '?')}}}")
    return "\n".join(lines) + "\n"


def guessed_mapping(topics: Sequence[Topic]) -> tuple[dict[str, Any], list[str]]:
    """A mapping file's content, and the quantities that a log needs and nothing looks like."""
    clocks = {topic.name: clock for topic in topics if (clock := _clock(topic)) is not None}
    rates = {topic.name: _hertz(_seconds(topic, clocks[topic.name])) for topic in topics if topic.name in clocks}
    ordered = sorted((topic for topic in topics if topic.name in clocks), key=lambda topic: -rates[topic.name])
    found: dict[str, tuple[Topic, str]] = {}
    taken = set(clocks.values())
    for name, patterns in NAMES.items():
        best = _best(ordered, patterns, taken)
        if best is not None:
            found[name] = best
            taken.add(best[1])
    if {"vx", "vy"} <= set(found):
        found.pop("v", None)
    elif "v" in found:
        found.pop("vx", None), found.pop("vy", None)
    tables = {topic.name: topic for topic, _ in found.values()}
    used = sorted(tables, key=lambda name: (-rates[name], name))
    unnamed = "recorder" if len(used) == 1 else "table"
    names = {name: re.sub(r"\W+", "_", name).strip("_") or unnamed for name in used}
    entries = {}
    for name in used:
        unit = _time_unit(tables[name], clocks[name])
        entries[names[name]] = {"column": clocks[name]} | ({} if unit == "s" else {"unit": unit})
    signals: dict[str, Any] = {}
    for key, (topic, column) in found.items():
        signals[key] = {"column": column, "unit": _unit(key, column, topic)}
        if len(used) > 1:
            signals[key]["clock"] = names[topic.name]
        if key == "omega_r" and "/" in signals[key]["unit"] and signals[key]["unit"] in DIMENSIONS["angular rate"][1]:
            signals[key]["radius"] = 0.3
    mapping = {
        "frame": "iso8855",
        "clocks": entries,
        "signals": signals,
    }
    known = (
        set(found) | ({"v"} if "vx" in found else set()) | ({"r", "v"} if {"x", "y", "psi"} <= set(found) else set())
    )
    return mapping, [name for name in NEEDED if name not in known]


def _summary(topic: Topic) -> TopicSummary:
    clock = _clock(topic)
    rate = span = None
    if clock is not None:
        t = _seconds(topic, clock)
        rate, span = _hertz(t), float(t[-1] - t[0])
    columns = []
    for name in topic.table.columns:
        values = pd.to_numeric(topic.table[name], errors="coerce").to_numpy(dtype=float)
        seen = values[np.isfinite(values)]
        low, high = (float(np.min(seen)), float(np.max(seen))) if len(seen) else (None, None)
        columns.append(Column(name, topic.units.get(name, ""), low, high))
    return TopicSummary(topic.name, len(topic.table), clock, rate, span, columns)


def _described(topic: TopicSummary) -> list[str]:
    clock = f"{topic.rate:.4g} Hz, {topic.span:.1f} s by {topic.clock}" if topic.clock else "no clock found"
    lines = [f"# {topic.name or 'table'}: {topic.rows} rows, {clock}"]
    for column in topic.columns[:MOST_LISTED]:
        extent = "no numbers"
        if column.low is not None and column.high is not None:
            digits = 6 if f"{column.low:.6g}" != f"{column.high:.6g}" else 15  # absolute stamps
            extent = f"{column.low:.{digits}g} to {column.high:.{digits}g}"
        lines.append(f"#   {column.name}{f' [{column.unit}]' if column.unit else ''}: {extent}")
    if len(topic.columns) > MOST_LISTED:
        lines.append(f"#   and {len(topic.columns) - MOST_LISTED} more")
    return lines


def _best(ordered: Sequence[Topic], patterns: Sequence[str], taken: set[str]) -> tuple[Topic, str] | None:
    """The column that the first pattern finds, in the topic that is read most often."""
    for pattern in patterns:
        for topic in ordered:
            for column in topic.table.columns:
                bare = column.removeprefix(topic.name).lstrip(".").lower()
                bare = re.sub(r"\s*[\[(][^\d\])]*[\])]$", "", bare).strip().replace(" ", "_")
                numeric = pd.api.types.is_numeric_dtype(topic.table[column])
                if column not in taken and numeric and re.search(pattern, bare):
                    return topic, column
    return None


def _clock(topic: Topic) -> str | None:
    """The column of times: a known name, and never backwards."""
    for pattern in TIMES:
        for column in topic.table.columns:
            if re.search(pattern, str(column).lower()) and pd.api.types.is_numeric_dtype(topic.table[column]):
                values = topic.table[column].to_numpy(dtype=float)
                if len(values) > 1 and np.mean(np.diff(values) >= 0.0) > 0.9 and values[-1] > values[0]:
                    return str(column)
    return None


def _time_unit(topic: Topic, column: str) -> str:
    """The coarsest unit in which the column's steps are those of a recorder."""
    if topic.units.get(column) in STEPS:
        return topic.units[column]
    values = topic.table[column].to_numpy(dtype=float)
    step = float(np.median(np.diff(values)[np.diff(values) > 0.0]))
    return next((unit for unit, factor in STEPS.items() if step * factor <= SLOWEST), "ns")


def _seconds(topic: Topic, column: str) -> np.ndarray:
    values = topic.table[column].to_numpy(dtype=float)
    return np.asarray(values[np.isfinite(values)] * STEPS[_time_unit(topic, column)])


def _hertz(t: np.ndarray) -> float:
    steps = np.diff(t)
    return float(1.0 / np.median(steps[steps > 0.0]))


def _unit(key: str, column: str, topic: Topic) -> str:
    """The unit that the file states, or the name says, or else SI; degrees for an angle that cannot be radians."""
    allowed = units_of(key)
    stated = topic.units.get(column, "").strip()
    in_name = re.search(r"[\[(]([^\])]+)[\])]\s*$", column)
    for unit in (stated, in_name[1].strip() if in_name else ""):
        if ALIASES.get(unit, unit) in allowed:
            return ALIASES.get(unit, unit)
    for pattern, unit in SUFFIXES.items():
        if unit in allowed and re.search(pattern, column.lower()):
            return unit
    if key in LARGEST and np.any(np.abs(topic.table[column].to_numpy(dtype=float)) > LARGEST[key]):
        return "deg"
    return DIMENSIONS[QUANTITIES[key]][0]
