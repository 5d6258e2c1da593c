"""Which column of a topic is its clock, in which unit, and which columns are read at the same ticks; doubts of it."""

import dataclasses
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pandas.api.types import is_numeric_dtype

from drift_drake.car.log.numbers import as_numbers, measured_numbers
from drift_drake.common.arrays import Array
from drift_drake.common.units import PACKED, unit_of
from drift_drake.gap.logs.importing.formats.times import clock_seconds, packed_seconds, packed_unit
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.names import bracketed, concepts, fit, stated_unit

STEPS = {"s": (8e-4, 2.0), "ms": (0.05, 2e3), "us": (50.0, 2e6), "ns": (5e4, 2e9),
         "min": (1.4e-5, 8e-4), "h": (2.3e-7, 1.4e-5), "day": (9e-10, 2.3e-7)}  # fmt: skip
"""Steps between two readings, 20 kHz (of s 1.2 kHz) to 0.5 Hz, by the unit that is then guessed, the first first."""
DATES = (25569.0, 73050.0), (719529.0, 767011.0)  # 1970 to 2100 as days of spreadsheets, and of MATLAB
ADVANCES = 0.9  # share of a clock's steps that do not go back
STANDS = 0.5  # share of steps from which a clock repeats its readings
FEWEST = 0.9  # share of a column's texts that are numbers, from which it is one of numbers
APART = 1.05  # ratio of two clocks' steps in the same rows, from which these are no rows of both
TOGETHER = 0.9  # share of two columns' readings that stand in the same rows, where one clock serves both
FASTEST, SLOWEST = 5e3, 0.5  # [Hz] of a recorder's rows
UNITS = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}


def own_name(topic: Topic, column: str) -> str:
    """A column's name without its topic's."""
    return str(column).removeprefix(f"{topic.name}.") if topic.name else str(column)


def with_numbers(topic: Topic) -> Topic:
    """The topic, columns of numbers with a few other texts among them as numbers (NaN where they are not)."""
    found = {}
    for column, values in topic.table.items():
        if not is_numeric_dtype(values):
            numbers = as_numbers(values)
            if numbers.notna().sum() > FEWEST * values.notna().sum():
                found[str(column)] = numbers
    return dataclasses.replace(topic, table=topic.table.assign(**found)) if found else topic


def numbers_of_column(topic: Topic, column: str) -> Array:
    return measured_numbers(topic.table[column])


def clock_of(topic: Topic) -> str | None:
    """The column of times: as the format says, or a name of a clock, and (nearly) never backwards; without such a name,
    the one column in a unit of time that always advances."""
    if topic.clock:
        return topic.clock
    if topic.name and topic.name in topic.table:  # of `by_clock`
        return topic.name
    best: tuple[float, str] | None = None
    for column in map(str, topic.table.columns):
        fits = fit("time", own_name(topic, column), topic.units.get(column, ""))
        if fits is None or (slow := _advances(topic, column)) is None:
            continue
        rank = fits[0] + 1.5 * slow + 0.5 * column.endswith("log_time")
        if best is None or rank < best[0]:
            best = rank, column
    if best is not None:
        return best[1]
    timed = [c for c in map(str, topic.table.columns) if _is_in_time(topic, c) and _always_advances(topic, c)]
    return timed[0] if len(timed) == 1 else None


def _is_in_time(topic: Topic, column: str) -> bool:
    name = own_name(topic, column)
    _, stated = stated_unit(name, topic.units.get(column, ""), "time")
    if stated is None:
        return _unit_as_name(name) is not None
    return stated.sure and unit_of(stated.text, ("time",)) is not None


def _unit_as_name(name: str) -> str | None:
    """The unit of time that a column is called, `us` or `ms`; a single letter is a path or a height as well."""
    unit = unit_of(name, ("time",)) if len(name) > 1 else None
    return None if unit is None else unit.name


def _always_advances(topic: Topic, column: str) -> bool:
    values = topic.table[column]
    return is_numeric_dtype(values) and len(values) > 1 and bool(np.all(np.diff(seconds(topic, column)) > 0.0))


def _advances(topic: Topic, column: str) -> bool | None:
    """Whether a column of times repeats most of its readings; None where it does not advance."""
    if not is_numeric_dtype(topic.table[column]):
        return None
    t = seconds(topic, column)
    steps = np.diff(t[np.isfinite(t)])
    if len(steps) < 1 or np.mean(steps >= 0.0) <= ADVANCES or np.sum(steps) <= 0.0:
        return None
    return bool(np.mean(steps == 0.0) > STANDS)


def other_clocks(topic: Topic, main: str | None) -> list[str]:
    """Columns of other times (`command_t`): next to a table's own, those of commands that differ from it."""
    found = []
    for column in map(str, topic.table.columns):
        said = concepts(bracketed(own_name(topic, column))[0])[0]
        if column == main or not said & {"time", "t"} or said & {"other", "engine"}:
            continue
        if _advances(topic, column) is not False:
            continue
        if main is None or ("target" in said and np.any(topic.table[column] != topic.table[main])):
            found.append(column)
    return found


def by_clock(topic: Topic) -> list[Topic]:
    """A table in which each signal has times of its own (`r_time, r, v_time, v`), as topics; else itself."""
    main = clock_of(topic)
    several = main is not None and " (column " in main
    if topic.clock or len(topic.table.columns) < 4:
        return [topic]
    named = [c for c in map(str, topic.table.columns) if concepts(bracketed(own_name(topic, c))[0])[0] & {"time", "t"}]
    timed = [column for column in named if _advances(topic, column) is not None]
    if len(timed) < 2 or (main is not None and not several and not _side_by_side(topic, timed)):
        return [topic]
    parts: dict[str, list[str]] = {column: [column] for column in timed}
    clock = timed[0]
    for column in map(str, topic.table.columns):
        clock = column if column in parts else clock
        if column not in parts:
            parts[clock].append(column)
    return [
        dataclasses.replace(topic, name=clock, table=topic.table[columns])
        for clock, columns in parts.items()
        if columns[1:]
    ]


