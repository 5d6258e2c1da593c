"""The double-track car run along the rows of a log, compiled."""

from typing import Any

import numpy as np

from drift_drake.arrays import Array
from drift_drake.vehicle.bicycle import world_rates
from drift_drake.vehicle.compilation import compiled
from drift_drake.vehicle.delays import commands_at
from drift_drake.vehicle.double_track.motion import OwnStates, double_track_motion, settled_states
from drift_drake.vehicle.double_track.parameters import DoubleTrackConstants
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.scalar import jitable

LOG_STATES = ("r", "v", "beta", "omega_r", "psi", "x", "y", *OwnStates._fields)
PERIOD = 0.01  # [s] of the rows
SUBSTEPS = 10  # RK4 steps a row; rear wheels ring in their tyres at some 300 rad/s, or settle in them within 1.5 ms


@compiled
def _rates(z: Any, delta: Any, tau: Any, p: Any, q: Any, out: Any) -> Any:
    """Writes d(LOG_STATES)/dt; returns (a_x, a_y)."""
    own = OwnStates(z[7], z[8], z[9], z[10], z[11], z[12], z[13], z[14], z[15], z[16], z[17], z[18], z[19])
    m, rates = double_track_motion(z[0], z[1], z[2], z[3], z[4], own, delta, tau, p, q)
    out[0], out[1], out[2], out[3] = m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot
    out[5], out[6], out[4] = world_rates(z[0], z[1], z[2], z[4])
    (out[7], out[8], out[9], out[10], out[11], out[12], out[13], out[14], out[15], out[16], out[17], out[18],
     out[19]) = rates  # fmt: skip
    return m.a_x, m.a_y


@jitable
def runge_kutta_row(rates: Any, z: Any, row: Any, delta: Any, tau: Any, p: Any, q: Any) -> Any:
    """States z a row later, in place, by RK4 of `rates(z, delta, tau, p, q, out)`; returns (a_x, a_y) there."""
    h, n, last = PERIOD / SUBSTEPS, len(z), row + 1
    k1, k2, k3, k4 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(SUBSTEPS):
        a, b, c = row + i / SUBSTEPS, row + (i + 0.5) / SUBSTEPS, row + (i + 1) / SUBSTEPS
        begin = commands_at(delta, tau, a, last, PERIOD, q)
        middle = commands_at(delta, tau, b, last, PERIOD, q)
        end = commands_at(delta, tau, c, last, PERIOD, q)
        rates(z, begin[0], begin[1], p, q, k1)
        rates(z + 0.5 * h * k1, middle[0], middle[1], p, q, k2)
        rates(z + 0.5 * h * k2, middle[0], middle[1], p, q, k3)
        rates(z + h * k3, end[0], end[1], p, q, k4)
        z += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return rates(z, end[0], end[1], p, q, k1)


@compiled
def _advance(z: Any, row: Any, delta: Any, tau: Any, p: Any, q: Any) -> Any:
    return runge_kutta_row(_rates, z, row, delta, tau, p, q)


@compiled
def _start(r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, p: Any, q: Any, z: Any) -> Any:
    z[0], z[1], z[2], z[3] = r, v, beta, omega_r
    z[4], z[5], z[6] = 0.0, 0.0, 0.0
    own = settled_states(r, v, beta, omega_r, delta, tau, p, q)
    for i, value in enumerate(own):
        z[7 + i] = value
    return _rates(z, delta, tau, p, q, np.empty(len(z)))


def start(state: Array, command: tuple[float, float], p: DoubleTrackConstants, q: Effects) -> tuple[Array, Array]:
    """States [20] (`LOG_STATES`) settled in (r, v, beta, omega_r) at the origin, and (a_x, a_y) [m/s^2] there."""
    z = np.empty(len(LOG_STATES))
    r, v, beta, omega_r = (float(value) for value in state)
    acceleration = _start(r, v, beta, omega_r, command[0], command[1], p, q, z)
    return z, np.array(acceleration)


def advance(z: Array, row: int, delta: Array, tau: Array, p: DoubleTrackConstants, q: Effects) -> tuple[Array, Array]:
    """States a row later, and (a_x, a_y) [m/s^2] there.

    Args:
        z: states [20] at `row`; delta [rad], tau [N m]: the commands' rows [rows], filled up to row + 1, linear
            between rows; each is delayed here.
        p: the car; q: magnitudes, the sensors' unused.
    """
    later = z.copy()
    acceleration = _advance(later, row, delta, tau, p, q)
    return later, np.array(acceleration)
