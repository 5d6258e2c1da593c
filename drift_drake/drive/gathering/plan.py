"""Info-OCP: a drive along a lane that is planned for what it tells a belief."""

import dataclasses
from typing import NamedTuple

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.gathering.config import (
    FEASIBLE,
    GatheringConfig,
    Objective,
    bound_end,
    bound_slip,
    bound_steering,
    problem_data,
)
from drift_drake.drive.gathering.information import (
    InformationCost,
    PredictiveInformation,
    StageInformation,
    UpdatedInformation,
)
from drift_drake.drive.learnt.checkpoint import BayesianModel, InvalidCheckpointError
from drift_drake.drive.learnt.features import Expansions
from drift_drake.drive.learnt.posterior import Posterior, weighed
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.mpc.ocp import OptimalControlProblem
from drift_drake.drive.mpc.sqp import LineSearchSqp, SqpOptions, SqpResult
from drift_drake.drive.mpc.tightening import lateral_deviation, tightened
from drift_drake.drive.qp.qp import QpOptions

MORE = 2  # times as many first guesses where none has led to a plan
QP_TOLERANCE = 1e-6  # of a quadratic program: a thousandth of the plan's
OSQP_ITERATIONS = 4000
NARROWINGS = 3  # of the lane, each by the uncertainty along the plan before
CONVERGED = "converged"  # of an SQP's statuses
TRIAL = 10  # SQP iterations from each first guess, before the best one's solution is gone on with


class InfeasiblePlanError(DriftDrakeError, RuntimeError):
    """No drive was found that keeps to the lane and the limits; the message says what to change."""


class Trajectory(NamedTuple):
    """A planned trajectory of 0.1 s steps."""

    x: Array  # states and lagged commands [N+1, 8]
    u: Array  # [N+1, 2]
    cost: float
    information: float  # [nat] to the belief that it was planned with, by the objective
    status: str
    alpha: float = 0.0  # weight of the information that it was planned with [1/nat]


@one_blas_thread()
def plan_drive(
    model: BayesianModel,
    belief: Posterior,
    config: GatheringConfig,
    alpha: float,
    seed: int = 0,
    lateral: Array | None = None,
) -> Trajectory:
    """Solves OCP (alpha = 0) or Info-OCP (section III of the paper), from the best of several first guesses.

    Args:
        model, belief, config: see `info_ocp`; alpha: weight of the information [1/nat]; seed: of the random first
            guesses; lateral: line e(t) [N+1] in m to drive instead of the lane's middle.

    Returns:
        States and lagged commands [N+1, 8] (SI) and inputs [N+1, 2] (delta [rad], tau [N m]), 0.1 s apart.

    Raises:
        InvalidCheckpointError: see `info_ocp`.
        InfeasiblePlanError: no first guess led to a feasible trajectory, or, with `only_converged`, to the least cost.

    Examples:
        >>> trajectory = plan_drive(model, model.prior(), GatheringConfig(), alpha=8.0)  # doctest: +SKIP
    """
    problem = info_ocp(model, belief, config, alpha, lateral)
    cost = information_cost(model, belief, config.objective, alpha)
    solver = LineSearchSqp(problem, sqp_options(config))
    straight = problem.GetInitialGuess(problem.decision_variables())
    generator, count = np.random.default_rng(seed), config.starts if alpha > 0.0 else 1
    guesses = _first_guesses(problem, straight, count, generator)
    try:
        best = _best(solver, guesses, config.only_converged)
    except InfeasiblePlanError:
        if alpha == 0.0:
            raise
        more = _first_guesses(problem, straight, MORE * count + 1, generator)[1:]
        best = _best(solver, more, config.only_converged)
    if config.tightening > 0.0:
        best = _narrowed(problem, solver, model, belief, config, best, lateral)
    x, u, _ = problem.unstack(best.z)
    return Trajectory(x, u, best.cost, cost.information(x[:-1], u[:-1], u[1:]), best.status, alpha)


def sqp_options(config: GatheringConfig) -> SqpOptions:
    """To convergence, as plans are solved."""
    qp = QpOptions(config.qp, QP_TOLERANCE, OSQP_ITERATIONS, interior_tolerance=QP_TOLERANCE)
    return SqpOptions(config.max_iterations, config.tolerance, qp)


def _first_guesses(
    problem: OptimalControlProblem, straight: Array, count: int, generator: np.random.Generator
) -> list[Array]:
    """The straight line, and beyond the first one of `count` random steering along it."""
    guesses = [straight]
    while len(guesses) < count:
        x, u, _ = problem.unstack(straight)
        u[1:, 0] = 0.06 * np.sin(
            np.arange(len(u) - 1) * generator.uniform(0.2, 0.6) + generator.uniform(0.0, 2.0 * np.pi)
        )
        u[1:, 1] = generator.uniform(50.0, 250.0)
        guesses.append(problem.stack(x, u))
    return guesses


def usable(result: SqpResult, only_converged: bool) -> bool:
    """Whether a solution is one to drive: feasible, and of the least cost where that is asked for."""
    ended = result.status == CONVERGED if only_converged else not result.failed
    return ended and result.primal_residual < FEASIBLE


def _best(solver: LineSearchSqp, guesses: list[Array], only_converged: bool) -> SqpResult:
    """The solution from the guess that leads furthest in `TRIAL` iterations; from the next one where it fails."""
    most = solver.options.max_iterations
    trials = [solver.solve(guess, most=min(TRIAL, most)) for guess in guesses]
    for trial in sorted(trials, key=lambda result: (result.failed, result.cost)):
        result = trial
        if trial.status == "iterations" and most > TRIAL:
            result = solver.solve(trial.z, trial.y, most - TRIAL)
        if usable(result, only_converged):
            return result
    if only_converged:
        raise InfeasiblePlanError(
            f"no first guess led to a plan that converged in {most} iterations; lower alpha or allow more iterations"
        )
    raise InfeasiblePlanError(
        "no first guess led to a feasible trajectory; widen the lane, lower alpha or allow more iterations"
    )


