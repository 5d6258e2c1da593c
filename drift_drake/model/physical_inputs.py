"""What the nominal car's tyres say of z (`features`).

Inputs of the feature network beside z itself. A network given z alone has to find the quotients, arcs and saturations
behind the tyres' slips and forces, which differ little from car to car; what it then misses, adaptation must make up
for. Slips are squashed and forces are shares of the friction, so that none leaves [-1, 1].
"""

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drift_drake.model.command_lag import lag_factors
from drift_drake.vehicle.bicycle import static_loads
from drift_drake.vehicle.bicycle_jacobian import slip_point
from drift_drake.vehicle.compilation import compiled
from drift_drake.vehicle.parameters import Constants
from drift_drake.vehicle.scalar import jitable
from drift_drake.vehicle.tyre import tyre_gradient

Array = NDArray[np.float64]

PHYSICAL_COUNT = 8
# Front lateral slip and force, rear slips and forces (x, y), all at x_k under the lagged steering; the front's under
# the steering that the lag has come to at the step's end.
PHYSICAL_SCALE = np.array([0.3, 0.6, 0.3, 0.3, 0.6, 0.6, 0.3, 0.6])

_R, _V, _BETA, _OMEGA = 0, 1, 2, 3  # places in z
_DELTAS = (4, 6, 8)  # of the steering command, that at the end of the step, and the lagged one


def physical_inputs(z: Array, nominal: Constants, dt: float = 0.1) -> tuple[Array, Array]:
    """Slips and forces of the nominal car's tyres, and their Jacobian.

    Args:
        z: [..., 10]; nominal: the car inside h; dt: the step [s].

    Returns:
        (inputs [..., 8], d inputs / dz [..., 8, 10]): slips as sigma / sqrt(1 + sigma^2), forces over mu F_z.
    """
    flat = np.ascontiguousarray(z, dtype=float).reshape(-1, z.shape[-1])
    values = np.zeros((len(flat), PHYSICAL_COUNT))
    gradient = np.zeros((len(flat), PHYSICAL_COUNT, flat.shape[1]))
    _physical(flat, nominal, _wheel(dt), values, gradient)
    return values.reshape(*z.shape[:-1], PHYSICAL_COUNT), gradient.reshape(*z.shape[:-1], *gradient.shape[1:])


@cache
def _wheel(dt: float) -> Array:
    """The road wheel's angle at either end of the step as a sum of the three angles in z [2, 3]."""
    keep, by_now, by_next = (float(factor[0]) for factor in lag_factors(dt))
    return np.array([[0.0, 0.0, 1.0], [by_now, by_next, keep]])


@jitable
def _write(values: Any, gradient: Any, row: Any, place: Any, value: Any, by_slip: Any, wheel: Any) -> None:
    """A value whose gradient over (r, v, beta, omega_r, road wheel's angle) is `by_slip` [5]."""
    values[row, place] = value
    for j in range(4):
        gradient[row, place, j] = by_slip[j]
    for j in range(3):
        gradient[row, place, _DELTAS[j]] = by_slip[4] * wheel[j]


@jitable
def _squashed(slip: Any) -> tuple[Any, Any]:
    root = math.sqrt(1.0 + slip * slip)
    return slip / root, 1.0 / (root * root * root)


@compiled
def _physical(z: Array, p: Constants, wheel: Array, values: Array, gradient: Array) -> None:
    slip, dslip = np.empty(4), np.empty((4, 5))
    f_zf, f_zr = static_loads(p)
    peak_f, peak_r = p.friction * f_zf, p.friction * f_zr
    for n in range(z.shape[0]):
        for turn in range(2):  # at the step's end the front alone is asked
            angles = wheel[turn]
            delta = 0.0
            for j in range(3):
                delta += angles[j] * z[n, _DELTAS[j]]
            slip_point(z[n, _R], z[n, _V], z[n, _BETA], z[n, _OMEGA], delta, p, slip, dslip)
            front = 6 if turn else 0
            value, slope = _squashed(slip[1])
            _write(values, gradient, n, front, value, slope * dslip[1], angles)
            _, f_y, _, _, by_x, by_y = tyre_gradient(slip[0], slip[1], p.front_stiffness, peak_f, p.tyre)
            _write(values, gradient, n, front + 1, f_y / peak_f, (by_x * dslip[0] + by_y * dslip[1]) / peak_f, angles)
            if turn:
                continue
            for axis in range(2):
                value, slope = _squashed(slip[2 + axis])
                _write(values, gradient, n, 2 + axis, value, slope * dslip[2 + axis], angles)
            f_x, f_y, xx, xy, yx, yy = tyre_gradient(slip[2], slip[3], p.rear_stiffness, peak_r, p.tyre)
            _write(values, gradient, n, 4, f_x / peak_r, (xx * dslip[2] + xy * dslip[3]) / peak_r, angles)
            _write(values, gradient, n, 5, f_y / peak_r, (yx * dslip[2] + yy * dslip[3]) / peak_r, angles)
