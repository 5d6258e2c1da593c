"""An import before it is made: what looks wrong in a recording with a mapping as it stands, and what would fix it."""

import copy
import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError, significant
from drift_drake.common.units import unit_of
from drift_drake.gap.logs.importing.checks import doubts_of
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.importer import PERIOD, Piece, as_run, pieces_of
from drift_drake.gap.logs.importing.mapping import RecorderMapping, mapping_from_dict
from drift_drake.gap.logs.importing.recording import read_recording
from drift_drake.gap.logs.screening.consistency import SWAPPED
from drift_drake.gap.logs.screening.suspicions import Suspicion
from drift_drake.gap.logs.wording.conversion import dimensions_of, units_of

NEAR = math.log(1.03)  # of a factor to that of a unit
CHECKED_BY = {"v": ("v", "vx", "vy"), "y": ("x", "y")}  # lines of a mapping that a column of the log is made of
NEEDED = ("r", "v", "delta_cmd")
TIMED = {"beta": ("beta", "vy")}  # signals that a column's time is that of
EXCHANGED = {**SWAPPED, "v": ("v", "omega_r")}  # by the column that a doubt names


class Fix(NamedTuple):
    """What to do in words, and the mapping's plain data once it is done."""

    label: str
    mapping: dict[str, Any]


def fixes(doubt: Suspicion, mapping: Mapping[str, Any]) -> list[Fix]:
    """Ways to put right what is doubted, the likeliest first; none where no mapping can.

    Args:
        mapping: plain data, as `mapping_from_dict` takes it.
    """
    column = doubt.column
    if column is None or column == "t":
        return []
    if doubt.point is not None:
        where = [round(q, 3) for q in doubt.point]
        return [
            Fix(f"set measured_point to [{where[0]:g}, {where[1]:g}] m", {**_copied(mapping), "measured_point": where})
        ]
    if "swapped" in doubt.sentence and column in EXCHANGED:
        return _exchanged(mapping, *EXCHANGED[column])
    if doubt.shift is not None:
        return _on_own_clock(mapping, doubt.columns, doubt.shift)
    lines = _lines(column, mapping)
    if doubt.offset is not None:
        return _each(lines, mapping, f"add {doubt.offset:.3g} to {column}", _moved(doubt.offset))
    if doubt.factor is None:
        return _without(lines, column, doubt, mapping)
    if doubt.factor < 0.0:
        return _each(
            lines, mapping, f"turn the sign of {column}", lambda line: {**line, "sign": -line.get("sign", 1.0)}
        )
    return [*_units(lines, column, doubt, mapping), *_scaled(lines, column, doubt.factor, mapping)][:2]


def _on_own_clock(mapping: Mapping[str, Any], columns: Sequence[str], shift: float) -> list[Fix]:
    """A clock for the signals that columns are read from: the one that they have, and so much added to it [s]."""
    changed = _copied(mapping)
    lines = [name for column in columns for name in TIMED.get(column, (column,)) if name in changed["signals"]]
    first = next(iter(changed["clocks"]))
    for name in lines:
        clock = changed["signals"][name].get("clock") or first
        old = changed["clocks"][clock]
        new = f"{clock}_{columns[0]}"
        changed["clocks"][new] = {**old, "offset": _rounded((old.get("offset") or 0.0) + shift)}
        changed["signals"][name]["clock"] = new
    return [Fix(f"add {shift:.2g} s to the times of {' and '.join(columns)}", changed)] if lines else []


def _copied(mapping: Mapping[str, Any]) -> dict[str, Any]:
    return copy.deepcopy(dict(mapping))


def _lines(column: str, mapping: Mapping[str, Any]) -> list[str]:
    """Names of the signals that a column of the log is read from; none where it is a formula's."""
    signals = mapping.get("signals", {})
    if column in mapping.get("formulas", {}):
        return []
    return [name for name in CHECKED_BY.get(column, (column,)) if name in signals]


def _each(lines: list[str], mapping: Mapping[str, Any], label: str, change: Any) -> list[Fix]:
    """One way, of all these lines together."""
    if not lines:
        return []
    changed = _copied(mapping)
    for name in lines:
        line = change(changed["signals"][name])
        changed["signals"][name] = {key: value for key, value in line.items() if (key, value) not in DEFAULTS}
    return [Fix(label, changed)]


DEFAULTS = (("sign", 1.0), ("scale", 1.0), ("offset", 0.0))


def _moved(offset: float) -> Any:
    return lambda line: {**line, "offset": _rounded(line.get("offset", 0.0) + offset)}


def _rounded(value: float) -> float:
    return float(significant(value, 4))


def _exchanged(mapping: Mapping[str, Any], one: str, other: str) -> list[Fix]:
    changed = _copied(mapping)
    signals = changed["signals"]
    if one not in signals or other not in signals:
        return []
    signals[one]["column"], signals[other]["column"] = signals[other]["column"], signals[one]["column"]
    return [Fix(f"exchange the columns of {one} and {other}", changed)]


