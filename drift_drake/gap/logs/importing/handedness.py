"""Whether a recorder's axes are positive to the left, as in ISO 8855, or to the right: columns that agree do not tell.

What does: a position over ground, velocities to the north and east, a compass' heading, which is clockwise from north,
and names.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.gap.logs.importing.candidates import ColumnChoice, Traces, axes_of
from drift_drake.gap.logs.importing.clocks import own_name
from drift_drake.gap.logs.importing.evidence import Trace, clockwise, derivative, product, sense, velocity
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.names import bracketed, concepts
from drift_drake.gap.logs.wording.vocabulary import pieces

LEFT, RIGHT = {"enu", "flu"}, {"ned", "frd", "down"}  # words of a yaw rate that is positive to that side
WRAP = 0.75  # of a turn, that a heading jumps by where it passes north
RELATIVE = 1.0  # [deg] from which a heading does not begin where a drive does
GROUND = {"cog", "ground", "gps", "gnss", "bearing", "track", "north"}  # words of a course that is a compass'
DOUBT = " Only its range speaks for a compass: if it is counted to the left, write "
WHOLE = (
    "Nothing here tells a log from one that is mirrored as a whole: see that psi grows in a left turn; if it does not, "
    "write 'ned' for 'iso8855' in the first line, or the other way round, and in the lines that have a frame."
)
UPRIGHT = 5.0  # [m/s^2] of a vertical acceleration that is gravity
TURNED = 0.35  # [rad] of sideslip on average, within which a heading's zero lies at an axis of x, y


class Handed(NamedTuple):
    """The frame of a mapping, what lines of signals have besides (their frame, an offset), and sentences on both."""

    frame: str
    lines: dict[str, dict[str, str | float]]
    notes: list[str]


def tracks(topics: Sequence[Topic], signals: Traces, place: tuple[Trace, Trace] | None) -> list[tuple[str, Trace]]:
    """How fast the car's direction of travel turns clockwise [rad/s], by what says so.

    place: latitude and longitude [deg].
    """
    found = [] if place is None else [("the position", clockwise(*velocity(*place, degrees=True)))]
    for topic in topics:
        columns = axes_of(topic)
        for of in ("velocity", "position"):
            if {(of, "north"), (of, "east")} <= set(columns):
                names = [columns[of, way] for way in ("north", "east")]
                north, east = (signals(ColumnChoice(topic, name, 0.0, None)) for name in names)
                ways = (north, east) if of == "velocity" else velocity(north, east, degrees=False)
                found.append((" with ".join(names), clockwise(*ways)))
    return found


def is_compass(name: str, values: Array, degrees: bool, course: bool) -> bool:
    """Whether a heading is clockwise from north: by its name, degrees from 0 to 360, and as it passes north.

    Args:
        values: readings [n] as recorded; course: whether it is the direction of travel, which receivers count so.
    """
    turn = 360.0 if degrees else 2.0 * np.pi
    seen = values[np.isfinite(values)]
    if not len(seen):
        return False
    inside = float(np.min(seen)) >= 0.0 and float(np.max(seen)) <= turn
    passes = passes_north(values, degrees)
    if course:
        return passes or (inside and degrees)
    named = "heading" in concepts(bracketed(name)[0])[0] and "psi" not in pieces(name)
    return named and inside and (passes or (degrees and float(seen[0]) > RELATIVE))


def passes_north(values: Array, degrees: bool) -> bool:
    """Whether a heading jumps by a turn within its readings [n]."""
    seen = values[np.isfinite(values)]
    return bool(np.any(np.abs(np.diff(seen)) > WRAP * (360.0 if degrees else 2.0 * np.pi)))


def handedness(
    found: Mapping[str, ColumnChoice], units: Mapping[str, str], read: Mapping[str, Trace],
    travel: Sequence[tuple[str, Trace]], place: tuple[Trace, Trace] | None = None,
) -> Handed:  # fmt: skip
    """Which way the chosen columns are positive.

    Args:
        found: columns by quantity, units: theirs, read: readings in SI; travel: of `tracks`; place: latitude and
            longitude [deg].
    """
    if frame := next((c.topic.frame for c in found.values() if c.topic.frame), ""):
        return Handed(frame, {}, [])
    rates = {name: derivative(read[name], turns=True) for name in ("psi", "course") if name in read}
    rates |= {"r": read["r"]} if "r" in read else {}
    ways: dict[str, int] = {}  # 1: positive to the left, -1: to the right
    because, doubt = "", False
    along = _along(read, place)
    turning = None if along is None else clockwise(*along)
    counted = {
        name: angle for name in ("psi", "course") if name in read and (angle := _counted(read[name], along, turning))
    }
    for name in ("psi", "course"):
        if name in found and _is_clockwise(found[name], units[name], name, counted.get(name)):
            ways[name] = -1
    for says, track in travel[::-1]:
        known = {name: -way for name in ("r", "psi") if name in rates and (way := sense(rates[name], track))}
        ways, because = ways | known, says if "r" in known else because
    known_way = bool(ways)
    if "r" not in rates and "psi" in rates:
        heading = ways.get("psi") or _from_axis_of_y(counted.get("psi"))
        rates, ways = _by_heading(read, rates, ways | ({"psi": heading} if heading else {}))
        because = found["psi"].column
    if "r" in rates and "r" not in ways:
        words = {*pieces(found["r"].topic.name), *pieces(found["r"].column)}
        said = {name: ways[name] * way for name in ways if (way := sense(rates["r"], rates[name]))}
        if said:
            name, ways["r"] = next(iter(said.items()))
            because = f"{found[name].column}, clockwise from north,"
            doubt = _by_range(found[name], units[name], name)
        elif words & (LEFT | RIGHT):
            ways["r"], because = (1 if words & LEFT else -1), "its name"
    handed = _written(found, read, rates, ways, because, doubt, turning if {"x", "y"} <= set(read) else None)
    for name, angle in counted.items():
        handed = _by_path(found, read, handed, name, angle)
    return handed if "r" in read or known_way or "psi" not in read else handed._replace(notes=[*handed.notes, WHOLE])


def _from_axis_of_y(counted: tuple[int, float] | None) -> int:
    """Which way a heading that is counted from the axis of y is positive; 0 of any other."""
    return counted[0] if counted is not None and abs(abs(counted[1]) - 0.5 * np.pi) < TURNED else 0


def _by_heading(
    read: Mapping[str, Trace], rates: dict[str, Trace], ways: dict[str, int]
) -> tuple[dict[str, Trace], dict[str, int]]:
    """Of a log without a yaw rate: the heading's, positive to the side to which the acceleration or the steering is."""
    speed = read.get("v", read.get("vx"))
    if "psi" not in ways or speed is None:
        return rates, ways
    left = Trace(rates["psi"].t, ways["psi"] * rates["psi"].values, rates["psi"].unit)
    across = product(left, speed)
    side = next((way for name in ("ay", "delta_cmd") if name in read and (way := sense(read[name], across))), 1)
    return rates | {"r": Trace(left.t, side * left.values, left.unit)}, ways | {"r": side}


