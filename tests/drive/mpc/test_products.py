"""The compiled products of an SQP iteration against the same matrices written out."""

import numpy as np
import pytest
from control_problems import ocp_data

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.mpc.ocp import OptimalControlProblem
from drift_drake.drive.qp.products import (
    along,
    blocks_times,
    cost_times,
    dual_residual,
    dynamics_times,
    iterate,
    largest,
    violations,
)
from drift_drake.drive.qp.qp import constraint_matrix, row_limits
from drift_drake.drive.qp.stages import StageBounds, StageRows, Stages
from drift_drake.drive.reference.trajectory import Reference

HORIZON = 4
TOLERANCE = {"rtol": 1e-12, "atol": 1e-11}


def dense_hessian(problem: OptimalControlProblem) -> np.ndarray:
    """The cost's, as the program holds it."""
    return np.asarray(problem.quadratic_costs()[0].evaluator().Q())


def test_products_by_stages_are_those_of_the_whole_matrices(references: dict[str, Reference]) -> None:
    vehicle, rng = VehicleParameters(), np.random.default_rng(3)
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, HORIZON)
    data = ocp_data(references["figure_8"], 20.0, HORIZON)
    problem.set(data)
    stages, columns = problem.stages, problem.layout.block_columns
    z = problem.first_guess(data) + 0.1 * rng.normal(size=problem.size)
    residual, f = problem.dynamics.linearize(z)
    matrix = constraint_matrix(stages, f).toarray()
    np.testing.assert_allclose(dynamics_times(f, columns, z), matrix[: residual.size] @ z, **TOLERANCE)
    low, high = (limit[residual.size :] for limit in row_limits(stages, np.zeros((HORIZON, 6))))
    rows = matrix[residual.size :] @ z
    outside = np.append(np.abs(residual), np.maximum(np.maximum(low - rows, rows - high), 0.0))
    np.testing.assert_allclose(violations(residual, stages, z), [outside.sum(), outside.max()], **TOLERANCE)

    blocks, whole = rng.normal(size=(HORIZON, 10, 10)), np.zeros((problem.size, problem.size))
    for block, place in zip(blocks, columns, strict=True):
        whole[np.ix_(place, place)] += block
    for times in (blocks_times(blocks, columns, z), cost_times(blocks, z)):
        np.testing.assert_allclose(times, whole @ z, **TOLERANCE)

    gradient, y = rng.normal(size=z.size), rng.normal(size=len(matrix))
    expected = np.abs(gradient + matrix.T @ y).max()
    assert dual_residual(gradient, stages, f, y) == pytest.approx(expected, rel=1e-12)

    slope, quadratic_slope, bend, model_bend = along(gradient, 2.0 * gradient, stages.hessian, blocks, columns, z)
    assert quadratic_slope == 2.0 * slope == pytest.approx(2.0 * gradient @ z, rel=1e-12)
    assert bend == pytest.approx(z @ dense_hessian(problem) @ z, rel=1e-12)
    assert model_bend == pytest.approx(z @ whole @ z, rel=1e-12)


@pytest.mark.parametrize("with_extra", [False, True])
def test_an_iterates_numbers_are_those_of_the_program(references: dict[str, Reference], with_extra: bool) -> None:
    vehicle, rng = VehicleParameters(), np.random.default_rng(5)
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, HORIZON)
    data = ocp_data(references["figure_8"], 20.0, HORIZON)
    problem.set(data)
    stages, linear = problem.stages, problem.stages.gradient
    z = problem.first_guess(data) + 0.1 * rng.normal(size=problem.size)
    residual, f = problem.dynamics.linearize(z)
    y, extra = rng.normal(size=stages.multiplier_count), rng.normal(size=z.size * with_extra)
    found = iterate(stages, extra, residual, f, z, y)
    bent = dense_hessian(problem) @ z
    np.testing.assert_allclose(found.quadratic_gradient, bent + linear, **TOLERANCE)
    np.testing.assert_allclose(found.gradient, bent + linear + (extra if with_extra else 0.0), **TOLERANCE)
    assert found.cost == pytest.approx(stages.constant + 0.5 * z @ bent + linear @ z, rel=1e-12)
    assert (found.violation, found.primal) == violations(residual, stages, z)
    dual = dual_residual(found.gradient, stages, f, y)
    assert found.dual == pytest.approx(dual / max(1.0, np.abs(y).max()), rel=1e-12)
    target = dynamics_times(f, stages.columns, z) - residual
    np.testing.assert_allclose(found.target.ravel(), target, **TOLERANCE)


def test_violations_are_those_of_both_sides_and_not_a_number_where_a_value_is_not() -> None:
    """One stage of one state, z = (x_0, x_1, u_0 [2], u_1 [2], slack), with bounds of x_1 and the slack."""
    values, residual = np.eye(4)[[0, 3]], np.array([0.25, -0.5])
    rows = StageRows("", np.array([1, 1]), values, np.array([-np.inf, -1.0]), np.array([1.0, np.inf]))
    columns, bounds = np.array([[0, 2, 3, 4, 5]]), StageBounds.of([rows], 1)
    stages = Stages(columns, np.array([[1, 4, 5, 6]]), np.zeros((1, 5, 5)), np.zeros(7), 0.0, np.zeros(3), bounds)
    assert violations(residual, stages, np.array([-2.0, 4.0, 0.0, 0.0, 0.0, 0.0, -0.5])) == (5.75, 3.0)
    assert violations(residual, stages, np.array([0.0, 1.0, 0.0, 0.0, 7.0, 0.0, 9.0])) == (0.75, 0.5)
    for at in (0, 1, 2, 6):
        z = np.zeros(7)
        z[at] = np.nan
        assert np.isnan(violations(residual, stages, z)).all()
    assert np.isnan(violations(np.array([np.nan, 0.0]), stages, np.zeros(7))).all()


def test_the_largest_magnitude_is_not_a_number_where_a_value_is_not() -> None:
    assert largest(np.array([1.0, -3.0, 2.0])) == 3.0
    assert largest(np.empty(0)) == 0.0
    for at in range(3):
        values = np.array([1.0, -3.0, 2.0])
        values[at] = np.nan
        assert np.isnan(largest(values))
