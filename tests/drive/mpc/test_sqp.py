"""The line-search SQP against Drake's SNOPT and IPOPT on the same programs."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from control_problems import ocp_data
from pydrake.solvers import IpoptSolver, SnoptSolver, SolverOptions

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.mpc.ocp import OcpData, OcpWeights, OptimalControlProblem
from drift_drake.drive.mpc.sqp import LineSearchSqp, SqpOptions
from drift_drake.drive.qp.qp import QpWorkspace
from drift_drake.drive.reference.trajectory import Reference

PARAMETERS = VehicleParameters()
SPREAD = np.array([0.1, 0.5, 0.06, 0.5, 0.4, 0.05])


@cache
def solver(horizon: int) -> LineSearchSqp:
    return LineSearchSqp(OptimalControlProblem(NominalStepModel(PARAMETERS), PARAMETERS, horizon))


def posed(references: dict[str, Reference]) -> tuple[LineSearchSqp, np.ndarray]:
    """The solver, its program set to a car off the figure-8, and the first guess."""
    exact = solver(15)
    data = ocp_data(references["figure_8"], 20.0, 15, SPREAD)
    exact.problem.set(data)
    return exact, exact.problem.first_guess(data)


def referee_costs(problem: OptimalControlProblem, guess: np.ndarray) -> list[float]:
    """SNOPT's and IPOPT's; infinite, with which no cost agrees, where one has not converged."""
    options = SolverOptions()
    ipopt = IpoptSolver()
    for name, value in (("tol", 1e-8), ("bound_relax_factor", 0.0)):
        options.SetOption(ipopt.id(), name, value)
    for name, count in (("max_iter", 1500), ("limited_memory_max_history", 60)):
        options.SetOption(ipopt.id(), name, count)
    results = [referee.Solve(problem, guess, options) for referee in (SnoptSolver(), ipopt)]
    return [result.get_optimal_cost() if result.is_success() else np.inf for result in results]


def problems(references: dict[str, Reference], name: str, horizon: int, count: int) -> list[OcpData]:
    """Places drawn along a reference, with errors; the first straight-line problem is the paper's own."""
    rng = np.random.default_rng([horizon, count])
    reference = references[name]
    if name == "straight":
        places, errors = np.linspace(0.0, 12.0, count), [np.zeros(6)] + [rng.normal(size=6) * SPREAD] * (count - 1)
    else:
        places = rng.uniform(0.0, reference.path.length, count)
        errors = [rng.normal(size=6) * SPREAD for _ in range(count)]
    return [ocp_data(reference, s, horizon, error) for s, error in zip(places, errors, strict=True)]


def agreement(references: dict[str, Reference], name: str, horizon: int, count: int) -> list[list[bool]]:
    """For each problem, whether the SQP's cost is SNOPT's and whether it is IPOPT's, to 1e-5."""
    agree = []
    for data in problems(references, name, horizon, count):
        # At these weights each of the short problems has one optimum.
        weights = OcpWeights(delta=20.0)
        sqp = LineSearchSqp(OptimalControlProblem(NominalStepModel(PARAMETERS), PARAMETERS, horizon, weights))
        sqp.problem.set(data)
        guess = sqp.problem.first_guess(data)
        result = sqp.solve(guess)
        assert result.status == "converged"
        agree.append([result.cost == pytest.approx(cost, rel=1e-5) for cost in referee_costs(sqp.problem, guess)])
    return agree


@pytest.mark.parametrize(("name", "horizon", "count"), [("straight", 10, 2), ("figure_8", 10, 3), ("loops", 8, 2)])
def test_agrees_with_snopt_and_ipopt(references: dict[str, Reference], name: str, horizon: int, count: int) -> None:
    assert np.all(agreement(references, name, horizon, count))


