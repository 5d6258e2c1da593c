"""The interior-point method's Newton steps against dense linear algebra, and its solutions against OSQP's."""

from typing import NamedTuple

import numpy as np
import osqp
import pytest
import scipy.sparse as sparse
from numpy.typing import NDArray

from drift_drake.drive.qp.interior_point import STARTS, Inequalities, interior_point
from drift_drake.drive.qp.riccati import costates, factorise, substitute
from drift_drake.drive.qp.stacked import StageLayout
from drift_drake.drive.qp.stages import StageBounds, Stages
from drift_drake.drive.qp.stagewise_qp import solve_stages

Array = NDArray[np.float64]
STATES = 6


class StagewiseProblem(NamedTuple):
    """What `interior_point` takes."""

    f: Array
    hessian: Array
    gradient_x: Array
    gradient_u: Array
    penalty: Array
    target: Array
    rows: Inequalities


class StagewiseSolution(NamedTuple):
    x: Array
    u: Array
    slack: Array
    costate: Array
    multipliers: Array
    iterations: int
    solved: bool


def solve_stagewise(problem: StagewiseProblem, x: Array, u: Array, tolerance: float) -> StagewiseSolution:
    """The solution from a trajectory, whose first rows are given."""
    x, u, slack = np.array(x), np.array(u), np.empty(len(problem.f))
    costate, multipliers = np.empty((len(x), x.shape[1] + 2)), np.empty(problem.rows.bound.size)
    found = interior_point(*problem, tolerance, x, u, slack, costate, multipliers)
    return StagewiseSolution(x, u, slack, costate, multipliers, *found)


def random_problem(
    rng: np.random.Generator, horizon: int, width: float = 1.0, bound: float = 0.5, further: int = 0
) -> StagewiseProblem:
    """A problem with unstable dynamics.

    Args:
        width: of the lane, infinite for none; bound: of the inputs.
        further: rows of a stage over all its variables, of which the first is hard and has a margin at a trajectory.
    """
    size = STATES + 4
    factor = rng.normal(size=(horizon, size, size))
    f = np.concatenate([np.eye(STATES) + 0.1 * rng.normal(size=(horizon, STATES, STATES)),
                        0.3 * rng.normal(size=(horizon, STATES, 4))], axis=2)  # fmt: skip
    target, eye = 0.1 * rng.normal(size=(horizon, STATES)), np.eye(STATES + 3)
    x, u = np.zeros(STATES), np.vstack([np.zeros(2), rng.uniform(-bound, bound, (horizon, 2))])
    rows, bounds, first = [], [], [0]
    for k in range(horizon):
        x = f[k] @ np.concatenate([x, u[k], u[k + 1]]) - target[k]
        here = [sign * eye[i] for i in (STATES, STATES + 1) for sign in (1.0, -1.0)]
        limits = [-bound] * len(here)
        if np.isfinite(width):
            here += [sign * eye[4] + eye[-1] for sign in (1.0, -1.0)]
            limits += [-width, -width]
        for i in range(further):
            softness = rng.uniform(0.1, 10.0) if i else 0.0
            here.append(np.append(rng.normal(size=STATES + 2), softness))
            limits.append(rng.normal() if i else here[-1][:-1] @ np.append(x, u[k + 1]) - rng.uniform(0.01, 1.0))
        rows += [*here, eye[-1]]
        bounds += [*limits, 0.0]
        first.append(len(rows))
    row = np.array(rows)
    return StagewiseProblem(
        f, factor @ np.swapaxes(factor, 1, 2) / size, rng.normal(size=(horizon + 1, STATES)),
        rng.normal(size=(horizon + 1, 2)), np.full(horizon, 3.0), target,
        Inequalities(row[:, :-1].copy(), row[:, -1].copy(), np.array(bounds), np.array(first)),
    )  # fmt: skip


def dense(problem: StagewiseProblem) -> tuple[Array, Array, Array]:
    """(Hessian, gradient, dynamics' Jacobian) in the decision vector (x_0..x_N, u_0..u_N, slack)."""
    horizon = len(problem.f)
    states, inputs = STATES * (horizon + 1), 2 * (horizon + 1)
    total = states + inputs + horizon
    hessian, jacobian = np.zeros((total, total)), np.zeros((STATES * horizon, total))
    for k in range(horizon):
        columns = np.r_[STATES * k : STATES * (k + 1), states + 2 * k : states + 2 * k + 4]
        hessian[np.ix_(columns, columns)] += problem.hessian[k]
        rows = np.arange(STATES * k, STATES * (k + 1))
        jacobian[np.ix_(rows, columns)] = problem.f[k]
        jacobian[rows, rows + STATES] = -1.0
    return hessian, np.concatenate([problem.gradient_x.ravel(), problem.gradient_u.ravel(), problem.penalty]), jacobian


