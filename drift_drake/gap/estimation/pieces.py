"""Pieces of long logs, spread evenly over them: which are taken depends on their places, not on what happened."""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from drift_drake.car.log.table import Run

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def lasting(run: Run) -> float:
    """From a run's first row to its last [s]: a drive of 4.5 s has one row more than periods."""
    return float(run.t[-1] - run.t[0])


def pieces_of(run: Run, seconds: float, longest: float = np.inf) -> list[Run]:
    """A run in pieces of equal length, about so long, named by the seconds of the run that they begin at.

    longest: [s] that a piece is cut to.
    """
    count = max(round(lasting(run) / seconds), 1)
    if count == 1:
        return [run] if lasting(run) < 1.5 * longest else [run.rows(0, round(1.5 * longest / run.period))]
    edges = np.linspace(0, len(run), count + 1).round().astype(int)
    most = min(longest / run.period, len(run))
    return [
        dataclasses.replace(
            run.rows(int(a), min(int(b), int(a) + round(most))),
            name=f"{run.name} from {run.t[a] - run.t[0]:.0f} s",
            recording=run.recording or run.name,
        )
        for a, b in itertools.pairwise(edges)
    ]


def spread(pieces: Sequence[Run], most: float, later: Sequence[bool] | np.ndarray | None = None) -> list[int]:
    """Indices of pieces that last so long together [s], or of one, spread evenly; those `later` after all others.

    Multiples of the golden ratio fall evenly and in no rhythm: manoeuvres that take turns are all met.
    """
    last = np.zeros(len(pieces), dtype=bool) if later is None else np.asarray(later, dtype=bool)
    place = np.empty(len(pieces))
    for kind in (False, True):
        place[last == kind] = np.arange(np.count_nonzero(last == kind)) * GOLDEN % 1.0
    order = np.lexsort((place, last))
    until = np.cumsum([lasting(pieces[i]) for i in order])
    return [int(i) for i in sorted(order[: max(int(np.count_nonzero(until <= most)), 1)])]
