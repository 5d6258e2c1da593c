"""An OCP's stages: how rows fall to them, and that the MathematicalProgram made from them is the same."""

import numpy as np
import pytest
from control_problems import ocp_data
from pydrake.solvers import SnoptSolver

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.gathering.config import LaneDrive, bound_end, bound_slip, problem_data
from drift_drake.drive.mpc.ocp import OptimalControlProblem
from drift_drake.drive.mpc.sqp import LineSearchSqp
from drift_drake.drive.qp.products import cost_times
from drift_drake.drive.qp.qp import constraint_matrix, row_limits
from drift_drake.drive.qp.stages import StageBounds, StageRows
from drift_drake.drive.qp.stagewise_qp import one_sided
from drift_drake.drive.reference.trajectory import Reference

EYE = np.eye(6)  # rows over (x_k [3], u_k [2], slack_k)
SOFT = EYE[1] - 2.0 * EYE[4] - EYE[5]


def kind(stage: int, row: np.ndarray, low: float, high: float) -> StageRows:
    return StageRows("a row", np.array([stage]), row[None], np.array([low]), np.array([high]))


def test_rows_fall_to_their_stages_as_inequalities_from_below() -> None:
    kinds = [kind(2, EYE[3], -np.inf, 9.0), kind(1, SOFT, -1.0, 1.4), kind(2, EYE[5], 0.0, np.inf)]
    bounds = StageBounds.of([*kinds, kind(1, EYE[5], 0.0, np.inf)], 2)
    np.testing.assert_array_equal(bounds.first, [0, 2, 4])
    np.testing.assert_array_equal(bounds.values, [0.5 * SOFT, EYE[5], EYE[3], EYE[5]])
    inequalities, place, side = one_sided(bounds)
    np.testing.assert_array_equal(inequalities.first, [0, 3, 5])
    np.testing.assert_array_equal(inequalities.row[:2], [[0.0, -0.5, 0.0, 0.0, 1.0], [0.0, 0.5, 0.0, 0.0, -1.0]])
    np.testing.assert_array_equal(inequalities.row[3], [0.0, 0.0, 0.0, -1.0, 0.0])
    np.testing.assert_array_equal(inequalities.softness, [0.5, -0.5, 1.0, 0.0, 1.0])
    np.testing.assert_array_equal(inequalities.bound, [-0.7, -0.5, 0.0, -9.0, 0.0])
    np.testing.assert_array_equal(place, [0, 0, 1, 2, 3])
    np.testing.assert_array_equal(side, [-1.0, 1.0, 1.0, -1.0, 1.0])


def lane_problem(steps: int) -> OptimalControlProblem:
    """A lane drive's, which bounds slip and its end too, of a car that slips at first."""
    vehicle, lane = VehicleParameters(), LaneDrive(steps=steps, v_end=10.0)
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, steps)
    bound_slip(problem, lane)
    bound_end(problem)
    data = problem_data(lane)
    problem.set(data._replace(x_init=data.x_init + np.array([0.1, 0.5, 0.5, 0.5, 0.3, 0.05])))
    return problem


def sorted_rows(matrix: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Rows with their limits, each scaled to a largest entry of one."""
    rows = np.column_stack([matrix, low, high]) / np.abs(matrix).max(axis=1)[:, None]
    return np.round(rows[np.lexsort(np.round(rows, 9).T)], 12)


@pytest.mark.parametrize("lane", [False, True])
def test_the_program_is_that_of_its_stages(references: dict[str, Reference], lane: bool) -> None:
    vehicle, steps = VehicleParameters(), 4
    if lane:
        problem = lane_problem(steps)
    else:
        problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, steps)
        problem.set(ocp_data(references["figure_8"], 20.0, steps))
    stages, size, count = problem.stages, problem.size, problem.dynamics.size
    hessian, gradient, constant = np.zeros((size, size)), np.zeros(size), 0.0
    for binding in problem.quadratic_costs():
        index = problem.FindDecisionVariableIndices(binding.variables())
        hessian[np.ix_(index, index)] += binding.evaluator().Q()
    for binding in problem.linear_costs():
        gradient[problem.FindDecisionVariableIndices(binding.variables())] += binding.evaluator().a()
        constant += binding.evaluator().b()
    np.testing.assert_allclose(np.array([cost_times(stages.hessian, e) for e in np.eye(size)]), hessian, atol=1e-12)
    np.testing.assert_array_equal(stages.gradient, gradient)
    assert stages.constant == constant
    rows, low, high = [], [], []
    for binding in (*problem.linear_constraints(), *problem.bounding_box_constraints()):
        constraint = binding.evaluator()
        row = np.zeros((constraint.num_constraints(), size))
        row[:, problem.FindDecisionVariableIndices(binding.variables())] = constraint.GetDenseA()
        rows.append(row)
        low.append(constraint.lower_bound())
        high.append(constraint.upper_bound())
    program = sorted_rows(np.concatenate(rows), np.concatenate(low), np.concatenate(high))

    z = problem.first_guess(problem_data(LaneDrive(steps=steps))) + 0.01
    residual, f = problem.dynamics.linearize(z)
    matrix = constraint_matrix(stages, f).toarray()
    limits = (limit[count:] for limit in row_limits(stages, np.zeros(f.shape[:2])))
    np.testing.assert_array_equal(sorted_rows(matrix[count:], *limits), program)
    step = 1e-6 * np.random.default_rng(0).normal(size=size)
    after = problem.EvalBinding(problem.dynamics_binding, z + step)
    np.testing.assert_allclose(after - residual, matrix[:count] @ step, atol=1e-9)


def test_snopt_solves_the_program_as_the_sqp_its_stages() -> None:
    problem = lane_problem(12)
    guess = problem.first_guess(problem_data(LaneDrive(steps=12, v_end=10.0)))
    found, referee = LineSearchSqp(problem).solve(guess), SnoptSolver().Solve(problem, guess, None)
    assert found.status == "converged"
    assert referee.is_success()
    assert found.cost == pytest.approx(referee.get_optimal_cost(), rel=1e-6)
    np.testing.assert_allclose(found.z, referee.GetSolution(problem.decision_variables()), atol=2e-3)
    assert problem.unstack(found.z).slack.max() > 0.01  # a softened bound of slip holds


def test_what_is_added_to_the_program_alone_is_refused() -> None:
    vehicle = VehicleParameters()
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, 2)
    LineSearchSqp(problem)
    problem.AddLinearConstraint(problem.x[1, 0] <= problem.x[2, 0]).evaluator().set_description("a slower turn")
    with pytest.raises(ValueError, match=r"'a slower turn' was added to the program alone, .* rows of a stage by"):
        LineSearchSqp(problem)