def _is_clockwise(chosen: ColumnChoice, unit: str, name: str, counted: tuple[int, float] | None) -> bool:
    """Whether a heading or a course is a compass'; one that x and y speak for as much is not, for its range alone."""
    if chosen.column in chosen.topic.known:
        return True
    values = Traces({})(chosen).values
    if not is_compass(own_name(chosen.topic, chosen.column), values, unit == "deg", name == "course"):
        return False
    alike = name == "course" and counted is not None and counted[0] == 1 and abs(counted[1]) < TURNED
    return not alike or passes_north(values, unit == "deg")


def _by_range(chosen: ColumnChoice, unit: str, name: str) -> bool:
    """Whether nothing but its range and the word makes a course a compass'."""
    sure = chosen.column in chosen.topic.known or GROUND & set(pieces(chosen.column)) or name != "course"
    return not sure and not passes_north(Traces({})(chosen).values, unit == "deg")


def _along(read: Mapping[str, Trace], place: tuple[Trace, Trace] | None) -> tuple[Trace, Trace] | None:
    """The velocity along x and y; of a latitude and longitude to the north and west, as they are imported."""
    if {"x", "y"} <= set(read):
        return velocity(read["x"], read["y"], degrees=False)
    if place is None:
        return None
    north, east = velocity(*place, degrees=True)
    return north, Trace(east.t, -east.values, east.unit)


def _counted(angle: Trace, along: tuple[Trace, Trace] | None, turning: Trace | None) -> tuple[int, float] | None:
    """Whether a heading or course turns as the car's way does (1) or against it (-1), and its value [rad] along x."""
    side = 0 if turning is None else sense(derivative(angle, turns=True), turning)
    if along is None or side == 0:
        return None
    ahead, across = along
    known = np.isfinite(angle.t) & np.isfinite(angle.values)
    turned = np.interp(ahead.t, angle.t[known], np.unwrap(angle.values[known]))
    turned -= side * np.arctan2(across.values, ahead.values)
    return side, float(np.angle(np.sum(np.hypot(ahead.values, across.values) * np.exp(1j * turned))))


