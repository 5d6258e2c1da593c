"""The OCP's program against the paper's formulas, written out."""

import numpy as np
import pytest
from control_problems import ocp_data
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import SnoptSolver, Solve

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import INPUT_SCALE, STATE_SCALE, NominalStepModel
from drift_drake.drive.mpc.ocp import OcpWeights, OptimalControlProblem, ocp
from drift_drake.drive.reference.similarity import Similarity
from drift_drake.drive.reference.trajectory import Reference

PARAMETERS = VehicleParameters()
HORIZON = 6


@pytest.fixture(scope="module")
def problem() -> OptimalControlProblem:
    return OptimalControlProblem(NominalStepModel(PARAMETERS), PARAMETERS, HORIZON)


def random_point(problem: OptimalControlProblem, reference: Reference, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    data = ocp_data(reference, 10.0, problem.horizon)
    z = problem.first_guess(data)
    return z + 0.05 * rng.normal(size=z.size)


def test_the_first_guess_is_the_reference_with_what_is_off_fading_out(
    problem: OptimalControlProblem, references: dict[str, Reference]
) -> None:
    data = ocp_data(references["figure_8"], 30.0, HORIZON, np.array([0.0, 0.0, 0.05, 0.0, 0.4, 0.0]))
    data = data._replace(u_init=data.u_init + np.array([0.1, 30.0]))
    x, held, _ = problem.unstack(problem.first_guess(data))
    np.testing.assert_allclose(x[[0, -1]], [data.x_init, data.x_ref[-1]])
    np.testing.assert_allclose(held, np.tile(data.u_init, (HORIZON + 1, 1)))
    u_ref = np.tile([-0.3, 50.0], (HORIZON + 1, 1))
    _, u, _ = problem.unstack(problem.first_guess(data._replace(u_ref=u_ref)))
    np.testing.assert_allclose(u[[0, -1]], [data.u_init, u_ref[-1]])


def test_cost_is_the_papers(problem: OptimalControlProblem, references: dict[str, Reference]) -> None:
    data = ocp_data(references["figure_8"], 30.0, HORIZON)
    problem.set(data)
    z = random_point(problem, references["figure_8"], 0)
    x, u, slack = problem.unstack(z)
    w = problem.weights
    q = np.array([w.r, w.v, w.beta, w.omega_r, w.e, w.dphi])
    expected = w.lane_penalty * slack.sum()
    for k in range(HORIZON):
        expected += q @ (x[k] - data.x_ref[k]) ** 2
        expected += np.array([w.delta, w.tau]) @ (u[k] - u[k + 1]) ** 2
    total = sum(problem.EvalBinding(b, z)[0] for b in problem.GetAllCosts())
    assert total == pytest.approx(expected, rel=1e-12)


def test_constraints_are_the_papers(problem: OptimalControlProblem, references: dict[str, Reference]) -> None:
    """At an independent solver's solution each constraint holds, and the lane's bounds are where they should be."""
    data = ocp_data(references["figure_8"], 30.0, HORIZON, np.array([0.0, 0.0, 0.05, 0.0, 0.4, 0.0]))
    data = data._replace(e_max=np.full(HORIZON + 1, 0.1))
    problem.set(data)
    z = SnoptSolver().Solve(problem, problem.first_guess(data)).GetSolution(problem.decision_variables())
    x, u, slack = problem.unstack(z)
    x_next = NominalStepModel(PARAMETERS).step(x[:-1], u[:-1], u[1:], data.curvature)
    np.testing.assert_allclose(x[1:], x_next, atol=1e-4)
    np.testing.assert_allclose(x[0], data.x_init, atol=1e-7)
    np.testing.assert_allclose(u[0], data.u_init, atol=1e-4)
    assert (np.abs(u[:, 0]) <= PARAMETERS.steering_limit + 1e-6).all()
    assert (u[:, 1] >= PARAMETERS.torque_min - 1e-3).all()
    assert (u[:, 1] <= PARAMETERS.torque_max + 1e-3).all()
    # The start is outside the lane, so no plan is inside at once: the slack is what is missing, no more.
    np.testing.assert_allclose(slack, np.maximum(x[1:, 4] - 0.1, 0.0), atol=1e-6)
    assert slack.max() > 0.05
    assert slack[-1] < 1e-6


def test_every_row_is_what_it_says(problem: OptimalControlProblem, references: dict[str, Reference]) -> None:
    """At any point: e and the slack on both sides of the lane, inputs and slacks within their own limits."""
    data = ocp_data(references["figure_8"], 30.0, HORIZON)
    problem.set(data)
    z = problem.first_guess(data) + np.random.default_rng(6).normal(size=problem.size)
    x, u, slack = problem.unstack(z)
    found = {}
    for binding in (*problem.linear_constraints(), *problem.bounding_box_constraints()):
        constraint = binding.evaluator()
        found[constraint.get_description()] = (
            problem.EvalBinding(binding, z), constraint.lower_bound(), constraint.upper_bound()
        )  # fmt: skip
    value, low, high = found["lane, softened"]
    np.testing.assert_allclose(value, [*(x[1:, 4] + slack), *(x[1:, 4] - slack)], rtol=1e-12)
    np.testing.assert_array_equal(low, [*data.e_min[1:], *np.full(HORIZON, -np.inf)])
    np.testing.assert_array_equal(high, [*np.full(HORIZON, np.inf), *data.e_max[1:]])
    value, low, high = found["limits of steering and torque"]
    np.testing.assert_allclose(value, (u[1:] / INPUT_SCALE).ravel(), rtol=1e-12)
    p = PARAMETERS
    np.testing.assert_allclose(low, np.tile([-p.steering_limit / 0.3, p.torque_min / 100.0], HORIZON))
    np.testing.assert_allclose(high, np.tile([p.steering_limit / 0.3, p.torque_max / 100.0], HORIZON))
    value, low, high = found["no negative slack"]
    np.testing.assert_array_equal([*value, *low, *high], [*slack, *np.zeros(HORIZON), *np.full(HORIZON, np.inf)])
    assert len(found) == 5


def test_a_car_twice_as_large_has_the_same_cost_in_its_own_units() -> None:
    units, rng = Similarity(2.0, 1.5, 3.0), np.random.default_rng(8)
    sizes = np.array([1.0 / units.time, units.speed, 1.0, units.speed, units.length, 1.0])
    one = OcpWeights(*rng.uniform(0.5, 2.0, 9))
    other = one.of_size(units)
    x, change = rng.normal(size=6), rng.normal(size=2)
    assert other.state() * (x * sizes) ** 2 == pytest.approx(one.state() * x**2)
    assert other.input() * (change * [1.0, units.torque]) ** 2 == pytest.approx(one.input() * change**2)
    assert other.lane_penalty * 0.3 * units.length == pytest.approx(one.lane_penalty * 0.3)


def test_dynamics_on_autodiff(problem: OptimalControlProblem, references: dict[str, Reference]) -> None:
    problem.set(ocp_data(references["figure_8"], 30.0, HORIZON))
    z = random_point(problem, references["figure_8"], 1)[: -HORIZON or None]
    seeds = np.random.default_rng(2).normal(size=(z.size, 3))
    result = problem.dynamics(InitializeAutoDiff(z[:, None], seeds).ravel())
    np.testing.assert_allclose(ExtractValue(result).ravel(), problem.dynamics.value(z), rtol=0, atol=1e-13)
    step = 1e-6
    numeric = [
        (problem.dynamics.value(z + step * d) - problem.dynamics.value(z - step * d)) / (2 * step) for d in seeds.T
    ]
    np.testing.assert_allclose(ExtractGradient(result), np.array(numeric).T, rtol=1e-5, atol=1e-6)


def test_curvature_blocks_are_second_differences(
    problem: OptimalControlProblem, references: dict[str, Reference]
) -> None:
    problem.set(ocp_data(references["figure_8"], 30.0, HORIZON))
    z = random_point(problem, references["figure_8"], 3)[: -HORIZON or None]
    y = np.random.default_rng(4).normal(size=problem.dynamics.size)
    hessian = np.zeros((z.size, z.size))
    for block, columns in zip(problem.dynamics.curvature_blocks(z, y), problem.layout.block_columns, strict=True):
        hessian[np.ix_(columns, columns)] += block
    direction = np.random.default_rng(5).normal(size=z.size)
    step = 1e-3
    values = [y @ problem.dynamics.value(z + shift * direction) for shift in (-step, 0.0, step)]
    second = (values[0] - 2.0 * values[1] + values[2]) / step**2
    assert direction @ hessian @ direction == pytest.approx(second, rel=1e-4)


def test_stack_and_unstack_are_inverse(problem: OptimalControlProblem) -> None:
    rng = np.random.default_rng(0)
    x, u = rng.normal(size=(HORIZON + 1, 6)), rng.normal(size=(HORIZON + 1, 2))
    z = problem.stack(x, u)
    np.testing.assert_allclose(z[:6], x[0] / STATE_SCALE)
    np.testing.assert_allclose(z[6 * (HORIZON + 1) :][:2], u[0] / INPUT_SCALE)
    solution = problem.unstack(z)
    np.testing.assert_allclose(solution.x, x)
    np.testing.assert_allclose(solution.u, u)


def test_every_cost_and_constraint_says_what_it_is(problem: OptimalControlProblem) -> None:
    said = [b.evaluator().get_description() for b in (*problem.GetAllCosts(), *problem.GetAllConstraints())]
    assert all(said)
    assert {"initial state", "command in force", "lane, softened", "dynamics"} < set(said)


def test_drake_solves_the_problem_as_it_is(references: dict[str, Reference]) -> None:
    problem = ocp(NominalStepModel(PARAMETERS), PARAMETERS, references["figure_8"], s=30.0, horizon=HORIZON)
    result = Solve(problem)
    assert result.is_success()
    x, u, slack = problem.unstack(result.GetSolution(problem.decision_variables()))
    np.testing.assert_allclose(x[0], references["figure_8"].state(30.0), atol=1e-6)
    np.testing.assert_allclose(u[0], references["figure_8"].input(30.0), atol=1e-4)
    assert slack.max() < 1e-6


def test_bad_data_is_refused(problem: OptimalControlProblem, references: dict[str, Reference]) -> None:
    data = ocp_data(references["straight"], 0.0, HORIZON)
    with pytest.raises(ValueError, match=r"curvature has shape \(3,\); a horizon of 6 steps needs \(6,\)"):
        problem.set(data._replace(curvature=np.zeros(3)))
    x_ref = data.x_ref.copy()
    x_ref[2, 1] = np.nan
    with pytest.raises(ValueError, match=r"x_ref holds NaN at index \(2, 1\)"):
        problem.set(data._replace(x_ref=x_ref))
