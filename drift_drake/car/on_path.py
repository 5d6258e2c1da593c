"""Cars with states of their own on a path: the states of a plant or of a step model, and those of their equations.

Equations (`car.equations`) are of z: r, v, beta, omega_r, psi, then the car's own states. A plant has `PLANT_STATES` in
their place, a step model the paper's six. Each kind of car gives its `rates`.
"""

from collections.abc import Callable
from typing import Any

from drift_drake.car.scalar import jitable, length, loaded, stored
from drift_drake.car.single_track.motion import STATES, body_acceleration, path_rates, world_rates

POSE = ("x", "y", "psi")
PLANT_STATES = (*STATES, "s", *POSE)
PLANT, STEP_STATES, OF_EQUATIONS = len(PLANT_STATES), 6, 5  # states before the car's own
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


@jitable
def step_rates_of(rates: Callable[..., Any], x: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the rates of a step model's states x under the commands (delta [rad], tau [N m]); where these are `lanes`,
    of that many cars. car: the path's curvature [1/m], constants, effects, wrench, scratch [2, a number less]."""
    curvature, p, q, wrench, scratch = car
    like, z, k = command[0], scratch[0], scratch[1]
    for i in range(MOVING):
        stored(z, i, loaded(x, i, like))
    stored(z, MOVING, 0.0 * like)
    for i in range(OF_EQUATIONS, length(z, like)):
        stored(z, i, loaded(x, i + STEP_STATES - OF_EQUATIONS, like))
    rates(z, command, (p, q, wrench), k)
    for i in range(MOVING):
        stored(out, i, loaded(k, i, like))
    e_dot, dphi_dot, _ = path_rates(loaded(x, 0, like), loaded(x, 1, like), loaded(k, 2, like), loaded(x, 4, like),
                                    loaded(x, 5, like), curvature)  # fmt: skip
    stored(out, MOVING, e_dot)
    stored(out, MOVING + 1, dphi_dot)
    for i in range(OF_EQUATIONS, length(z, like)):
        stored(out, i + STEP_STATES - OF_EQUATIONS, loaded(k, i, like))
