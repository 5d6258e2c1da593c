"""Bad samples of a channel: spikes, a few rows far from what those on both sides say, and frozen rows."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.car.log.driving import in_spans, spans
from drift_drake.gap.logs.noise import step, white_noise_level

LONGEST = 5  # rows of a spike; what lasts longer may be the car
NEIGHBOURS = 8  # rows on either side that say what is expected; as many at a run's ends are not judged
FROM_RANGE = 4.0  # half ranges of the neighbouring rows that a spike lies outside of them
FROM_NOISE = 8.0  # standard deviations of the channel's white noise
FROM_USUAL = 8.0  # times what one row in a hundred of this channel lies outside of its neighbours
USUAL = 0.99
FROM_MANY, MANY = 40.0, 0.97  # the same where more than one row in a hundred is a spike
STEPS = 2.5  # steps of the channel's numbers, which rounding may make of a small change
PASSES = 10  # a large spike hides smaller ones next to it
# Of frozen rows.
SHORTEST = 5  # rows
LONGEST_HOLD = 0.5  # [s] that any sensor holds a reading for: longer stretches are no yardstick of its usual hold
BEYOND_HOLD = 3.0  # times as long as the channel usually holds a reading
FINE = 0.1  # of the usual change from reading to reading, below which its resolution explains no repetition
MOVES = 0.1  # of the usual change, from which a channel moves before and after
STOPS = 0.2  # the same where only one side is there to tell
JUMP = 5.0  # usual changes, and changes right after it, that a coarse channel has missed when it is released
STRAIGHT = 1e-3  # of the bends at the readings: rows that lie on the line between slower readings
STANDING = 0.05  # of the high speeds of a run, below which everything may stand still
FAR = 20.0  # usual changes to a value that no car reaches within a row
EDGE = 5  # readings next to a stretch that tell whether the channel moved
# Of commands.
REST = 0.98  # share of a run's rows that a command usually lies in
FROM_COMMANDS = 30.0  # times what these have
Columns = Mapping[str, np.ndarray]
Span = tuple[int, int]
MEASURED = ("psi", "r", "v", "beta", "omega_r", "ax", "ay")


def spikes(values: np.ndarray, resolution: float = 0.0) -> list[tuple[int, int]]:
    """Spans of rows (start, stop), in order, that are spikes of the signal [n].

    A row is one where it lies outside of the range of its neighbours on both sides, by far more than that range, than
    the channel's white noise and than its rows usually do. Next to a step the range holds the step, so that hard
    steering, wheel spin or a reading that is held for some rows are none.

    Args:
        resolution: step of the signal's numbers (`noise.step`).
    """
    if len(values) <= 2 * NEIGHBOURS + LONGEST:
        return []
    found: list[tuple[int, int]] = []
    cleaned = values.astype(float)
    for _ in range(PASSES):
        new = _clear_spikes(cleaned, resolution)
        if not new:
            break
        found += new
        cleaned = filled(values, found)
    return spans(in_spans(found, len(values)))


def command_dropouts(values: np.ndarray, period: float, farthest: float) -> list[Span]:
    """Spans of rows (start, stop) in which a command [n] is no number that anything has commanded.

    A command may jump and pulse, so that its neighbours say little: a short part is one where it lies beyond what is
    possible, or a few rows where it is many times what the rest of the run has.

    Args:
        period: time between rows [s]; farthest: largest possible value, in the command's unit.
    """
    size = np.abs(values)
    usual = float(np.quantile(size, REST))
    if usual == 0.0:
        usual = farthest / FROM_COMMANDS  # no command but in the part itself: only the possible tells
    found = [(start, stop) for start, stop in spans(size > FROM_COMMANDS * usual) if stop - start <= LONGEST]
    if usual < farthest:  # otherwise the whole column has another unit, which is doubted elsewhere
        found += [(start, stop) for start, stop in spans(size > farthest) if (stop - start) * period < LONGEST_HOLD]
    # Rows next to it may lie on the line from a good reading to the bad one.
    near = [(max(start - (stop - start), 0), stop + (stop - start)) for start, stop in found]
    bad = in_spans(near, len(values)) if near else np.zeros(len(values), dtype=np.bool_)
    return spans(bad) if not bad.all() else []


def filled(values: np.ndarray, bad: Sequence[tuple[int, int]]) -> np.ndarray:
    """The signal [n] with bad spans of rows on the line between the rows next to them."""
    good, rows = ~in_spans(bad, len(values)), np.arange(len(values))
    return np.where(good, values, np.interp(rows, rows[good], values[good]))


def _clear_spikes(values: np.ndarray, resolution: float) -> list[tuple[int, int]]:
    """Spikes that stand out with the neighbours as they are, the longest first, none overlapping."""
    taken = np.zeros(len(values), dtype=np.bool_)
    noise, medians = white_noise_level(values), _medians(values)
    found = []
    for width in range(LONGEST, 0, -1):
        outside, half_range = _outside_neighbours(values, medians, width)
        rare, many = (max(float(q), 0.0) for q in np.quantile(outside, [USUAL, MANY]))
        usual = min(FROM_USUAL * rare, FROM_MANY * many)
        least = np.maximum(FROM_RANGE * half_range, max(FROM_NOISE * noise, usual))
        # What is as small as the rounding of the numbers is no evidence.
        least = np.maximum(least, max(STEPS * resolution, 1e-5 * float(np.max(np.abs(values)))))
        for i in np.flatnonzero(outside > least):
            start, stop = int(i) + NEIGHBOURS, int(i) + NEIGHBOURS + width
            near = slice(max(start - LONGEST, 0), stop + LONGEST)
            if not np.any(taken[near]):
                taken[start:stop] = True
                found.append((start, stop))
    return found


@compiled
def _outside_neighbours(values: Any, medians: Any, width: int) -> Any:
    """How far each window of `width` rows lies outside of its neighbours' range, and half that range.

    Both [n - 2 NEIGHBOURS - width + 1], in the signal's unit, relative to the line through the medians of either side;
    of the neighbours the farthest is left out. Of a window's rows the one that lies outside least counts.

    Args:
        medians: of the signal's stretches of NEIGHBOURS rows [n - NEIGHBOURS + 1].
    """
    total = 2 * NEIGHBOURS + width
    count = len(values) - total + 1
    outside, half_range, near = np.empty(count), np.empty(count), np.empty(2 * NEIGHBOURS)
    for i in range(count):
        left, right = medians[i], medians[i + NEIGHBOURS + width]
        middle, slope = 0.5 * (left + right), (right - left) / (NEIGHBOURS + width)
        lowest, low, high, highest = np.inf, np.inf, -np.inf, -np.inf  # the two least, the two largest
        for j in range(2 * NEIGHBOURS):
            at = j if j < NEIGHBOURS else j + width
            q = near[j] = values[i + at] - middle - slope * (at - 0.5 * (total - 1))
            low = min(low, max(lowest, q))
            lowest = min(lowest, q)
            high = max(high, min(highest, q))
            highest = max(highest, q)
        if _lies_low(near, lowest, highest):
            high = highest
        else:
            low = lowest
        half_range[i] = 0.5 * (high - low)
        least = np.inf
        for at in range(NEIGHBOURS, NEIGHBOURS + width):
            q = values[i + at] - middle - slope * (at - 0.5 * (total - 1))
            least = min(least, abs(q - 0.5 * (high + low)))
        outside[i] = least - half_range[i]
    return outside, half_range


@compiled
def _lies_low(near: Any, lowest: float, highest: float) -> bool:
    """Whether the lowest of the numbers [2 NEIGHBOURS] is farther from their median than the highest is."""
    centre, rounding = 0.5 * (lowest + highest), 1e-9 * (highest - lowest)
    below = above = 0
    for q in near:
        below += q < centre - rounding
        above += q > centre + rounding
    if max(below, above) > NEIGHBOURS:
        return bool(above > below)
    median = _median(near)
    return bool(median - lowest > highest - median)


@compiled
def _median(near: Any) -> float:
    """Of an even number of numbers, which are sorted by it."""
    for j in range(1, len(near)):
        q, k = near[j], j
        while k > 0 and near[k - 1] > q:
            near[k] = near[k - 1]
            k -= 1
        near[k] = q
    return float(0.5 * (near[len(near) // 2 - 1] + near[len(near) // 2]))


@compiled
def _medians(values: Any) -> Any:
    """Of the signal's stretches of NEIGHBOURS rows [n - NEIGHBOURS + 1]."""
    found = np.empty(len(values) - NEIGHBOURS + 1)
    for i in range(len(found)):
        found[i] = _median(values[i : i + NEIGHBOURS].copy())
    return found


