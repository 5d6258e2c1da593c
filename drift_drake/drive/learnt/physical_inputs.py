"""What the nominal car's tyres say of z (`features`).

Inputs of the feature network in addition to z. A network given z alone has to find the quotients, arcs and saturations
behind the tyres' slips and forces, which differ little from car to car; what it then misses, adaptation must make up
for. Slips are squashed and forces are shares of the friction, so that none leaves [-1, 1].
"""

import math
from functools import cache
from typing import Any

import numpy as np

from drift_drake.car.compilation import compiled, copied
from drift_drake.car.parameters import Constants
from drift_drake.car.scalar import jitable
from drift_drake.car.single_track.motion import slip_point, static_loads
from drift_drake.car.tyre import tyre_gradient
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.command_lag import lag_factors

PHYSICAL_COUNT = 8
# Front lateral slip and force, rear slips and forces (x, y), all at x_k under the lagged steering; the front's under
# the steering that the lag has come to at the step's end.
PHYSICAL_SCALE = np.array([0.3, 0.6, 0.3, 0.3, 0.6, 0.6, 0.3, 0.6])

_R, _V, _BETA, _OMEGA = 0, 1, 2, 3  # places in z
_DELTAS = (4, 6, 8)  # of the steering command, that at the end of the step, and the lagged one
STEPS = (0.7e-5, 5e-5, 0.4e-5, 6e-5, 0.3e-5)  # of (r, v, beta, omega_r, road wheel's angle), for second derivatives


def with_physical_inputs(z: Array, nominal: Constants, dt: float = 0.1) -> tuple[Array, Array]:
    """z, behind it slips and forces of the nominal car's tyres, and their Jacobian.

    Args:
        z: [..., 10]; nominal: the car inside h; dt: the step [s].

    Returns:
        (z and inputs [..., 18], d inputs / dz [..., 8, 10]): slips as sigma / sqrt(1 + sigma^2), forces over mu F_z.
    """
    flat = np.ascontiguousarray(z, dtype=float).reshape(-1, z.shape[-1])
    inputs, gradient = _physical(flat, nominal, _wheel(dt))
    if z.ndim == 2:
        return inputs, gradient
    return inputs.reshape(*z.shape[:-1], -1), gradient.reshape(*z.shape[:-1], *gradient.shape[1:])


@cache
def _wheel(dt: float) -> Array:
    """The road wheel's angle at either end of the step as a sum of the three angles in z [2, 3]."""
    keep, by_now, by_next = (float(factor[0]) for factor in lag_factors(dt))
    return np.array([[0.0, 0.0, 1.0], [by_now, by_next, keep]])


@jitable
def _squashed(slip: Any) -> tuple[Any, Any]:
    root = math.sqrt(1.0 + slip * slip)
    return slip / root, 1.0 / (root * root * root)


@jitable
def _asked(at: Any, front_alone: Any, p: Constants, slip: Any, dslip: Any, values: Any, gradient: Any) -> None:
    """Writes what the tyres say [6] at (r, v, beta, omega_r, road wheel's angle), and its derivatives by these [6, 5].

    The front's two come first; `slip` [4] and `dslip` [4, 5] are scratch.
    """
    f_zf, f_zr = static_loads(p)
    peak_f, peak_r = p.friction * f_zf, p.friction * f_zr
    slip_point(at[0], at[1], at[2], at[3], at[4], p, slip, dslip)
    values[0], slope = _squashed(slip[1])
    _, f_y, _, _, by_x, by_y = tyre_gradient(slip[0], slip[1], p.front_stiffness, peak_f, p.tyre)
    values[1] = f_y / peak_f
    for j in range(5):
        gradient[0, j] = slope * dslip[1, j]
        gradient[1, j] = (by_x * dslip[0, j] + by_y * dslip[1, j]) / peak_f
    if front_alone:
        return
    values[2], slope_x = _squashed(slip[2])
    values[3], slope_y = _squashed(slip[3])
    f_x, f_y, xx, xy, yx, yy = tyre_gradient(slip[2], slip[3], p.rear_stiffness, peak_r, p.tyre)
    values[4], values[5] = f_x / peak_r, f_y / peak_r
    for j in range(5):
        gradient[2, j], gradient[3, j] = slope_x * dslip[2, j], slope_y * dslip[3, j]
        gradient[4, j] = (xx * dslip[2, j] + xy * dslip[3, j]) / peak_r
        gradient[5, j] = (yx * dslip[2, j] + yy * dslip[3, j]) / peak_r