def _narrowed(
    problem: OptimalControlProblem, solver: LineSearchSqp, model: BayesianModel, belief: Posterior,
    config: GatheringConfig, found: SqpResult, lateral: Array | None,
) -> SqpResult:  # fmt: skip
    """A plan within the lane less `config.tightening` standard deviations of its e, each time of the last solution.

    Raises:
        InfeasiblePlanError: there is none.
    """
    data = problem_data(config, lateral)
    data = data._replace(x_init=np.append(data.x_init, data.u_init))
    believed = step_model(model, belief, config.path_step)
    for _ in range(NARROWINGS):
        x, u, _ = problem.unstack(found.z)
        sigma = lateral_deviation(believed, model.sigma, belief.covariance, x, u, data.curvature)
        e_min, e_max = tightened(data.e_min, data.e_max, config.tightening * sigma)
        problem.set(data._replace(e_min=e_min, e_max=e_max))
        found = solver.solve(found.z, found.y)
        if not usable(found, config.only_converged):
            raise InfeasiblePlanError(
                f"no plan keeps to the lane less {config.tightening:g} standard deviations of e; lower tightening"
            )
    return found


def info_ocp(
    model: BayesianModel,
    belief: Posterior,
    config: GatheringConfig = GatheringConfig(),
    alpha: float | None = None,
    lateral: Array | None = None,
) -> OptimalControlProblem:
    """Info-OCP (section III of the paper) along the lane as a MathematicalProgram, with a first guess set.

    Args:
        model, belief: what the drive is planned to tell of; config: the lane, the objective and the limits.
        alpha: weight of the information [1/nat]; the config's without, 0 for the plain OCP.
        lateral: line e(t) [N+1] in m to drive instead of the lane's middle.

    Raises:
        InvalidCheckpointError: the objective is "drifts", and the model names none.

    Examples:
        >>> problem = info_ocp(model, model.prior(), GatheringConfig(steps=5))
        >>> result = Solve(problem)  # doctest: +SKIP
    """
    alpha = config.alpha if alpha is None else alpha
    informative = alpha > 0.0
    believed = step_model(model, belief, config.path_step).expanded()
    cost = None
    if informative:
        cost = information_cost(model, belief, config.objective, alpha, believed.expansions)
    problem = OptimalControlProblem(
        believed, model.vehicle, config.steps, config.weights, cost, "information, times -alpha"
    )
    if config.bounded:
        bound_slip(problem, config)
    if np.isfinite(config.steering.rate):
        bound_steering(problem, config.steering, model.lag[0])
    if informative and config.ends_straight:
        bound_end(problem)
    data = problem_data(config, lateral)
    data = data._replace(x_init=np.append(data.x_init, data.u_init))  # the lags are settled
    problem.set(data)
    problem.SetInitialGuessForAllVariables(problem.first_guess(data))
    return problem


def information_cost(
    model: BayesianModel,
    belief: Posterior,
    objective: Objective,
    alpha: float = 1.0,
    expansions: Expansions | None = None,
) -> InformationCost:
    """-alpha times an objective's information, a sample counting as the regression weighs it.

    Args:
        expansions: see `InformationCost`.

    Raises:
        InvalidCheckpointError: the model does not know where it is to predict.
    """
    if objective != "drifts":
        kind = UpdatedInformation if objective == "updated" else StageInformation
        return kind(model.network, weighed(belief.covariance, model.sample_weight), alpha, expansions)
    if model.drifts is None:
        raise InvalidCheckpointError(
            "the checkpoint names no drifts to plan for; train it anew, or choose objective 'updated' for later rounds"
        )
    return PredictiveInformation(model.network, belief.covariance, model.sample_weight, model.drifts, alpha, expansions)


def information_expected(model: BayesianModel, belief: Posterior, drive: Trajectory) -> float:
    """Information [nat] that a planned drive's samples together would bring."""
    return information_cost(model, belief, "updated").information(drive.x[:-1], drive.u[:-1], drive.u[1:])


def information_gained(before: Posterior, after: Posterior) -> float:
    """Information [nat] between two beliefs: half the log of their covariances' determinants, before over after."""
    return float(0.5 * (np.linalg.slogdet(before.covariance)[1] - np.linalg.slogdet(after.covariance)[1]))


def plan_again(
    model: BayesianModel, belief: Posterior, first: Trajectory, config: GatheringConfig, seed: int = 0,
    share: float = 1.0,
) -> Trajectory:  # fmt: skip
    """Info-OCP's plan of a later round, with what is believed after the rounds before.

    Args:
        share: of the weight of the information (`round_alpha`).

    Raises:
        InfeasiblePlanError: no first guess led to a feasible trajectory.
        InvalidCheckpointError: see `information_cost`.
    """
    again = dataclasses.replace(config, objective=config.objective_later)
    return plan_drive(model, belief, again, share * round_alpha(model, belief, first, config), seed)


def round_alpha(model: BayesianModel, belief: Posterior, first: Trajectory, config: GatheringConfig) -> float:
    """The weight of the information in a later round: a repeat of the first drive is worth what it was then.

    As the belief narrows, all information shrinks; under a fixed weight the second plan is a straight line again.
    """
    if config.fixed_alpha:
        return config.alpha
    cost = information_cost(model, belief, config.objective_later)
    return first.alpha * first.information / cost.information(first.x[:-1], first.u[:-1], first.u[1:])