def frozen(values: np.ndarray, v: np.ndarray, resolution: float, period: float = 0.01) -> list[tuple[int, int]]:
    """Spans of rows (start, stop) in which the signal [n] repeats one value although it should have changed.

    Slow sensors hold each reading for some rows, and coarse ones repeat readings while the car hardly moves: a stretch
    is frozen where it lasts much longer than the channel's usual hold and the channel moves on both sides of it; where
    the resolution is coarse, or rows are interpolated between slower readings that may repeat, only if the value has
    jumped by many steps when it ends.

    Args:
        v: speed [n]; a standing car repeats everything. resolution: step of the signal's numbers (`noise.step`);
        period: time between rows [s].
    """
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    lengths = np.diff(edges)
    if len(lengths) < 2 * EDGE:
        return []  # constant, or hardly ever read
    readings = values[edges[:-1]]
    changes = np.abs(np.diff(readings))
    usual = float(np.median(changes))
    short = lengths[lengths * period <= LONGEST_HOLD]
    hold = _weighted_median(short if len(short) else lengths)
    fine = resolution < FINE * usual and not _interpolated(values)
    standing = STANDING * float(np.quantile(v, 0.95))
    found = []
    for i in np.flatnonzero(lengths >= max(SHORTEST, BEYOND_HOLD * hold)):
        start, stop = int(edges[i]), int(edges[i + 1])
        before, after = changes[max(i - EDGE, 0) : i], changes[i : i + EDGE]
        jump = max(_jump(before[::-1], usual), _jump(after, usual))
        if float(np.median(v[start:stop])) < standing and jump < FAR:
            continue
        if fine:
            moved = [float(np.mean(part)) for part in (before, after) if len(part)]
            least = MOVES if len(moved) == 2 else STOPS
            # A channel that is zero up to its first change, or from its last on, may have nothing to tell.
            idle = len(moved) < 2 and values[start] == 0.0 and jump < JUMP
            reported = not idle and all(m >= least * usual for m in moved)
        else:
            reported = jump >= JUMP
        if reported:
            found.append((start, stop))
    return found


