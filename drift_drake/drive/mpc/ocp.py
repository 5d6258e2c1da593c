"""The paper's optimal control problem (OCP) as stages, and as a Drake MathematicalProgram, for any one-step model.

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
from pydrake.solvers import MathematicalProgram

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import INPUT_SCALE, STATE_SCALE, StepModel
from drift_drake.common.arrays import Array
from drift_drake.drive.qp.stacked import StackedCost, StackedDynamics, StageCost, StageLayout
from drift_drake.drive.qp.stages import StageBounds, StageRows, Stages, dynamics_pattern
from drift_drake.drive.reference.similarity import Similarity
from drift_drake.drive.reference.trajectory import Reference


@dataclasses.dataclass(frozen=True)
class OcpWeights:
    """Diagonals of Q (per state) and R (per input), and the lane's penalty, of a car of the default one's size.

    Examples:
        >>> mpc = Mpc(NominalStepModel(car), car, reference, weights=OcpWeights(e=10.0))
    """

    r: float = 1.0  # [1/(rad/s)^2]
    v: float = 0.1  # [1/(m/s)^2]
    beta: float = 20.0  # [1/rad^2]
    omega_r: float = 0.02  # [1/(m/s)^2]
    e: float = 4.0  # [1/m^2]
    dphi: float = 4.0  # [1/rad^2]
    # Smooth steering: cars whose front tyre slides were lost with a third of it (chosen on the training population).
    delta: float = 60.0  # [1/rad^2] of a change of steering over one step
    tau: float = 5e-5  # [1/(N m)^2] of a change of torque over one step
    lane_penalty: float = 100.0  # [1/m]

    def of_size(self, units: Similarity) -> "OcpWeights":
        """The weights that plan for a car of other units (`Similarity`) as these plan for the default one."""
        per_rate, per_speed, per_length = units.time, 1.0 / units.speed, 1.0 / units.length
        return OcpWeights(
            self.r * per_rate**2, self.v * per_speed**2, self.beta, self.omega_r * per_speed**2,
            self.e * per_length**2, self.dphi, self.delta, self.tau / units.torque**2, self.lane_penalty * per_length,
        )  # fmt: skip

    def state(self) -> Array:
        """Diagonal of Q [6]."""
        return np.array([self.r, self.v, self.beta, self.omega_r, self.e, self.dphi])

    def input(self) -> Array:
        """Diagonal of R [2]."""
        return np.array([self.delta, self.tau])


class OcpData(NamedTuple):
    """What changes from one problem to the next.

    Examples:
        >>> h = reference.horizon(0.0, dt=0.1, count=25)
        >>> data = OcpData(h.x_ref[0], h.u_ref[0], h.x_ref, h.curvature, h.e_min, h.e_max)
    """

    x_init: Array  # [n], n = 6 but for models with states of their own
    u_init: Array  # [2], the command in force
    x_ref: Array  # [N+1, 6] (the last row does not enter the cost)
    curvature: Array  # [N] of the path [1/m]
    e_min: Array  # [N+1] [m] (the first entry is not used)
    e_max: Array  # [N+1] [m]
    u_ref: Array | None = None  # [N+1, 2] that goes with x_ref, for the first guess alone


class OcpSolution(NamedTuple):
    """A trajectory over the horizon."""

    x: Array  # [N+1, n]
    u: Array  # [N+1, 2]
    slack: Array  # [N], how far each stage leaves the lane [m]


class OptimalControlProblem(MathematicalProgram):
    """The OCP (section III of the paper), built once for a horizon; `set` changes its data.

    Its `stages` are what our own solver takes. The MathematicalProgram, which Drake's solvers take, is made from them:
    each cost and constraint says in its description what it is.

    Attributes:
        x, u, slack: its variables [N+1, n], [N+1, 2], [N]; states and inputs are scaled.
        stages: costs and bounds, all but the dynamics.
        dynamics: the stacked dynamics constraint, which the line-search SQP reads with the stages.
        extra_cost: a cost in addition to l_k that is not quadratic (Info-OCP's), if any.

    Args:
        model: one step of the car; parameters: for the limits of the inputs; horizon: N, steps of the model.
        weights: of the cost; extra_cost: see above; extra_description: what the program says of it.

    Examples:
        >>> OptimalControlProblem(NominalStepModel(car), car, horizon=10).num_vars()
        98
    """

    def __init__(
        self,
        model: StepModel,
        parameters: VehicleParameters,
        horizon: int,
        weights: OcpWeights | None = None,
        extra_cost: StageCost | None = None,
        extra_description: str = "extra cost",
    ) -> None:
        MathematicalProgram.__init__(self)
        self.horizon = horizon
        self.weights = weights or OcpWeights()
        self.parameters = parameters
        self.layout = StageLayout(model.internal_scale, horizon)
        self.dynamics = StackedDynamics(model, self.layout)
        self.extra_cost = StackedCost(extra_cost, self.layout) if extra_cost else None
        # Flat, stage after stage: Drake orders the variables of a matrix by column, but the dynamics read rows.
        n = self.layout.state_size
        self.x = self.NewContinuousVariables(n * (horizon + 1), "x").reshape(-1, n)
        self.u = self.NewContinuousVariables(2 * (horizon + 1), "u").reshape(-1, 2)
        self.slack = self.NewContinuousVariables(horizon, "slack")
        self._z = np.concatenate([self.x.ravel(), self.u.ravel(), self.slack])
        self._rows: list[StageRows] = []
        self.stages = Stages(
            self.layout.block_columns, self.layout.bound_columns, np.tile(self.stage_hessian(), (horizon, 1, 1)),
            np.zeros(self.size), 0.0, np.zeros(n + 2), StageBounds.of(self._kinds(), horizon),
        )  # fmt: skip
        self._linear_cost, self._given = self._make_program(extra_description)
        self._lane, *_ = [self._add(rows) for rows in self._kinds()]
        self._known = {binding.evaluator().get_description() for binding in self._bindings()}

    def _bindings(self) -> list[Any]:
        return [*self.GetAllCosts(), *self.GetAllConstraints()]

    def check_stages(self) -> None:
        """Sees that nothing was added to the program alone.

        Raises:
            ValueError: a cost or constraint that its stages lack; the message names it.
        """
        for binding in self._bindings():
            if (what := binding.evaluator().get_description()) not in self._known:
                raise ValueError(
                    f"'{what or binding}' was added to the program alone, which Drake's solvers take; add rows of a "
                    "stage by `bound`, a cost as `extra_cost`, for them to reach `LineSearchSqp`"
                )

    def _kinds(self) -> list[StageRows]:
        """All rows but those of the dynamics; a stage's begin with the lane's two and end with its slack's own."""
        n, count = self.layout.state_size, self.horizon
        eye, stage = np.eye(n + 3), np.arange(1, count + 1)
        lane = np.repeat([eye[4] + eye[-1], eye[4] - eye[-1]], count, axis=0)  # from e_min, up to e_max
        free = np.full(2 * count, np.inf)
        low, high = (np.tile(limit / INPUT_SCALE, count) for limit in self.parameters.command_limits())
        return [
            StageRows("lane, softened", np.tile(stage, 2), lane, -free, free),
            *self._rows,
            StageRows("limits of steering and torque", stage.repeat(2), np.tile(eye[n:-1], (count, 1)), low, high),
            StageRows("no negative slack", stage, np.tile(eye[-1], (count, 1)), np.zeros(count), free[:count]),
        ]

    def bound(self, rows: StageRows) -> None:
        """Adds rows, in scaled variables, before `set` is called; what is added otherwise only Drake's solvers see."""
        self._rows.append(rows)
        self._known.add(rows.what)
        self.stages = self.stages._replace(bounds=StageBounds.of(self._kinds(), self.horizon))
        self._add(rows)

    def _add(self, rows: StageRows) -> Any:
        """The binding of a kind of rows in the program, which says what they are."""
        whole = np.zeros((rows.stage.size, self.size))
        np.put_along_axis(whole, self.layout.bound_columns[rows.stage - 1], rows.values, axis=1)
        row, column = np.nonzero(whole)
        if np.array_equal(row, np.arange(rows.stage.size)) and (whole[row, column] == 1.0).all():
            return described(rows.what, self.AddBoundingBoxConstraint(rows.low, rows.high, self._z[column]))
        used = np.unique(column)
        return described(rows.what, self.AddLinearConstraint(whole[:, used], rows.low, rows.high, self._z[used]))

    def _make_program(self, extra_description: str) -> tuple[Any, tuple[Any, Any]]:
        """Costs, what is given, and the dynamics; the bindings whose numbers `set` changes."""
        hessian, zero = np.zeros((self.size, self.size)), np.zeros(self.size)
        for columns, block in zip(self.stages.columns, self.stages.hessian, strict=True):
            hessian[np.ix_(columns, columns)] += block
        described(
            "state errors and changes of input, squared",
            self.AddQuadraticCost(hessian, zero, 0.0, self._z, is_convex=True),
        )
        linear = described(
            "state errors, the part linear in the reference, and the lane's penalty",
            self.AddLinearCost(zero, 0.0, self._z),
        )
        given = tuple(
            described(what, self.AddBoundingBoxConstraint(np.zeros(first.size), np.zeros(first.size), first))
            for what, first in (("initial state", self.x[0]), ("command in force", self.u[0]))
        )
        zeros, trajectory = np.zeros(self.dynamics.size), self._z[: -self.horizon or None]
        self.dynamics_binding = self.AddConstraint(
            self.dynamics, lb=zeros, ub=zeros, vars=trajectory, description="dynamics"
        )
        self.dynamics_binding.evaluator().SetGradientSparsityPattern(
            [(int(i), int(j)) for i, j in zip(*dynamics_pattern(self.stages.columns), strict=True)]
        )
        if self.extra_cost:
            self.AddCost(self.extra_cost, vars=trajectory, description=extra_description)
        return linear, given

    @property
    def size(self) -> int:
        """Number of decision variables."""
        return int(self._z.size)

    def stage_hessian(self) -> Array:
        """Second derivatives of l_k by the scaled (x_k, u_k, u_{k+1}) [n+4, n+4]; their sum is the cost's."""
        n = self.layout.state_size
        block = np.zeros((n + 4, n + 4))
        block[range(6), range(6)] = 2.0 * self.weights.state() * STATE_SCALE**2
        block[n:, n:] = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.diag(2.0 * self.weights.input() * INPUT_SCALE**2))
        return block

    def set(self, data: OcpData) -> None:
        """Puts the data of one problem into the stages, and from there into the program.

        Raises: as `set_stages`.
        """
        self.set_stages(data)
        self._linear_cost.evaluator().UpdateCoefficients(self.stages.gradient, self.stages.constant)
        given, free = self.stages.given, np.full(self.horizon, np.inf)
        for binding, value in zip(self._given, (given[:-2], given[-2:]), strict=True):
            binding.evaluator().set_bounds(value, value)
        self._lane.evaluator().set_bounds(
            np.concatenate([data.e_min[1:], -free]), np.concatenate([free, data.e_max[1:]])
        )

    def set_stages(self, data: OcpData) -> None:
        """Puts the data into the stages alone, which are all that `LineSearchSqp` reads; the program keeps what it had.

        Raises:
            ValueError: data that is not finite or of the wrong length; the message names it.
        """
        n = self.horizon
        shapes = {
            "x_init": (self.layout.state_size,),
            "u_init": (2,),
            "x_ref": (n + 1, 6),
            "curvature": (n,),
            "e_min": (n + 1,),
            "e_max": (n + 1,),
        }
        for name, shape in shapes.items():
            value = np.asarray(getattr(data, name))
            if np.shape(value) != shape:
                raise ValueError(f"{name} has shape {np.shape(value)}; a horizon of {n} steps needs {shape}")
            if not np.isfinite(value.sum()) and np.isnan(value).any():
                raise ValueError(f"{name} holds NaN at index {tuple(int(i) for i in np.argwhere(np.isnan(value))[0])}")
        q, reference, gradient = self.weights.state(), data.x_ref[:-1], np.zeros(self.size)
        states, _, slack = self.stages.split(gradient)
        states[:-1, :6] = -2.0 * q * STATE_SCALE * reference
        slack[:] = self.weights.lane_penalty
        given = self.given(data)
        bounds, lane = self.stages.bounds, self.stages.bounds.first[:-1]
        low, high = bounds.low.copy(), bounds.high.copy()
        low[lane], high[lane + 1] = data.e_min[1:], data.e_max[1:]
        self.stages = self.stages._replace(
            gradient=gradient, constant=float(np.sum(q * reference * reference)), given=given,
            bounds=bounds._replace(low=low, high=high),
        )  # fmt: skip
        self.dynamics.curvature = np.ascontiguousarray(data.curvature, dtype=float)

    def given(self, data: OcpData) -> Array:
        """(x_0, u_0) [n+2] in scaled variables."""
        return np.concatenate([data.x_init / self.layout.state_scale, data.u_init / INPUT_SCALE])

    def stack(self, x: Array, u: Array, slack: Array | None = None) -> Array:
        """The decision vector of a trajectory x [N+1, n], u [N+1, 2] (SI)."""
        slack = np.zeros(self.horizon) if slack is None else slack
        return np.concatenate([np.ravel(x / self.layout.state_scale), np.ravel(u / INPUT_SCALE), slack])

    def unstack(self, z: Array) -> OcpSolution:
        """The trajectory x [N+1, n], u [N+1, 2], slack [N] (SI) of a decision vector z [size]."""
        return OcpSolution(*self.layout.split(z), z[-self.horizon :].copy())

    def first_guess(self, data: OcpData) -> Array:
        """A decision vector [size] to start from: the reference with what is off at the start fading out.

        Inputs are held where the reference has none.
        """
        fade = np.linspace(1.0, 0.0, self.horizon + 1)[:, None]
        x = np.tile(data.x_init, (self.horizon + 1, 1))
        x[:, :6] = data.x_ref + fade * (data.x_init[:6] - data.x_ref[0])
        u = np.tile(data.u_init, (self.horizon + 1, 1))
        if data.u_ref is not None:
            u = data.u_ref + fade * (data.u_init - data.u_ref[0])
        return self.stack(x, u)


