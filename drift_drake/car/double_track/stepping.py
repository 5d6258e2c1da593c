"""The double-track car's states along a path in time: RK4 by the plant's own equations, for models and predictions.

States [19]: r [rad/s], v [m/s], beta [rad], omega_r [m/s], e [m], dphi [rad], then `motion.OwnStates`.
"""

from typing import Any

from drift_drake.car.double_track.motion import OwnStates, double_track_motion
from drift_drake.car.double_track.parameters import DoubleTrackConstants
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.scalar import fixed_tuple, jitable
from drift_drake.car.single_track.motion import path_rates
from drift_drake.common.arrays import Array

OWN = len(OwnStates._fields)
SIZE = 6 + OWN


@jitable
def path_motion(x: Any, delta: Any, tau: Any, curvature: Any, p: DoubleTrackConstants, q: Effects,
                out: Any, force_y: Any = 0.0) -> None:  # fmt: skip
    """Writes the states' rates under the commands delta [rad] and tau [N m], on a path of this curvature [1/m].

    force_y: a further force on the body [N].
    """
    own = OwnStates(*fixed_tuple(x[6:], OWN))
    m, d = double_track_motion(x[0], x[1], x[2], x[3], 0.0, own, delta, tau, p, q, 0.0, force_y)
    e_dot, dphi_dot, _ = path_rates(x[0], x[1], m.beta_dot, x[4], x[5], curvature)
    out[0], out[1], out[2], out[3], out[4], out[5] = m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, e_dot, dphi_dot
    for i, rate in enumerate(d):
        out[6 + i] = rate


@jitable
def advance_state(x: Array, u: Array, u_next: Array, first: float, last: float, curvature: float,
                  p: DoubleTrackConstants, q: Effects, h: float, work: Array,
                  force_y: float = 0.0) -> None:  # fmt: skip
    """RK4 over h [s] in place, the input going from share `first` to share `last` of its way from u to u_next."""
    k, point, total = work[0], work[1], work[2]
    for stage in range(4):
        node = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        weight = 1.0 / 6.0 if stage in (0, 3) else 1.0 / 3.0
        for i in range(SIZE):
            point[i] = x[i] if stage == 0 else x[i] + node * h * k[i]
        share = first + node * (last - first)
        delta, tau = u[0] + share * (u_next[0] - u[0]), u[1] + share * (u_next[1] - u[1])
        path_motion(point, delta, tau, curvature, p, q, k, force_y)
        for i in range(SIZE):
            total[i] = weight * k[i] if stage == 0 else total[i] + weight * k[i]
    for i in range(SIZE):
        x[i] += h * total[i]
