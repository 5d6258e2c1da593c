"""Stretches of runs that are kept for validation: nothing is fitted to them, and the car is judged by them."""

import dataclasses
import re
from collections.abc import Collection, Sequence

import numpy as np

from drift_drake.car.log.driving import spans
from drift_drake.car.log.table import SHORTEST_RUN, InvalidLogError, Run

STRETCH = re.compile(r"(?P<run>.+?)(?::(?P<start>\d+(?:\.\d*)?)-(?P<end>\d+(?:\.\d*)?))?", re.DOTALL)


def split(runs: Sequence[Run], stretches: Sequence[str]) -> tuple[list[Run], list[Run]]:
    """Runs to be fitted, and runs to be judged by: parts of runs that are split.

    Args:
        stretches: each a run's name, or NAME:START-END in seconds of the run's column t.

    Raises:
        InvalidLogError: a stretch is of no run, or holds too few rows; or nothing is left to be fitted.
    """
    names, held = [run.name for run in runs], [np.zeros(len(run), dtype=np.bool_) for run in runs]
    for stretch in stretches:
        name, start, end = _read(stretch, names)
        k = names.index(name)
        rows = (runs[k].t >= start) & (runs[k].t <= end)
        if np.count_nonzero(rows) < SHORTEST_RUN:
            t = runs[k].t
            raise InvalidLogError(
                f"validation stretch {stretch}: has {np.count_nonzero(rows)} rows, {SHORTEST_RUN} are the least; the "
                f"run goes from {t[0]:.4g} to {t[-1]:.4g} s"
            )
        held[k] |= rows
    fitted = [part for run, rows in zip(runs, held, strict=True) for part in _parts(run, ~rows)]
    if not fitted:
        raise InvalidLogError("validation: all runs are kept for it; leave some of them to be fitted")
    return fitted, [part for run, rows in zip(runs, held, strict=True) for part in _parts(run, rows)]


def _read(stretch: str, names: Collection[str]) -> tuple[str, float, float]:
    """A stretch's run, start and end [s]."""
    if stretch in names:
        return stretch, -np.inf, np.inf
    found = STRETCH.fullmatch(stretch)
    if found is None or found["run"] not in names or found["start"] is None:
        raise InvalidLogError(
            f"validation stretch {stretch}: is no run; give NAME or NAME:START-END, of {', '.join(names)}"
        )
    return found["run"], float(found["start"]), float(found["end"])


def _parts(run: Run, rows: np.ndarray) -> list[Run]:
    """Parts [rows] (bool) of a run that are long enough, each a run of its own."""
    if rows.all():
        return [run]
    parts = [(a, b) for a, b in spans(rows) if b - a >= SHORTEST_RUN]
    names = [run.name if len(parts) == 1 else f"{run.name}_{k}" for k in range(len(parts))]
    recording = run.recording or run.name
    return [dataclasses.replace(run.rows(a, b), name=name, recording=recording)
            for name, (a, b) in zip(names, parts, strict=True)]  # fmt: skip
