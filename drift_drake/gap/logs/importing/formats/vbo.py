"""Racelogic's VBOX .vbo: text in sections, a row each sample.

Latitude and longitude are minutes of arc, longitude positive to the west (some other makers' files have degrees,
positive to the east); they are turned into degrees, positive to the north and east. Times hhmmss.ss become seconds.
"""

import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drift_drake.car.log.numbers import as_numbers, without_endless
from drift_drake.common.arrays import Array
from drift_drake.gap.logs.importing.formats.times import packed_seconds, unwrapped
from drift_drake.gap.logs.importing.formats.topics import Topic

COLUMNS = ["sats", "time", "lat", "long", "velocity", "heading", "height"]  # where a file names none
STANDARD = (  # channels that have no line among the units: their names in [header]
    r"sat\w*|time|latitude|longitude|velocity.*|speed.*|heading|course|height|altitude|vert\w*[ _-]vel\w*.*|vertvel.*"
    r"|event.*|trigger.*|\w*acc\w*[ _]?g?|longitudinal .*|lateral .*|sample ?period|solution.*|avi.*|glonass.*|gps.*"
)
UNITS = {  # that VBOX units and software give their own channels, where the file states none
    r"lat|long|heading|course|true_?head\w*|slip\w*|pitch|roll|yaw": "deg",
    r"height": "m",
    r"time": "s",
    r"velocity|speed": "km/h",
    r"(yaw|pitch|roll|[xyz])[_-]?rate|yaw-calc": "deg/s",
    r"(lat|long|lateral|longitudinal|[xyz])[_-]?acc\w*": "g",
    r"steer\w*": "deg",
}
WORDS = {"kmh": "km/h", "km/h": "km/h", "kph": "km/h", "mph": "mph", "knots": "kn", "kts": "kn", "m/s": "m/s", "g": "g"}
KNOWN = {"lat": "latitude", "long": "longitude", "heading": "course", "velocity": "v"}
SHORT = {"latitude": "lat", "longitude": "long", "lon": "long", "lng": "long", "satellites": "sats"}
PACKED = 0.98  # share of times whose last two digits, and the two before, are below sixty
DEGREES = (90.0, 180.0)  # latitude and longitude at most
DIGITS = 4  # before the decimal point: minutes of arc are written with leading zeros


def read_vbo(path: Path) -> list[Topic]:
    """The table of a .vbo file.

    Raises:
        ValueError: no [data] section, or no rows with the columns that it names; OSError.
    """
    sections = _sections(_text(path))
    rows = [line for line in sections.get("data", []) if line.strip()]
    if not rows:
        raise ValueError("has no rows below [data]")
    table, names = _table(rows, " ".join(sections.get("column names", [])).split() or COLUMNS)
    units = _units(sections, names)
    if "time" in table:
        table["time"] = seconds_of_day(table["time"])
    if {"lat", "long"} <= set(table):
        _in_degrees(table, rows[0])
    known = {name: KNOWN[name] for name in names if name in KNOWN}
    return [Topic("", table, units, clock="time" if "time" in table else "", known=known)]


def _text(path: Path) -> str:
    data = path.read_bytes()
    for encoding in ("utf-8-sig", "cp1252"):
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1")


def _sections(text: str) -> dict[str, list[str]]:
    """Lines below each [name], in lower case."""
    sections: dict[str, list[str]] = {}
    lines: list[str] = []
    whole = text.endswith("\n")
    for line in text.splitlines():
        heading = re.fullmatch(r"\s*\[([^\]]+)\]\s*", line)
        if heading:
            lines = sections.setdefault(heading[1].strip().lower(), [])
        else:
            lines.append(line)
    data = sections.get("data", [])
    if not whole and len(data) > 1 and len(data[-1]) < len(data[-2]):
        data.pop()  # the file breaks off within a row
    return sections


