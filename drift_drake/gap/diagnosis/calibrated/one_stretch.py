"""Seconds of the logs that hold a gap: a cause that acts throughout is judged without them.

Where a wheel lifts, a car spins or a tyre bursts for a while, a few windows are farther off than any cause explains,
and what acts in all of the driving is lost among them.
"""

import numpy as np

from drift_drake.common.errors import significant
from drift_drake.gap.diagnosis.calibrated.changed_car import changed_car
from drift_drake.gap.estimation.lost_blocks import FAR, as_often, lost_blocks, transitions
from drift_drake.gap.estimation.scores import block_scores
from drift_drake.gap.evidence.hypotheses import Hypothesis
from drift_drake.gap.evidence.posterior import NONE
from drift_drake.gap.evidence.ranking import DayRanked
from drift_drake.gap.evidence.search import Search

MOST = 0.2  # share of the blocks of time that a gap may be held by, to be one of a few seconds
HELD = 0.7  # share of the gap that they hold then; both were set on a van whose wheel locks (validation)
FEW = 2  # stretches of a run that are said one by one
USUAL = (
    f"predictions are more than {FAR:g} times their usual errors off in {{}}, as in about as much of the baseline: "
    "the car is judged by the rest of its driving"
)


def odd_blocks(search: Search, h: Hypothesis) -> np.ndarray:
    """Blocks [blocks] (bool) that hold nearly all of what a hypothesis leaves; none where more hold it."""
    there = changed_car(search, h) if h.names else search
    day, normal = there.day, there.normal
    scores = block_scores(day, day.errors, normal.scales, normal.precision)
    held = scores @ there.scatter.inverse @ there.scores({})
    out = np.zeros(len(held), dtype=bool)
    most = np.argsort(-held)[: int(MOST * len(held))]
    if held[most].sum() >= HELD * held.sum() > 0.0:
        out[most] = held[most] > np.mean(held)
    return out


def usual_blocks(search: Search) -> np.ndarray:
    """Blocks [blocks] (bool) that no prediction follows, if the baseline has as many of these; else none."""
    day, normal = search.day, search.normal
    lost = lost_blocks(day.errors, normal.offset, normal.scales, day.block)
    usual = as_often(transitions(lost, day.block, day.run), normal.lost)
    return lost if usual else np.zeros_like(lost)


def without(search: Search, odd: np.ndarray) -> Search:
    """The search in the windows of the other blocks; odd: [blocks] (bool)."""
    rest = search.day.kept(~odd[search.day.block])
    return Search(rest, search.normal, search.vehicle, list(search.ranges), search.threads)


def stretches_in_words(search: Search, odd: np.ndarray) -> str:
    """Runs and times [s] of blocks, in words; of a run with many stretches, how much of it they are."""
    day, out = search.day, []
    for k, run in enumerate(day.runs):
        blocks = np.unique(day.block[day.run == k])
        starts = [run.starts[day.block[day.run == k] == block] * run.period for block in blocks]
        ends = [(float(at.min()), float(at.max()) + run.horizons[-1]) for at in starts]
        numbers = np.flatnonzero(odd[blocks])
        pieces = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
        times = [(ends[piece[0]][0], ends[piece[-1]][1]) for piece in pieces if len(piece)]
        if len(times) > FEW:
            out.append(f"{run.name} for {significant(sum(end - start for start, end in times), 2)} s here and there")
        elif times:
            words = [f"between {start:.1f} and {end:.1f} s" for start, end in times]
            out.append(f"{run.name} {' and '.join(words)}")
    return ", ".join(out)


def stretch_sentence(where: str, rest: DayRanked) -> str:
    """That a few seconds hold most of a gap, and what is said without them."""
    without = "without them no cause is named either"
    if rest.verdict == NONE:
        without = f"without them these logs show no gap (probability {rest.probabilities[NONE]:.2f} of none)"
    elif named_alone(rest):
        without = "the cause is judged without them"
    return f"most of the gap is in a few seconds, {where}: look at the logs there; {without}"


def named_alone(found: DayRanked) -> bool:
    """Whether a cause is named, without something else."""
    return found.verdict == "effect" and not found.something_else
