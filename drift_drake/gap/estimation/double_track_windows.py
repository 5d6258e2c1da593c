"""Predictions over short windows by the double-track car: `windows` for a car that has four wheels, roll and load.

The car's own states (`motion.OwnStates`), which no sensor reads, are run along the measured motion up to each start.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.compilation import compiled
from drift_drake.car.double_track.motion import settled_states
from drift_drake.car.double_track.parameters import DoubleTrackConstants
from drift_drake.car.double_track.stepping import OWN, SIZE, advance_state
from drift_drake.car.effects.magnitudes import Effects, unbiased
from drift_drake.car.road import on_road
from drift_drake.common.arrays import Array
from drift_drake.gap.estimation.filter_state import MIN_FILTER_SPEED
from drift_drake.gap.estimation.windows import HORIZONS, LARGEST_ERROR, PREDICTED, WindowedRun

STEP = 0.0034  # [s] of Runge-Kutta, at most: the rear rims ring in their tyres at 300 rad/s, of light wheels at 600


def double_track_errors(runs: Sequence[WindowedRun], car: DoubleTrackConstants, effects: Effects) -> Array:
    """Prediction errors [windows of all runs, HORIZONS, 5], measured less predicted; zero where nothing is measured.

    Raises:
        ValueError: a run without torque.
    """
    if any(run.fed for run in runs):
        raise ValueError("the column tau_cmd is missing; a double-track car is predicted under its torque")
    return np.concatenate([_run_errors(run, car, effects) for run in runs])


def _run_errors(run: WindowedRun, car: DoubleTrackConstants, effects: Effects) -> Array:
    commands = np.ascontiguousarray(np.stack([run.delta, run.tau], axis=1))
    out = np.empty((len(run.starts), HORIZONS, len(PREDICTED)))
    substeps = math.ceil(run.period / STEP)
    dynamic, banked = on_road(run.bank, car.mass, car.gravity, effects)
    force_y = np.ascontiguousarray(banked[:, 1]) if len(banked) else np.zeros(len(commands))
    _predict(run.start_y, run.y, run.starts, run.stride_rows, commands, force_y, run.period, substeps, car,
             run.read_with(dynamic), out)  # fmt: skip
    out[..., ~run.used] = 0.0
    return out


@compiled
def _measured(y: Array, effects: Effects, x: Array) -> None:
    """Writes the measured states, biases taken out; the path is straight, and begins where the window does."""
    x[0], v, x[2], x[3] = unbiased(y[0], y[1], y[2], y[3], effects)
    x[1] = max(v, MIN_FILTER_SPEED)
    x[4], x[5] = 0.0, x[2] + y[4]


@compiled
def _row(x: Array, commands: Array, force_y: Array, row: int, period: float, substeps: int, car: DoubleTrackConstants,
         effects: Effects, work: Array) -> None:  # fmt: skip
    """One row on, in place."""
    for sub in range(substeps):
        advance_state(x, commands[row], commands[row + 1], sub / substeps, (sub + 1) / substeps, 0.0, car, effects,
                      period / substeps, work, force_y[row])  # fmt: skip


@compiled
def _predict(start_y: Array, y: Array, starts: NDArray[np.int_], stride_rows: int, commands: Array, force_y: Array,
             period: float, substeps: int, car: DoubleTrackConstants, effects: Effects,
             out: Array) -> None:  # fmt: skip
    """Writes errors [windows, horizons, 5]; start_y, y: smoothed and raw measurements [rows, 5]; commands [rows, 2].

    force_y: of gravity on a banked road, along the body's y [rows].
    """
    x, carried, work = np.zeros(SIZE), np.zeros(SIZE), np.empty((3, SIZE))
    _measured(start_y[0], effects, carried)
    own = settled_states(
        carried[0], carried[1], carried[2], carried[3], commands[0, 0], commands[0, 1], car, effects
    )  # fmt: skip
    for i in range(OWN):
        carried[6 + i] = own[i]
    row = 0
    for s in range(len(starts)):
        while row < starts[s]:
            _measured(start_y[row], effects, carried)
            _row(carried, commands, force_y, row, period, substeps, car, effects, work)
            row += 1
        x[:] = carried
        _measured(start_y[row], effects, x)
        for h in range(out.shape[1]):
            for k in range(stride_rows):
                _row(x, commands, force_y, row + h * stride_rows + k, period, substeps, car, effects, work)
            end = row + (h + 1) * stride_rows
            r, v, beta, omega_r = unbiased(y[end, 0], y[end, 1], y[end, 2], y[end, 3], effects)
            out[s, h, 0], out[s, h, 1], out[s, h, 2] = r - x[0], v - x[1], beta - x[2]
            out[s, h, 3], out[s, h, 4] = omega_r - x[3], y[end, 4] - (x[5] - x[2])
            for i in range(out.shape[2]):
                if not abs(out[s, h, i]) < LARGEST_ERROR:
                    out[s, h, i] = LARGEST_ERROR
