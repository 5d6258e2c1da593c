"""A first mapping of a recorder's topics: of names, units and numbers, and of the motion where these leave a choice."""

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from pandas.api.types import is_numeric_dtype

from drift_drake.common.units import DIMENSIONS
from drift_drake.gap.logs.importing.candidates import (
    LOOKED_FOR,
    ColumnChoice,
    Traces,
    named_candidates,
    over_ground,
)
from drift_drake.gap.logs.importing.clocks import (
    by_clock,
    clock_of,
    other_clocks,
    own_name,
    rate_of,
    read_together,
    seconds,
    time_unit,
)
from drift_drake.gap.logs.importing.evidence import (
    LIKE,
    RADII,
    WHEELBASES,
    Trace,
    better,
    is_course,
    is_raw,
    likeness,
    product,
    ratio,
    steering_unit,
    travelled,
    units_by_motion,
    wheel_unit,
)
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.handedness import handedness, tracks
from drift_drake.gap.logs.importing.names import (
    DRIVEN,
    LIMIT,
    as_yaw,
    fit,
    is_demand,
    is_handwheel,
    is_in_g,
    stated_unit,
)
from drift_drake.gap.logs.wording.conversion import QUANTITIES, dimension, units_of

NEEDED = {"delta_cmd": "rad", "r": "rad/s", "v": "m/s"}
LARGEST = {"delta_cmd": 4.0 * np.pi, "beta": np.pi, "course": 7.0}  # [rad] of a steering wheel, of a spinning car
NEAR = 1.0  # of ranks, between which the motion decides
MOST_NAMED = 6  # columns in a sentence
BACKWARDS = 0.2  # share of readings below zero from which vx is no car's forward speed
METRES = 1.11e5  # of a degree
FASTEST = 150.0  # [m/s] of a vehicle whose latitude and longitude these may be
TOGETHER = 0.1  # of a recording, within which clocks of one epoch have their first readings
FARTHEST = 50.0  # [deg] that road wheels are turned by, but of few drift cars
RADIUS = 0.3  # [m] of a wheel, where nothing tells it


class Guess(NamedTuple):
    """A mapping file's content; quantities that a log needs and nothing looks like; sentences on what was chosen."""

    mapping: dict[str, Any]
    missing: list[str]
    notes: list[str]


def guessed_mapping(topics: Sequence[Topic]) -> Guess:
    """A first mapping of these topics."""
    topics = [part for topic in topics for part in by_clock(topic)]
    clocks = {topic.name: clock for topic in topics if (clock := clock_of(topic)) is not None}
    times = {topic.name: seconds(topic, clocks[topic.name]) for topic in topics if topic.name in clocks}
    rates = {name: rate_of(t) for name, t in times.items()}
    ordered = sorted(topics, key=lambda topic: -rates.get(topic.name, 0.0))
    choices = {name: fits for name in LOOKED_FOR if (fits := named_candidates(name, ordered, clocks))}
    choices = choices if {"x", "y"} & set(choices) else choices | over_ground(ordered)
    signals = Traces(times)
    found, notes = _one_position(_chosen(choices, signals), signals)
    notes += _choices_said(found, choices)
    place = _place(choices, signals)
    units, said = _units(found, signals, place)
    entries, of_column = _clock_entries(found, clocks, rates)
    blocks = [name for name, clock in clocks.items() if name == clock]  # of one table: see `by_clock`
    if len(blocks) > 1 and _began_together([times[name] for name in blocks]):
        entries = {name: entry | {"epoch": "shared"} for name, entry in entries.items()}
    if len(set(of_column.values())) > len({topic.name for topic, *_ in found.values()}):
        said.append("Columns are read in rows of their own: each such group has a clock of its own, of the same times.")
    lines: dict[str, Any] = {}
    for key, (topic, column, *_) in found.items():
        lines[key] = {"column": column, "unit": units[key]}
        if len(entries) > 1:
            lines[key]["clock"] = of_column[topic.name, column]
    read = {key: dataclasses.replace(signals(c), unit=units[key]).si() for key, c in found.items()}
    handed = handedness(found, units, read, tracks(topics, signals, place), place)
    for key, line in handed.lines.items():
        lines[key] |= line
    said += _adapted(lines, read, units) + handed.notes
    said += _clocks_said({c.topic.name: (c.topic, of_column[c.topic.name, c.column]) for c in found.values()}, clocks)
    said += _symbols_said(topics, found)
    known = set(found) | ({"v"} if {"vx", "latitude"} & set(found) else set())
    known |= {"r", "v"} if {"x", "y", "psi"} <= set(found) else set()
    mapping = {"frame": handed.frame, "clocks": entries, "signals": lines}
    return Guess(mapping, [name for name in NEEDED if name not in known], notes + said)