def linear_rows(problem: StagewiseProblem) -> Array:
    """Of the first state and input, then the inequalities, in the decision vector."""
    horizon, rows = len(problem.f), problem.rows
    states, inputs = STATES * (horizon + 1), 2 * (horizon + 1)
    eye = np.eye(states + inputs + horizon)
    matrix = np.zeros((rows.bound.size, len(eye)))
    for k in range(horizon):
        here = slice(rows.first[k], rows.first[k + 1])
        columns = np.r_[STATES * (k + 1) : STATES * (k + 2), states + 2 * k + 2 : states + 2 * k + 4]
        matrix[here, columns] = rows.row[here]
        matrix[here, states + inputs + k] = rows.softness[here]
    return np.concatenate([eye[:STATES], eye[states : states + 2], matrix])


def limits(problem: StagewiseProblem, x_init: Array, u_init: Array) -> tuple[Array, Array]:
    """(low, high) of the dynamics and the linear rows."""
    equations = np.concatenate([problem.target.ravel(), x_init, u_init])
    bound = problem.rows.bound
    return np.append(equations, bound), np.append(equations, np.full(bound.size, np.inf))


def by_osqp(problem: StagewiseProblem, x_init: Array, u_init: Array) -> tuple[Array, Array]:
    """(decision vector, multipliers)."""
    hessian, gradient, jacobian = dense(problem)
    solver = osqp.OSQP()
    solver.setup(
        sparse.csc_matrix(np.triu(hessian)), gradient,
        sparse.csc_matrix(np.concatenate([jacobian, linear_rows(problem)])), *limits(problem, x_init, u_init),
        verbose=False, eps_abs=1e-9, eps_rel=1e-9, max_iter=100000, polishing=True,
    )  # fmt: skip
    result = solver.solve(raise_error=True)
    return np.array(result.x), np.array(result.y)


def flat(x: Array, u: Array, slack: Array) -> Array:
    return np.concatenate([x.ravel(), u.ravel(), slack])


@pytest.mark.parametrize("horizon", [1, 2, 9])
def test_the_recursion_solves_the_newton_system(horizon: int) -> None:
    rng = np.random.default_rng(horizon)
    problem = random_problem(rng, horizon)
    linear, end = rng.normal(size=(horizon, STATES + 4)), rng.normal(size=STATES + 2)
    factor, barrier = rng.normal(size=(horizon, STATES + 2, 3)), rng.normal(size=(horizon, STATES + 2))
    curvature = factor @ np.swapaxes(factor, 1, 2)
    defect = rng.normal(size=(horizon, STATES))
    size = STATES + 2
    p, gain, pivots = np.empty((horizon + 1, size, size)), np.empty((horizon, 2, size)), np.empty((horizon, 3))
    q, ahead, step = np.empty((horizon + 1, size)), np.empty((horizon, 2)), np.empty((horizon + 1, size))
    assert factorise(problem.f, problem.hessian, curvature, p, gain, pivots)
    substitute(problem.f, linear, end, barrier, defect, p, gain, pivots, q, ahead, step)
    out = np.empty_like(step)
    costates(p, q, step, out)

    hessian, _, jacobian = dense(problem)
    states, count = STATES * (horizon + 1), (STATES + 2) * (horizon + 1)
    hessian, jacobian = hessian[:count, :count], jacobian[:, :count]
    gradient = np.zeros(count)
    for k in range(horizon):
        columns = np.r_[STATES * k : STATES * (k + 1), states + 2 * k : states + 2 * k + 4]
        gradient[columns] += linear[k]
        after = np.r_[STATES * (k + 1) : STATES * (k + 2), states + 2 * k + 2, states + 2 * k + 3]
        hessian[np.ix_(after, after)] += curvature[k]
        gradient[after] += barrier[k]
    gradient[np.r_[states - STATES : states, count - 2 : count]] += end
    first = np.r_[:STATES, states : states + 2]
    fixed = np.eye(count)[first]
    whole = np.block([[hessian, np.vstack([jacobian, fixed]).T],
                      [np.vstack([jacobian, fixed]), np.zeros((len(jacobian) + len(fixed),) * 2)]])  # fmt: skip
    answer = np.linalg.solve(whole, np.concatenate([-gradient, -defect.ravel(), np.zeros(len(fixed))]))
    np.testing.assert_allclose(flat(step[:, :STATES], step[:, STATES:], np.empty(0)), answer[:count], atol=1e-8)
    np.testing.assert_allclose(out[1:, :STATES].ravel(), answer[count : count + len(jacobian)], atol=1e-7)


