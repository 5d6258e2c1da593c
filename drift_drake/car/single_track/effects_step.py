"""The car with effects as a one-step model: what an MPC that knows the true car believes (the oracle).

The effects' own states are states of the model (`car.internal_states`).
"""

import copy
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.catalogue import PARAMETRIC
from drift_drake.car.effects.magnitudes import INSTALLED_STATES, INTERNAL_COUNT, Effects, InternalStates
from drift_drake.car.integrate import ramp, runge_kutta
from drift_drake.car.internal_states import RememberingStepModel, check_one_step
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.scalar import fixed_tuple, jitable
from drift_drake.car.single_track.motion import path_rates
from drift_drake.car.single_track.motion_with_effects import (
    RATE_LIMIT_TIME,
    changed_constants,
    motion_with_effects,
    settled_internal_states,
)
from drift_drake.car.step_model import STEP, SUBSTEPS, NominalStepModel, block_scale
from drift_drake.common.arrays import Array, contiguous

INTERNAL_SCALE = np.array([0.3, 100.0, 0.3, 0.3, 1.0, 1.0, 5.0, 5.0] + [1.0] * len(INSTALLED_STATES))
STATE_SIZE = 6 + INTERNAL_COUNT
COMPLEX_STEP = 1e-30
DIFFERENCES = 1e-7 * block_scale(INTERNAL_SCALE)
STABLE = 2.5  # times its settling time, up to which a step of Runge-Kutta is stable (2.78 at the limit)
FASTEST = 30.0  # [m/s] at which slips still settle so


class EffectsStepModel(RememberingStepModel):
    """One step of the car with effects: RK4 with sub-steps under linear input.

    Its Jacobians are exact (complex step) or, for a controller, forward differences of 1e-7 of the states' sizes: good
    to a millionth, in less than half of the time.

    A transport delay is beyond it (a step knows the commands at its own ends only), as are a road's grade
    on a heading (the six states have none) and the sensors' effects.

    Args:
        parameters: the car without effects; effects: magnitudes; exact: Jacobians; dt: of a step [s].

    Raises:
        ValueError: such an effect.

    Examples:
        >>> believed = EffectsStepModel(car, make_effects({"aero_drag": 1.0}))
        >>> believed.step(x, u, u, np.zeros(1)).shape
        (1, 6)
    """

    def __init__(self, parameters: VehicleParameters, effects: Effects, exact: bool = True, dt: float = STEP) -> None:
        check_one_step(effects)
        self._exact, self.dt = exact, dt
        self.internal_scale = INTERNAL_SCALE
        self.constants, self.effects = parameters.constants(), effects
        self._substeps = max(SUBSTEPS, _stable_substeps(effects, self.dt))

    def of_car(self, constants: Constants, effects: Effects) -> "EffectsStepModel":
        """The same step of another car, by its constants, whose effects are of the same kind."""
        other = copy.copy(self)
        other.constants, other.effects = constants, effects
        other._substeps = max(self._substeps, _stable_substeps(effects, self.dt))
        return other

    def with_effects(self, effects: Effects) -> "EffectsStepModel":
        return self.of_car(self.constants, effects)

    def settled(self, state: Array, command: Array) -> Array:
        return np.array(settled_internal_states(*state, *command, self.constants, self.effects), dtype=float)

    def run_on(self, x: Array, u: Array, u_next: Array, duration: float) -> Array:
        x_next = np.empty((1, STATE_SIZE))
        substeps = _stable_substeps(self.effects, duration)
        _steps(x[None].copy(), u[None].copy(), u_next[None].copy(), np.zeros(1), self.constants, self.effects, duration,
               substeps, x_next)  # fmt: skip
        return x_next[0]

    def follows_at_once(self) -> NDArray[np.bool_]:
        q = self.effects
        relaxed, lagged = q.tyre_relaxation > 0.0, q.steering_lag + q.steering_rate_limit > 0.0
        installed = [getattr(q, name) == 0.0 for name in INSTALLED_STATES]
        return np.array([not lagged, q.torque_lag <= 0.0, not relaxed, not relaxed, *[False] * 4, *installed])

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        if self._parametric:
            return self.linearize(x, u, u_next, curvature)[0]
        x_next = np.empty(x.shape)
        car = (self.constants, self.effects, self.dt, self._substeps)
        _steps(*contiguous(x, u, u_next, curvature), *car, x_next)
        return x_next

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        if self._parametric:
            return self._linearize_parametric(x, u, u_next, curvature)
        x_next, jacobian = np.empty(x.shape), np.empty((len(x), STATE_SIZE, STATE_SIZE + 4))
        car = (self.constants, self.effects, self.dt, self._substeps)
        jacobians = _jacobians if self._exact else _differences
        jacobians(*contiguous(x, u, u_next, curvature), *car, x_next, jacobian)
        n = STATE_SIZE
        return x_next, jacobian[:, :, :n], jacobian[:, :, n : n + 2], jacobian[:, :, n + 2 :]

    @property
    def _parametric(self) -> bool:
        return not any(q for name, q in zip(Effects._fields, self.effects, strict=True) if name not in PARAMETRIC)

    def _linearize_parametric(
        self, x: Array, u: Array, u_next: Array, curvature: Array
    ) -> tuple[Array, Array, Array, Array]:
        """The same of a car with other constants and no more; internal states, which nothing depends on, are held."""
        car = NominalStepModel.of(changed_constants(self.constants, self.effects), self.dt)
        count, n = len(x), STATE_SIZE
        x_next, by_x = x.copy(), np.tile(np.eye(n), (count, 1, 1))
        by_u, by_u_next = np.zeros((count, n, 2)), np.zeros((count, n, 2))
        x_next[:, :6], by_x[:, :6, :6], by_u[:, :6], by_u_next[:, :6] = car.linearize(x[:, :6], u, u_next, curvature)
        return x_next, by_x, by_u, by_u_next


