"""A low-level controller that executes a planned trajectory: feedforward of the plan plus feedback of the state."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.car.step_model import StepModel
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_update
from drift_drake.drive.mpc.plan import DT, Plan, interpolate_knots, plan_size

STATE_WEIGHT = np.array([2.0, 0.2, 8.0, 0.02, 0.5, 4.0])  # of (r, v, beta, omega_r, e, dphi)
PERIOD = 0.01  # [s] between updates of what the actuators have made of the commands
INPUT_WEIGHT = np.array([40.0, 1e-4])  # of (delta, tau)


def tracking_gains(model: StepModel, x: Array, u: Array, curvature: Array) -> Array:
    """Time-varying LQR gains K_k [N, 2, 6] about a trajectory, u = u_plan + K (x - x_plan).

    Args:
        model: one step of the car (without states of its own); x: [N+1, 6]; u: [N+1, 2]; curvature: [N] [1/m].
    """
    _, a, b, b_next = model.linearize(x[:-1], u[:-1], u[1:], curvature)
    return lqr_gains(a, b + b_next)  # the correction is held over the step


def lqr_gains(a: Array, b: Array) -> Array:
    """K_k [N, 2, n] for d_{k+1} = A_k d_k + B_k K_k d_k by a Riccati recursion; a: [N, n, n]; b: [N, n, 2].

    A model's states beyond the six have no weight.
    """
    size = a.shape[1]
    q, r = np.diag(np.append(STATE_WEIGHT, np.zeros(size - 6))), np.diag(INPUT_WEIGHT)
    value = q
    gains = np.empty((len(a), 2, size))
    for k in reversed(range(len(a))):
        gain = -np.linalg.solve(r + b[k].T @ value @ b[k], b[k].T @ value @ a[k])
        closed = a[k] + b[k] @ gain
        value = q + gain.T @ r @ gain + closed.T @ value @ closed
        gains[k] = gain
    return gains


class TrackingController(LeafSystem):
    """Follows a trajectory of steps of 0.1 s; beyond its end the last point is held.

    Input port: measured_state [7] (r, v, beta, omega_r, e, dphi, s).
    Output port: plan [5], of one step as `LinearInterpolationActuator` takes it: the trajectory's commands now and
    a step later, both corrected by the feedback of now.
    State in the Context, with lags: what the actuators have made of the commands so far [2], each 0.01 s.

    Args:
        x: states [N+1, 6], or [N+1, 8] with the lagged commands behind them; u: inputs [N+1, 2];
        gains: [N, 2, 6 or 8], see `tracking_gains`.
        lag, rate: of the actuators, for gains of eight columns: time constants [2] [s]; the steering's limit [rad/s].
    """

    def __init__(self, x: Array, u: Array, gains: Array, lag: Array | None = None, rate: float = np.inf) -> None:
        LeafSystem.__init__(self)
        self._x, self._u, self._gains = np.array(x), np.array(u), np.array(gains)
        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        given = {self.time_ticket(), self._measured.ticket()}
        self._actual = None
        if lag is not None:
            self._share, self._most = 1.0 - np.exp(-PERIOD / lag), np.array([rate * PERIOD, np.inf])
            self._actual = self.DeclareDiscreteState(self._u[0])
            given.add(self.discrete_state_ticket(self._actual))
            declare_update(self, PERIOD, self._update)
        declare_output(self, "plan", plan_size(1), self._plan, given)

    def _plan(self, context: Context) -> Array:
        t, correction = context.get_time(), self._correction(context)
        commands = [interpolate_knots(self._u, t) + correction, interpolate_knots(self._u, t + DT) + correction]
        return Plan(t, np.array(commands)).vector()

    def _correction(self, context: Context) -> Array:
        t, state = context.get_time(), self._measured.Eval(context)[:6]
        if self._actual is not None:
            state = np.append(state, context.get_discrete_state(self._actual).value())
        return interpolate_knots(self._gains, t) @ (state - interpolate_knots(self._x, t))

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        assert self._actual is not None
        actual = context.get_discrete_state(self._actual).value()
        command = interpolate_knots(self._u, context.get_time()) + self._correction(context)
        moved = np.clip(self._share * (command - actual), -self._most, self._most)
        discrete.set_value(self._actual, actual + moved)
