"""Columns that may be each quantity of a log, by names and units; all columns, ranked by what motion says of them."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from pandas.api.types import is_numeric_dtype

from drift_drake.common.units import unit_of
from drift_drake.gap.logs.importing.clocks import (
    by_clock,
    clock_of,
    numbers_of_column,
    own_name,
    rate_of,
    seconds,
    with_numbers,
)
from drift_drake.gap.logs.importing.evidence import LIKE, Trace, agreements_with, derivative, likeness, product
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.names import COMMON, LIMIT, as_gyro, bracketed, concepts, fit, stated_unit
from drift_drake.gap.logs.wording.conversion import dimensions_of, to_iso8855
from drift_drake.gap.logs.wording.vocabulary import pieces

LOOKED_FOR = ("latitude", "longitude", "course", "x", "y", "r", "psi", "vx", "vy", "v", "beta", "omega_r", "ax", "ay",
              "delta_cmd", "tau_cmd")  # fmt: skip
MOST_ROWS = 60_000  # that the motion is judged on
SLOWER = 1.0  # what a constant column, and one without a clock, count against it
FORMAT_SAYS = -10.0  # rank of a column that the file's format says is this quantity
COMMANDED = ("delta_cmd", "tau_cmd")
FEW = 100  # readings that are looked at first
AXES = {"north": "north", "northing": "north", "n": "north", "nord": "north", "hochwert": "north",
        "east": "east", "easting": "east", "e": "east", "ost": "east", "rechtswert": "east"}  # fmt: skip
GRID = {"northing", "easting", "hochwert", "rechtswert"}  # words of a position alone
OVER_GROUND = 2.0  # rank of the position over ground as x and y
SLOWEST = 0.5  # [m/s] below which a rate of sideslip is not asked


class ColumnChoice(NamedTuple):
    """A column that may be a quantity: how badly its name fits, and its unit (None: not stated, `?`: not known)."""

    topic: Topic
    column: str
    rank: float
    unit: str | None


class Traces:
    """Readings of candidates, thinned, by their topic's clock (by rows where there is none)."""

    def __init__(self, times: Mapping[str, np.ndarray]) -> None:
        self.times = times

    def __call__(self, candidate: ColumnChoice) -> Trace:
        values = numbers_of_column(candidate.topic, candidate.column)
        t = self.times.get(candidate.topic.name, np.arange(float(len(values))))
        thin = slice(None, None, 1 + len(values) // MOST_ROWS)
        return Trace(t[thin], values[thin], candidate.unit)


def named_candidates(quantity: str, ordered: Sequence[Topic], clocks: Mapping[str, str]) -> list[ColumnChoice]:
    """All columns that may be this quantity, the best first."""
    found = []
    for topic in ordered:
        names = {str(column): own_name(topic, column) for column in topic.table.columns}
        for column, name in names.items():
            if column == clocks.get(topic.name) or not is_numeric_dtype(topic.table[column]):
                continue
            fits = fit(quantity, as_gyro(name, names.values()), topic.units.get(column, ""), topic.name)
            if column in topic.known:
                said = topic.known[column] == quantity
                unit = unit_of(topic.units.get(column, ""), dimensions_of(quantity)) if said else None
                fits = (FORMAT_SAYS, unit.name if unit else None) if said else None
            if fits is None:
                continue
            values = numbers_of_column(topic, column)
            seen = values[np.isfinite(values)]
            if not len(seen):
                continue
            late = SLOWER * bool(np.ptp(seen) == 0.0) + SLOWER * (topic.name not in clocks)
            late += LIMIT * (quantity not in COMMANDED and _is_flag(seen))
            found.append(ColumnChoice(topic, str(column), fits[0] + late, fits[1]))
    return sorted(found, key=lambda candidate: candidate.rank)


def over_ground(ordered: Sequence[Topic]) -> dict[str, list[ColumnChoice]]:
    """Columns of a position to the east and to the north, as x and y: of the first topic that has both."""
    for topic in ordered:
        columns = axes_of(topic)
        both = [columns.get(("position", way), "") for way in ("east", "north")]
        units = [_unit_of_position(topic, column) for column in both if column]
        if len(units) == 2 and None not in units:
            return {key: [ColumnChoice(topic, column, OVER_GROUND, unit or None)]
                    for key, column, unit in zip(("x", "y"), both, units, strict=True)}  # fmt: skip
    return {}


def _unit_of_position(topic: Topic, column: str) -> str | None:
    """A length that is stated, empty if none is; None of a column that may be no position."""
    bare, stated = stated_unit(own_name(topic, column), topic.units.get(column, ""), "x")
    known = unit_of(stated.text, dimensions_of("x")) if stated else None
    if known is not None:
        return known.name
    words = set(pieces(bare))
    return "" if stated is None and (words & GRID or "pos" in concepts(bare)[0]) else None


def axes_of(topic: Topic) -> dict[tuple[str, str], str]:
    """Columns of a velocity's and a position's parts to the north and east, by ("velocity" or "position", way)."""
    return {axis: column for column in map(str, topic.table.columns) if (axis := _axis(topic, column))}


def _axis(topic: Topic, column: str) -> tuple[str, str] | None:
    """Whether a column is a velocity's or a position's part to the north or east (`vel_n`, `VelEast`, `easting`)."""
    name = bracketed(own_name(topic, column))[0]
    words = ("v", name[1:].lower()) if name.lower() in ("vn", "ve") else pieces(name)
    if not words:  # a name of signs alone
        return None
    way = AXES.get(words[-1]) or next((AXES[word] for word in words if len(word) > 1 and word in AXES), None)
    said = concepts(" ".join(words))[0] - COMMON - {"earth", "linear", "x", "y", "hand"}
    of = {frozenset({"speed"}): "velocity", frozenset({"v"}): "velocity", frozenset({"pos"}): "position"}
    kind = of.get(frozenset(said)) or (None if said or len(words[-1]) == 1 else "position")
    return None if way is None or kind is None or not is_numeric_dtype(topic.table[column]) else (kind, way)


def _is_flag(values: np.ndarray) -> bool:
    """Whether readings are both of two of -1, 0 and 1, or all three: a sign or a state, of nothing that is measured."""
    return bool(np.ptp(values) > 0.0 and np.isin(values[:FEW], (-1.0, 0.0, 1.0)).all()
                and np.isin(values, (-1.0, 0.0, 1.0)).all())  # fmt: skip


class RankedColumn(NamedTuple):
    """A column that may be a quantity.

    likeness: its correlation with what other columns say of it (0: nothing says anything); says: what that is; unit:
    of the quantity's kind, as the file or the name states it, else ""; named: whether its name looks like it.
    """

    column: str
    likeness: float
    says: str
    unit: str
    named: bool


def ranked(topics: Sequence[Topic], signals: Mapping[str, Mapping[str, Any]]) -> dict[str, list[RankedColumn]]:
    """Columns of numbers by quantity, best first: those that motion speaks for, then those whose names do, the rest.

    Args:
        signals: columns that are chosen so far, as a mapping's `signals`; each is judged by the others.
    """
    topics = [with_numbers(part) for topic in topics for part in by_clock(topic)]
    clocks = {topic.name: clock for topic in topics if (clock := clock_of(topic)) is not None}
    times = {topic.name: seconds(topic, clocks[topic.name]) for topic in topics if topic.name in clocks}
    ordered = sorted(topics, key=lambda topic: -rate_of(times[topic.name]) if topic.name in times else 0.0)
    traces, every = Traces(times), _columns(ordered, clocks)
    read = _chosen(signals, every, traces)
    found = {}
    for quantity in LOOKED_FOR:
        names = {(c.topic.name, c.column): c for c in named_candidates(quantity, ordered, clocks)}
        known = {name: trace for name, trace in read.items() if name != quantity}
        rows = []
        for key, choice in every.items():
            by_name = names.get(key)
            agreeing = agreements_with(quantity, traces(choice), known) + _slower(quantity, traces(choice), known)
            size, says = max(agreeing, default=(0.0, ""))
            unit = _unit(quantity, choice) if by_name is None or by_name.unit in (None, "?") else str(by_name.unit)
            order = (-round(size, 2) if size > LIKE else 0.0, 99.0 if by_name is None else by_name.rank, -size)
            rows.append((order, RankedColumn(choice.column, max(size, 0.0), says, unit, by_name is not None)))
        found[quantity] = [candidate for _, candidate in sorted(rows, key=lambda row: row[0])]
    return found


def _columns(topics: Sequence[Topic], clocks: Mapping[str, str]) -> dict[tuple[str, str], ColumnChoice]:
    return {
        (topic.name, str(column)): ColumnChoice(topic, str(column), 0.0, None)
        for topic in topics
        for column in topic.table.columns
        if column != clocks.get(topic.name) and is_numeric_dtype(topic.table[column])
    }


def _slower(quantity: str, choice: Trace, known: Mapping[str, Trace]) -> list[tuple[float, str]]:
    """What the chosen columns say of sideslip, and wheels of a speed: no reason to choose, but one to rank by."""
    if quantity in ("v", "vx") and "omega_r" in known:
        return [(likeness(choice, known["omega_r"]), "omega_r")]
    if quantity in ("beta", "vy") and {"ay", "v", "r"} <= set(known):
        turning, ay, v = product(known["v"], known["r"]), known["ay"], known["v"]
        there = np.isfinite(turning.values) & np.isfinite(v.values)
        if np.count_nonzero(there) > 1:
            slides = ay.values - np.interp(ay.t, turning.t[there], turning.values[there])
            if quantity == "vy":
                return [(likeness(derivative(choice), Trace(ay.t, slides, None)), "its rate is ay - v r")]
            speed = np.maximum(np.interp(ay.t, v.t[there], v.values[there]), SLOWEST)
            return [(likeness(derivative(choice), Trace(ay.t, slides / speed, None)), "its rate is ay / v - r")]
    return []


def _chosen(
    signals: Mapping[str, Mapping[str, Any]], every: Mapping[tuple[str, str], ColumnChoice], traces: Traces
) -> dict[str, Trace]:
    """What is chosen so far, in SI as far as the mapping says how."""
    by_name = {column: choice for (_, column), choice in every.items()}
    found = {}
    for name, line in signals.items():
        if not isinstance(line, Mapping) or line.get("column") not in by_name:
            continue
        trace, unit = traces(by_name[line["column"]]), unit_of(str(line.get("unit", "")), dimensions_of(name))
        size = (1.0 if unit is None else unit.factor) * _number(line.get("sign")) * _number(line.get("scale"))
        found[name] = Trace(trace.t, to_iso8855(name, size * trace.values, str(line.get("frame") or "iso8855")), None)
    return found | ({"v": found["vx"]} if "vx" in found and "v" not in found else {})


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else 1.0


def _unit(quantity: str, choice: ColumnChoice) -> str:
    kinds = dimensions_of(quantity)
    name, stated = own_name(choice.topic, choice.column), choice.topic.units.get(choice.column, "")
    for kind in kinds:
        _, found = stated_unit(name, stated, kind)
        unit = unit_of(found.text, kinds) if found is not None else None
        if unit is not None:
            return unit.name
    return ""