def _chosen(choices: Mapping[str, list[ColumnChoice]], signals: Traces) -> dict[str, ColumnChoice]:
    """One column for each quantity, none for two."""
    found: dict[str, ColumnChoice] = {}
    taken: set[tuple[str, str]] = set()

    def take(name: str, candidate: ColumnChoice) -> None:
        if name in found:
            taken.discard((found[name].topic.name, found[name].column))
        found[name] = candidate
        taken.add((candidate.topic.name, candidate.column))

    for name, candidates in choices.items():
        free = [c for c in candidates if c.rank < LIMIT and (c.topic.name, c.column) not in taken]
        if free:
            take(name, free[0])
    for name in ("r", "v", "ay", "psi", "omega_r", "delta_cmd"):
        if name in found:
            near = [found[name]] + [
                c for c in choices[name]
                if c.rank < min(LIMIT, found[name].rank + NEAR) and (c.topic.name, c.column) not in taken
            ]  # fmt: skip
            if len(near) > 1:
                known = {key: signals(c) for key, c in found.items() if key != name}
                take(name, near[better(name, [signals(c) for c in near], known)])
    if {"vx", "vy"} <= set(found) and "v" in found and np.mean(signals(found["vx"]).values < 0.0) > BACKWARDS:
        found.pop("vx"), found.pop("vy")  # of a fixed frame
    if {"vx", "vy"} <= set(found):
        found.pop("v", None)
    elif {"vx", "v"} <= set(found) and is_demand(found["v"].column) and not is_demand(found["vx"].column):
        found["v"] = found.pop("vx")
        found.pop("vy", None)
    elif "v" in found:
        found.pop("vx", None), found.pop("vy", None)
    return found


def _one_position(found: dict[str, ColumnChoice], signals: Traces) -> tuple[dict[str, ColumnChoice], list[str]]:
    """What was chosen without half a position, or one that no vehicle has; with one, x and y are made of it, and a
    heading that is the way's is the course. Sentences on it."""
    notes = []
    halves = [found[name] for name in ("latitude", "longitude") if name in found]
    if len(halves) == 2 and halves[0].topic is halves[1].topic:
        (t, north, _), (_, east, _) = (dataclasses.astuple(signals(half)) for half in halves)
        seen = np.isfinite(t) & np.isfinite(north) & np.isfinite(east)
        steps, lasting = METRES * np.hypot(np.diff(north[seen]), np.diff(east[seen])), np.diff(t[seen])
        moved = (steps > 0.0) & (lasting > 0.0)
        speed = np.median(steps[moved] / lasting[moved]) if moved.any() else 0.0
        if speed < FASTEST:
            kept = {key: c for key, c in found.items() if key not in ("x", "y")}
            if "psi" in kept and not {"r", "course"} & set(kept) and is_course(signals(kept["psi"]), t, north, east):
                kept["course"] = kept.pop("psi")
                notes.append(f"{kept['course'].column} is the way's direction: it is taken for the course.")
            return kept, notes
        notes.append(
            f"{halves[0].column} and {halves[1].column} are no degrees, or the car moves at {speed:.2g} m/s: convert "
            "degrees and minutes in one number (ddmm.mmm), or parts of a degree, and import them as degrees."
        )
    return {key: c for key, c in found.items() if key not in ("latitude", "longitude")}, notes


def _choices_said(found: Mapping[str, ColumnChoice], choices: Mapping[str, list[ColumnChoice]]) -> list[str]:
    """Sentences on quantities that several columns may be."""
    sentences = []
    used = {(c.topic.name, c.column) for c in found.values()}
    for name, candidates in choices.items():
        others = [c.column for c in candidates if (c.topic.name, c.column) not in used]
        listed = ", ".join(others[:MOST_NAMED]) + (
            f" and {len(others) - MOST_NAMED} more" if others[MOST_NAMED:] else ""
        )
        if name in found and others:
            sentences.append(f"{name} is taken from {found[name].column}; it may also be {listed}.")
        elif others and name in NEEDED and not ({"vx", "vy"} <= set(found) and name == "v"):
            sentences.append(f"{name} may be {listed}, whose name says that it is another quantity.")
        if name == "v" and name in found and found[name].rank >= DRIVEN and fit("omega_r", found[name].column):
            sentences.append("v is the wheels' speed, which slips: take the car's own if there is one.")
    return sentences


