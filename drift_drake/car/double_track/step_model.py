"""The double-track car as a one-step model: what an MPC believes that knows this car and its effects (its oracle).

The car's own states (`double_track.motion.OwnStates`: actuators, rim difference, roll, wheel loads, slips) are states
of the model (`car.internal_states`).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.compilation import compiled
from drift_drake.car.double_track.constants import DoubleTrackConstants
from drift_drake.car.double_track.motion import (
    OWN,
    OwnStates,
    check_supported,
    double_track_motion,
    own_states,
    settled_states,
)
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.integrate import paths
from drift_drake.car.internal_states import RememberingStepModel, check_one_step, check_states
from drift_drake.car.lanes import LANES, load_lanes, multiply_add, store_lanes
from drift_drake.car.scalar import jitable, loaded_tuple, stored
from drift_drake.car.single_track.motion import path_rates
from drift_drake.car.step_model import INPUT_SCALE, STATE_SCALE, STEP
from drift_drake.common.arrays import Array, contiguous

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
        self.substeps = 2 * math.ceil(max(LEAST_SUBSTEPS, STEP * self._fastest() / ACCURATE) / 2)  # even, in pairs

    def with_effects(self, effects: Effects) -> "DoubleTrackStepModel":
        return DoubleTrackStepModel(self.parameters, effects)

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        check_states(x, self)
        path = np.empty((1, *x.shape))
        _paths(*contiguous(x, u, u_next, curvature), self.constants, self.effects, STEP, self.substeps, path)
        return path[0]

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        check_states(x, self)
        path, sensitivity = np.empty((self.substeps, *x.shape)), np.empty((len(x), SIZE, SIZE + 4))
        x, u, u_next, curvature = contiguous(x, u, u_next, curvature)
        car = (self.constants, self.effects, STEP)
        _paths(x, u, u_next, curvature, *car, 1, path)
        _sensitivities(path, u, u_next, curvature, *car, sensitivity)
        n = SIZE
        return path[-1], sensitivity[:, :, :n], sensitivity[:, :, n : n + 2], sensitivity[:, :, n + 2 :]

    def settled(self, state: Array, command: Array) -> Array:
        r, v, beta, omega_r = (float(value) for value in state)
        own = settled_states(r, v, beta, omega_r, float(command[0]), float(command[1]), self.constants, self.effects)
        return np.array(own, dtype=float)

    def run_on(self, x: Array, u: Array, u_next: Array, duration: float) -> Array:
        path, substeps = np.empty((1, 1, SIZE)), math.ceil(self.substeps * duration / STEP)
        _paths(*contiguous(x[None], u[None], u_next[None], np.zeros(1)), self.constants, self.effects, duration,
               substeps, path)  # fmt: skip
        return path[0, 0]

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
def _rates(x: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the states' rates under the commands (delta [rad], tau [N m]); where these are `lanes`, of that many cars.
    car: the path's curvature [1/m], constants, effects."""
    curvature, p, q = car
    delta, tau = command
    r, v, beta, omega_r, e, dphi = loaded_tuple(x, 0, 6, delta)
    m, d = double_track_motion(r, v, beta, omega_r, 0.0, own_states(x, 6, delta), delta, tau, p, q)
    e_dot, dphi_dot, _ = path_rates(r, v, m.beta_dot, e, dphi, curvature)
    for i, rate in enumerate((m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, e_dot, dphi_dot)):
        stored(out, i, rate)
    for i, rate in enumerate(d):
        stored(out, 6 + i, rate)


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
        _rates(z, (load_lanes(z, SIZE), load_lanes(z, SIZE + 1)), (curvature, p, q), out)
        for i in range(SIZE):
            for lane in range(LANES):
                rates[i, first + lane] = out[i * LANES + lane]
    for i in range(SIZE):
        for j in range(SIZE + 2):
            jacobian[i, j] = (rates[i, j] - rates[i, SIZE + 2]) / DIFFERENCES[j]


