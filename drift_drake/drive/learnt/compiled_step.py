"""The learnt model's step point after point, compiled: nominal car, learnt part, path and lagged commands together.

A point is (x_k, u_k, u_{k+1}, the path's curvature) [13]. `tests/model/test_bayesian_step.py` holds the step to the
equations of motion and the features, and the derivatives to differences.
"""

from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.compilation import compiled, copied
from drift_drake.car.parameters import Constants
from drift_drake.car.scalar import jitable
from drift_drake.car.single_track.motion import linearize_point
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.command_lag import TIME_STEP
from drift_drake.drive.learnt.features import STATE_COUNT

PLACE_IN_Z = (0, 1, 2, 3, -1, -1, 8, 9, 4, 5, 6, 7)  # of each of (x, u, u_next); none of e and dphi


@jitable
def _trapezoid_point(x: Any, x_next: Any, k: Any, by_state: Any, by_next: Any) -> Any:
    """(e, dphi) of one point; writes its derivatives, but for those that are always zero."""
    e, dphi = x[4], x[5]
    # The turn of the course comes from the body; what the path turns by in the meantime is taken from it at the
    # mean speed and the course at the start.
    v = 0.5 * (x[1] + x_next[1])
    stretch = 1.0 - k * e
    cos_start, sin_start = np.cos(dphi), np.sin(dphi)
    s_dot = v * cos_start / stretch
    turn = x_next[2] - x[2] + 0.5 * TIME_STEP * (x[0] + x_next[0])
    dphi_next = dphi + turn - TIME_STEP * k * s_dot
    mid = 0.5 * (dphi + dphi_next)
    cos_mid, sin_mid = np.cos(mid), np.sin(mid)
    by_speed = -0.5 * TIME_STEP * k * cos_start / stretch
    d = by_state[1]  # of dphi_next
    d[0], d[1], d[2] = 0.5 * TIME_STEP, by_speed, -1.0
    d[4] = -TIME_STEP * k * k * s_dot / stretch
    d[5] = 1.0 + TIME_STEP * k * v * sin_start / stretch
    by_next[1, 0], by_next[1, 1], by_next[1, 2] = 0.5 * TIME_STEP, by_speed, 1.0
    lever = 0.5 * TIME_STEP * v * cos_mid
    for i in range(6):
        by_state[0, i] = lever * d[i]
    by_state[0, 1] += 0.5 * TIME_STEP * sin_mid
    by_state[0, 4] += 1.0
    by_state[0, 5] += lever
    for i in range(4):
        by_next[0, i] = lever * by_next[1, i]
    by_next[0, 1] += 0.5 * TIME_STEP * sin_mid
    return e + TIME_STEP * v * sin_mid, dphi_next


class Lags(NamedTuple):
    """Of a car's steering and torque, each factor [2]: see `command_lag`."""

    keep: Array
    by_now: Array
    by_next: Array
    share: Array  # of the command in what a typical car would have to be given


class _Slopes(NamedTuple):
    """Derivatives at one point, and the commands that a typical car would have to be given there."""

    by_x: Array  # [6, 6], of the nominal car's rates
    by_u: Array  # [6, 2]
    path_by_x: Array  # [2, 6], of the trapezoid
    path_by_next: Array  # [2, 4]
    command: Array  # [2]


@jitable
def _no_slopes() -> Any:
    return _Slopes(np.empty((6, 6)), np.empty((6, 2)), np.zeros((2, 6)), np.zeros((2, 4)), np.empty(2))


@jitable
def _step_point(point: Any, g: Any, p: Any, lag: Any, trapezoid: Any, rates: Any, slopes: Any,
                x_next: Any) -> None:  # fmt: skip
    """Writes x_{k+1} [8] for a point [13] and the learnt part g [4]; `rates` [6] is scratch."""
    for i in range(2):
        slopes.command[i] = lag.share[i] * point[8 + i] + (1.0 - lag.share[i]) * point[6 + i]
    linearize_point(point[:6], slopes.command, point[12], p, rates, slopes.by_x, slopes.by_u)
    for i in range(6):
        x_next[i] = 0.0 if i == 3 else point[i] + TIME_STEP * rates[i]
        if i < STATE_COUNT:
            x_next[i] += g[i]
    if trapezoid:
        x_next[4], x_next[5] = _trapezoid_point(point, x_next, point[12], slopes.path_by_x, slopes.path_by_next)
    for i in range(2):
        x_next[6 + i] = lag.keep[i] * point[6 + i] + lag.by_now[i] * point[8 + i] + lag.by_next[i] * point[10 + i]