def _units(
    found: Mapping[str, ColumnChoice], signals: Traces, place: tuple[Trace, Trace] | None
) -> tuple[dict[str, str], list[str]]:
    """Units of the chosen columns: as stated, else by names and motion, else SI; and sentences on them."""
    units = {key: c.unit for key, c in found.items()}
    sentences = []
    for key, c in found.items():
        if c.unit == "?":
            _, stated = stated_unit(own_name(c.topic, c.column), c.topic.units.get(c.column, ""), key)
            text = stated.text if stated else ""
            sentences.append(
                f"The unit '{text}' of {c.column} is not known: write one of {', '.join(units_of(key))} for '?'."
            )
        if key != "omega_r" and is_raw(signals(c)):  # a wheel may turn that fast
            units[key] = "?"
            sentences.append(
                f"{c.column} cannot be in {c.unit}, as the file says, with these numbers: of raw counts, write the "
                "unit for '?' and add 'scale: FACTOR' to its line."
            )
        if c.unit is None and QUANTITIES[key] == "acceleration" and is_in_g(c.column):
            units[key] = "g"
    read = {key: dataclasses.replace(signals(c), unit=units[key]) for key, c in found.items()}
    by_motion = units_by_motion(read, _speed_of_position(found, signals, place))
    for key, size in LARGEST.items():
        if key in found and units[key] is None and np.nanmax(np.abs(read[key].values), initial=0.0) > size:
            by_motion[key] = "deg"
    if "omega_r" in found and units["omega_r"] is None and "v" in found:
        speed = dataclasses.replace(read["v"], unit=by_motion.get("v", units["v"])).si()
        if unit := wheel_unit(read["omega_r"], speed):
            by_motion["omega_r"] = unit
    if {"delta_cmd", "v", "r"} <= set(found) and units["delta_cmd"] is None and "delta_cmd" not in by_motion:
        v, r = (dataclasses.replace(read[key], unit=by_motion.get(key, units[key])).si() for key in ("v", "r"))
        if unit := steering_unit(read["delta_cmd"], v, r, is_handwheel(found["delta_cmd"].column)):
            by_motion["delta_cmd"] = unit
    if by_motion.get("ay") == "g" and "ax" in found and units["ax"] is None and found["ax"].topic is found["ay"].topic:
        by_motion["ax"] = "g"  # of one sensor
    by_motion |= {key: "deg" for key in ("latitude", "longitude") if key in found and units[key] is None}
    plain = {key: DIMENSIONS[QUANTITIES[key]][0] for key in found}
    guessed = {key: unit for key, unit in by_motion.items() if units[key] is None and unit != plain[key]}
    silent = [key for key in found if units[key] is None and key not in by_motion]
    if guessed:
        listed = ", ".join(f"{key} in {unit}" for key, unit in guessed.items())
        sentences.append(f"The file states no unit of {', '.join(guessed)}: the numbers fit {listed}.")
    if silent:
        sentences.append(f"The file states no unit of {', '.join(silent)}: SI is assumed.")
    return {key: units[key] or by_motion.get(key) or plain[key] for key in found}, sentences


def _place(choices: Mapping[str, list[ColumnChoice]], signals: Traces) -> tuple[Trace, Trace] | None:
    """Latitude and longitude [deg], whether or not they are chosen."""
    halves = [choices[name][0] for name in ("latitude", "longitude") if name in choices]
    if len(halves) < 2 or halves[0].topic is not halves[1].topic:
        return None
    north, east = (signals(half) for half in halves)
    return (north, east) if np.nanmax(np.abs(north.values), initial=0.0) <= 90.0 else None


def _speed_of_position(
    found: Mapping[str, ColumnChoice], signals: Traces, place: tuple[Trace, Trace] | None
) -> Trace | None:
    """Speed by x and y in metres, or by latitude and longitude."""
    if {"x", "y"} <= set(found) and found["x"].unit in (None, "m"):
        return travelled(signals(found["x"]), signals(found["y"]), degrees=False)
    return None if place is None else travelled(*place, degrees=True)


def _began_together(times: Sequence[np.ndarray]) -> bool:
    """Whether clocks count from the same moment: their first readings are near, relative to how long they run."""
    seen = [t[np.isfinite(t)] for t in times]
    firsts = [t[0] for t in seen if len(t)]
    return bool(firsts) and np.ptp(firsts) < TOGETHER * max(np.ptp(t) for t in seen if len(t))


