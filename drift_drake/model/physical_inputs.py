"""What the nominal car's tyres say of z = (r, v, beta, omega_r, delta_k, tau_k, delta_{k+1}, tau_{k+1}).

Inputs of the feature network beside z itself. A network given z alone has to find the quotients, arcs and saturations
behind the tyres' slips and forces, which differ little from car to car; what it then misses, adaptation must make up
for. Slips are squashed and forces are shares of the friction, so that none leaves [-1, 1].
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drift_drake.compilation import compiled
from drift_drake.vehicle.bicycle import static_loads
from drift_drake.vehicle.bicycle_jacobian import brush_gradient, slip_point
from drift_drake.vehicle.parameters import Constants
from drift_drake.vehicle.scalar import jitable

Array = NDArray[np.float64]

PHYSICAL_COUNT = 8
# Front lateral slip and force, rear slips and forces (x, y), all at (x_k, u_k); the front's under delta_{k+1}.
PHYSICAL_SCALE = np.array([0.3, 0.6, 0.3, 0.3, 0.6, 0.6, 0.3, 0.6])

_R, _V, _BETA, _OMEGA, _DELTA, _NEXT_DELTA = 0, 1, 2, 3, 4, 6  # places in z


def physical_inputs(z: Array, nominal: Constants) -> tuple[Array, Array]:
    """Slips and forces of the nominal car's tyres, and their Jacobian.

    Args:
        z: [..., 8]; nominal: the car inside h.

    Returns:
        (inputs [..., 8], d inputs / dz [..., 8, 8]): slips as sigma / sqrt(1 + sigma^2), forces over mu F_z.
    """
    flat = np.ascontiguousarray(z, dtype=float).reshape(-1, z.shape[-1])
    values = np.zeros((len(flat), PHYSICAL_COUNT))
    gradient = np.zeros((len(flat), PHYSICAL_COUNT, flat.shape[1]))
    _physical(flat, nominal, values, gradient)
    return values.reshape(*z.shape[:-1], PHYSICAL_COUNT), gradient.reshape(*z.shape[:-1], *gradient.shape[1:])


@jitable
def _write(values: Any, gradient: Any, row: Any, place: Any, value: Any, by_slip: Any, delta: Any) -> None:
    """A value whose gradient over (r, v, beta, omega_r, delta) is `by_slip` [5]; `delta` is that angle's place in z."""
    values[row, place] = value
    for j in range(4):
        gradient[row, place, j] = by_slip[j]
    gradient[row, place, delta] = by_slip[4]


@jitable
def _squashed(slip: Any) -> tuple[Any, Any]:
    root = math.sqrt(1.0 + slip * slip)
    return slip / root, 1.0 / (root * root * root)


@compiled
def _physical(z: Array, p: Constants, values: Array, gradient: Array) -> None:
    slip, dslip = np.empty(4), np.empty((4, 5))
    f_zf, f_zr = static_loads(p)
    peak_f, peak_r = p.friction * f_zf, p.friction * f_zr
    for n in range(z.shape[0]):
        for turn in range(2):  # under delta_{k+1} the front alone differs
            delta = _NEXT_DELTA if turn else _DELTA
            slip_point(z[n, _R], z[n, _V], z[n, _BETA], z[n, _OMEGA], z[n, delta], p, slip, dslip)
            front = 6 if turn else 0
            value, slope = _squashed(slip[1])
            _write(values, gradient, n, front, value, slope * dslip[1], delta)
            _, f_y, _, _, by_x, by_y = brush_gradient(slip[0], slip[1], p.front_stiffness, peak_f)
            _write(values, gradient, n, front + 1, f_y / peak_f, (by_x * dslip[0] + by_y * dslip[1]) / peak_f, delta)
            if turn:
                continue
            for axis in range(2):
                value, slope = _squashed(slip[2 + axis])
                _write(values, gradient, n, 2 + axis, value, slope * dslip[2 + axis], delta)
            f_x, f_y, xx, xy, yx, yy = brush_gradient(slip[2], slip[3], p.rear_stiffness, peak_r)
            _write(values, gradient, n, 4, f_x / peak_r, (xx * dslip[2] + xy * dslip[3]) / peak_r, delta)
            _write(values, gradient, n, 5, f_y / peak_r, (yx * dslip[2] + yy * dslip[3]) / peak_r, delta)