def _table(rows: list[str], names: list[str]) -> tuple[pd.DataFrame, list[str]]:
    """The rows as numbers, and their columns' names."""
    first = rows[0].split()
    separator, decimal = r"\s+", "."
    if len(first) == 1 and rows[0].count(";") >= 2:
        separator = ";"
    elif len(first) == 1 and rows[0].count(",") >= 2:
        separator = ","
    if separator != "," and "," in rows[0] and "." not in rows[0]:
        decimal = ","
    count = len(first) if separator == r"\s+" else len(rows[0].split(separator))
    if count == len(names) - 1 and names[0].lower().startswith("sat"):
        names = names[1:]  # named, and not written, by some
    if count < len(names):
        raise ValueError(f"has {count} values in its first row, and names {len(names)} columns")
    names = [SHORT.get(name.lower(), name.lower() if name.lower() in COLUMNS else name) for name in names]
    names = [name if names.count(name) == 1 else f"{name} (column {i})" for i, name in enumerate(names, 1)]
    names += [f"column {i}" for i in range(len(names) + 1, count + 1)]
    table = pd.read_csv(
        io.StringIO("\n".join(rows)), sep=separator, header=None, names=names, index_col=False, on_bad_lines="skip",
        quoting=3, dtype=str, low_memory=False,
    )  # fmt: skip
    if decimal == ",":
        table = table.apply(lambda column: column.str.replace(",", ".", regex=False))
    numbers = {name: table[name] if name == "time" else as_numbers(table[name]) for name in table}
    return pd.DataFrame(numbers), names


def _units(sections: dict[str, list[str]], names: list[str]) -> dict[str, str]:
    """Units of the columns: by the format, in the channel's long name, or from [channel units]."""
    header = [line.strip() for line in sections.get("header", []) if line.strip()]
    if header and header[0].lower().startswith("sat") and not names[0].lower().startswith("sat"):
        header = header[1:]
    if len(header) != len(names):
        header = names  # which line belongs to which column is not stated
    units = {name: unit for name in names for pattern, unit in UNITS.items() if re.fullmatch(pattern, name.lower())}
    own = [
        name
        for name, long in zip(names, header, strict=True)
        if name not in COLUMNS and not re.fullmatch(STANDARD, long.lower())
    ]
    given = [line.strip() for line in sections.get("channel units", [])]
    stated = len("\n".join(given).rstrip("\n").split("\n")) if any(given) else 0
    # A list of another length than the channels says not which unit belongs to which; its last may be blank.
    for channels in (own, names):
        if stated <= len(channels) <= len(given):
            units |= {name: unit for name, unit in zip(channels, given, strict=False) if unit}
            break
    for name, long in zip(names, header, strict=True):
        word = long.lower().split()[-1].strip("()[]")
        if word in WORDS and len(long.split()) > 1 and name not in own:
            units[name] = WORDS[word]
    return units


def seconds_of_day(times: "pd.Series[Any]") -> Array:
    """Times hhmmss.ss, hh:mm:ss.ss or in seconds, as texts [n], in seconds [n], on through midnight."""
    if times.str.contains(":", na=False).any():
        t = np.array(pd.to_timedelta(times, errors="coerce").dt.total_seconds(), dtype=float)
    else:
        t = without_endless(np.array(as_numbers(times), dtype=float))
        with np.errstate(invalid="ignore"):
            packed = packed_seconds(t, "hhmmss")
        if np.mean(np.isfinite(packed[np.isfinite(t)])) > PACKED:
            t = packed
    return unwrapped(t)


def _in_degrees(table: pd.DataFrame, first: str) -> None:
    """Latitude and longitude in degrees, positive to the north and east; none where the receiver had no fix."""
    lat, long = (table[name].to_numpy(dtype=float) for name in ("lat", "long"))
    none = (lat == 0.0) & (long == 0.0)
    with np.errstate(invalid="ignore"):
        large = (np.abs(lat) > DEGREES[0]) | (np.abs(long) > DEGREES[1])
    words = re.split(r"[\s;]+", first.strip())
    padded = [word for word in words if re.fullmatch(rf"[+-]\d{{{DIGITS},}}[.,]\d+", word)]
    minutes = bool(np.median(large[~none]) if (~none).any() else False) or len(padded) >= 2  # also near 0 N 0 E
    table["lat"] = np.where(none, np.nan, lat / 60.0 if minutes else lat)
    table["long"] = np.where(none, np.nan, -long / 60.0 if minutes else long)
