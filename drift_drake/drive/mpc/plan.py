"""The plan: what a controller sends to the actuator, as a type and as the vector on the wire between them."""

import math
from typing import NamedTuple

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.car.single_track.motion import INPUTS
from drift_drake.common.arrays import Array

TIME_TOLERANCE = 1e-9  # [s] by which a plan's start and Drake's event times may differ through rounding
DT = 0.1  # [s] between the commands of the MPC's plans


class Plan(NamedTuple):
    """Commands to be followed by linear interpolation from `start` on.

    Examples:
        >>> Plan(0.0, np.array([[0.0, 100.0], [0.2, 100.0]])).command(0.05).tolist()
        [0.1, 100.0]
    """

    start: float  # [s]
    u: Array  # [N+1, 2] (delta [rad], tau [N m])
    dt: float = DT  # [s] between them

    def vector(self) -> Array:
        """[t_start, delta_0, tau_0, ..., delta_N, tau_N]."""
        return np.append(self.start, np.ravel(self.u))

    def command(self, t: float) -> Array:
        """(delta [rad], tau [N m]) at time t [s], held constant beyond either end."""
        return self.commands(t)[0]

    def commands(self, *times: float) -> Array:
        """(delta [rad], tau [N m]) at each of the times [s], held constant beyond either end."""
        vector = self.vector()
        return np.array([interpolate_plan(vector, t, self.dt)[:2] for t in times])

    @classmethod
    def of(cls, vector: Array, dt: float = DT) -> "Plan | None":
        """The plan that a vector [1 + 2 (N + 1)] holds, spaced by dt [s]; None where its start is NaN."""
        return None if math.isnan(vector[0]) else cls(float(vector[0]), np.reshape(vector[1:], (-1, len(INPUTS))), dt)


def plan_size(steps: int) -> int:
    """Length of the vector of a plan of N steps."""
    return 1 + len(INPUTS) * (steps + 1)


def no_plan(steps: int) -> Array:
    """The vector that says that there is no plan."""
    return np.full(plan_size(steps), np.nan)


@compiled
def interpolate_plan(plan: Array, t: float, dt: float) -> tuple[float, float, float, float]:
    """Command and its rate at time t: u(t) = u_k + (t - k dt) u_dot_k, held constant beyond either end.

    Args:
        plan: [t_start, delta_0, tau_0, ..., delta_N, tau_N] ([s], [rad], [N m]).
        t: [s]; at a knot the rate is that of the step which begins there.
        dt: the plan's spacing [s].

    Returns:
        (delta [rad], tau [N m], delta_dot [rad/s], tau_dot [N m/s]).
    """
    last = (len(plan) - 1) // 2 - 1
    steps = (t - plan[0]) / dt
    k = math.floor(steps + TIME_TOLERANCE / dt)
    if k < 0:
        return plan[1], plan[2], 0.0, 0.0
    if k >= last:
        return plan[2 * last + 1], plan[2 * last + 2], 0.0, 0.0
    delta, tau = plan[2 * k + 1], plan[2 * k + 2]
    part, delta_step, tau_step = steps - k, plan[2 * k + 3] - delta, plan[2 * k + 4] - tau
    return delta + part * delta_step, tau + part * tau_step, delta_step / dt, tau_step / dt


def interpolate_knots(knots: Array, t: float) -> Array:
    """Value [...] at time t [s] of knots [K, ...] that lie 0.1 s apart; the ends are held."""
    position = min(max(t / DT, 0.0), len(knots) - 1.0)
    k = min(int(position), len(knots) - 2)
    return np.asarray(knots[k] + (position - k) * (knots[k + 1] - knots[k]))
