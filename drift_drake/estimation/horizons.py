"""Errors of open-loop predictions over several horizons, restarted from filtered states."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drift_drake.estimation.commands import STAGES, SUBSTEPS, without_actuators
from drift_drake.estimation.filter_state import MEASURED, SIZE, advance_row, predict_measurement, rates_of
from drift_drake.estimation.problem import Gains, Problem, car, filtered_states, run_commands
from drift_drake.estimation.run_data import RunData
from drift_drake.vehicle.compilation import compiled

STATES = ("r", "v", "beta", "omega_r")
HORIZONS = (0.01, 0.1, 0.5, 2.0)  # [s]
EVERY = 10  # rows between restarts
JUDGED = 2  # horizon by which a gap is judged: half a second, which a controller plans over


def start_rows(run: RunData) -> np.ndarray:
    """Rows that predictions of a run start from; in one piece, as strides would be compiled for anew."""
    return np.ascontiguousarray(np.flatnonzero(run.counted)[::EVERY])


@compiled
def roll_out(
    states: Any, starts: Any, steps: Any, delta: Any, torque: Any, period: Any, constants: Any, effects: Any, out: Any
) -> Any:
    """Predicted measurements out [starts, horizons, 9] at `steps` [horizons] rows after each start; NaN beyond the end.

    Args:
        states: filtered states [rows, SIZE]; the rest as in `filter.filter_run`.
    """
    rows = states.shape[0]
    step = period / SUBSTEPS
    z, k, w, push = np.zeros(SIZE), np.zeros(SIZE + 2), np.zeros((2, SIZE)), np.zeros(3)
    predicted = np.zeros(MEASURED)
    for s in range(len(starts)):
        z[:] = states[starts[s]]
        done = 0
        for h in range(len(steps)):
            end = starts[s] + steps[h]
            if end >= rows:
                out[s, h] = np.nan
                continue
            for row in range(starts[s] + done, end):
                advance_row(z, delta, torque, row, step, constants, effects, push, k, w)
            done = steps[h]
            at = STAGES * end
            rates_of(z, delta[at], torque[at], constants, effects, push, k)
            predict_measurement(z, k[SIZE], k[SIZE + 1], effects, predicted)
            out[s, h] = predicted


def predicted_ahead(
    problem: Problem,
    theta: np.ndarray,
    names: Sequence[str],
    index: int,
    gains: Gains,
    starts: np.ndarray,
    steps: np.ndarray,
) -> np.ndarray:
    """Measurements of one run that a hypothesis predicts from its own filter's states (`roll_out`)."""
    run = problem.runs[index]
    constants, effects = car(problem, theta, names)
    states = filtered_states(problem, gains, theta, names, index)
    delta, torque = run_commands(problem, index, theta, effects)
    out = np.empty((len(starts), len(steps), MEASURED))
    roll_out(states, starts, steps, delta, torque, run.period, constants, without_actuators(effects), out)
    return out


def prediction_squares(
    problem: Problem, theta: np.ndarray, names: Sequence[str], index: int, gains: Gains, starts: np.ndarray
) -> np.ndarray:
    """Squared prediction errors [starts, HORIZONS, STATES] of one run under a hypothesis, in noise variances.

    NaN beyond the run's end or where a channel is missing, infinite where the prediction diverged.

    Args:
        gains: at theta; starts: first rows.
    """
    run = problem.runs[index]
    steps = np.array([max(round(h / run.period), 1) for h in HORIZONS])
    out = predicted_ahead(problem, theta, names, index, gains, starts, steps)
    measured = np.full(out.shape, np.nan)
    for h, step in enumerate(steps):
        inside = starts + step < len(run.y)
        measured[inside, h] = run.y[starts[inside] + step]
    out[np.isfinite(measured) & ~np.isfinite(out)] = np.inf  # no number is no prediction, not a missing measurement
    errors = (measured - out) / problem.noise
    errors[..., ~run.used] = np.nan
    return np.asarray(errors[..., : len(STATES)] ** 2)
