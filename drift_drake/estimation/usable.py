"""The parts of runs that an estimator can use: moving, and not spun."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.logs.driving import driven
from drift_drake.logs.table import InvalidLogError, Run
from drift_drake.vehicle.parameters import VehicleParameters

LEAST_ROWS = 150  # of a part


def usable(runs: Sequence[Run], vehicle: VehicleParameters) -> tuple[list[Run], list[str]]:
    """Runs cut where they spin or stand, each part a run of its own, and warnings about it.

    Raises:
        InvalidLogError: nothing is left.
    """
    kept, warnings = [], []
    for run in runs:
        edges = np.flatnonzero(np.diff(np.concatenate([[False], driven(run, vehicle), [False]])))
        parts = [(int(a), int(b)) for a, b in edges.reshape(-1, 2) if b - a >= LEAST_ROWS]
        if not parts:
            warnings.append(f"{run.name}: left out, no {LEAST_ROWS} rows without a spin or standstill")
            continue
        if parts != [(0, len(run))]:
            spans = " and ".join(f"{run.t[a]:.2f} to {run.t[b - 1]:.2f} s" for a, b in parts)
            warnings.append(f"{run.name}: only {spans} are used (spin or standstill)")
        for number, (a, b) in enumerate(parts):
            name = run.name if len(parts) == 1 else f"{run.name}_{number}"
            kept.append(dataclasses.replace(run.rows(a, b), name=name))
    if not kept:
        raise InvalidLogError("no run has a second and a half between spins and standstill; log longer drives")
    return kept, warnings
