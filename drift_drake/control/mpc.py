"""MpcController: replans at a fixed rate by real-time iterations on the OCP."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.control.ocp import OcpData, OcpWeights, OptimalControlProblem
from drift_drake.control.sqp import LineSearchSqp, SqpOptions, SqpResult
from drift_drake.control.step_model import StepModel
from drift_drake.control.tightening import LaneTightening, lateral_deviation, tightened
from drift_drake.model.features import COVARIANCE_COUNT, MEAN_COUNT
from drift_drake.reference.trajectory import Reference
from drift_drake.simulation.actuation import interpolate_plan, plan_size
from drift_drake.vehicle.parameters import VehicleParameters

Array = NDArray[np.float64]

DT = 0.1  # [s] of a plan's steps


class SolveStatistics(NamedTuple):
    """One solve, as the port `statistics` gives it. `seconds` is wall time: the one number that does not replay."""

    cost: float
    primal_residual: float
    dual_residual: float
    step: float  # of the last line search; 0 when it failed
    iterations: float  # SQP iterations
    qp_iterations: float  # OSQP's, of all QPs together
    qp_fallbacks: float  # QPs that went to the interior-point method
    qp_unsolved: float  # QPs that neither method solved
    slack: float  # [m] the largest planned excursion from the lane
    failed: float  # 1 if this solve failed
    failures: float  # solves that failed since the start
    seconds: float


class MpcController(LeafSystem):
    """Model predictive control along a reference: measured state in, plan and predicted trajectory out.

    Each `period`, the state is predicted to the time at which the plan will be in force (`delay` later), the OCP is set
    up from there with the command that the last plan has for that time as u_0, and SQP steps are made from the last
    solution, shifted: one, and up to `options.max_iterations` while the defect of the dynamics is above its tolerance.
    Each is taken only if the merit function is below that of the last plan, shifted to now and judged by the model of
    now; where no step is, that plan is the new one. If the state is not finite or the first QP fails, the last plan
    stays in force (it goes on in time, and the actuator holds its last command beyond its end) and the failure is
    counted, and so is an error of the solver; if a later one fails, the plan is that of the steps before.

    Input ports:
        measured_state: (r, v, beta, omega_r, e, dphi, s) [7].
        theta (optional): last-layer parameters for a model that has `with_theta`; else the model as it was given.
        memory: the model's further states, for a model that has any.
        posterior_covariance: of the last layer [4096], with `tightening`.

    Output ports:
        plan: [t_start, delta_0, tau_0, ..., delta_N, tau_N]; NaN before the first solve.
        prediction: states [(N + 1) * n] that go with the plan.
        statistics: `SolveStatistics`.

    State in the Context: the plan, the last solution (decision vector and multipliers), the statistics.

    Args:
        model: one step of the car, as the controller believes it.
        parameters: for the limits of the inputs.
        reference: what to drive.
        horizon: N, steps of 0.1 s.
        weights: of the cost.
        options: of the solver; real-time iterations by default.
        period: [s] between plans.
        delay: [s] from a measurement until its plan is in force: one period, which the solve may use up.
        initial_command: (delta [rad], tau [N m]) in force before the first plan.
        theta_size: length of the port `theta`; 0 for a model without.
        tightening: narrows the lane by the model's uncertainty along the last solution; needs a learnt model.
    """

    def __init__(
        self,
        model: StepModel,
        parameters: VehicleParameters,
        reference: Reference,
        horizon: int = 25,
        weights: OcpWeights | None = None,
        options: SqpOptions | None = None,
        period: float = 0.01,
        delay: float = 0.01,
        initial_command: tuple[float, float] = (0.0, 0.0),
        theta_size: int = 0,
        tightening: LaneTightening | None = None,
    ) -> None:
        LeafSystem.__init__(self)
        self.reference = reference
        self.horizon, self.period, self.delay = horizon, period, delay
        self._model = model
        self._initial_command = np.array(initial_command, dtype=float)
        self.problem = OptimalControlProblem(model, parameters, horizon, weights)
        self._solver = LineSearchSqp(self.problem, options or SqpOptions.real_time())

        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        self._theta = self.DeclareVectorInputPort("theta", theta_size) if theta_size else None
        memory_size = model.memory_scale.size
        self._memory = self.DeclareVectorInputPort("memory", memory_size) if memory_size else None
        self._tightening = tightening
        self._covariance = self.DeclareVectorInputPort("posterior_covariance", COVARIANCE_COUNT) if tightening else None
        nothing = np.full(plan_size(horizon), np.nan)
        self._plan = self.DeclareDiscreteState(nothing)
        self._primal = self.DeclareDiscreteState(np.full(self.problem.size, np.nan))
        self._dual = self.DeclareDiscreteState(np.zeros(self._solver.multiplier_count))
        self._statistics = self.DeclareDiscreteState(np.zeros(len(SolveStatistics._fields)))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._replan)

        for name, index in (("plan", self._plan), ("statistics", self._statistics)):
            self.DeclareStateOutputPort(name, index)
        self.DeclareVectorOutputPort(
            "prediction",
            (6 + memory_size) * (horizon + 1),
            self._calc_prediction,
            prerequisites_of_calc={self.discrete_state_ticket(self._primal)},
        )

    def _calc_prediction(self, context: Context, output: Any) -> None:
        x, _, _ = self.problem.unstack(context.get_discrete_state(self._primal).value())
        output.SetFromVector(x.ravel())

    def _replan(self, context: Context, discrete: DiscreteValues) -> None:
        last = SolveStatistics(*context.get_discrete_state(self._statistics).value())
        measured = self._measured.Eval(context)
        result, start = None, context.get_time() + self.delay
        if np.isfinite(measured).all():
            try:
                result = self._solve(context, measured, start)
            except (ArithmeticError, IndexError, RuntimeError, ValueError):
                result = None  # of numbers far off, or of the solver itself: a failure like any other
        if result is None or not result.iterations or (result.failed and result.iterations[0].step == 0.0):
            failed = last._replace(failed=1.0, failures=last.failures + 1.0)
            discrete.set_value(self._statistics, np.array(failed))
            return
        solution = self.problem.unstack(result.z)
        discrete.set_value(self._plan, np.concatenate([[start], solution.u.ravel()]))
        discrete.set_value(self._primal, result.z)
        discrete.set_value(self._dual, result.y)
        iterations = result.iterations
        statistics = SolveStatistics(
            cost=result.cost,
            primal_residual=result.primal_residual,
            dual_residual=iterations[-1].dual_residual,
            step=iterations[-1].step,
            iterations=float(len(iterations)),
            qp_iterations=float(sum(iteration.qp_iterations for iteration in iterations)),
            qp_fallbacks=float(sum(iteration.interior_iterations > 0 for iteration in iterations)),
            qp_unsolved=float(sum(iteration.qp_status != "solved" for iteration in iterations)),
            slack=float(solution.slack.max()),
            failed=0.0,
            failures=last.failures,
            seconds=sum(iteration.seconds for iteration in iterations),
        )
        discrete.set_value(self._statistics, np.array(statistics))

    def _solve(self, context: Context, measured: Array, start: float) -> SqpResult:
        model = self._model
        if self._theta is not None and self._theta.HasValue(context):
            model = model.with_theta(self._theta.Eval(context).reshape(4, -1))  # type: ignore[attr-defined]
        self.problem.dynamics.model = model
        plan = context.get_discrete_state(self._plan).value()
        now, at_start, later = (self._command(plan, t) for t in (context.get_time(), start, context.get_time() + DT))
        x, s = measured[:6], measured[6]
        if self._memory is not None:
            x = np.concatenate([x, self._memory.Eval(context)])
        curvature = np.atleast_1d(self.reference.path.curvature(s))
        step = model.step(x[None], now[None], later[None], curvature)[0] - x
        data = self._data(x + self.delay / DT * step, s + self.delay * x[1] * np.cos(x[5]), at_start)
        primal, dual = (context.get_discrete_state(index).value() for index in (self._primal, self._dual))
        if np.isnan(plan[0]):
            guess, dual = self.problem.initial_guess(data), np.zeros(self._solver.multiplier_count)
        else:
            guess = self._shifted(primal, (start - plan[0]) / DT, data)
        self.problem.set(self._tightened(context, model, data, guess))
        return self._solver.solve(guess, dual)

    def _tightened(self, context: Context, model: StepModel, data: OcpData, guess: Array) -> OcpData:
        """The data with the lane narrowed, where that is asked for."""
        if self._tightening is None or self._covariance is None:
            return data
        network, sigma, kappa = self._tightening
        covariance = self._covariance.Eval(context).reshape(MEAN_COUNT, MEAN_COUNT)
        x, u, _ = self.problem.unstack(guess)
        margin = kappa * lateral_deviation(model, network, sigma, covariance, x, u, data.curvature)
        e_min, e_max = tightened(data.e_min, data.e_max, margin)
        return data._replace(e_min=e_min, e_max=e_max)

    def _data(self, x: Array, s: float, command: Array) -> OcpData:
        horizon = self.reference.horizon(s, DT, self.horizon)
        return OcpData(x, command, horizon.x_ref, horizon.curvature, horizon.e_min, horizon.e_max)

    def _command(self, plan: Array, t: float) -> Array:
        """The command that a plan, or the initial command before there is any, has for time t."""
        return self._initial_command if np.isnan(plan[0]) else np.array(interpolate_plan(plan, t, DT)[:2])

    def _shifted(self, primal: Array, steps: float, data: OcpData) -> Array:
        """The last solution read `steps` (a fraction of one, as a rule) later, from the state and command of now."""
        x, u, slack = self.problem.unstack(primal)
        knots = np.arange(self.horizon + 1.0)
        at = np.minimum(knots + steps, self.horizon)
        index = np.minimum(at.astype(np.intp), self.horizon - 1)
        part = (at - index)[:, None]
        x, u = ((1.0 - part) * z[index] + part * z[index + 1] for z in (x, u))
        x[0], u[0] = data.x_init, data.u_init
        return self.problem.stack(x, u, slack)
