"""Line-search SQP (Nocedal and Wright, chapter 18) on the OCP's stages, its QPs solved by `drive.qp`.

Two Hessians. In real time Gauss-Newton: that of the quadratic cost alone. To convergence, by default, that of the
Lagrangian, each stage's block projected to the nearest positive semidefinite one. Either way every QP is convex. Steps
are globalised by backtracking on the l1 merit function cost + mu |violation|_1, with mu from equation (18.36) and, in
real time, no less than the largest multiplier of the QP: only then is the merit function exact, its minimum that of the
program (theorem 17.3). Over many iterations mu grows to that by itself; a real-time solve has few, and begins anew.
"""

import dataclasses
import time
from typing import NamedTuple

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.drive.mpc.ocp import OptimalControlProblem
from drift_drake.drive.qp.products import Iterate, along, blocks_times, cost_times, iterate, largest, violations
from drift_drake.drive.qp.qp import QpMethod, QpOptions, QpSolution, QpWorkspace

SUFFICIENT_DECREASE, HALF, LEAST_STEP = 1e-4, 0.5, 1e-4  # of the line search
CONVERGING = 10  # iterations from a plan that was nearly right, after which little is left to gain


@dataclasses.dataclass(frozen=True)
class SqpOptions:
    """Settings; residuals are in the program's scaled variables (1e-6 is 1 um in e, 10 um/s in v)."""

    max_iterations: int = 300  # one or more
    tolerance: float = 1e-6  # on the primal and dual residuals, to call a point converged
    qp: QpOptions = dataclasses.field(default_factory=QpOptions)
    gauss_newton: bool = False  # leave the constraints' curvature out of the Hessian
    exact_merit: bool = False  # keep the penalty at or above the multipliers from the first iteration on
    defect_tolerance: float | None = None  # of the dynamics after a step: good enough, no further iteration is made
    long_qp: float = np.inf  # iterations of a QP, after more than which no further SQP iteration is made
    short_step: float = 0.0  # share of the QP's step, after less than which none is made either

    @classmethod
    def real_time(cls, iterations: int = 2, method: QpMethod = "stagewise", osqp_iterations: int = 30) -> "SqpOptions":
        """One Gauss-Newton iteration, and up to `iterations` where the dynamics' defect asks for more.

        The defect |f(x_k, u_k, u_{k+1}) - x_{k+1}| after a step says how far the linear model of the dynamics held over
        it; it is large where the car was disturbed, the belief has changed, or the plan moves to another solution. Its
        tolerance is 1 cm in e, 0.1 m/s in v and 5 mrad in beta (scaled by `STATE_SCALE`). To bound the time
        of a solve, no iteration follows a QP that took both of its attempts or more than 6 interior-point iterations (3
        as a rule, more than 6 in one of 200), nor a step halved four times or more, after which the next is as short.
        Steps are halved: shortened to as little as a tenth at once they took less time, and plans fell behind the car
        (one of four starts off the reference spun).

        OSQP's `rho` was chosen on the training population. With 0.1 a QP of a drift whose front tyre slides took
        thousands of iterations. The controller's lane is soft, so each of its QPs has a feasible point.
        """
        return cls(
            max_iterations=iterations,
            tolerance=0.0,
            qp=QpOptions(method, 1e-4, osqp_iterations, polish=False, rho=1.0, feasible=True, interior_tolerance=1e-6),
            gauss_newton=True,
            exact_merit=True,
            defect_tolerance=0.01,
            long_qp=6 if method == "stagewise" else np.inf,
            short_step=0.1,
        )

    @classmethod
    def converging(cls, tolerance: float, method: QpMethod = "stagewise") -> "SqpOptions":
        """The same iterations until the residuals are within the tolerance, ten at most, however long they take."""
        options = cls.real_time(CONVERGING, method)
        return dataclasses.replace(options, tolerance=tolerance, defect_tolerance=None, long_qp=np.inf, short_step=0.0)


_NONE = np.empty(0)  # gradient of no cost


class SqpIteration(NamedTuple):
    """What one iteration did. Residuals are those of the point that it started from."""

    step: float
    trials: int  # of the line search
    cost: float
    primal_residual: float
    dual_residual: float
    penalty: float
    qp_status: str
    qp_iterations: int
    second_attempt: bool  # at the QP: see `QpSolution`
    seconds: float  # wall time of the whole iteration


class SqpResult(NamedTuple):
    """A solve's outcome.

    `status` is "converged", "feasible" (the dynamics' defect is within its tolerance), "iterations" (all were used),
    "line search failed", "qp failed: (its status)", or "not finite" where the model has no finite value at the start.
    """

    z: Array
    y: Array
    cost: float
    primal_residual: float
    status: str
    iterations: list[SqpIteration]

    @property
    def failed(self) -> bool:
        """Whether the point must not be used."""
        return self.status.startswith(("qp failed", "not finite"))


class _Point(NamedTuple):
    """An iterate, the program linearised there, and what steps from it are judged by."""

    z: Array
    y: Array
    residual: Array  # of the dynamics
    f: Array  # their derivatives F_k [N, n, n+4]
    extra_cost: float  # the part of the cost that is not quadratic
    numbers: Iterate
    blocks: Array  # the QP's Hessian by stages


class _Step(NamedTuple):
    """What an iteration arrives at; a step of 0 and the given point if no step would do."""

    step: float
    trials: int
    z: Array
    y: Array
    residual: Array
    extra_cost: float
    penalty: float
    qp: QpSolution


