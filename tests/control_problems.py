"""Problems that several tests solve."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.solvers import IpoptSolver, SnoptSolver, SolverOptions

from drift_drake.drive.gathering.config import GatheringConfig, problem_data
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import LAGGED
from drift_drake.drive.mpc.ocp import OcpData, OptimalControlProblem
from drift_drake.drive.mpc.sqp import LineSearchSqp, SqpOptions
from drift_drake.drive.qp.stacked import StageCost
from drift_drake.drive.reference.trajectory import Reference

Array = NDArray[np.float64]


def ocp_data(reference: Reference, s: float, horizon: int, error: Array | None = None) -> OcpData:
    """The problem of a car at s [m] of a reference, off it by `error` [6], its command the reference's."""
    window = reference.horizon(s, 0.1, horizon)
    x = reference.state(s) + (np.zeros(6) if error is None else error)
    return OcpData(x, reference.input(s), window.x_ref, window.curvature, window.e_min, window.e_max)


def stages(count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(x [n, 8], u [n, 2], u_next [n, 2]) of a lively drive."""
    rng = np.random.default_rng(seed)
    centre, spread = [0.0, 12.0, 0.0, 13.0, 0.0, 0.0, 0.0, 150.0], [0.6, 2.0, 0.2, 2.0, 0.5, 0.1, 0.2, 80.0]
    x = np.array(centre) + rng.normal(size=(count, 8)) * spread
    u = np.array([0.0, 150.0]) + rng.normal(size=(count + 1, 2)) * [0.2, 80.0]
    return x, u[:-1], u[1:]


def check_gradient(cost: StageCost, tolerance: float) -> None:
    """Exact, by central differences; the path coordinates tell nothing, the lagged commands do."""
    x, u, u_next = stages(4, 2)
    gradient = cost.expansion(x, u, u_next).gradient()
    assert gradient.shape == (4, 12)
    assert (gradient[:, 4:6] == 0.0).all()
    assert (gradient[:, LAGGED] != 0.0).all()
    point = np.concatenate([x, u, u_next], axis=1)
    scale = np.array([1.0, 10.0, 0.5, 10.0, 1.0, 0.5, 0.3, 100.0, 0.3, 100.0, 0.3, 100.0])
    for k in range(4):
        for j in range(12):
            moved = np.stack([point, point])
            moved[:, k, j] += np.array([1e-5, -1e-5]) * scale[j]
            values = [cost.value(p[:, :8], p[:, 8:10], p[:, 10:]) for p in moved]
            numeric = (values[0] - values[1]) / 2e-5
            assert gradient[k, j] * scale[j] == pytest.approx(numeric, rel=1e-5, abs=tolerance)


def check_curvature(cost: StageCost, value: Callable[[Array, Array, Array], float] | None = None) -> None:
    """Second derivatives within each stage, against second differences of the cost or of the given value."""
    x, u, u_next = stages(4, 2)
    value = value or cost.value
    steps = 3e-4 * np.array([1.0, 10.0, 0.5, 10.0, 1.0, 0.5, 0.3, 100.0, 0.3, 100.0, 0.3, 100.0])
    point, numeric = np.concatenate([x, u, u_next], axis=1), np.empty((4, 12, 12))

    def at(k: int, *moves: Array) -> float:
        moved = point.copy()
        moved[k] += np.sum(moves, axis=0)
        return value(moved[:, :8], moved[:, 8:10], moved[:, 10:])

    some = [0, 3]  # of the stages, the first and the last
    for k in some:
        for i, one in enumerate(np.diag(steps)):
            for j, other in enumerate(np.diag(steps)):
                numeric[k, i, j] = 0.25 * (
                    at(k, one, other) - at(k, one, -other) - at(k, -one, other) + at(k, -one, -other)
                )
    found, numeric = (cost.expansion(x, u, u_next).curvature() * steps[:, None] * steps)[some], numeric[some]
    np.testing.assert_allclose(found, numeric, rtol=0, atol=1e-3 * np.abs(numeric).max())


def lane_ocp(
    model: BayesianModel, steps: int, information: StageCost, count: int = 2
) -> tuple[OptimalControlProblem, list[np.ndarray]]:
    """(Info-OCP over a few steps, first guesses: the straight line and random ones)."""
    config = GatheringConfig(steps=steps, v_end=7.5 + 12.5 * steps / 45)
    step_model = BayesianStepModel(model.network, model.prior_mean, model.vehicle.constants())
    problem = OptimalControlProblem(step_model, model.vehicle, steps, config.weights, extra_cost=information)
    data = problem_data(config)
    data = data._replace(x_init=np.append(data.x_init, data.u_init))
    problem.set(data)
    straight = problem.first_guess(data)
    guesses = [straight]
    rng = np.random.default_rng(0)
    for _ in range(count - 1):
        x, u, _ = problem.unstack(straight)
        u[1:] = rng.normal(size=(steps, 2)) * [0.1, 60.0] + [0.0, 100.0]
        guesses.append(problem.stack(x, u))
    return problem, guesses


def check_against_referees(problem: OptimalControlProblem, guesses: list[np.ndarray]) -> None:
    """The SQP's best value of the first guesses is that of SNOPT and IPOPT."""
    solver = LineSearchSqp(problem, SqpOptions(max_iterations=150, tolerance=1e-5))
    results = [solver.solve(guess) for guess in guesses]
    feasible = [result.cost for result in results if not result.failed and result.primal_residual < 1e-5]
    best = min(feasible)
    options = SolverOptions()
    options.SetOption(IpoptSolver.id(), "max_iter", 400)
    referees = []
    for referee in (SnoptSolver(), IpoptSolver()):
        solved = [referee.Solve(problem, guess, options) for guess in guesses]
        referees += [result.get_optimal_cost() for result in solved if result.is_success()]
    assert referees
    assert best <= min(referees) + 1e-3 * abs(min(referees))