def _weighted_median(lengths: np.ndarray) -> float:
    """Length of the stretch that a row of the run usually lies in."""
    ordered = np.sort(lengths)
    return float(ordered[np.searchsorted(np.cumsum(ordered), 0.5 * np.sum(ordered))])


def _jump(changes: np.ndarray, usual: float) -> float:
    """The first of the changes next to a stretch, in usual ones or those that follow it, whichever are larger."""
    if not len(changes):
        return 0.0
    following = float(np.median(changes[1:])) if len(changes) > 1 else 0.0
    return float(changes[0]) / max(usual, following)


def _interpolated(values: np.ndarray) -> bool:
    """Whether rows lie on lines between slower readings: two of five bend, if at all, far less than some do."""
    first = np.diff(values)
    bends = np.abs(np.diff(first))[first[1:] != 0.0]
    if not len(bends):
        return True
    few, most = np.quantile(bends, [0.4, 0.97])
    return bool(few < STRAIGHT * most)


def without_stuck(runs: Sequence[Columns], period: float, fewest: int) -> tuple[list[Columns], list[str]]:
    """The parts of runs in which no measured column is stuck, and a sentence on each that is.

    Args:
        runs: columns of the log format [rows] by run, `t` and `v` among them; period: time between rows [s];
        fewest: rows of a part.
    """
    parts: list[Columns] = []
    found: dict[str, list[tuple[float, float]]] = {}
    for columns in runs:
        held = {name: stuck(columns[name], columns["v"], period) for name in MEASURED if name in columns}
        for name, stretches in held.items():
            times = [(float(columns["t"][start]), float(columns["t"][stop - 1])) for start, stop in stretches]
            found.setdefault(name, []).extend(times)
        bad = [stretch for stretches in held.values() for stretch in stretches]
        if not bad:
            parts.append(columns)
            continue
        good = [(start, stop) for start, stop in spans(~in_spans(bad, len(columns["v"]))) if stop - start >= fewest]
        parts += [{name: values[start:stop] for name, values in columns.items()} for start, stop in good]
    return parts, [_sentence(name, stretches) for name, stretches in found.items() if stretches]


def stuck(values: np.ndarray, v: np.ndarray, period: float) -> list[tuple[int, int]]:
    """Frozen stretches [rows] that last longer than any sensor holds a reading."""
    least = round(LONGEST_HOLD / period)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    if np.max(np.diff(edges)) <= least:
        return []
    return [(start, stop) for start, stop in frozen(values, v, step(values), period) if stop - start > least]


def _sentence(name: str, stretches: Sequence[tuple[float, float]]) -> str:
    lasting = sum(end - begin for begin, end in stretches)
    times = f"from {stretches[0][0]:.2f} to {stretches[0][1]:.2f} s"
    if len(stretches) > 1:
        times = f"for {lasting:.3g} s in {len(stretches)} stretches, the first {times}"
    return (
        f"column {name} is frozen {times}: one value while the car moves; 'check' and 'diagnose' leave these rows out, "
        "map another column if there is one."
    )