class LineSearchSqp:
    """A solver bound to one program: holds the QPs' workspace and nothing that a later result depends on."""

    def __init__(self, problem: OptimalControlProblem, options: SqpOptions | None = None) -> None:
        """Raises:
        ValueError: the program holds a cost or constraint that its stages lack; the message names it.
        """
        problem.check_stages()
        self.options = options or SqpOptions()
        self.problem = problem
        self._dynamics = problem.dynamics
        self.workspace = QpWorkspace(problem.stages, self.options.qp)
        self.multiplier_count = problem.stages.multiplier_count

    def solve(self, z_guess: Array, y_guess: Array | None = None, most: int | None = None) -> SqpResult:
        """Solves the program as its data now stand, from a decision vector (and multipliers, if known).

        `most`: iterations, where other than the options'.
        """
        stages, options, extra = self.problem.stages, self.options, self.problem.extra_cost
        z = np.array(z_guess, dtype=float)  # a copy: a view that is read only would be compiled for anew
        y = np.zeros(self.multiplier_count) if y_guess is None else np.array(y_guess, dtype=float)
        penalty, status = 0.0, "iterations"
        extra_cost = extra.value(z) if extra else 0.0
        iterations: list[SqpIteration] = []
        while True:
            start = time.perf_counter()
            residual, f = self._dynamics.linearize(z)
            numbers = iterate(stages, extra.gradient(z) if extra else _NONE, residual, f, z, y)
            cost, primal_residual, dual = numbers.cost + extra_cost, numbers.primal, numbers.dual
            if not largest(f.ravel()) < np.inf:
                status = "not finite"
                break
            if max(primal_residual, dual) < options.tolerance:
                status = "converged"
                break
            blocks = stages.hessian if options.gauss_newton else self._lagrangian_blocks(z, y)
            point = _Point(z, y, residual, f, extra_cost, numbers, blocks)
            step, trials, z, y, residual, extra_cost, penalty, qp = self._step(point, penalty)
            seconds = time.perf_counter() - start
            iterations.append(
                SqpIteration(step, trials, cost, primal_residual, dual, penalty, *qp[2:], seconds=seconds)
            )
            if step == 0.0:
                status = "line search failed" if qp.usable else f"qp failed: {qp.status}"
                break
            last = len(iterations) == (most or options.max_iterations)
            if options.defect_tolerance is not None:
                if largest(residual) <= options.defect_tolerance:
                    status, last = "feasible", True
                # In real time a long QP, or line search, is all the work that one solve may do.
                last = last or qp.second_attempt or qp.iterations > options.long_qp or step < options.short_step
            if last:
                bent = cost_times(stages.hessian, z)
                cost = float(0.5 * z @ bent + stages.gradient @ z + stages.constant) + extra_cost
                primal_residual = violations(residual, stages, z)[1]
                break
        return SqpResult(z, y, cost, primal_residual, status, iterations)

    def _step(self, point: _Point, penalty: float) -> _Step:
        """The step to the QP's solution, shortened until the merit function falls enough."""
        options, extra, numbers, stages = self.options, self.problem.extra_cost, point.numbers, self.problem.stages
        offset = numbers.gradient - blocks_times(point.blocks, stages.columns, point.z)
        model = stages._replace(hessian=point.blocks, gradient=offset)
        qp = self.workspace.solve(model, point.f, numbers.target, point.z, point.y)
        if not qp.usable:
            return _Step(0.0, 0, point.z, point.y, point.residual, point.extra_cost, penalty, qp)
        direction = qp.z - point.z
        slope, quadratic_slope, bend, model_bend = along(
            numbers.gradient, numbers.quadratic_gradient, stages.hessian, point.blocks, stages.columns, direction
        )
        if numbers.violation > 1e-12:
            if options.exact_merit:
                penalty = max(penalty, largest(qp.y))
            penalty = max(penalty, (slope + 0.5 * model_bend) / (0.5 * numbers.violation))
        start = numbers.cost + point.extra_cost
        merit, decrease = start + penalty * numbers.violation, slope - penalty * numbers.violation
        # Near the solution the decrease drowns in the merit's rounding error.
        rounding = 1e-12 * (1.0 + abs(merit))
        step, trials = 1.0, 0
        while step >= LEAST_STEP:
            trials += 1
            trial = point.z + step * direction
            residual = self._dynamics.value(trial)
            cost = start + step * quadratic_slope + 0.5 * step * step * bend
            extra_cost = extra.value(trial) if extra else 0.0
            cost += extra_cost - point.extra_cost
            trial_merit = cost + penalty * violations(residual, stages, trial)[0]
            if trial_merit <= merit + SUFFICIENT_DECREASE * step * decrease + rounding:
                y = point.y + step * (qp.y - point.y)
                return _Step(step, trials, trial, y, residual, extra_cost, penalty, qp)
            step *= HALF
        return _Step(0.0, trials, point.z, point.y, point.residual, point.extra_cost, penalty, qp)

    def _lagrangian_blocks(self, z: Array, y: Array) -> Array:
        """The Lagrangian's Hessian by stages, each block projected to the nearest positive semidefinite matrix."""
        curved = self._dynamics.curvature_blocks(z, y[: self._dynamics.size], self.problem.extra_cost)
        blocks = self.problem.stages.hessian + curved
        values, vectors = np.linalg.eigh(blocks)
        projected: Array = (vectors * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(vectors, 1, 2)
        return projected