def _clock_entries(
    found: Mapping[str, ColumnChoice], clocks: Mapping[str, str], rates: Mapping[str, float]
) -> tuple[dict[str, Any], dict[tuple[str, str], str]]:
    """The mapping's clocks, and the clock of each column by topic and column."""
    tables = {c.topic.name: c.topic for c in found.values()}
    used = sorted(tables, key=lambda name: (-rates.get(name, 0.0), name))
    entries: dict[str, Any] = {}
    of_column: dict[tuple[str, str], str] = {}
    for topic in used:
        bare = re.sub(r"\W+", "_", topic).strip("_") or ("recorder" if len(used) == 1 else "table")
        column = clocks.get(topic, "?")
        unit = time_unit(tables[topic], column) if column != "?" else "s"
        quantity = {c.column: key for key, c in found.items() if c.topic.name == topic}
        for number, group in enumerate(read_together(tables[topic], list(quantity))):
            name = bare if number == 0 else f"{bare}_{quantity[group[0]]}"
            entries[name] = {"column": column} | ({} if unit == "s" else {"unit": unit})
            of_column |= {(topic, one): name for one in group}
    if not entries and clocks:
        entries = {"recorder": {"column": next(iter(clocks.values()))}}
    return entries, of_column


def _clocks_said(used: Mapping[str, tuple[Topic, str]], clocks: Mapping[str, str]) -> list[str]:
    """Sentences on tables (by name, with their clock's name) without times, and on times next to a table's own."""
    sentences = []
    for name, (topic, clock) in used.items():
        others = other_clocks(topic, clocks.get(name))
        listed = ", ".join(others[:MOST_NAMED])
        if name not in clocks:
            sentences.append(
                f"No column looks like the times of {name or 'the table'}: name it in place of '?' under 'clocks'"
                f"{f' (it may be {listed})' if others else ''}, or write the rate of its rows there, as in "
                f"'{clock}: 100 Hz'."
            )
        elif others:
            sentences.append(
                f"{listed} may be times too: if signals were read at them, give these a clock of that column."
            )
    return sentences


def _symbols_said(topics: Sequence[Topic], found: Mapping[str, ColumnChoice]) -> list[str]:
    """Sentences on columns that may be the heading or its rate, or those of roll or pitch, by their symbol alone."""
    asked = {"psi": "the roll or pitch angle", "r": "the rate of roll or pitch"}
    sentences = []
    for key, other in asked.items():
        if key in found or (key == "psi" and "r" in found):
            continue
        for topic in topics:
            for column in map(str, topic.table.columns):
                fits = as_yaw(key, own_name(topic, column), topic.units.get(column, ""))
                if fits is not None and is_numeric_dtype(topic.table[column]):
                    unit = fits if fits != "?" else DIMENSIONS[QUANTITIES[key]][0]
                    sentences.append(
                        f"{column} may be {'the heading' if key == 'psi' else 'the yaw rate'}, or {other}: if it is "
                        f"the former, add '{key}: {{column: {column}, unit: {unit}}}' under 'signals'."
                    )
    return sentences


def _adapted(lines: dict[str, Any], read: Mapping[str, Trace], units: Mapping[str, str]) -> list[str]:
    """Adds a wheel's radius to its line; sentences on it, and on steering that is no road wheel's."""
    sentences = []
    if "omega_r" in lines and dimension(units["omega_r"]) == "angular rate":
        by_motion = ratio(read["omega_r"], read["v"]) if "v" in read else 0.0
        lines["omega_r"]["radius"] = round(by_motion, 3) if RADII[0] < by_motion < RADII[1] else RADIUS
        sentences.append(f"The radius of omega_r is {'that of v' if by_motion else 'a guess'}: write the wheel's own.")
    if "delta_cmd" in lines and units["delta_cmd"] != "?" and not is_handwheel(lines["delta_cmd"]["column"]):
        steer, length = read["delta_cmd"], 0.0
        if {"v", "r"} <= set(read) and abs(likeness(read["r"], product(steer, read["v"]))) > LIKE:
            length = abs(ratio(read["r"], product(steer, read["v"])))
        reach = np.degrees(np.nanmax(np.abs(steer.values), initial=0.0))
        if reach > FARTHEST or length > WHEELBASES[1]:
            sentences.append(
                f"delta_cmd reaches {reach:.0f} deg, like a steering wheel: to be the road wheel's it needs 'scale: ?' "
                "in its line, one over the steering ratio."
            )
    return sentences