@compiled
def steps(points: Array, g: Array, p: Constants, lag: Lags, trapezoid: bool, x_next: Array) -> None:
    """`_step_point` at all points [n, 13]."""
    slopes, rates = _no_slopes(), np.empty(6)
    for n in range(len(points)):
        _step_point(points[n], g[n], p, lag, trapezoid, rates, slopes, x_next[n])


@jitable
def _linearized_point(point: Any, g: Any, by_z: Any, p: Any, lag: Any, trapezoid: Any, rates: Any, slopes: Any,
                      x_next: Any, out: Any) -> None:  # fmt: skip
    """`_step_point`, and its derivatives by (x, u, u_next) [8, 12]; by_z: the learnt part's [4, 10]."""
    _step_point(point, g, p, lag, trapezoid, rates, slopes, x_next)
    out[:] = 0.0
    for i in range(6):
        if i != 3:
            for j in range(6):
                out[i, j] = TIME_STEP * slopes.by_x[i, j]
            out[i, i] += 1.0
            for j in range(2):
                by_command = TIME_STEP * slopes.by_u[i, j]
                out[i, 8 + j], out[i, 6 + j] = lag.share[j] * by_command, (1.0 - lag.share[j]) * by_command
    for i in range(STATE_COUNT):
        for j in range(STATE_COUNT):
            out[i, j] += by_z[i, j]
        for j in range(4):
            out[i, 8 + j] += by_z[i, STATE_COUNT + j]
        for j in range(2):
            out[i, 6 + j] += by_z[i, STATE_COUNT + 4 + j]
    if trapezoid:
        for i in range(2):
            for j in range(12):
                total = slopes.path_by_x[i, j] if j < 6 else 0.0
                for m in range(STATE_COUNT):
                    total += slopes.path_by_next[i, m] * out[m, j]
                out[4 + i, j] = total
    for i in range(2):
        out[6 + i, 6 + i], out[6 + i, 8 + i], out[6 + i, 10 + i] = lag.keep[i], lag.by_now[i], lag.by_next[i]


@compiled
def linearized_steps(points: Array, g: Array, by_z: Array, p: Constants, lag: Lags, trapezoid: bool,
                     x_next: Array, jacobian: Array) -> None:  # fmt: skip
    """`steps`, and the derivatives by (x, u, u_next) [n, 8, 12]; by_z: the learnt part's [n, 4, 10]."""
    slopes, rates = _no_slopes(), np.empty(6)
    for n in range(len(points)):
        _linearized_point(points[n], g[n], by_z[n], p, lag, trapezoid, rates, slopes, x_next[n], jacobian[n])


@compiled
def curved_steps(points: Array, g: Array, by_z: Array, weights: Array, p: Constants, lag: Lags,
                 trapezoid: bool, sizes: Array, bent: Array, by_g: Array) -> None:  # fmt: skip
    """Second derivatives by (x, u, u_next) [n, 12, 12] of weights [n, 8] times the step, the learnt part linear.

    Differences of the exact first ones over `sizes` [12]. Also writes the first ones by the learnt part [n, 4].
    """
    slopes, rates = _no_slopes(), np.empty(6)
    point, learnt, x_next, jacobian = np.empty(13), np.empty(STATE_COUNT), np.empty(8), np.empty((8, 12))
    gradient = np.empty((13, 12))
    for n in range(len(points)):
        for moved in range(13):  # the last time where it is
            copied(points[n], point)
            copied(g[n], learnt)
            if moved < 12:
                point[moved] += sizes[moved]
                place = PLACE_IN_Z[moved]
                if place >= 0:
                    for i in range(STATE_COUNT):
                        learnt[i] += sizes[moved] * by_z[n, i, place]
            _linearized_point(point, learnt, by_z[n], p, lag, trapezoid, rates, slopes, x_next, jacobian)
            for j in range(12):
                gradient[moved, j] = 0.0
                for i in range(8):
                    gradient[moved, j] += weights[n, i] * jacobian[i, j]
        for i in range(12):
            for j in range(12):
                one, other = gradient[i, j] - gradient[12, j], gradient[j, i] - gradient[12, i]
                bent[n, i, j] = 0.5 * (one / sizes[i] + other / sizes[j])
        for i in range(STATE_COUNT):
            by_g[n, i] = weights[n, i]
            if trapezoid:
                for m in range(2):
                    by_g[n, i] += weights[n, 4 + m] * slopes.path_by_next[m, i]
