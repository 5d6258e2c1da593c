"""The brush car as a one-step model: its oracle, which knows the car that no model of the package has equations of."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.integrate import ramp, runge_kutta
from drift_drake.car.internal_states import RememberingStepModel
from drift_drake.car.scalar import jitable
from drift_drake.car.single_track.motion import path_rates
from drift_drake.car.step_model import STEP
from drift_drake.common.arrays import Array, contiguous
from experiments.other_worlds.brush_car import STATES, BrushCar, rates

OWN_SCALE = np.array([3.0, 0.3, 100.0, 5.0, 5.0, 50.0, 0.3, 0.3])  # of `brush_plant.OWN`
SIZE = 6 + len(OWN_SCALE)
SUBSTEPS = 16  # a step of 0.1 s
SETTLE = 2.0  # [s] in which the car's own states settle


class BrushStepModel(RememberingStepModel):
    """States [N, 14]: the paper's six, then `brush_plant.OWN`. RK4; Jacobians are `StepModel`'s differences."""

    def __init__(self, car: BrushCar, effects: Effects) -> None:
        self.internal_scale = OWN_SCALE
        self.car, self.effects = car, effects

    def with_effects(self, effects: Effects) -> "BrushStepModel":
        return BrushStepModel(self.car, effects)

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        x_next = np.array(x, dtype=float, order="C")
        steps(x_next, *contiguous(u, u_next, curvature), self.car, self.effects, STEP, SUBSTEPS, 0)
        return x_next

    def settled(self, state: Array, command: Array) -> Array:
        """The car's own states under constant (r, v, beta, omega_r) and commands, its rear wheels at equal slip."""
        x = np.concatenate([state[:4], np.zeros(2), [self.car.track * state[0], *command], np.zeros(5)])[None]
        u = np.asarray(command, dtype=float)[None]
        steps(x, u, u, np.zeros(1), self.car, self.effects, SETTLE, round(SETTLE / 0.005), 7)
        return np.asarray(x[0, 6:])

    def run_on(self, x: Array, u: Array, u_next: Array, duration: float) -> Array:
        later = x[None].copy()
        steps(later, u[None], u_next[None], np.zeros(1), self.car, self.effects, duration, 2, 0)
        return np.asarray(later[0])

    def follows_at_once(self) -> NDArray[np.bool_]:
        q, free = self.effects, np.zeros(len(OWN_SCALE), dtype=bool)
        free[1], free[2] = q.steering_lag + q.steering_rate_limit <= 0.0, q.torque_lag <= 0.0
        return free


@compiled
def motion(x: Array, psi: float, delta: float, tau: float, curvature: float, p: BrushCar, q: Effects, z: Array,
           rate: Array, out: Array) -> tuple[float, float]:  # fmt: skip
    """Writes the rates of the 14 states at a heading; returns (a_x, a_y) [m/s^2]. z, rate: workspace of the car."""
    v, beta = x[1], x[2]
    z[0], z[1], z[2], z[3] = v * np.cos(beta), v * np.sin(beta), x[0], psi
    z[6], z[7] = x[3] - 0.5 * x[6], x[3] + 0.5 * x[6]
    z[8:] = x[7:]
    a_x, a_y = rates(z, (delta, tau), (p, q), rate)
    out[0], out[1] = rate[2], (z[0] * rate[0] + z[1] * rate[1]) / v
    out[2], out[3] = (z[0] * rate[1] - z[1] * rate[0]) / (v * v), 0.5 * (rate[6] + rate[7])
    out[4], out[5], _ = path_rates(x[0], v, out[2], x[4], x[5], curvature)
    out[6] = rate[7] - rate[6]
    out[7:] = rate[8:]
    return a_x, a_y


@jitable
def _rates(x: Any, command: Any, car: Any, out: Any) -> None:
    curvature, held, p, q, z, rate = car
    motion(x, 0.0, command[0], command[1], curvature, p, q, z, rate, out)
    out[:held] = 0.0


@compiled
def steps(x: Array, u: Array, u_next: Array, curvature: Array, p: BrushCar, q: Effects, dt: float, substeps: int,
          held: int) -> None:  # fmt: skip
    """States [N, 14] a time dt [s] later, in place; the first `held` of them stay as they are."""
    z, rate, work = np.zeros(len(STATES)), np.empty(len(STATES)), np.empty((3, SIZE))
    for n in range(x.shape[0]):
        for sub in range(substeps):
            begin, middle = ramp(u[n], u_next[n], sub / substeps), ramp(u[n], u_next[n], (sub + 0.5) / substeps)
            end = ramp(u[n], u_next[n], (sub + 1.0) / substeps)
            runge_kutta(_rates, x[n], begin, middle, end, dt / substeps, (curvature[n], held, p, q, z, rate), work[2],
                        work[:2])  # fmt: skip
