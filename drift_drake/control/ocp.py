"""The paper's optimal control problem (OCP) as a Drake MathematicalProgram, for any one-step vehicle model.

    min   sum_{k<N} |x_k - x_ref,k|^2_Q + |u_k - u_{k+1}|^2_R  +  penalty sum_k slack_k
    s.t.  x_{k+1} = f(x_k, u_k, u_{k+1}),  x_0 = x_init,  u_0 = the command in force,
          u_min <= u_k <= u_max,  e_min,k - slack_k <= e_k <= e_max,k + slack_k,  slack_k >= 0,   k = 1..N.

The lane is softened by an exact (l1) penalty: as long as the penalty exceeds the multiplier of the hard constraint, the
solution is that of the hard problem wherever the hard problem is feasible, and the smallest total violation where it is
not (Nocedal and Wright, section 17.2). So a start outside the lane is a problem with a solution.

The program holds states and inputs divided by `STATE_SCALE` and `INPUT_SCALE`: all solvers, OSQP and IPOPT most,
need numbers of order one. `stack` and `unstack` convert.
"""

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import MathematicalProgram

from drift_drake.control.step_model import StepModel
from drift_drake.vehicle.parameters import VehicleParameters

Array = NDArray[np.float64]

STATE_SCALE = np.array([1.0, 10.0, 0.5, 10.0, 1.0, 0.5])
INPUT_SCALE = np.array([0.3, 100.0])
CURVATURE_STEP = 1e-5  # of the scaled variables, for second derivatives


@dataclasses.dataclass(frozen=True)
class OcpWeights:
    """Diagonals of Q (per state) and R (per input), and the lane's penalty."""

    r: float = 1.0  # [1/(rad/s)^2]
    v: float = 0.1  # [1/(m/s)^2]
    beta: float = 20.0  # [1/rad^2]
    omega_r: float = 0.02  # [1/(m/s)^2]
    e: float = 4.0  # [1/m^2]
    dphi: float = 4.0  # [1/rad^2]
    delta: float = 20.0  # [1/rad^2] of a change of steering over one step
    tau: float = 5e-5  # [1/(N m)^2] of a change of torque over one step
    lane_penalty: float = 100.0  # [1/m]

    def state(self) -> Array:
        """Diagonal of Q [6]."""
        return np.array([self.r, self.v, self.beta, self.omega_r, self.e, self.dphi])

    def input(self) -> Array:
        """Diagonal of R [2]."""
        return np.array([self.delta, self.tau])


class OcpData(NamedTuple):
    """What changes from one problem to the next."""

    x_init: Array  # [n], n = 6 but for models with states of their own
    u_init: Array  # [2], the command in force
    x_ref: Array  # [N+1, 6] (the last row does not enter the cost)
    curvature: Array  # [N] of the path [1/m]
    e_min: Array  # [N+1] [m] (the first entry is not used)
    e_max: Array  # [N+1] [m]


class OcpSolution(NamedTuple):
    """A trajectory over the horizon."""

    x: Array  # [N+1, n]
    u: Array  # [N+1, 2]
    slack: Array  # [N], how far each stage leaves the lane [m]


