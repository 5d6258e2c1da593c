"""What a log says of the car's motion, row by row: complete enough to start a simulation from any row."""

import dataclasses

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import savgol_filter

from drift_drake.car.effects.delays import sensor_delay
from drift_drake.car.effects.magnitudes import Effects, unbiased
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array

WINDOW = 0.1  # [s] of measurements that a simulation's first state is smoothed over, by a parabola
COURSE_WINDOW = 0.6  # [s] of positions that a course is taken from


@dataclasses.dataclass(frozen=True)
class MeasuredMotion:
    """The measured motion; what the log lacks is derived, and said in `remarks`.

    `r` [rad/s], `v` [m/s], `beta` [rad], `omega_r` [m/s] (NaN where it is not logged), `x`, `y` [m], `psi` [rad], each
    [rows]; `smooth` holds the same seven columns [rows, 7] with less noise, to start simulations from.
    """

    r: Array
    v: Array
    beta: Array
    omega_r: Array
    x: Array
    y: Array
    psi: Array
    smooth: Array
    remarks: tuple[str, ...]

    def state(self, row: int, period: float, effects: Effects) -> tuple[list[float], list[float]]:
        """State (r, v, beta, omega_r) and pose (x, y, psi) of a car whose sensors have these effects, at a row.

        A late sensor shows the state of this row `sensor_latency` later, and biases are taken off.
        """
        at = min(row + round(sensor_delay(effects) / period), len(self.smooth) - 1)
        r, v, beta, omega_r, *pose = (float(value) for value in self.smooth[at])
        r, v, beta, omega_r = unbiased(r, v, beta, omega_r, effects)
        return [r, v, beta, omega_r], pose


def measured_motion(run: Run, vehicle: VehicleParameters) -> MeasuredMotion:
    """The motion that a run shows, with what it lacks derived from the rest.

    Args:
        vehicle: for the rear axle's place, where no sideslip can be had otherwise.
    """
    remarks = []
    psi = run.psi
    if psi is None:
        psi = cumulative_trapezoid(run.r, run.t, initial=0.0)
        remarks.append("no psi: the heading is integrated from r")
    psi = np.unwrap(psi)
    beta = run.beta
    if beta is None and run.x is not None and run.y is not None and run.psi is not None:
        x_dot, y_dot = (_smoothed(p, run.period, COURSE_WINDOW, derivative=1) for p in (run.x, run.y))
        course = np.unwrap(np.arctan2(y_dot, x_dot))
        beta = np.arctan2(np.sin(course - psi), np.cos(course - psi))
        remarks.append("no beta: the sideslip is the positions' course less the heading")
    elif beta is None:
        beta = np.arctan2(vehicle.rear_axle_distance * run.r, np.maximum(run.v, 1.0))
        remarks.append("no beta and no positions: the sideslip is that of a rear axle that does not slip")
    x, y = run.x, run.y
    if x is None or y is None:
        x, y = (cumulative_trapezoid(run.v * f(psi + beta), run.t, initial=0.0) for f in (np.cos, np.sin))
        remarks.append("no x and y: the path is integrated from v, beta and the heading")
    rolling = run.omega_r
    if rolling is None:
        rolling = run.v * np.cos(beta)
        remarks.append("no omega_r: simulations start with the rear wheels rolling freely")
    columns = (run.r, run.v, beta, rolling, x, y, psi)
    smooth = np.stack([_smoothed(column, run.period, WINDOW) for column in columns], axis=1)
    omega_r = np.full(len(run), np.nan) if run.omega_r is None else run.omega_r
    return MeasuredMotion(run.r, run.v, beta, omega_r, x, y, psi, smooth, tuple(remarks))


def _smoothed(values: Array, period: float, window: float, derivative: int = 0) -> Array:
    """Least-squares parabolas over a moving window [s], or their slopes."""
    rows = max(2 * round(0.5 * window / period) + 1, 5)
    return np.asarray(savgol_filter(values, rows, 2, deriv=derivative, delta=period))
