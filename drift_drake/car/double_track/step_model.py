"""The double-track car as a one-step model: what an MPC believes that knows this car and its effects (its oracle).

The car's own states (`double_track.motion.OwnStates`: actuators, rim difference, roll, wheel loads, slips) are states
of the model (`car.internal_states`).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.compilation import compiled
from drift_drake.car.double_track.motion import (
    OwnStates,
    check_supported,
    double_track_motion,
    own_states,
    settled_states,
)
from drift_drake.car.double_track.parameters import DoubleTrackConstants, DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.integrate import ramp, runge_kutta
from drift_drake.car.internal_states import RememberingStepModel, check_one_step
from drift_drake.car.lanes import LANES, load_lanes, store_lanes
from drift_drake.car.scalar import jitable, loaded, stored
from drift_drake.car.single_track.motion import path_rates
from drift_drake.car.step_model import INPUT_SCALE, STATE_SCALE, STEP
from drift_drake.common.arrays import Array, contiguous

OWN = len(OwnStates._fields)
SIZE = 6 + OWN
OWN_SCALE = np.array(OwnStates(
    steering=0.3, torque=100.0, rim_difference=3.0, roll=0.05, roll_rate=0.3, a_x=5.0, a_y=5.0, front_left_slip=0.3,
    front_right_slip=0.3, rear_left_slip=0.3, rear_right_slip=0.3, rear_left_drive_slip=0.3, rear_right_drive_slip=0.3,
))  # fmt: skip
DIFFERENCES = 1e-7 * np.concatenate([STATE_SCALE, OWN_SCALE, INPUT_SCALE])
COLUMNS = -(-(SIZE + 4) // LANES) * LANES  # of (x, u, u_next), or of moved states and inputs and then none, in lanes
LEAST_SUBSTEPS = 16
ACCURATE = 1.8  # of a sub-step times the fastest eigenvalue: RK4 is stable to 2.8 or so; a loaded tyre is stiffer
SPEEDS = (3.0, 10.0, 30.0)  # [m/s] at which, rolling straight ahead, the fastest eigenvalue is looked for


class DoubleTrackStepModel(RememberingStepModel):
    """One step of the double-track car: RK4 with sub-steps under linear input, by the plant's own equations.

    States [N, 19]: r [rad/s], v [m/s], beta [rad], omega_r [m/s] (the mean rim speed of the rear wheels, as the
    plant's sensors measure it), e [m], dphi [rad]; then `OwnStates`. Nothing is left out or taken for settled: the
    fastest mode, the difference of the rear rims ringing in the tyres at some 270 rad/s, sets the number of sub-steps.
    The Jacobians are those of the equations (forward differences of a ten-millionth of the states' sizes, good to a
    millionth), at the middle of each sub-step and constant over it: second order in the sub-step, not the derivative of
    the integrator's sum.

    A transport delay is beyond it, as are a road's grade on a heading and the sensors' effects.

    Raises:
        ValueError: such an effect.
        InvalidVehicleError: an effect that this car cannot have.
    """

    def __init__(self, parameters: DoubleTrackParameters, effects: Effects = Effects()) -> None:
        check_one_step(effects)
        check_supported(effects)
        self.internal_scale = OWN_SCALE
        self.parameters, self.constants, self.effects = parameters, parameters.constants(), effects
        self.substeps = max(LEAST_SUBSTEPS, math.ceil(STEP * self._fastest() / ACCURATE))

    def with_effects(self, effects: Effects) -> "DoubleTrackStepModel":
        return DoubleTrackStepModel(self.parameters, effects)

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        x_next = np.array(x, dtype=float, order="C")
        _steps(x_next, *contiguous(u, u_next, curvature), self.constants, self.effects, STEP, self.substeps)
        return x_next

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        x_next, sensitivity = np.array(x, dtype=float, order="C"), np.empty((len(x), SIZE, SIZE + 4))
        _sensitivities(x_next, *contiguous(u, u_next, curvature), self.constants, self.effects, STEP, self.substeps,
                       sensitivity)  # fmt: skip
        n = SIZE
        return x_next, sensitivity[:, :, :n], sensitivity[:, :, n : n + 2], sensitivity[:, :, n + 2 :]

    def settled(self, state: Array, command: Array) -> Array:
        r, v, beta, omega_r = (float(value) for value in state)
        own = settled_states(r, v, beta, omega_r, float(command[0]), float(command[1]), self.constants, self.effects)
        return np.array(own, dtype=float)

    def run_on(self, x: Array, u: Array, u_next: Array, duration: float) -> Array:
        later = x[None].copy()
        substeps = math.ceil(self.substeps * duration / STEP)
        _steps(later, *contiguous(u[None], u_next[None], np.zeros(1)), self.constants, self.effects, duration,
               substeps)  # fmt: skip
        return later[0]

    def follows_at_once(self) -> NDArray[np.bool_]:
        q, free = self.effects, np.zeros(OWN, dtype=bool)
        free[OwnStates._fields.index("steering")] = q.steering_lag + q.steering_rate_limit <= 0.0
        free[OwnStates._fields.index("torque")] = q.torque_lag <= 0.0
        return free

    def _fastest(self) -> float:
        """Largest modulus [rad/s] of the equations' eigenvalues, rolling straight ahead at `SPEEDS`."""
        found, jacobian = 0.0, np.zeros((SIZE, SIZE + 2))
        for speed in SPEEDS:
            moving = np.array([0.0, speed, 0.0, speed])
            x = np.concatenate([moving, np.zeros(2), self.settled(moving, np.zeros(2))])
            _linearized(x, np.zeros(2), 0.0, self.constants, self.effects, jacobian)
            found = max(found, float(np.abs(np.linalg.eigvals(jacobian[:, :SIZE])).max()))
        return found


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


@compiled
def _linearized(x: Array, command: Array, curvature: float, p: DoubleTrackConstants, q: Effects,
                jacobian: Array) -> None:  # fmt: skip
    """Writes the derivatives of the rates by (x, delta, tau) [19, 21], as forward differences: a lane each."""
    z, out, rates = np.empty((SIZE + 2) * LANES), np.empty(SIZE * LANES), np.empty((SIZE, COLUMNS))
    for first in range(0, COLUMNS, LANES):
        for i in range(SIZE + 2):
            value = x[i] if i < SIZE else command[i - SIZE]
            for lane in range(LANES):
                z[i * LANES + lane] = value + (DIFFERENCES[i] if i == first + lane else 0.0)
        path_motion(z, load_lanes(z, SIZE), load_lanes(z, SIZE + 1), curvature, p, q, out)
        for i in range(SIZE):
            for lane in range(LANES):
                rates[i, first + lane] = out[i * LANES + lane]
    for i in range(SIZE):
        for j in range(SIZE + 2):
            jacobian[i, j] = (rates[i, j] - rates[i, SIZE + 2]) / DIFFERENCES[j]


@compiled
def _steps(x: Array, u: Array, u_next: Array, curvature: Array, p: DoubleTrackConstants, q: Effects, dt: float,
           substeps: int) -> None:  # fmt: skip
    """The states [N, 19] a time dt [s] later, in place."""
    work = np.empty((3, SIZE))
    for n in range(x.shape[0]):
        for sub in range(substeps):
            first, last = sub / substeps, (sub + 1) / substeps
            advance_state(x[n], u[n], u_next[n], first, last, curvature[n], p, q, dt / substeps, work)


@compiled
def _sensitivities(x: Array, u: Array, u_next: Array, curvature: Array, p: DoubleTrackConstants, q: Effects, dt: float,
                   substeps: int, sensitivity: Array) -> None:  # fmt: skip
    """The same, and the sensitivities S [N, 19, 23] by (x, u, u_next): dS/dt = A S + B (input's share), A, B at the
    middle of each sub-step."""
    work, before, middle, command = np.empty((3, SIZE)), np.empty(SIZE), np.empty(SIZE), np.empty(2)
    jacobian = np.zeros((SIZE, SIZE + 2))
    s, k, scratch = np.empty((SIZE, COLUMNS)), np.empty(SIZE * COLUMNS), np.empty((2, SIZE * COLUMNS))
    h = dt / substeps
    for n in range(x.shape[0]):
        for i in range(SIZE):
            for j in range(COLUMNS):
                s[i, j] = 1.0 if i == j else 0.0
        for sub in range(substeps):
            first, last = sub / substeps, (sub + 1) / substeps
            before[:] = x[n]
            advance_state(x[n], u[n], u_next[n], first, last, curvature[n], p, q, h, work)
            share = 0.5 * (first + last)
            for i in range(SIZE):
                middle[i] = 0.5 * (before[i] + x[n, i])
            for i in range(2):
                command[i] = u[n, i] + share * (u_next[n, i] - u[n, i])
            _linearized(middle, command, curvature[n], p, q, jacobian)
            runge_kutta(_sensitivity_rates, s.reshape(-1), (first,), (share,), (last,), h, jacobian, k, scratch)
        sensitivity[n] = s[:, : SIZE + 4]


@jitable
def _sensitivity_rates(s: Array, share: tuple[float], jacobian: Array, out: Array) -> None:
    """dS/dt = A S + B (input's share), S and its rates flat, [A B] the jacobian."""
    n, blocks = COLUMNS, COLUMNS // LANES
    for i in range(SIZE):
        for block in range(blocks):
            total = jacobian[i, 0] * load_lanes(s, block)
            for m in range(1, SIZE):
                total = total + jacobian[i, m] * load_lanes(s, m * blocks + block)
            store_lanes(out, i * blocks + block, total)
        for j in range(2):
            out[i * n + SIZE + j] += (1.0 - share[0]) * jacobian[i, SIZE + j]
            out[i * n + SIZE + 2 + j] += share[0] * jacobian[i, SIZE + j]