def _side_by_side(topic: Topic, clocks: Sequence[str]) -> bool:
    """Whether columns of times, each with signals to its right, run apart: they are no two clocks of the same rows."""
    columns = list(map(str, topic.table.columns))
    places = [columns.index(clock) for clock in clocks]
    if places[0] != 0 or places[-1] == len(columns) - 1 or min(np.diff(places)) < 2:
        return False
    times = [seconds(topic, clock) for clock in clocks]
    known = np.isfinite(times).all(axis=0)
    steps = [np.diff(t[known]) for t in times]
    if len(steps[0]) < 1 or any(np.any(step <= 0.0) for step in steps):
        return False
    rates = [float(np.median(step)) for step in steps]
    return max(rates) > APART * min(rates)


def time_unit(topic: Topic, column: str) -> str:
    """The unit of a clock: packed where it jumps so, as stated (`?` where that is not known), or by its steps."""
    numbers = numbers_of_column(topic, column)
    if packed := packed_unit(numbers):
        return packed
    _, stated = stated_unit(str(column), topic.units.get(column, ""), "time")
    if stated is not None:
        known = unit_of(stated.text, ("time",))
        if known is not None:
            return known.name
        if re.fullmatch(r"h+\W?m+\W?s+\W?[s\d0f#]*", stated.text.lower()):
            return next((unit for unit in PACKED if np.isfinite(packed_seconds(numbers, unit)).any()), "?")
        return "?"
    if named := _unit_as_name(own_name(topic, column)):
        return named
    seen = numbers[np.isfinite(numbers)]
    steps = np.diff(seen)
    if not np.any(steps > 0.0):
        return "s"
    step = float(np.median(steps[steps > 0.0]))
    if any(low < seen[0] < high for low, high in DATES) and step < STEPS["h"][1]:
        return "day"
    return next((unit for unit, (low, high) in STEPS.items() if low <= step <= high), "ns" if step > 1.0 else "s")


def seconds(topic: Topic, column: str) -> Array:
    """Times [s] of a topic's rows by that column."""
    numbers, unit = numbers_of_column(topic, column), time_unit(topic, column)
    return clock_seconds(numbers, "s" if unit == "?" else unit)


def rate_of(t: Array) -> float:
    """Readings a second of a clock [n] [s]; 0 where it does not advance."""
    steps = np.diff(t[np.isfinite(t)])
    steps = steps[steps > 0.0]
    return float(1.0 / np.median(steps)) if len(steps) else 0.0


def read_together(topic: Topic, columns: Sequence[str]) -> list[list[str]]:
    """Groups of columns that are read in the same rows; a table with blanks has several, the fullest first."""
    rows: dict[str, NDArray[np.bool_]] = {}
    groups: list[list[str]] = []
    for column in columns:
        here = np.isfinite(numbers_of_column(topic, column))
        rows[column] = here
        home = next((group for group in groups if _together(rows[group[0]], here)), None)
        if home is None:
            groups.append([column])
        else:
            home.append(column)
    return sorted(groups, key=lambda group: -int(np.count_nonzero(rows[group[0]])))


def _together(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> bool:
    """Whether two columns are read in the same rows, while both are read at all."""
    if one.all() and other.all():
        return True
    a, b = np.flatnonzero(one), np.flatnonzero(other)
    if not len(a) or not len(b):
        return True
    part = slice(max(a[0], b[0]), min(a[-1], b[-1]) + 1)
    both, either = np.count_nonzero((one & other)[part]), np.count_nonzero((one | other)[part])
    return bool(either > 0 and both >= TOGETHER * either)


def clock_doubts(column: str, t: Array, unit: str) -> list[str]:
    """Sentences on a clock [n] in seconds, if its unit is not what the mapping states.

    Args:
        column: its name; unit: as stated, where it is one of time.
    """
    size = next((size for size, name in UNITS.items() if name == unit), None)
    steps = np.diff(t)
    steps = steps[steps > 0.0]
    if size is None or not len(steps):
        return []
    return _another_power(column, float(np.median(steps)), unit, size) or packed_doubts(column, t / size)


def _another_power(column: str, step: float, unit: str, size: float) -> list[str]:
    if 1.0 / FASTEST <= step <= 1.0 / SLOWEST:
        return []
    fit = [(other, name) for other, name in UNITS.items() if 1.0 / FASTEST <= step / size * other <= 1.0 / SLOWEST]
    if not fit:
        return []
    # Of two that fit, the rate nearest to 100 Hz.
    other, name = min(fit, key=lambda entry: abs(np.log(step / size * entry[0] / 0.01)))
    return [
        f"the clock '{column}' has a row each {step:.3g} s as {unit}: it looks like {name} "
        f"({1.0 / (step / size * other):.3g} Hz); give its unit as {name}"
    ]


def packed_doubts(column: str, numbers: Array) -> list[str]:
    """Sentences on a clock [n] as it stands in the file, if its digits are packed: it jumps from 59 to 100."""
    unit = packed_unit(numbers)
    if unit is None:
        return []
    return [
        f"the clock '{column}' jumps by 40 each time that its last two digits pass 59: it looks like hours, minutes "
        f"and seconds in one number, which breaks a run at each minute; give its unit as {unit}"
    ]