@pytest.mark.slow
def test_agrees_with_snopt_and_ipopt_at_full_length(references: dict[str, Reference]) -> None:
    """Where the three do not agree, there are several local optima, and the SQP finds that of one of the others."""
    agree = np.concatenate([
        agreement(references, name, horizon, count)
        for name, horizon, count in (("straight", 45, 4), ("figure_8", 25, 14), ("loops", 20, 6))
    ])  # fmt: skip
    assert agree.any(axis=1).all()
    assert agree.all(axis=1).sum() >= 20


def test_gauss_newton_reaches_the_same_solution(references: dict[str, Reference]) -> None:
    exact = solver(15)
    gauss_newton = LineSearchSqp(exact.problem, SqpOptions(gauss_newton=True))
    data = ocp_data(references["figure_8"], 20.0, 15, 0.5 * SPREAD)
    exact.problem.set(data)
    guess = exact.problem.first_guess(data)
    first, second = exact.solve(guess), gauss_newton.solve(guess)
    assert first.status == second.status == "converged"
    assert second.cost == pytest.approx(first.cost, rel=1e-8)


def test_merit_falls_and_statistics_are_complete(references: dict[str, Reference]) -> None:
    sqp = solver(15)
    data = ocp_data(references["figure_8"], 20.0, 15, SPREAD)
    sqp.problem.set(data)
    result = sqp.solve(sqp.problem.first_guess(data))
    assert result.primal_residual < 1e-6
    for iteration in result.iterations:
        assert 0.0 < iteration.step <= 1.0
        assert iteration.qp_status == "solved"
        assert iteration.qp_iterations > 0
        assert iteration.seconds > 0.0
    assert result.iterations[-1].dual_residual < result.iterations[0].dual_residual


def test_real_time_iterations_converge_on_a_fixed_problem(references: dict[str, Reference]) -> None:
    """One iteration at a time from its own result, as in the loop, ends where the converged mode ends."""
    exact = solver(15)
    real_time = LineSearchSqp(exact.problem, SqpOptions.real_time(1))
    data = ocp_data(references["figure_8"], 20.0, 15, 0.5 * SPREAD)
    exact.problem.set(data)
    z, y = exact.problem.first_guess(data), None
    for _ in range(15):
        result = real_time.solve(z, y)
        assert len(result.iterations) == 1
        assert result.iterations[0].qp_status == "solved"
        z, y = result.z, result.y
    assert result.cost == pytest.approx(exact.solve(exact.problem.first_guess(data)).cost, rel=1e-3)


def test_a_second_iteration_is_made_where_the_defect_asks_for_it(references: dict[str, Reference]) -> None:
    exact, guess = posed(references)
    options = SqpOptions.real_time(8)
    assert options.defect_tolerance is not None
    result = LineSearchSqp(exact.problem, options).solve(guess)
    assert result.status == "feasible"
    assert 1 < len(result.iterations) < 8
    defects = [iteration.primal_residual for iteration in result.iterations[1:]]
    assert min(defects) > options.defect_tolerance >= result.primal_residual
    once = LineSearchSqp(exact.problem, SqpOptions.real_time(1)).solve(guess)
    assert (once.status, len(once.iterations)) == ("iterations", 1)
    # From its own result one iteration will do.
    again = LineSearchSqp(exact.problem, options).solve(result.z, result.y)
    assert (again.status, len(again.iterations)) == ("feasible", 1)


def test_to_convergence_iterations_go_on_until_the_residuals_are_small(references: dict[str, Reference]) -> None:
    exact, guess = posed(references)
    options = SqpOptions.converging(1e-4)
    result = LineSearchSqp(exact.problem, options).solve(guess)
    assert (result.status, options.gauss_newton) == ("converged", True)
    assert len(LineSearchSqp(exact.problem, SqpOptions.real_time(10)).solve(guess).iterations) < len(result.iterations)
    assert result.cost == pytest.approx(exact.solve(guess).cost, rel=1e-5)
    never = LineSearchSqp(exact.problem, dataclasses.replace(options, tolerance=1e-14)).solve(guess)
    assert (never.status, len(never.iterations)) == ("iterations", 10)


