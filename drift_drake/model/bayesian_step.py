"""The controller's one-step model f_theta(x_k, u_k, u_{k+1}) = h(x_k, u_k) + theta^T phi(z_k) and its Jacobians.

h is one Euler step of the nominal car with h_4 = 0: the wheel speed is learnt whole. The path coordinates e and dphi
have no learnt part (g_5 = g_6 = 0); two rules for their step are offered:

- "euler", the paper's: rates of the nominal car at the start of the step. The course rate then holds the *nominal*
  car's beta_dot and forces, whatever has been learnt.
- "trapezoid": the course advances by what the learnt model says of the body, beta_{k+1} - beta_k + dt (r_k +
  r_{k+1}) / 2, and the path terms use the mean of v and of dphi over the step. On held-out vehicles, after 100 samples,
  the median error of e falls from 8.0 to 1.4 cm over 0.5 s and from 0.87 to 0.12 m over 2 s, that of dphi over 2 s from
  0.091 to 0.012 rad (`experiments.model.quality`). The closed loop uses this one.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import LeafSystem

from drift_drake.model.command_lag import LAGGED, CommandLag, lag_factors
from drift_drake.model.features import STATE_COUNT, MeanFunction, Network, network_inputs
from drift_drake.vehicle.bicycle_jacobian import linearize
from drift_drake.vehicle.compilation import compiled
from drift_drake.vehicle.parameters import Constants
from drift_drake.vehicle.step_model import StepModel

Array = NDArray[np.float64]
PathStep = Literal["euler", "trapezoid"]

TIME_STEP = 0.1  # [s] of the model, of the plan's grid and of the training table


def euler_step(x: Array, u: Array, curvature: Array, nominal: Constants) -> Array:
    """h(x, u) [..., 6] for x [..., 6], u [..., 2], curvature [...]: Euler, with h_4 = 0."""
    rates, _, _ = linearize(x, u, curvature, nominal)
    h = np.asarray(x) + TIME_STEP * rates
    h[..., 3] = 0.0
    return h


def residual(x: Array, u: Array, x_next: Array, nominal: Constants) -> Array:
    """y [..., 4] = x_{k+1} - h(x_k, u_k) of the learnt states: what the last layer is fitted to."""
    state = np.zeros((*np.shape(x)[:-1], 6))
    state[..., :STATE_COUNT] = np.asarray(x)[..., :STATE_COUNT]
    h = euler_step(state, u, np.zeros(state.shape[:-1]), nominal)
    return np.asarray(x_next)[..., :STATE_COUNT] - h[..., :STATE_COUNT]


class BayesianStepModel(StepModel):
    """One step of the learnt car over the arrays of a horizon, for one theta.

    Its state is the paper's (r, v, beta, omega_r, e, dphi) and the lagged commands (`command_lag`).
    """

    memory_scale: Array = np.array([0.3, 100.0])  # of the lagged commands

    def __init__(
        self,
        network: Network,
        theta: Array,
        nominal: Constants,
        path_step: PathStep = "trapezoid",
    ) -> None:
        """Args: theta: last-layer parameters [4, 16], as a rule the posterior mean; nominal: the car inside h."""
        self._mean = MeanFunction(network, theta)
        self._nominal = nominal
        self._lag = lag_factors(TIME_STEP)
        self._trapezoid = path_step == "trapezoid"

    def with_theta(self, theta: Array) -> "BayesianStepModel":
        """The model with another theta [4, 16] or [64] (the features and work arrays are shared)."""
        other = object.__new__(BayesianStepModel)
        other.__dict__.update(self.__dict__)
        other._mean = self._mean.with_theta(np.reshape(theta, (4, -1)))
        return other

    def observer(self, period: float) -> LeafSystem:
        """See `CommandLag`."""
        return CommandLag(period)

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        """x_{k+1} [n, 8] for states x [n, 8], inputs at both ends of the step [n, 2] and path curvature [n] [1/m]."""
        body = euler_step(x[:, :6], u, curvature, self._nominal)
        body[:, :STATE_COUNT] += self._mean.value(network_inputs(x, u, u_next))
        if self._trapezoid:
            body[:, 4:] = _trapezoid_path(x, body, curvature)[0]
        keep, by_now, by_next = self._lag
        return np.concatenate([body, keep * x[:, LAGGED] + by_now * u + by_next * u_next], axis=1)

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        """The step and its Jacobians.

        Returns:
            (x_{k+1} [n, 8], A = d/dx [n, 8, 8], B = d/du_k [n, 8, 2], B_next = d/du_{k+1} [n, 8, 2]).
        """
        count, learnt = len(x), STATE_COUNT
        next_state, a = np.empty((count, 8)), np.zeros((count, 8, 8))
        b, b_next = np.zeros((count, 8, 2)), np.zeros((count, 8, 2))
        rates, rate_a, rate_b = linearize(x[:, :6], u, curvature, self._nominal)
        next_state[:, :6] = x[:, :6] + TIME_STEP * rates
        a[:, :6, :6], b[:, :6] = TIME_STEP * rate_a, TIME_STEP * rate_b
        a[:, range(6), range(6)] += 1.0
        next_state[:, 3], a[:, 3], b[:, 3] = 0.0, 0.0, 0.0
        g, slope = self._mean.linearize(network_inputs(x, u, u_next))
        next_state[:, :learnt] += g
        a[:, :learnt, :learnt] += slope[..., :learnt]
        a[:, :learnt, LAGGED] = slope[..., learnt + 4 :]
        b[:, :learnt] += slope[..., learnt : learnt + 2]
        b_next[:, :learnt] = slope[..., learnt + 2 : learnt + 4]
        if self._trapezoid:
            path, by_state, by_next = _trapezoid_path(x, next_state, curvature)
            next_state[:, 4:6] = path
            a[:, 4:6] = by_next @ a[:, :learnt]
            a[:, 4:6, :6] += by_state
            b[:, 4:6] = by_next @ b[:, :learnt]
            b_next[:, 4:6] = by_next @ b_next[:, :learnt]
        factors = self._lag
        next_state[:, LAGGED] = factors[0] * x[:, LAGGED] + factors[1] * u + factors[2] * u_next
        for matrix, factor in zip((a[:, LAGGED, LAGGED], b[:, LAGGED], b_next[:, LAGGED]), factors, strict=True):
            matrix[:, range(2), range(2)] = factor
        return next_state, a, b, b_next

    def disturbance(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        """How an error of the learnt states' step enters x_{k+1}: its derivative by g [n, 8, 4]."""
        enters = np.zeros((len(x), 8, STATE_COUNT))
        enters[:, range(STATE_COUNT), range(STATE_COUNT)] = 1.0
        if self._trapezoid:
            enters[:, 4:6] = _trapezoid_path(x, self.step(x, u, u_next, curvature), curvature)[2]
        return enters

    def weighted_gradient(self, x: Array, u: Array, u_next: Array, curvature: Array, weights: Array) -> Array:
        """See `StepModel`: one reverse pass through the network, where `linearize` needs one for each learnt state."""
        learnt = STATE_COUNT
        rates, by_x, by_u = linearize(x[:, :6], u, curvature, self._nominal)
        g, pullback = self._mean.value_and_pullback(network_inputs(x, u, u_next))
        body = weights[:, :6].copy()
        gradient = np.zeros((len(x), 12))
        if self._trapezoid:
            x_next = np.empty((len(x), 6))
            x_next[:, :learnt] = x[:, :learnt] + TIME_STEP * rates[:, :learnt]
            x_next[:, 3] = 0.0
            x_next[:, :learnt] += g
            _, by_state, by_next = _trapezoid_path(x, x_next, curvature)
            path = weights[:, None, 4:6]
            gradient[:, :6] = (path @ by_state)[:, 0]
            body[:, :learnt] += (path @ by_next)[:, 0]
            body[:, 4:] = 0.0
        by_z = pullback(body[:, :learnt])
        body[:, 3] = 0.0  # h_4 = 0
        gradient[:, :6] += body + TIME_STEP * (body[:, None] @ by_x)[:, 0]
        gradient[:, :learnt] += by_z[:, :learnt]
        keep, by_now, by_end = (factor * weights[:, LAGGED] for factor in self._lag)
        gradient[:, LAGGED] = keep + by_z[:, learnt + 4 :]
        gradient[:, 8:10] = by_now + TIME_STEP * (body[:, None] @ by_u)[:, 0] + by_z[:, learnt : learnt + 2]
        gradient[:, 10:] = by_end + by_z[:, learnt + 2 : learnt + 4]
        return gradient


