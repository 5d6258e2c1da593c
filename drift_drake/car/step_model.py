"""What the optimal control problems need of a vehicle model, and the nominal car as such a model."""

from typing import Any, Protocol

import numpy as np
from pydrake.systems.framework import LeafSystem

from drift_drake.car.compilation import compiled
from drift_drake.car.integrate import paths
from drift_drake.car.lanes import load_lanes
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.scalar import jitable, loaded_tuple, stored
from drift_drake.car.single_track.motion import linearize_point, motion, path_rates
from drift_drake.common.arrays import Array, contiguous

STEP, SUBSTEPS = 0.1, 8  # [s] of a model that is not given another, and its sub-steps
DIFFERENCE = np.array([1e-5, 1e-4, 1e-5, 1e-4, 1e-5, 1e-5])  # of the six states, for central differences
INPUT_DIFFERENCE = np.array([1e-5, 1e-3])
INTERNAL_DIFFERENCE = 1e-5  # of `internal_scale`
STATE_SCALE = np.array([1.0, 10.0, 0.5, 10.0, 1.0, 0.5])  # sizes of the six states, which programs are scaled by
INPUT_SCALE = np.array([0.3, 100.0])
CURVATURE_STEP = 1e-5  # of the scaled variables, for second derivatives


def block_scale(internal_scale: Array) -> Array:
    """Of (x_k, u_k, u_{k+1}) [n+4] of a model with these further states."""
    return np.concatenate([STATE_SCALE, internal_scale, INPUT_SCALE, INPUT_SCALE])


class CostExpansion(Protocol):
    """A cost over all stages about one trajectory."""

    def gradient(self) -> Array:
        """The total's derivative by each stage's (x, u, u_next) [N, n+4] (SI)."""

    def curvature(self) -> Array:
        """Its second derivatives within each stage, the other stages held where they are [N, n+4, n+4]."""


class StepModel(Protocol):
    """One time step x_{k+1} = f(x_k, u_k, u_{k+1}) over all stages of a horizon at once.

    Shapes: x [N, n] with n = 6 + m: the paper's six states and m further ones of the model's own (m = 0 as a rule);
    u and u_next [N, 2]; curvature [N] (of the path, the mean over the step) [1/m]. A model that inherits from this
    class has to define `step` alone.

    Examples:
        >>> class Still(StepModel):
        ...     def step(self, x, u, u_next, curvature):
        ...         return x
    """

    dt: float = STEP
    """Of a step [s]."""
    internal_scale: Array = np.empty(0)
    """Sizes [m] of the model's further states, which no cost or bound knows."""

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        """x_next [N, n]."""

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        """(x_next [N, n], d x_next/dx [N, n, n], d x_next/du [N, n, 2], d x_next/du_next [N, n, 2]).

        By central differences, unless a model knows better.
        """
        n = x.shape[1]
        sizes = np.concatenate(
            [DIFFERENCE, INTERNAL_DIFFERENCE * self.internal_scale, INPUT_DIFFERENCE, INPUT_DIFFERENCE]
        )
        ends = self.stepped(
            x, u, u_next, curvature, np.concatenate([np.diag(sizes), np.diag(-sizes), np.zeros((1, n + 4))])
        )
        jacobian = np.moveaxis((ends[: n + 4] - ends[n + 4 : -1]) / (2.0 * sizes[:, None, None]), 0, 2)
        by_x, by_u, by_u_next = np.split(jacobian, [n, n + 2], axis=2)
        return ends[-1], by_x, by_u, by_u_next

    def stepped(self, x: Array, u: Array, u_next: Array, curvature: Array, shifts: Array) -> Array:
        """The states [M, N, n] after (x, u, u_next) moved by each of the shifts [M, n+4], all at once."""
        n = x.shape[1]
        points = (np.concatenate([x, u, u_next], axis=1) + shifts[:, None]).reshape(-1, n + 4)
        ends = self.step(points[:, :n], points[:, n : n + 2], points[:, n + 2 :], np.tile(curvature, len(shifts)))
        return ends.reshape(len(shifts), -1, n)

    @property
    def headed(self) -> bool:
        """Whether its motion depends on the heading, so that `along` is to say it."""
        return False

    def along(self, heading: Array) -> "StepModel":  # noqa: ARG002 (of a model that is headed)
        """The model on a path of this heading [rad] at each stage [N]."""
        return self

    def with_theta(self, theta: Array) -> "StepModel":  # noqa: ARG002 (a model with parameters needs them)
        """The model with parameters theta [k] in place of its own, of a model that has any.

        Raises:
            TypeError: it has none.
        """
        raise TypeError(f"{type(self).__name__} has no parameters to be given")

    def weighted_gradient(self, x: Array, u: Array, u_next: Array, curvature: Array, weights: Array) -> Array:
        """The derivative of weights [N, n] times x_next by (x, u, u_next) [N, n+4], from `linearize` as a rule."""
        _, by_x, by_u, by_u_next = self.linearize(x, u, u_next, curvature)
        return (weights[:, None] @ np.concatenate([by_x, by_u, by_u_next], axis=2))[:, 0]

    def weighted_curvature(self, x: Array, u: Array, u_next: Array, curvature: Array, weights: Array) -> Array | None:  # noqa: ARG002
        """Second derivatives of weights [N, n] times x_next within each stage, by (x, u, u_next) [N, n+4, n+4].

        None where a model has no better ones than differences of `weighted_gradient`.
        """
        return None

    def curvature_with(
        self, x: Array, u: Array, u_next: Array, curvature: Array, weights: Array, cost: CostExpansion
    ) -> Array | None:
        """The sum of `weighted_curvature`, of weights [N, n], and of a cost's second derivatives [N, n+4, n+4].

        A model may know what they share. None where it has no second derivatives.
        """
        own = self.weighted_curvature(x, u, u_next, curvature, weights)
        return None if own is None else own + cost.curvature()

    def observer(self, period: float) -> LeafSystem | None:  # noqa: ARG002 (a model with further states needs it)
        """The system that follows the model's further states in closed loop, every `period` [s]; None without any.

        Its inputs are `measured_state` and `command`, one of them or both; its one output is those states.
        """
        return None


