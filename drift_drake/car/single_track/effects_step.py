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
from drift_drake.car.integrate import paths
from drift_drake.car.internal_states import RememberingStepModel, check_one_step, check_states
from drift_drake.car.lanes import load_lanes
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.scalar import jitable, loaded_tuple, stored
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
DIFFERENCES = 1e-7 * block_scale(INTERNAL_SCALE)
STABLE = 2.5  # times its settling time, up to which a step of Runge-Kutta is stable (2.78 at the limit)
FASTEST = 30.0  # [m/s] at which slips still settle so


class EffectsStepModel(RememberingStepModel):
    """One step of the car with effects: RK4 with sub-steps under linear input.

    Its Jacobians are forward differences of 1e-7 of the states' sizes, good to a millionth: half the time of
    `StepModel`'s central ones.

    A transport delay is beyond it (a step knows the commands at its own ends only), as are the sensors' effects. What
    depends on the heading (a road's grade) takes that of the path from `along`.

    Args:
        parameters: the car without effects; effects: magnitudes; dt: of a step [s].

    Raises:
        ValueError: such an effect; states without the model's own.

    Examples:
        >>> believed = EffectsStepModel(car, make_effects({"aero_drag": 1.0}))
        >>> own = believed.settled(x[0, :4], u[0])
        >>> believed.step(np.append(x, [own], axis=1), u, u, np.zeros(1))[:, :6].shape
        (1, 6)
    """

    def __init__(self, parameters: VehicleParameters, effects: Effects, dt: float = STEP) -> None:
        check_one_step(effects)
        self.dt = dt
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
        substeps = _stable_substeps(self.effects, duration)
        car = self.with_effects(self.unheaded()) if self.headed else self
        return car._after(duration, substeps, x[None], u[None], u_next[None], np.zeros(1))[0]

    def follows_at_once(self) -> NDArray[np.bool_]:
        q = self.effects
        relaxed, lagged = q.tyre_relaxation > 0.0, q.steering_lag + q.steering_rate_limit > 0.0
        installed = [getattr(q, name) == 0.0 for name in INSTALLED_STATES]
        return np.array([not lagged, q.torque_lag <= 0.0, not relaxed, not relaxed, *[False] * 4, *installed])

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        if self._parametric:
            return self.linearize(x, u, u_next, curvature)[0]
        return self._after(self.dt, self._substeps, x, u, u_next, curvature)

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        if self._parametric:
            return self._linearize_parametric(x, u, u_next, curvature)
        n, shifts = STATE_SIZE, np.vstack([np.diag(DIFFERENCES), np.zeros(STATE_SIZE + 4)])
        ends = self.stepped(x, u, u_next, curvature, shifts)
        jacobian = np.ascontiguousarray(np.moveaxis((ends[:-1] - ends[-1]) / DIFFERENCES[:, None, None], 0, 2))
        return ends[-1], jacobian[:, :, :n], jacobian[:, :, n : n + 2], jacobian[:, :, n + 2 :]

    def _after(self, duration: float, substeps: int, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        """The states [N, n] a duration [s] later."""
        check_states(x, self)
        path = np.empty((1, *x.shape))
        _paths(
            *contiguous(x, u, u_next, self.on_paths(curvature)), self.constants, self.effects, duration, substeps, path
        )
        return path[0]

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
    """Writes the rates, on `lanes`; car: the path's curvature [1/m] and heading [rad], constants, effects."""
    path, p, q = car
    delta, tau = command
    r, v, beta, omega_r, e, dphi = loaded_tuple(x, 0, 6, delta)
    curvature, psi = load_lanes(path, 0), load_lanes(path, 1) + dphi - beta
    internal = InternalStates(*loaded_tuple(x, 6, INTERNAL_COUNT, delta))
    m, d = motion_with_effects(r, v, beta, omega_r, psi, internal, delta, tau, p, q)
    e_dot, dphi_dot, _ = path_rates(r, v, m.beta_dot, e, dphi, curvature)
    for i, rate in enumerate((m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, e_dot, dphi_dot)):
        stored(out, i, rate)
    for i, rate in enumerate(d):
        stored(out, 6 + i, rate)


@compiled
def _paths(x: Array, u: Array, u_next: Array, curvature: Array, p: Constants, q: Effects, dt: float, every: int,
           path: Array) -> None:  # fmt: skip
    """`integrate.paths` of this car."""
    paths(_rates, x, u, u_next, curvature, (p, q), dt, every, path)