def _without(lines: list[str], column: str, doubt: Suspicion, mapping: Mapping[str, Any]) -> list[Fix]:
    """Of a column that is no measurement: leave it out, where a log can do without it."""
    if not lines or column in NEEDED or "is dead:" not in doubt.sentence:
        return []
    changed = _copied(mapping)
    for name in lines:
        changed["signals"].pop(name)
    return [Fix(f"leave {column} out", changed)]


def _units(lines: list[str], column: str, doubt: Suspicion, mapping: Mapping[str, Any]) -> list[Fix]:
    """Another unit that has the factor."""
    factor = float(doubt.factor or 1.0)
    if not lines:
        return []
    line = mapping["signals"][lines[0]]
    now = unit_of(str(line.get("unit", "")), dimensions_of(lines[0]))
    if now is None:
        return []
    if column == "omega_r" and "rad/s" in doubt.sentence and now.dimension == "speed":
        to = {"unit": "rad/s", "radius": float(significant(1.0 / factor, 3))}
        return _each(
            lines, mapping, f"read omega_r in rad/s, of a wheel of {to['radius']:g} m", lambda one: {**one, **to}
        )
    for name in units_of(lines[0]):
        unit = unit_of(name, (now.dimension,))
        if unit is not None and abs(math.log(unit.factor * factor / now.factor)) < NEAR and name != now.name:
            return _each(lines, mapping, f"read {column} in {name}", lambda one, to=name: {**one, "unit": to})
    return []


def _scaled(lines: list[str], column: str, factor: float, mapping: Mapping[str, Any]) -> list[Fix]:
    """The factor itself."""
    said = f"divide {column} by {significant(factor, 3)}"
    if lines:
        return _each(
            lines, mapping, said, lambda line: {**line, "scale": float(significant(line.get("scale", 1.0) / factor, 4))}
        )
    if column not in mapping.get("formulas", {}):
        return []
    changed = _copied(mapping)
    changed["formulas"][column] = f"({changed['formulas'][column]}) / {significant(factor, 4)}"
    return [Fix(said, changed)]


GUESSED = {"km/h": "km/h", "degrees per": "deg/s", "degrees": "deg"}  # what a refusal takes a column for, its unit


def fixes_of_refusal(sentence: str, mapping: Mapping[str, Any]) -> list[Fix]:
    """The same of a log that is refused since no car can have such numbers (`car.log.plausible`)."""
    found = re.search(r"column (\w+) .*it looks like (.*)", sentence)
    if found is None:
        return []
    lines = _lines(found[1], mapping)
    unit = next((unit for words, unit in GUESSED.items() if found[2].startswith(words)), None)
    if not lines or unit is None or mapping["signals"][lines[0]].get("unit") == unit:
        return []
    return _each(lines, mapping, f"read {found[1]} in {unit}", lambda line: {**line, "unit": unit})


@dataclasses.dataclass(frozen=True)
class Remark:
    """A sentence on what looks wrong, and ways to put it right."""

    sentence: str
    fixes: list[Fix] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True)
class Preview:
    """What an import would say of a recording.

    pieces: columns of the log [rows] by run, at `PERIOD` [s]; remarks: on what looks wrong; refused: why the import
    would be refused, None where it would not; unchecked: columns that no other column can check; undecided: what
    else they cannot tell.
    """

    pieces: list[Mapping[str, Array]]
    remarks: list[Remark]
    refused: Remark | None
    unchecked: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()


def preview(
    path: str | Path, topics: Sequence[Topic], data: Mapping[str, Any], start: float = 0.0, end: float = math.inf
) -> Preview:
    """What an import of one recording would say.

    Args:
        topics: what the file holds; data: the mapping as plain data; start, end: part to look at [s].
    """
    try:
        mapping = mapping_from_dict(dict(data), "mapping.yaml")
        recording = read_recording(path, mapping, (), topics)
        pieces, _, said = pieces_of(Path(path), recording.name, recording, mapping, start, end)
        doubts, wrong = doubts_of([(piece.label, piece.columns) for piece in pieces], PERIOD, mapping)
    except DriftDrakeError as error:
        return Preview([], [], Remark(str(error)))
    sentences = dict.fromkeys([*said, *(one for several in wrong.values() for one in several)])
    remarks = [
        Remark(one, fixes(doubts.suspicions[one], data) if one in doubts.suspicions else []) for one in sentences
    ]
    return Preview(
        [piece.columns for piece in pieces],
        remarks,
        _refused(pieces, mapping, data),
        doubts.unchecked,
        doubts.undecided,
    )


def _refused(pieces: Sequence[Piece], mapping: RecorderMapping, data: Mapping[str, Any]) -> Remark | None:
    try:
        for piece in pieces:
            as_run(piece, mapping, ())
    except DriftDrakeError as error:
        return Remark(str(error), fixes_of_refusal(str(error), data))
    return None