def _stable_substeps(effects: Effects, duration: float) -> int:
    """Steps of Runge-Kutta over a duration [s] that what settles fastest asks for: lags, slips, a limited wheel."""
    settling = (effects.steering_lag, effects.torque_lag, effects.tyre_relaxation / FASTEST)
    steps = [duration / (STABLE * time) for time in settling if time > 0.0]
    if effects.steering_rate_limit > 0.0:
        steps.append(duration / (2.0 * RATE_LIMIT_TIME))  # 2 ms: steps of at most 4 ms
    return math.ceil(max(steps, default=1.0))


@jitable
def _rates(x: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the rates; car: the path's curvature [1/m], constants, effects."""
    curvature, p, q = car
    internal = InternalStates(*fixed_tuple(x[6:], INTERNAL_COUNT))
    m, d = motion_with_effects(x[0], x[1], x[2], x[3], 0.0, internal, command[0], command[1], p, q)
    e_dot, dphi_dot, _ = path_rates(x[0], x[1], m.beta_dot, x[4], x[5], curvature)
    out[0], out[1], out[2], out[3], out[4], out[5] = m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, e_dot, dphi_dot
    for i, rate in enumerate(d):
        out[6 + i] = rate


@jitable
def _rk4(x: Any, u: Any, u_next: Any, curvature: Any, p: Constants, q: Effects, dt: float, substeps: int,
         work: Any) -> None:  # fmt: skip
    """Advances x in place; work [3, STATE_SIZE] is scratch of x's type."""
    for sub in range(substeps):
        begin, middle = ramp(u, u_next, sub / substeps), ramp(u, u_next, (sub + 0.5) / substeps)
        end = ramp(u, u_next, (sub + 1.0) / substeps)
        runge_kutta(_rates, x, begin, middle, end, dt / substeps, (curvature, p, q), work[2], work[:2])


@compiled
def _steps(x: Array, u: Array, u_next: Array, curvature: Array, p: Constants, q: Effects, dt: float, substeps: int,
           x_next: Array) -> None:  # fmt: skip
    work = np.empty((3, STATE_SIZE))
    for n in range(x.shape[0]):
        x_next[n] = x[n]
        _rk4(x_next[n], u[n], u_next[n], curvature[n], p, q, dt, substeps, work)


@compiled
def _jacobians(x: Array, u: Array, u_next: Array, curvature: Array, p: Constants, q: Effects, dt: float,
               substeps: int, x_next: Array, jacobian: Array) -> None:  # fmt: skip
    n_x = STATE_SIZE
    z = np.empty(n_x + 4, dtype=np.complex128)
    work = np.empty((3, n_x), np.complex128)
    for n in range(x.shape[0]):
        for j in range(n_x + 4):
            for i in range(n_x):
                z[i] = x[n, i]
            for i in range(2):
                z[n_x + i], z[n_x + 2 + i] = u[n, i], u_next[n, i]
            z[j] += COMPLEX_STEP * 1j
            _rk4(z[:n_x], z[n_x : n_x + 2], z[n_x + 2 :], curvature[n], p, q, dt, substeps, work)
            for i in range(n_x):
                jacobian[n, i, j] = z[i].imag / COMPLEX_STEP
        for i in range(n_x):
            x_next[n, i] = z[i].real


@compiled
def _differences(x: Array, u: Array, u_next: Array, curvature: Array, p: Constants, q: Effects, dt: float,
                 substeps: int, x_next: Array, jacobian: Array) -> None:  # fmt: skip
    n_x = STATE_SIZE
    z, work = np.empty(n_x + 4), np.empty((3, n_x))
    for n in range(x.shape[0]):
        for j in range(-1, n_x + 4):
            z[:n_x], z[n_x : n_x + 2], z[n_x + 2 :] = x[n], u[n], u_next[n]
            if j >= 0:
                z[j] += DIFFERENCES[j]
            _rk4(z[:n_x], z[n_x : n_x + 2], z[n_x + 2 :], curvature[n], p, q, dt, substeps, work)
            if j < 0:
                x_next[n] = z[:n_x]
            else:
                jacobian[n, :, j] = (z[:n_x] - x_next[n]) / DIFFERENCES[j]
