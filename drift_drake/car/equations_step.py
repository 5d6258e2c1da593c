"""A car with states of its own as a one-step model: what an MPC believes that knows this car and its effects.

The car's own states (a kind's `own`: actuators, rim difference, wheel loads, slips) are states of the model
(`car.internal_states`). Its equations are those of `car.equations`, of any kind of car that has such states.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drift_drake.car import equations
from drift_drake.car.compilation import compiled
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import check_supported, kind_of
from drift_drake.car.integrate import paths
from drift_drake.car.internal_states import RememberingStepModel, check_one_step, check_states
from drift_drake.car.lanes import LANES, load_lanes, multiply_add, store_lanes
from drift_drake.car.on_path import of_step, step_rates_of
from drift_drake.car.parameters import CarParameters
from drift_drake.car.scalar import jitable
from drift_drake.car.step_model import INPUT_SCALE, STATE_SCALE, STEP
from drift_drake.common.arrays import Array, contiguous

DIFFERENCE = 1e-7  # of the states' sizes
COLUMNS = 3 * LANES  # of (z, u, u_next), or of moved states and inputs and then none, in lanes; z: of `on_path.of_step`
PSI = 4  # its place in z
MOST_OWN = COLUMNS - 7 - 4  # states of a car's own
LEAST_SUBSTEPS = 16
ACCURATE = 1.8  # of a sub-step times the fastest eigenvalue: RK4 is stable to 2.8 or so; a loaded tyre is stiffer
SPEEDS = (3.0, 10.0, 30.0)  # [m/s] at which, rolling straight ahead, the fastest eigenvalue is looked for
FOLLOWERS = {"steering": ("steering_lag", "steering_rate_limit"), "torque": ("torque_lag",)}
"""Own states of actuators, each with the effects without which it is the command."""


class EquationsStepModel(RememberingStepModel):
    """One step of a car of any kind with states of its own: RK4 with sub-steps under linear input.

    States [N, 6 + m]: r [rad/s], v [m/s], beta [rad], omega_r [m/s] (the mean rim speed of the rear wheels, as the
    plant's sensors measure it), e [m], dphi [rad]; then the kind's `own`. Nothing is left out or taken for settled: the
    fastest mode (of the double-track car the difference of the rear rims, ringing in the tyres at some 270 rad/s) sets
    the number of sub-steps. The Jacobians are those of the equations (forward differences of a ten-millionth of the
    states' sizes, good to a millionth), at the middle of each sub-step and constant over it: second order in the
    sub-step, not the derivative of the integrator's sum.

    A transport delay is beyond it, as are the sensors' effects. What depends on the heading (a road's grade) takes that
    of the path from `along`.

    Args:
        parameters: the car without effects; effects: magnitudes; dt: of a step [s].

    Raises:
        ValueError: such an effect, or more than `MOST_OWN` own states.
        InvalidVehicleError: an effect that this car cannot have.
    """

    def __init__(self, parameters: CarParameters, effects: Effects = Effects(), dt: float = STEP) -> None:
        check_one_step(effects)
        self.dt = dt
        self.parameters, self.constants, self.effects = parameters, parameters.constants(), effects
        self._kind = kind_of(self.constants)
        check_supported(self.constants, effects)
        self.internal_scale = np.array(self._kind.own_scale)
        if len(self.internal_scale) > MOST_OWN:
            raise ValueError(f"the car has {len(self.internal_scale)} own states; this model takes {MOST_OWN} at most")
        self._places = of_step(len(self.internal_scale))
        self._differences = np.full(len(self._places) + 3, DIFFERENCE)
        self._differences[self._places] *= np.concatenate([STATE_SCALE, self.internal_scale])
        self._differences[-2:] *= INPUT_SCALE
        self.substeps = 2 * math.ceil(max(LEAST_SUBSTEPS, dt * self._fastest() / ACCURATE) / 2)  # even, in pairs

    def with_effects(self, effects: Effects) -> "EquationsStepModel":
        return EquationsStepModel(self.parameters, effects, self.dt)

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        return self._after(x, u, u_next, curvature, self.dt, self.substeps)

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        z, n = self._of_equations(x), x.shape[1]
        path, sensitivity = np.empty((self.substeps, *z.shape)), np.empty((len(x), n, n + 4))
        given = contiguous(u, u_next, curvature)
        car = (self.constants, self.effects, self.dt)
        _paths(z, *given, *car, 1, path)
        _sensitivities(path, *given, *car, self._differences, self._places, sensitivity)
        by_x, by_u, by_u_next = np.split(sensitivity, [n, n + 2], axis=2)
        return path[-1][:, self._places], by_x, by_u, by_u_next

    def settled(self, state: Array, command: Array) -> Array:
        z = np.zeros(self._kind.size)
        z[:4] = state
        delta, tau = (float(value) for value in command)
        self._kind.settle(z, delta, tau, self.constants, self.effects)
        return z[5:]

    def run_on(self, x: Array, u: Array, u_next: Array, duration: float) -> Array:
        substeps = math.ceil(self.substeps * duration / self.dt)
        car = self.with_effects(self.unheaded()) if self.headed else self
        return car._after(x[None], u[None], u_next[None], np.zeros(1), duration, substeps)[0]

    def follows_at_once(self) -> NDArray[np.bool_]:
        q = self.effects._asdict()
        return np.array([
            name in FOLLOWERS and not any(q[effect] > 0.0 for effect in FOLLOWERS[name]) for name in self._kind.own
        ])  # fmt: skip

    def _of_equations(self, x: Array) -> Array:
        """Their states z with e and dphi behind them [N, n + 1]."""
        check_states(x, self)
        z = np.empty((len(x), x.shape[1] + 1))
        z[:, self._places] = x
        z[:, PSI] = np.resize(self.heading, len(x)) + x[:, 5] - x[:, 2]
        return z

    def _after(self, x: Array, u: Array, u_next: Array, curvature: Array, duration: float, substeps: int) -> Array:
        """The states [N, n] a duration [s] later."""
        z = self._of_equations(x)
        path = np.empty((1, *z.shape))
        _paths(z, *contiguous(u, u_next, curvature), self.constants, self.effects, duration, substeps, path)
        return path[0][:, self._places]

    def _fastest(self) -> float:
        """Largest modulus [rad/s] of the equations' eigenvalues, rolling straight ahead at `SPEEDS`."""
        size = len(self._places) + 1
        found, jacobian = 0.0, np.zeros((size, size + 2))
        for speed in SPEEDS:
            moving = np.array([0.0, speed, 0.0, speed])
            x = np.concatenate([moving, np.zeros(2), self.settled(moving, np.zeros(2))])[None]
            _linearized(self._of_equations(x)[0], np.zeros(2), 0.0, self.constants, self.effects, self._differences,
                        jacobian)  # fmt: skip
            found = max(found, float(np.abs(np.linalg.eigvals(jacobian[:, :size])).max()))
        return found


@jitable
def _rates(z: Any, command: Any, car: Any, out: Any) -> None:
    """`on_path.step_rates_of` on `lanes`, of the kind of the car."""
    step_rates_of(equations.rates, z, command, (load_lanes(car[0], 0), car[1], car[2]), out)


@compiled
def _linearized(state: Array, command: Array, curvature: float, p: Any, q: Effects, differences: Array,
                jacobian: Array) -> None:  # fmt: skip
    """Writes the derivatives of the rates by (z, delta, tau), as forward differences: a lane each."""
    size = len(state)
    z, out, rates = np.empty((size + 2) * LANES), np.empty(size * LANES), np.empty((size, COLUMNS))
    for first in range(0, COLUMNS, LANES):
        for i in range(size + 2):
            value = state[i] if i < size else command[i - size]
            for lane in range(LANES):
                z[i * LANES + lane] = value + (differences[i] if i == first + lane else 0.0)
        step_rates_of(equations.rates, z[: size * LANES], (load_lanes(z, size), load_lanes(z, size + 1)),
                      (curvature, p, q), out)  # fmt: skip
        for i in range(size):
            for lane in range(LANES):
                rates[i, first + lane] = out[i * LANES + lane]
    for i in range(size):
        for j in range(size + 2):
            jacobian[i, j] = (rates[i, j] - rates[i, size + 2]) / differences[j]


@compiled
def _paths(z: Array, u: Array, u_next: Array, curvature: Array, p: Any, q: Effects, dt: float, every: int,
           path: Array) -> None:  # fmt: skip
    """`integrate.paths` of this car."""
    paths(_rates, z, u, u_next, curvature, (p, q), dt, every, path)


@compiled
def _sensitivities(path: Array, u: Array, u_next: Array, curvature: Array, p: Any, q: Effects, dt: float,
                   differences: Array, places: NDArray[np.int64], sensitivity: Array) -> None:  # fmt: skip
    """Writes the sensitivities S [N, n, n + 4] by (x, u, u_next): dS/dt = A S + B (input's share), with A, B at every
    other state of a path [2 K, N, n + 1] and constant from the state before it to the one behind; places [n]: of x in
    the path's states."""
    size = path.shape[2]
    command, jacobian, substeps = np.empty(2), np.zeros((size, size + 2)), len(path)
    s, further = np.zeros((size + 2) * COLUMNS), np.zeros((2, (size + 2) * COLUMNS))
    filled, count = np.empty((size, size + 2), np.int64), np.empty(size, np.int64)
    for n in range(len(u)):
        s[:] = 0.0
        for i in range(size + 2):
            s[i * COLUMNS + i] = 1.0
        for sub in range(substeps):
            if sub % 2 == 0:
                share = (sub + 1) / substeps
                for i in range(2):
                    command[i] = u[n, i] + share * (u_next[n, i] - u[n, i])
                _linearized(path[sub, n], command, curvature[n], p, q, differences, jacobian)
                _find_filled(jacobian, filled, count)
            _propagate(s, further, jacobian, filled, count, dt / substeps, 1.0 / substeps)
        for i in range(len(places)):
            for j in range(len(places)):
                sensitivity[n, i, j] = s[places[i] * COLUMNS + places[j]]
            for j in range(4):
                sensitivity[n, i, len(places) + j] = s[places[i] * COLUMNS + size + j]
            by_psi = s[places[i] * COLUMNS + PSI]  # that of the path, and dphi - beta
            sensitivity[n, i, 5] += by_psi
            sensitivity[n, i, 2] -= by_psi


@jitable
def _find_filled(jacobian: Array, filled: NDArray[np.int64], count: NDArray[np.int64]) -> None:
    """Which entries of a row are not zero: of the double-track car 151 of 400 of A."""
    for i in range(len(count)):
        count[i] = 0
        for m in range(jacobian.shape[1]):
            if jacobian[i, m] != 0.0:
                filled[i, count[i]] = m
                count[i] += 1


@jitable
def _propagate(s: Array, further: Array, jacobian: Array, filled: NDArray[np.int64], count: NDArray[np.int64], h: float,
               share: float) -> None:  # fmt: skip
    """S and the inputs' rows below it [n + 2 rows, flat], h [s] and a share of the inputs' way later: Runge-Kutta's sum
    for constant A and B, s + h A (s + h/2 A (s + h/3 A (s + h/4 A s))). A row is of COLUMNS / LANES = 3 lanes."""
    before, size = s, len(count)
    for order in range(4, 0, -1):
        after = further[order % 2]
        for i in range(size):
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
            row = (size + j) * COLUMNS
            after[row + size + j] = s[row + size + j] - share / order
            after[row + size + 2 + j] = s[row + size + 2 + j] + share / order
        before = after
    for i in range(len(s)):
        s[i] = before[i]