def described(what: str, binding: Any) -> Any:
    """The binding of a cost or constraint, which now says what it is."""
    binding.evaluator().set_description(what)
    return binding


def ocp(
    model: StepModel,
    parameters: VehicleParameters,
    reference: Reference,
    s: float = 0.0,
    x: Array | None = None,
    command: Array | None = None,
    horizon: int = 25,
    weights: OcpWeights | None = None,
) -> OptimalControlProblem:
    """The OCP (section III of the paper) along a reference, with data and a first guess, for `pydrake.solvers.Solve`.

    Examples:
        >>> problem = ocp(NominalStepModel(car), car, reference, s=20.0)
        >>> x, u, slack = problem.unstack(Solve(problem).GetSolution(problem.decision_variables()))

    Args:
        model: one step of the car; parameters: for the limits of the inputs; reference: what to drive.
        s: path position at the start [m]; x: state there [n], the reference's without.
        command: in force at the start (delta [rad], tau [N m]), the reference's without.
        horizon: N, steps of the model; weights: of the cost.
    """
    along = reference.horizon(s, model.dt, horizon)
    problem = OptimalControlProblem(model.along(along.heading), parameters, horizon, weights)
    start = np.append(reference.state(s), np.zeros(model.internal_scale.size)) if x is None else np.asarray(x, float)
    in_force = np.asarray(reference.input(s) if command is None else command, dtype=float)
    data = OcpData(start, in_force, along.x_ref, along.curvature, along.e_min, along.e_max, along.u_ref)
    problem.set(data)
    problem.SetInitialGuessForAllVariables(problem.first_guess(data))
    return problem