class NominalStepModel(StepModel):
    """The nominal car over one step under linearly interpolated input: Runge-Kutta 4 with sub-steps, exact Jacobians.

    The rim speed is stiff (about 170/s at 7.5 m/s), which sets the number of sub-steps: RK4 is stable for
    dt / substeps below 2.7 times the time constant, so 8 sub-steps of 12.5 ms serve speeds above 6 m/s.

    Args:
        parameters: the car; dt: of a step [s]; substeps: of each step.

    Examples:
        >>> NominalStepModel(car).step(x, u, u, np.zeros(1)).shape
        (1, 6)
    """

    def __init__(self, parameters: VehicleParameters, dt: float = STEP, substeps: int = SUBSTEPS) -> None:
        self.dt = dt
        self._substeps = substeps
        self._constants = parameters.constants()

    @classmethod
    def of(cls, constants: Constants, dt: float = STEP) -> "NominalStepModel":
        """The model of a car's constants, in steps of dt [s]."""
        model = cls.__new__(cls)
        model.dt, model._substeps, model._constants = dt, SUBSTEPS, constants
        return model

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        path = np.empty((1, *x.shape))
        _paths(*contiguous(x, u, u_next, curvature), self._constants, self.dt, self._substeps, path)
        return path[0]

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        count = x.shape[0]
        x_next, sensitivity = np.empty((count, 6)), np.empty((count, 6, 10))
        _rk4_sensitivity(*contiguous(x, u, u_next, curvature), self._constants, self.dt, self._substeps, x_next,
                         sensitivity)  # fmt: skip
        return x_next, sensitivity[:, :, :6], sensitivity[:, :, 6:8], sensitivity[:, :, 8:]


@jitable
def _rates(z: Any, command: Any, car: Any, out: Any) -> None:
    """The six states' rates of `lanes` of cars; car: of their paths (`integrate.paths`), constants, nothing."""
    curvature, p = load_lanes(car[0], 0), car[1]
    r, v, beta, omega_r, e, dphi = loaded_tuple(z, 0, 6, curvature)
    rates = motion(r, v, beta, omega_r, command[0], command[1], p)
    e_dot, dphi_dot, _ = path_rates(r, v, rates.beta_dot, e, dphi, curvature)
    for i, rate in enumerate((rates.r_dot, rates.v_dot, rates.beta_dot, rates.omega_r_dot, e_dot, dphi_dot)):
        stored(out, i, rate)


@compiled
def _paths(x: Array, u: Array, u_next: Array, curvature: Array, p: Constants, dt: float, substeps: int,
           path: Array) -> None:  # fmt: skip
    paths(_rates, x, u, u_next, curvature, (p, 0.0), dt, substeps, path)


@compiled
def _rk4_sensitivity(x: Array, u: Array, u_next: Array, curvature: Array, p: Constants, dt: float, substeps: int,
                     x_next: Array, sensitivity: Array) -> None:  # fmt: skip
    """Integrates state and sensitivity d x(t) / d(x_0, u, u_next) together, which makes its Jacobian exact."""
    h = dt / substeps
    slope, a, b = np.empty(6), np.empty((6, 6)), np.empty((6, 2))
    state, sens = np.empty(6), np.empty((6, 10))
    point, point_sens = np.empty(6), np.empty((6, 10))
    total, total_sens = np.empty(6), np.empty((6, 10))
    slope_sens = np.empty((6, 10))
    command = np.empty(2)
    nodes = (0.0, 0.5, 0.5, 1.0)
    weights = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
    for n in range(x.shape[0]):
        for i in range(6):
            state[i] = x[n, i]
            for j in range(10):
                sens[i, j] = 1.0 if i == j else 0.0
        for sub in range(substeps):
            for i in range(6):
                total[i] = 0.0
                for j in range(10):
                    total_sens[i, j] = 0.0
            for stage in range(4):
                advance = nodes[stage] * h
                for i in range(6):
                    point[i] = state[i] if stage == 0 else state[i] + advance * slope[i]
                    for j in range(10):
                        point_sens[i, j] = sens[i, j] if stage == 0 else sens[i, j] + advance * slope_sens[i, j]
                share = (sub + nodes[stage]) / substeps
                for i in range(2):
                    command[i] = (1.0 - share) * u[n, i] + share * u_next[n, i]
                linearize_point(point, command, curvature[n], p, slope, a, b)
                for i in range(6):
                    total[i] += weights[stage] * slope[i]
                    for j in range(10):
                        value = 0.0
                        for m in range(6):
                            value += a[i, m] * point_sens[m, j]
                        if 6 <= j < 8:
                            value += (1.0 - share) * b[i, j - 6]
                        elif j >= 8:
                            value += share * b[i, j - 8]
                        slope_sens[i, j] = value
                        total_sens[i, j] += weights[stage] * value
            for i in range(6):
                state[i] += h * total[i]
                for j in range(10):
                    sens[i, j] += h * total_sens[i, j]
        for i in range(6):
            x_next[n, i] = state[i]
            for j in range(10):
                sensitivity[n, i, j] = sens[i, j]
