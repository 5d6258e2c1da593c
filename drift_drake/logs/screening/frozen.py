"""Frozen rows: a channel that repeats the very same value while the car moves."""

import numpy as np

SHORTEST = 5  # rows
BEYOND_HOLD = 3.0  # times as long as the channel usually holds a reading
FINE = 0.1  # of the usual change from reading to reading, below which its resolution explains no repetition
MOVES = 0.1  # of the usual change, from which a channel moves before and after
STOPS = 0.2  # the same where only one side is there to tell
JUMP = 5.0  # usual changes, and changes right after it, that a coarse channel has missed when it is released
STRAIGHT = 1e-3  # of the bends at the readings: rows that lie on the line between slower readings
STANDING = 0.05  # of the high speeds of a run, below which everything may stand still
FAR = 20.0  # usual changes to a value that no car reaches within a row
EDGE = 5  # readings beside a stretch that tell whether the channel moved


def frozen(values: np.ndarray, v: np.ndarray, resolution: float) -> list[tuple[int, int]]:
    """Spans of rows (start, stop) in which the signal [n] repeats one value although it should have changed.

    Slow sensors hold each reading for some rows, and coarse ones repeat readings while the car hardly moves: a stretch
    is frozen where it lasts much longer than the channel's usual hold and the channel moves on both sides of it; where
    the resolution is coarse, or rows are interpolated between slower readings that may repeat, only if the value has
    jumped by many steps when it ends.

    Args:
        v: speed [n]; a standing car repeats everything. resolution: step of the signal's numbers (`noise.step`).
    """
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    lengths = np.diff(edges)
    if len(lengths) < 2 * EDGE:
        return []  # constant, or hardly ever read
    readings = values[edges[:-1]]
    changes = np.abs(np.diff(readings))
    usual = float(np.median(changes))
    hold = _weighted_median(lengths)
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
            idle = len(moved) < 2 and values[start] == 0.0
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
    """The first of the changes beside a stretch, in usual ones or those that follow it, whichever are larger."""
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