@jitable
def _asked_of(z: Any, angles: Any, at: Any) -> None:
    """Writes (r, v, beta, omega_r, road wheel's angle) of z."""
    at[0], at[1], at[2], at[3], at[4] = z[_R], z[_V], z[_BETA], z[_OMEGA], 0.0
    for j in range(3):
        at[4] += angles[j] * z[_DELTAS[j]]


@compiled
def _physical(z: Array, p: Constants, wheel: Array) -> tuple[Array, Array]:
    count, size = z.shape
    inputs, gradient = np.empty((count, size + PHYSICAL_COUNT)), np.zeros((count, PHYSICAL_COUNT, size))
    at, slip, dslip, found, slopes = np.empty(5), np.empty(4), np.empty((4, 5)), np.empty(6), np.empty((6, 5))
    for n in range(count):
        copied(z[n], inputs[n, :size])
        for turn in range(2):  # at the step's end the front alone is asked
            _asked_of(z[n], wheel[turn], at)
            _asked(at, turn == 1, p, slip, dslip, found, slopes)
            for i in range(2 if turn else 6):
                place = 6 * turn + i
                inputs[n, size + place] = found[i]
                for j in range(4):
                    gradient[n, place, j] = slopes[i, j]
                for j in range(3):
                    gradient[n, place, _DELTAS[j]] = slopes[i, 4] * wheel[turn, j]
    return inputs, gradient


def physical_curvature(z: Array, weights: Array, nominal: Constants) -> Array:
    """Second derivatives by z [N, 10, 10] of the inputs' sums with weights [N, 8]; see `with_physical_inputs`.

    They are differences of the exact first ones, over `STEPS`.
    """
    bent = np.zeros((len(z), z.shape[1], z.shape[1]))
    _physical_curvature(np.ascontiguousarray(z), np.ascontiguousarray(weights), nominal, _wheel(0.1), bent)
    return bent


@compiled
def _physical_curvature(z: Array, weights: Array, p: Constants, wheel: Array, bent: Array) -> None:
    at, slip, dslip, found, slopes = np.empty(5), np.empty(4), np.empty((4, 5)), np.empty(6), np.empty((6, 5))
    gradient, second = np.empty((6, 5)), np.empty((5, 5))
    places, lever = np.empty(7, np.intp), np.ones(7)
    of = (0, 1, 2, 3, 4, 4, 4)
    for i in range(4):
        places[i] = i
    for i in range(3):
        places[4 + i] = _DELTAS[i]
    for n in range(z.shape[0]):
        for turn in range(2):
            first, count = 6 * turn, 2 if turn else 6
            for moved in range(6):  # the last time where it is
                _asked_of(z[n], wheel[turn], at)
                if moved < 5:
                    at[moved] += STEPS[moved]
                _asked(at, turn == 1, p, slip, dslip, found, slopes)
                for j in range(5):
                    gradient[moved, j] = 0.0
                    for i in range(count):
                        gradient[moved, j] += weights[n, first + i] * slopes[i, j]
            for i in range(5):
                for j in range(5):
                    second[i, j] = (gradient[i, j] - gradient[5, j]) / STEPS[i]
            for i in range(3):
                lever[4 + i] = wheel[turn, i]
            for i in range(7):
                for j in range(7):
                    half = 0.5 * (second[of[i], of[j]] + second[of[j], of[i]])
                    bent[n, places[i], places[j]] += lever[i] * lever[j] * half