def test_in_real_time_a_qp_of_two_attempts_is_the_last(
    references: dict[str, Reference], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It costs as much as a whole iteration, and the time of a solve has a bound."""
    exact, guess = posed(references)
    attempt = QpWorkspace.solve
    monkeypatch.setattr(QpWorkspace, "solve", lambda *arguments: attempt(*arguments)._replace(second_attempt=True))
    for options, count in ((SqpOptions.real_time(2), 1), (SqpOptions(max_iterations=2), 2)):
        result = LineSearchSqp(exact.problem, options).solve(guess)
        assert (result.status, len(result.iterations)) == ("iterations", count)


def test_in_real_time_a_long_qp_is_the_last(references: dict[str, Reference]) -> None:
    exact, guess = posed(references)
    options = SqpOptions.real_time(2)
    first = LineSearchSqp(exact.problem, options).solve(guess).iterations[0].qp_iterations
    for most, count in ((first - 1, 1), (first, 2)):
        result = LineSearchSqp(exact.problem, dataclasses.replace(options, long_qp=most)).solve(guess)
        assert len(result.iterations) == count


def test_in_real_time_a_short_step_is_the_last(references: dict[str, Reference]) -> None:
    exact, guess = posed(references)
    options = SqpOptions.real_time(2)
    for share, count in ((1.1, 1), (1.0, 2)):  # the first step from this guess is a whole one
        result = LineSearchSqp(exact.problem, dataclasses.replace(options, short_step=share)).solve(guess)
        assert len(result.iterations) == count


def test_the_merit_function_of_a_real_time_iteration_is_exact(references: dict[str, Reference]) -> None:
    """Its penalty is at least the largest multiplier from the first iteration on, as theorem 17.3 asks."""
    exact, guess = posed(references)
    result = LineSearchSqp(exact.problem, SqpOptions.real_time(1)).solve(guess)
    assert result.iterations[0].step == 1.0  # so that y is the QP's
    assert result.iterations[0].penalty >= np.abs(result.y).max()
    weak = dataclasses.replace(SqpOptions.real_time(1), exact_merit=False)
    assert LineSearchSqp(exact.problem, weak).solve(guess).iterations[0].penalty < np.abs(result.y).max()


def test_a_solve_depends_on_its_arguments_alone(references: dict[str, Reference]) -> None:
    """The workspace's history leaves no trace: the same call gives the same bits after other problems."""
    problem = OptimalControlProblem(NominalStepModel(PARAMETERS), PARAMETERS, 10)
    sqp = LineSearchSqp(problem, SqpOptions.real_time(2))
    one, other = (ocp_data(references["figure_8"], s, 10, 0.5 * SPREAD) for s in (20.0, 70.0))
    problem.set(one)
    first = sqp.solve(problem.first_guess(one))
    problem.set(other)
    sqp.solve(problem.first_guess(other))
    problem.set(one)
    again = sqp.solve(problem.first_guess(one))
    np.testing.assert_array_equal(first.z, again.z)
    np.testing.assert_array_equal(first.y, again.y)


def test_a_start_far_outside_the_lane_has_a_solution(references: dict[str, Reference]) -> None:
    sqp = solver(15)
    data = ocp_data(references["figure_8"], 20.0, 15, np.array([0.0, 0.0, 0.0, 0.0, 3.6, 0.0]))
    sqp.problem.set(data)
    result = sqp.solve(sqp.problem.first_guess(data))
    assert result.status == "converged"
    slack = sqp.problem.unstack(result.z).slack
    assert slack[0] > 0.4
    assert slack[-1] < 1e-6


def test_a_model_that_is_not_finite_is_reported(references: dict[str, Reference]) -> None:
    sqp = solver(15)
    data = ocp_data(references["figure_8"], 20.0, 15)
    sqp.problem.set(data)
    guess = sqp.problem.first_guess(data)
    guess[3] = np.nan
    result = sqp.solve(guess)
    assert result.failed
    assert result.status == "not finite"
