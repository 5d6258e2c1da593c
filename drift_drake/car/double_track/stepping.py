"""The double-track car's states along a path in time: RK4 by the plant's own equations, for models and predictions.

States [19]: r [rad/s], v [m/s], beta [rad], omega_r [m/s], e [m], dphi [rad], then `motion.OwnStates`.
"""

from typing import Any

from drift_drake.car.double_track.motion import OwnStates, double_track_motion, own_states
from drift_drake.car.double_track.parameters import DoubleTrackConstants
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.integrate import ramp, runge_kutta
from drift_drake.car.scalar import jitable, loaded, stored
from drift_drake.car.single_track.motion import path_rates
from drift_drake.common.arrays import Array

OWN = len(OwnStates._fields)
SIZE = 6 + OWN


@jitable
def path_motion(x: Any, delta: Any, tau: Any, curvature: Any, p: DoubleTrackConstants, q: Effects,
                out: Any) -> None:  # fmt: skip
    """Writes the states' rates under the commands delta [rad] and tau [N m], on a path of this curvature [1/m]; where
    commands are `lanes`, those of that many cars."""
    r, v, beta, omega_r = loaded(x, 0, delta), loaded(x, 1, delta), loaded(x, 2, delta), loaded(x, 3, delta)
    m, d = double_track_motion(r, v, beta, omega_r, 0.0, own_states(x, 6, delta), delta, tau, p, q)
    e_dot, dphi_dot, _ = path_rates(r, v, m.beta_dot, loaded(x, 4, delta), loaded(x, 5, delta), curvature)
    for i, rate in enumerate((m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, e_dot, dphi_dot)):
        stored(out, i, rate)
    for i, rate in enumerate(d):
        stored(out, 6 + i, rate)


@jitable
def _rates(x: Any, command: Any, car: Any, out: Any) -> None:
    curvature, p, q = car
    path_motion(x, command[0], command[1], curvature, p, q, out)


@jitable
def advance_state(x: Array, u: Array, u_next: Array, first: float, last: float, curvature: float,
                  p: DoubleTrackConstants, q: Effects, h: float, work: Array) -> None:  # fmt: skip
    """RK4 over h [s] in place, the input going from share `first` to share `last` of its way from u to u_next."""
    runge_kutta(_rates, x, ramp(u, u_next, first), ramp(u, u_next, first + 0.5 * (last - first)),
                ramp(u, u_next, last), h, (curvature, p, q), work[2], work[:2])  # fmt: skip