def _by_path(
    found: Mapping[str, ColumnChoice], read: Mapping[str, Trace], handed: Handed, of: str, counted: tuple[int, float]
) -> Handed:
    """The same, a heading (or course) that is counted from the axis of y, or against the way of x, y, in addition."""
    (side, zero), name = counted, found[of].column
    quarters = round(zero / (0.5 * np.pi))
    near = abs(zero - 0.5 * np.pi * quarters) < TURNED
    frames = (handed.lines.get(quantity, {}).get("frame", handed.frame) for quantity in (of, "y"))
    turns, mirror = (-1 if frame == "ned" else 1 for frame in frames)
    mirror = mirror if "y" in read else 1
    if near and abs(quarters) == 1 and (side == turns * mirror or "r" not in read):
        frame = "ned" if side * mirror == -1 else "iso8855"
        line: dict[str, str | float] = {} if frame == handed.frame else {"frame": frame}
        line["offset"] = round(-side * mirror * 0.5 * np.pi * quarters, 6)
        axis = "the axis of y" if "y" in read else "the east" if quarters * side == 1 else "the west"
        said = f"{name} is counted from {axis}{', clockwise' * (side == -1)}: its frame and offset say so."
        return handed._replace(lines=handed.lines | {of: line}, notes=[*handed.notes, said])
    if "r" in read or "y" not in read or of != "psi":
        return handed
    if side == -1:
        said = (
            f"{name} turns against the way of x, y: write 'ned' for '?' if it is positive to the right, or 'iso8855', "
            "and 'sign: -1' in the line of y, if y is."
        )
        return handed._replace(lines=handed.lines | {of: {"frame": "?"}}, notes=[*handed.notes, said])
    if "delta_cmd" in read and sense(read["delta_cmd"], derivative(read[of], turns=True)) == -1:
        said = (
            f"{found['delta_cmd'].column} turns against {name} and the way of x, y: write 'frame: ned' in the first "
            "line and 'frame: iso8855' in its own if these are positive to the right, or 'frame: ned' in its own."
        )
        return handed._replace(lines=handed.lines | {"delta_cmd": {"frame": "?"}}, notes=[*handed.notes, said])
    return handed


def _written(
    found: Mapping[str, ColumnChoice], read: Mapping[str, Trace], rates: Mapping[str, Trace], ways: dict[str, int],
    because: str, doubt: bool, turning: Trace | None,
) -> Handed:  # fmt: skip
    """The frames by which all is positive to the left; turning: of the way from x to y, where these are measured."""
    mirrored = ways.get("r") == -1
    of = next((found[name].column for name in ("r", "ay", "delta_cmd") if name in found), "")
    lines: dict[str, str] = {}
    notes = []
    for name in [name for name in rates if name != "r"]:
        alike = sense(rates["r"], rates[name]) if "r" in rates else 0
        way = ways.get(name) or ways.get("r", 1) * alike or (-1 if name == "course" or mirrored else 1)
        if (way == -1) != mirrored:
            lines[name] = "ned" if way == -1 else "iso8855"
    if mirrored:
        said = f"{of} is positive to the right, as {because} shows: all is read so (frame: ned)."
        notes.append(f"{said}{DOUBT}'frame: iso8855'." if doubt else said)
        if "az" in read and float(np.nanmedian(read["az"].values)) > UPRIGHT:
            lines["az"] = "iso8855"
    elif lines.get("psi") == "ned":
        why = "turns against r: it" if "r" in read else f"({found['psi'].column})"
        notes.append(f"psi {why} is taken for a compass' heading, positive to the right (frame: ned).")
    if "r" in ways and turning is not None:
        alike = sense(rates["r"], turning)
        if alike and (alike * ways["r"] == -1) != mirrored:
            lines["y"] = "iso8855" if mirrored else "ned"
    if doubt and not mirrored:
        said = f"{of} is positive to the left, as {because} shows."
        notes.append(f"{said}{DOUBT}'frame: ned', and 'frame: iso8855' in the line of the course.")
    speed = read.get("v", read.get("vx"))
    if "r" in ways and speed is not None:
        across = product(rates["r"], speed)
        against = [name for name in ("ay", "delta_cmd") if name in read and sense(read[name], across) == -1]
        lines |= dict.fromkeys(against, "iso8855" if mirrored else "ned")
        other = "r" if "r" in read else "the heading"
        notes += [f"{name} turns against {other}: it is positive to the other side (its frame)." for name in against]
    elif "r" in rates and "r" not in ways and found["r"].column != "r" and not found["r"].topic.name.startswith("/"):
        notes.append(
            "Nothing here tells whether r is positive to the left: if it is negative in a left turn, write "
            "'frame: ned' in the first line."
        )
    return Handed("ned" if mirrored else "iso8855", {name: {"frame": frame} for name, frame in lines.items()}, notes)