def test_a_stage_that_is_not_convex_is_refused() -> None:
    problem = random_problem(np.random.default_rng(0), 3)
    hessian = problem.hessian.copy()
    hessian[2] = -np.eye(STATES + 4)
    found = solve_stagewise(problem._replace(hessian=hessian), np.zeros((4, STATES)), np.zeros((4, 2)), 1e-6)
    assert not found.solved


@pytest.mark.parametrize("further", [0, 4])
@pytest.mark.parametrize(("width", "bound"), [(100.0, 100.0), (0.3, 0.2), (0.01, 0.05), (np.inf, 0.5)])
def test_agrees_with_osqp(width: float, bound: float, further: int) -> None:
    """Bounds that hold nowhere, at most stages, a narrow lane, and none; with rows over states and inputs, and not."""
    rng = np.random.default_rng(3)
    for horizon in (1, 5, 12):
        problem = random_problem(rng, horizon, width, bound, further)
        x, u = rng.normal(size=(horizon + 1, STATES)), rng.normal(size=(horizon + 1, 2))
        x[0], u[0] = 0.0, 0.0
        found = solve_stagewise(problem, x, u, 1e-9)
        assert found.solved
        z, y = by_osqp(problem, x[0], u[0])
        mine = flat(found.x, found.u, found.slack)
        hessian, gradient, _ = dense(problem)
        np.testing.assert_allclose(mine, z, atol=1e-5)
        assert 0.5 * mine @ hessian @ mine + gradient @ mine == pytest.approx(
            0.5 * z @ hessian @ z + gradient @ z, rel=1e-7, abs=1e-7
        )
        layout, rows = StageLayout(np.empty(0), horizon), problem.rows
        bounds = StageBounds(
            np.column_stack([rows.row, rows.softness]), rows.bound, np.full(rows.bound.size, np.inf), rows.first
        )
        given = np.append(x[0], u[0])
        stages = Stages(
            layout.block_columns, layout.bound_columns, problem.hessian, gradient, 0.0, given, bounds
        )  # fmt: skip
        by_rows = solve_stages(stages, problem.f, problem.target, flat(x, u, np.zeros(horizon)), 1e-9)
        np.testing.assert_array_equal(by_rows[0], mine)
        np.testing.assert_allclose(by_rows[1], y, atol=1e-4)


def test_the_optimality_conditions_hold() -> None:
    """Karush, Kuhn and Tucker's, which are sufficient here."""
    rng = np.random.default_rng(7)
    for _ in range(60):
        horizon, further = int(rng.integers(1, 40)), int(rng.integers(0, 9))
        problem = random_problem(rng, horizon, *10.0 ** rng.uniform(-2.0, 1.0, 2), further)
        found = solve_stagewise(problem, np.zeros((horizon + 1, STATES)), np.zeros((horizon + 1, 2)), 1e-10)
        assert found.solved
        hessian, gradient, jacobian = dense(problem)
        z, rows = flat(found.x, found.u, found.slack), linear_rows(problem)
        margin = rows[STATES + 2 :] @ z - problem.rows.bound
        multipliers = np.concatenate([found.costate[0], found.multipliers])
        largest = max(1.0, np.abs(multipliers).max(), np.abs(found.costate).max())
        stationary = hessian @ z + gradient + jacobian.T @ found.costate[1:, :STATES].ravel() - rows.T @ multipliers
        np.testing.assert_allclose(stationary / largest, 0.0, atol=1e-8)
        np.testing.assert_allclose(jacobian @ z, problem.target.ravel(), atol=1e-8)
        assert margin.min() > -1e-8
        assert found.multipliers.min() >= 0.0
        assert np.mean(found.multipliers * margin) < 1e-8


def test_every_problem_is_solved_in_few_iterations() -> None:
    """From near and from far off, with bounds that hold nowhere and ones that hold nearly everywhere."""
    rng = np.random.default_rng(5)
    counts = []
    for _ in range(100):
        problem = random_problem(rng, 25, *10.0 ** rng.uniform(-3.0, 1.0, 2))
        size = 10.0 ** rng.uniform(-2.0, 2.0)
        found = solve_stagewise(problem, size * rng.normal(size=(26, STATES)), size * rng.normal(size=(26, 2)), 1e-6)
        assert found.solved
        counts.append(found.iterations)
    assert np.median(counts) <= 25
    assert max(counts) < sum(limit for *_, limit in STARTS)


def test_numbers_that_are_not_finite_are_not_solved() -> None:
    problem = random_problem(np.random.default_rng(0), 3)
    rows = problem.rows._replace(bound=problem.rows.bound + np.nan)
    for changed in (problem._replace(f=problem.f * np.nan), problem._replace(target=problem.target + np.inf),
                    problem._replace(rows=rows)):  # fmt: skip
        assert not solve_stagewise(changed, np.zeros((4, STATES)), np.zeros((4, 2)), 1e-6).solved
