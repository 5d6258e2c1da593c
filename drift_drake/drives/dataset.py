"""From logs at 100 Hz to the model's samples at 10 Hz."""

from typing import Protocol

import numpy as np
import pandas as pd

from drift_drake.arrays import Array
from drift_drake.model.command_lag import lagged_commands
from drift_drake.model.samples import Samples, concatenate
from drift_drake.vehicle.bicycle import INPUTS, STATES

DECIMATION = 10  # rows of a log to a sample
MIN_SAMPLES = 5  # a drive shorter than this teaches nothing


class CurvatureLookup(Protocol):
    """What is asked of a path here; see `drift_drake.reference.path.Path`."""

    def curvature(self, s: Array) -> Array:
        """Curvature [1/m] at s [m]."""


def samples_from_log(
    table: pd.DataFrame, path: CurvatureLookup | None, vehicle: int, drive: int, phase: int = 0
) -> Samples:
    """Every tenth row of a log, from row `phase` on, as samples.

    Args:
        table: rows 0.01 s apart with t, the six measured states, s, delta_cmd and tau_cmd.
        path: that e, dphi and s refer to; None for a straight one (of no curvature).
    """
    commands = table[[f"{name}_cmd" for name in INPUTS]].to_numpy()
    states = np.concatenate([table[list(STATES)].to_numpy(), lagged_commands(table["t"].to_numpy(), commands)], axis=1)
    states, commands = states[phase::DECIMATION], commands[phase::DECIMATION]
    count = max(0, len(states) - 1)
    if path is None:
        curvature = np.zeros(count)
    else:
        fine = np.asarray(path.curvature(table["s"].to_numpy()))
        # The mean over a step: trapezoidal over the rows between its ends.
        middle = 0.5 * (fine[1:] + fine[:-1])
        curvature = np.array([middle[phase + DECIMATION * k :][:DECIMATION].mean() for k in range(count)])
    return Samples(states[:-1], commands[:-1], commands[1:], states[1:], curvature, np.full(count, vehicle),
                   np.full(count, drive))  # fmt: skip


def all_phases(parts: list[list[Samples]]) -> Samples:
    """One table of all ten ways to take every tenth row, the phases one after the other, each a drive of its own.

    Args:
        parts: [phase][drive].
    """
    numbered, drives = [], 0
    for drives_of_phase in parts:
        for samples in drives_of_phase:
            numbered.append(samples._replace(drive=np.full(len(samples.x), drives)))
            drives += 1
    return concatenate(numbered)