@compiled
def _paths(x: Array, u: Array, u_next: Array, curvature: Array, p: DoubleTrackConstants, q: Effects, dt: float,
           every: int, path: Array) -> None:  # fmt: skip
    """`integrate.paths` of this car."""
    paths(_rates, x, u, u_next, curvature, (p, q), dt, every, path)


@compiled
def _sensitivities(path: Array, u: Array, u_next: Array, curvature: Array, p: DoubleTrackConstants, q: Effects,
                   dt: float, sensitivity: Array) -> None:  # fmt: skip
    """Writes the sensitivities S [N, 19, 23] by (x, u, u_next): dS/dt = A S + B (input's share), with A, B at every
    other state of a path [2 K, N, 19] and constant from the state before it to the one behind."""
    command, jacobian, substeps = np.empty(2), np.zeros((SIZE, SIZE + 2)), len(path)
    s, further = np.zeros((SIZE + 2) * COLUMNS), np.zeros((2, (SIZE + 2) * COLUMNS))
    filled, count = np.empty((SIZE, SIZE + 2), np.int64), np.empty(SIZE, np.int64)
    for n in range(len(u)):
        s[:] = 0.0
        for i in range(SIZE + 2):
            s[i * COLUMNS + i] = 1.0
        for sub in range(substeps):
            if sub % 2 == 0:
                share = (sub + 1) / substeps
                for i in range(2):
                    command[i] = u[n, i] + share * (u_next[n, i] - u[n, i])
                _linearized(path[sub, n], command, curvature[n], p, q, jacobian)
                _find_filled(jacobian, filled, count)
            _propagate(s, further, jacobian, filled, count, dt / substeps, 1.0 / substeps)
        for i in range(SIZE):
            for j in range(SIZE + 4):
                sensitivity[n, i, j] = s[i * COLUMNS + j]


@jitable
def _find_filled(jacobian: Array, filled: NDArray[np.int64], count: NDArray[np.int64]) -> None:
    """Which entries of a row are not zero: 150 of 361 of A."""
    for i in range(SIZE):
        count[i] = 0
        for m in range(SIZE + 2):
            if jacobian[i, m] != 0.0:
                filled[i, count[i]] = m
                count[i] += 1


@jitable
def _propagate(s: Array, further: Array, jacobian: Array, filled: NDArray[np.int64], count: NDArray[np.int64], h: float,
               share: float) -> None:  # fmt: skip
    """S and the inputs' rows below it [21 rows, flat], h [s] and a share of the inputs' way later: Runge-Kutta's sum
    for constant A and B, s + h A (s + h/2 A (s + h/3 A (s + h/4 A s))). A row is of COLUMNS / LANES = 3 lanes."""
    before = s
    for order in range(4, 0, -1):
        after = further[order % 2]
        for i in range(SIZE):
            first = second = third = 0.0 * load_lanes(s, 0)
            for c in range(count[i]):
                m = filled[i, c]
                entry = jacobian[i, m]
                first = multiply_add(entry, load_lanes(before, 3 * m), first)
                second = multiply_add(entry, load_lanes(before, 3 * m + 1), second)
                third = multiply_add(entry, load_lanes(before, 3 * m + 2), third)
            store_lanes(after, 3 * i, load_lanes(s, 3 * i) + h / order * first)
            store_lanes(after, 3 * i + 1, load_lanes(s, 3 * i + 1) + h / order * second)
            store_lanes(after, 3 * i + 2, load_lanes(s, 3 * i + 2) + h / order * third)
        for j in range(2):
            row = (SIZE + j) * COLUMNS
            after[row + SIZE + j] = s[row + SIZE + j] - share / order
            after[row + SIZE + 2 + j] = s[row + SIZE + 2 + j] + share / order
        before = after
    for i in range(len(s)):
        s[i] = before[i]
