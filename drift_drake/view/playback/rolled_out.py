"""What a simulator of the user's makes of a log's commands, from each restart to the next."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from drift_drake.car.effects.magnitudes import Effects, measured, unbiased
from drift_drake.car.equations import folded_into
from drift_drake.car.foreign.along import inputs_along
from drift_drake.car.foreign.asked import job_along, motion_of
from drift_drake.car.foreign.pool import roll_all
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.log.measured_motion import MeasuredMotion
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.sensors import LOG_ROW
from drift_drake.common.arrays import Array


def rolled_out(
    run: Run, motion: MeasuredMotion, car: SimulatorCar, effects: Effects, stretches: Sequence[tuple[int, int]],
    window: NDArray[np.int_],
) -> pd.DataFrame:  # fmt: skip
    """A table as `side_by_side.Played` has of a car: rows of all stretches, NaN elsewhere.

    Args:
        motion: what was measured; stretches: first and last row of each roll-out; window: number of the restart by row.

    Raises:
        InvalidLogError: the log has no torque; SimulatorError: the simulator cannot be run.
    """
    if run.tau_cmd is None:
        raise InvalidLogError(f"{run.name}: has no tau_cmd, which a simulator of yours is driven by; log the torque")
    simulator = car.simulator
    constants, rest = folded_into(car.constants(), effects)
    steps = simulator.steps_in(run.period)
    true: Array = np.stack([*unbiased(*motion.smooth[:, :4].T, rest), motion.smooth[:, 6]], axis=-1)
    signals = inputs_along((run.delta_cmd, run.tau_cmd), true, run.period, constants, rest, run.bank)
    leads = [min(round(simulator.lead_in / run.period), first) for first, _ in stretches]
    jobs = [
        job_along(constants, run.period, true, signals, np.array([first - lead]), lead, last - first + lead)
        for (first, last), lead in zip(stretches, leads, strict=True)
    ]
    values = np.full((len(run), len(LOG_ROW)), np.nan)
    for (first, last), lead, got in zip(stretches, leads, roll_all(jobs), strict=True):
        found: Array = motion_of(simulator, got, run.period / steps)[0, steps * lead :: steps]
        found[:, 4] += true[first, 4] - found[0, 4]  # headings are changes
        values[first : last + 1, 1:] = _row_of(found, motion.smooth[first, 4:6], run.period, rest)
    table = pd.DataFrame(dict(zip(LOG_ROW, values.T, strict=True)))
    return table.assign(t=run.t - run.t[0], delta=run.delta_cmd, window=window)


def _row_of(motion: Array, place: Array, period: float, effects: Effects) -> Array:
    """What would be logged of a motion [rows, 5] that begins at a place: `LOG_ROW` but for its time."""
    r, v, beta, omega_r, psi = motion.T
    x, y = (begin + cumulative_trapezoid(v * f(psi + beta), dx=period, initial=0.0)
            for begin, f in zip(place, (np.cos, np.sin), strict=True))  # fmt: skip
    v_x, v_y = v * np.cos(beta), v * np.sin(beta)
    a_x, a_y = np.gradient(v_x, period) - r * v_y, np.gradient(v_y, period) + r * v_x
    read = measured(r, v, beta, omega_r, effects)
    return np.stack([x, y, psi, *read, a_x, a_y], axis=-1)