class StackedDynamics:
    """All dynamics constraints as one, f(x_k, u_k, u_{k+1}) - x_{k+1} = 0, residuals and variables scaled.

    Called by Drake's solvers with the variables (x_0..x_N, u_0..u_N) as float or AutoDiffXd; the SQP calls `linearize`.
    """

    def __init__(self, model: StepModel, horizon: int) -> None:
        self.model = model
        self.horizon = horizon
        self.curvature = np.zeros(horizon)
        self.state_scale = np.concatenate([STATE_SCALE, model.memory_scale])
        self.state_size = n = self.state_scale.size
        inputs_at = n * (horizon + 1)
        stage, row, column = np.meshgrid(np.arange(horizon), np.arange(n), np.arange(n + 4), indexing="ij")
        x_column, u_column = n * stage + column, inputs_at + 2 * stage + column - n
        self._rows = np.concatenate([(n * stage + row).ravel(), np.arange(n * horizon)])
        self._columns = np.concatenate([np.where(column < n, x_column, u_column).ravel(), n + np.arange(n * horizon)])
        self._block_scale = np.concatenate([self.state_scale, INPUT_SCALE, INPUT_SCALE]) / self.state_scale[:, None]

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.state_size * self.horizon

    def sparsity(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """(row, column) of each entry of `linearize`'s Jacobian, within this constraint's own variables."""
        return self._rows, self._columns

    def value(self, z: Array) -> Array:
        """The residuals [n N]."""
        x, u = self.split(z)
        residual: Array = (self.model.step(x[:-1], u[:-1], u[1:], self.curvature) - x[1:]) / self.state_scale
        return residual.ravel()

    def linearize(self, z: Array) -> tuple[Array, Array]:
        """(residuals [n N], the Jacobian's entries in the order of `sparsity`)."""
        x, u = self.split(z)
        x_next, a, b, b_next = self.model.linearize(x[:-1], u[:-1], u[1:], self.curvature)
        block = np.concatenate([a, b, b_next], axis=2) * self._block_scale
        return ((x_next - x[1:]) / self.state_scale).ravel(), np.concatenate([block.ravel(), np.full(self.size, -1.0)])

    def curvature_blocks(self, z: Array, multipliers: Array) -> Array:
        """Second derivatives of multipliers' residuals by each stage's (x_k, u_k, u_{k+1}) [N, n+4, n+4].

        Central differences of the models' exact Jacobians, all stages and directions in one batch.
        """
        n, count = self.state_size, self.state_size + 4
        x, u = self.split(z)
        point = np.concatenate([x[:-1], u[:-1], u[1:]], axis=1)
        scale = np.concatenate([self.state_scale, INPUT_SCALE, INPUT_SCALE])
        shifts = np.concatenate([np.eye(count), -np.eye(count)]) * CURVATURE_STEP * scale
        points = (point[None] + shifts[:, None]).reshape(-1, count)
        curvature = np.tile(self.curvature, 2 * count)
        _, a, b, b_next = self.model.linearize(points[:, :n], points[:, n : n + 2], points[:, n + 2 :], curvature)
        jacobian = (np.concatenate([a, b, b_next], axis=2) * self._block_scale).reshape(2 * count, -1, n, count)
        gradient = np.einsum("ki,jkil->jkl", multipliers.reshape(-1, n), jacobian)
        blocks = np.moveaxis((gradient[:count] - gradient[count:]) / (2.0 * CURVATURE_STEP), 0, 1)
        symmetric: Array = 0.5 * (blocks + np.swapaxes(blocks, 1, 2))
        return symmetric

    def block_columns(self) -> NDArray[np.intp]:
        """Where the variables of each stage's block lie in the decision vector [N, n+4]."""
        n, stage = self.state_size, np.arange(self.horizon)[:, None]
        inputs = n * (self.horizon + 1) + 2 * stage + np.arange(4)
        return np.concatenate([n * stage + np.arange(n), inputs], axis=1)

    def split(self, z: Array) -> tuple[Array, Array]:
        """(x [N+1, n], u [N+1, 2]) in SI units of the stacked variables."""
        states = self.state_size * (self.horizon + 1)
        inputs = z[states : states + 2 * (self.horizon + 1)]
        return z[:states].reshape(-1, self.state_size) * self.state_scale, inputs.reshape(-1, 2) * INPUT_SCALE

    def __call__(self, z: NDArray[Any]) -> NDArray[Any]:
        if z.dtype != object:
            return self.value(z)
        value, entries = self.linearize(ExtractValue(z).ravel())
        jacobian = np.zeros((self.size, z.size))
        jacobian[self._rows, self._columns] = entries
        gradient = ExtractGradient(z)
        if gradient.size == 0:
            return np.array([AutoDiffXd(v) for v in value])
        return InitializeAutoDiff(value[:, None], jacobian @ gradient).ravel()


class OptimalControlProblem:
    """The OCP, built once for a horizon; `set` then changes its data in place.

    Attributes:
        program: the MathematicalProgram that Drake's solvers take (scaled variables).
        dynamics: the stacked dynamics constraint, which the line-search SQP reads beside the program.
    """

    def __init__(
        self,
        model: StepModel,
        parameters: VehicleParameters,
        horizon: int,
        weights: OcpWeights | None = None,
    ) -> None:
        self.horizon = horizon
        self.weights = weights or OcpWeights()
        self.parameters = parameters
        self.dynamics = StackedDynamics(model, horizon)
        self.program = program = MathematicalProgram()
        # Flat, stage after stage: Drake orders the variables of a matrix by column, but the dynamics read rows.
        n = self.dynamics.state_size
        x = program.NewContinuousVariables(n * (horizon + 1), "x").reshape(-1, n)
        u = program.NewContinuousVariables(2 * (horizon + 1), "u").reshape(-1, 2)
        slack = program.NewContinuousVariables(horizon, "slack")
        self._z = np.concatenate([x.ravel(), u.ravel(), slack])
        program.AddQuadraticCost(self._hessian(), np.zeros(self._z.size), 0.0, self._z, is_convex=True)
        self._linear_cost = program.AddLinearCost(np.zeros(self._z.size), 0.0, self._z)
        self._x_init = program.AddBoundingBoxConstraint(np.zeros(n), np.zeros(n), x[0])
        self._u_init = program.AddBoundingBoxConstraint(np.zeros(2), np.zeros(2), u[0])
        low = np.array([-parameters.steering_limit, parameters.torque_min]) / INPUT_SCALE
        high = np.array([parameters.steering_limit, parameters.torque_max]) / INPUT_SCALE
        program.AddBoundingBoxConstraint(np.tile(low, horizon), np.tile(high, horizon), u[1:].ravel())
        program.AddBoundingBoxConstraint(np.zeros(horizon), np.full(horizon, np.inf), slack)
        eye = np.eye(horizon)
        lane = np.block([[eye, eye], [eye, -eye]])  # e + slack >= e_min, e - slack <= e_max
        unbounded = np.full(2 * horizon, np.inf)
        self._lane = program.AddLinearConstraint(lane, -unbounded, unbounded, np.concatenate([x[1:, 4], slack]))
        zeros = np.zeros(self.dynamics.size)
        self.dynamics_binding = program.AddConstraint(
            self.dynamics, lb=zeros, ub=zeros, vars=self._z[: -horizon or None], description="dynamics"
        )
        self.dynamics_binding.evaluator().SetGradientSparsityPattern(
            [(int(i), int(j)) for i, j in zip(*self.dynamics.sparsity(), strict=True)]
        )

    def _hessian(self) -> Array:
        """Second derivatives of the cost: the stages' blocks, summed."""
        hessian = np.zeros((self._z.size, self._z.size))
        for columns in self.dynamics.block_columns():
            hessian[np.ix_(columns, columns)] += self.stage_hessian()
        return hessian

    @property
    def size(self) -> int:
        """Number of decision variables."""
        return int(self._z.size)

    def stage_hessian(self) -> Array:
        """Second derivatives of l_k by the scaled (x_k, u_k, u_{k+1}) [n+4, n+4]; their sum is the cost's."""
        n = self.dynamics.state_size
        block = np.zeros((n + 4, n + 4))
        block[range(6), range(6)] = 2.0 * self.weights.state() * STATE_SCALE**2
        block[n:, n:] = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.diag(2.0 * self.weights.input() * INPUT_SCALE**2))
        return block

    def set(self, data: OcpData) -> None:
        """Puts the data of one problem into the program.

        Raises:
            ValueError: data that is not finite or of the wrong length; the message names it.
        """
        n = self.horizon
        shapes = {
            "x_init": (self.dynamics.state_size,),
            "u_init": (2,),
            "x_ref": (n + 1, 6),
            "curvature": (n,),
            "e_min": (n + 1,),
            "e_max": (n + 1,),
        }
        for name, shape in shapes.items():
            value = getattr(data, name)
            if np.shape(value) != shape:
                raise ValueError(f"{name} has shape {np.shape(value)}; a horizon of {n} steps needs {shape}")
            if np.isnan(value).any():
                raise ValueError(f"{name} holds NaN at index {tuple(int(i) for i in np.argwhere(np.isnan(value))[0])}")
        q = self.weights.state()
        reference = data.x_ref[:-1]
        linear = np.zeros(self._z.size)
        states = linear[: self.dynamics.state_size * n].reshape(n, -1)
        states[:, :6] = -2.0 * q * STATE_SCALE * reference
        linear[-n:] = self.weights.lane_penalty
        self._linear_cost.evaluator().UpdateCoefficients(linear, float(np.sum(q * reference * reference)))
        x_init, u_init = data.x_init / self.dynamics.state_scale, data.u_init / INPUT_SCALE
        self._x_init.evaluator().set_bounds(x_init, x_init)
        self._u_init.evaluator().set_bounds(u_init, u_init)
        unbounded = np.full(n, np.inf)
        self._lane.evaluator().set_bounds(
            np.concatenate([data.e_min[1:], -unbounded]), np.concatenate([unbounded, data.e_max[1:]])
        )
        self.dynamics.curvature = np.ascontiguousarray(data.curvature, dtype=float)

    def stack(self, x: Array, u: Array, slack: Array | None = None) -> Array:
        """The decision vector of a trajectory x [N+1, n], u [N+1, 2] (SI)."""
        slack = np.zeros(self.horizon) if slack is None else slack
        return np.concatenate([np.ravel(x / self.dynamics.state_scale), np.ravel(u / INPUT_SCALE), slack])

    def unstack(self, z: Array) -> OcpSolution:
        """The trajectory (SI) of a decision vector."""
        return OcpSolution(*self.dynamics.split(z), z[-self.horizon :].copy())

    def initial_guess(self, data: OcpData) -> Array:
        """A decision vector to start from: the reference with the initial state's errors fading out, inputs held."""
        fade = np.linspace(1.0, 0.0, self.horizon + 1)[:, None]
        x = np.tile(data.x_init, (self.horizon + 1, 1))
        x[:, :6] = data.x_ref + fade * (data.x_init[:6] - data.x_ref[0])
        return self.stack(x, np.tile(data.u_init, (self.horizon + 1, 1)))
