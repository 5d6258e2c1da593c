"""Of long logs the part that an estimator which keeps rows works on: pieces spread evenly over all runs."""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from drift_drake.logs.table import Run

MOST_SECONDS = 300.0
PIECE = 12.0  # [s], about, that longer runs are cut into
ROUNDING = 1e-6  # [s]
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def part_of(runs: Sequence[Run], most: float = MOST_SECONDS) -> tuple[list[Run], list[str]]:
    """At most so many seconds of the runs, and a sentence that says so; all runs as they are where they last no longer.

    Which pieces are taken depends on their places alone, not on what happened in them.
    """
    total = sum(_seconds(run) for run in runs)
    most += ROUNDING
    if total <= most:
        return list(runs), []
    pieces = [piece for run in runs for piece in _pieces(run)]
    # Multiples of the golden ratio fall evenly and in no rhythm: manoeuvres that take turns are all met.
    order = np.argsort(np.arange(len(pieces)) * GOLDEN % 1.0)
    lasting = np.cumsum([_seconds(pieces[i]) for i in order])
    kept = sorted(order[: max(int(np.count_nonzero(lasting <= most)), 1)])
    used = sum(_seconds(pieces[i]) for i in kept)
    sentence = f"of {total:.0f} s of logs {used:.0f} s are used, {len(kept)} pieces spread evenly over them"
    return [pieces[i] for i in kept], [sentence]


def _seconds(run: Run) -> float:
    return float(run.t[-1] - run.t[0])


def _pieces(run: Run) -> list[Run]:
    """A run in pieces of equal length, named by the seconds of the run that they begin at."""
    count = max(round(_seconds(run) / PIECE), 1)
    if count == 1:
        return [run]
    edges = np.linspace(0, len(run), count + 1).round().astype(int)
    return [
        dataclasses.replace(
            run.rows(a, b), name=f"{run.name} from {run.t[a] - run.t[0]:.0f} s", recording=run.recording or run.name
        )
        for a, b in itertools.pairwise(edges)
    ]