def _trapezoid_path(x: Array, x_next: Array, curvature: Array) -> tuple[Array, Array, Array]:
    """(e, dphi) [n, 2] at the end of a step whose first four states are known at both ends, and its derivatives.

    Returns:
        ((e, dphi) [n, 2], derivative by x at fixed x_next[:4] [n, 2, 6], derivative by x_next[:4] [n, 2, 4]).
    """
    count = x.shape[0]
    path, by_state, by_next = np.empty((count, 2)), np.zeros((count, 2, 6)), np.zeros((count, 2, 4))
    _trapezoid_points(np.ascontiguousarray(x), np.ascontiguousarray(x_next), np.ascontiguousarray(curvature), path,
                      by_state, by_next)  # fmt: skip
    return path, by_state, by_next


@compiled
def _trapezoid_points(x: Array, x_next: Array, curvature: Array, path: Array, by_state: Array,
                      by_next: Array) -> None:  # fmt: skip
    """Writes `_trapezoid_path`'s results into zeroed arrays."""
    for n in range(x.shape[0]):
        e, dphi, k = x[n, 4], x[n, 5], curvature[n]
        # The turn of the course comes from the body; what the path turns by in the meantime is taken from it at the
        # mean speed and the course at the start.
        v = 0.5 * (x[n, 1] + x_next[n, 1])
        stretch = 1.0 - k * e
        cos_start, sin_start = np.cos(dphi), np.sin(dphi)
        s_dot = v * cos_start / stretch
        turn = x_next[n, 2] - x[n, 2] + 0.5 * TIME_STEP * (x[n, 0] + x_next[n, 0])
        dphi_next = dphi + turn - TIME_STEP * k * s_dot
        mid = 0.5 * (dphi + dphi_next)
        cos_mid, sin_mid = np.cos(mid), np.sin(mid)
        path[n, 0], path[n, 1] = e + TIME_STEP * v * sin_mid, dphi_next
        by_speed = -0.5 * TIME_STEP * k * cos_start / stretch
        d = by_state[n, 1]  # of dphi_next
        d[0], d[1], d[2] = 0.5 * TIME_STEP, by_speed, -1.0
        d[4] = -TIME_STEP * k * k * s_dot / stretch
        d[5] = 1.0 + TIME_STEP * k * v * sin_start / stretch
        by_next[n, 1, 0], by_next[n, 1, 1], by_next[n, 1, 2] = 0.5 * TIME_STEP, by_speed, 1.0
        lever = 0.5 * TIME_STEP * v * cos_mid
        for i in range(6):
            by_state[n, 0, i] = lever * d[i]
        by_state[n, 0, 1] += 0.5 * TIME_STEP * sin_mid
        by_state[n, 0, 4] += 1.0
        by_state[n, 0, 5] += lever
        for i in range(4):
            by_next[n, 0, i] = lever * by_next[n, 1, i]
        by_next[n, 0, 1] += 0.5 * TIME_STEP * sin_mid
