"""Cars with states of their own on a path: the states of a plant or of a step model, and those of their equations.

Equations (`car.equations`) are of z: r, v, beta, omega_r, psi, then the car's own states. A plant has `PLANT_STATES` in
place of the first five, a step model the paper's six: `of_step` says where these are in z with e and dphi behind it.
Each kind of car gives its `rates`.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.scalar import jitable, length, loaded, stored
from drift_drake.car.single_track.motion import STATES, body_acceleration, path_rates, world_rates

POSE = ("x", "y", "psi")
PLANT_STATES = (*STATES, "s", *POSE)
PLANT, OF_EQUATIONS = len(PLANT_STATES), 5  # states before the car's own
MOVING = 4  # r, v, beta, omega_r, which all of them begin with
PSI = PLANT_STATES.index("psi")


@jitable
def kinematic_rates(x: Any, beta_dot: Any, curvature: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Rates of (e, dphi, s, x, y, psi) at a plant's state x, which begins with `PLANT_STATES`."""
    e_dot, dphi_dot, s_dot = path_rates(x[0], x[1], beta_dot, x[4], x[5], curvature)
    x_dot, y_dot, psi_dot = world_rates(x[0], x[1], x[2], x[9])
    return e_dot, dphi_dot, s_dot, x_dot, y_dot, psi_dot


@jitable
def plant_rates_of(rates: Callable[..., Any], x: Any, u: Any, wrench: Any, curvature: Any, p: Any, q: Any, scratch: Any,
                   out: Any) -> None:  # fmt: skip
    """Writes the rates of a plant's state x [n], and behind them (a_x, a_y) [m/s^2].

    Args:
        rates: of the kind of car; x, u, wrench, curvature: see `path_plant.PathPlant`; p, q: the car and its effects;
        scratch: [2, n - 5]; out: [n + 2].
    """
    z, k = scratch[0], scratch[1]
    for i in range(MOVING):
        z[i] = x[i]
    z[MOVING] = x[PSI]
    for i in range(OF_EQUATIONS, len(z)):
        z[i] = x[i + PLANT - OF_EQUATIONS]
    rates(z, (u[0], u[1]), (p, q, wrench), k)
    for i in range(MOVING):
        out[i] = k[i]
    for i, rate in enumerate(kinematic_rates(x, k[2], curvature)):
        out[MOVING + i] = rate
    for i in range(OF_EQUATIONS, len(z)):
        out[i + PLANT - OF_EQUATIONS] = k[i]
    out[len(x)], out[len(x) + 1] = body_acceleration(x[0], x[1], x[2], k[1], k[2])


def of_step(own: int) -> NDArray[np.int64]:
    """Places [6 + own] of a step model's states in z, e and dphi."""
    last = OF_EQUATIONS + own
    return np.array([*range(MOVING), last, last + 1, *range(OF_EQUATIONS, last)])


@jitable
def step_rates_of(rates: Callable[..., Any], z: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the rates of the equations' states, e and dphi under the commands (delta [rad], tau [N m]); where these
    are `lanes`, of that many cars. car: the path's curvature [1/m], constants, effects."""
    curvature, p, q = car
    like = command[0]
    rates(z, command, (p, q, (0.0, 0.0, 0.0)), out)
    e, dphi = length(z, like) - 2, length(z, like) - 1
    e_dot, dphi_dot, _ = path_rates(loaded(z, 0, like), loaded(z, 1, like), loaded(out, 2, like), loaded(z, e, like),
                                    loaded(z, dphi, like), curvature)  # fmt: skip
    stored(out, e, e_dot)
    stored(out, dphi, dphi_dot)
