"""The compiled products of an SQP iteration against the same matrices written out."""

import numpy as np
import pytest
from control_problems import ocp_data

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.mpc.ocp import OptimalControlProblem
from drift_drake.drive.qp.products import (
    Rows,
    along,
    blocks_times,
    dual_residual,
    dynamics_times,
    iterate,
    largest,
    rows_times,
    violations,
)
from drift_drake.drive.qp.qp import LinearQuadraticPart, QpOptions, QpWorkspace
from drift_drake.drive.reference.trajectory import Reference

HORIZON = 4
TOLERANCE = {"rtol": 1e-12, "atol": 1e-11}


def test_products_by_stages_are_those_of_the_whole_matrices(references: dict[str, Reference]) -> None:
    vehicle, rng = VehicleParameters(), np.random.default_rng(3)
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, HORIZON)
    part, columns = LinearQuadraticPart(problem), problem.layout.block_columns
    data = ocp_data(references["figure_8"], 20.0, HORIZON)
    problem.set(data)
    z = problem.first_guess(data) + 0.1 * rng.normal(size=problem.size)
    residual, jacobian = problem.dynamics.linearize(z)
    workspace = QpWorkspace(part, problem.dynamics, np.tile(problem.stage_hessian(), (HORIZON, 1, 1)), QpOptions())
    workspace.set_jacobian(jacobian)
    matrix, f = workspace.matrix.toarray(), problem.dynamics.by_stages(jacobian)
    np.testing.assert_allclose(dynamics_times(f, columns, z), matrix[: residual.size] @ z, **TOLERANCE)
    linear = Rows.of(part.matrix)
    np.testing.assert_allclose(rows_times(linear, z), part.matrix.toarray() @ z, **TOLERANCE)

    blocks, whole = rng.normal(size=(HORIZON, 10, 10)), np.zeros((problem.size, problem.size))
    for block, place in zip(blocks, columns, strict=True):
        whole[np.ix_(place, place)] += block
    np.testing.assert_allclose(blocks_times(blocks, columns, z), whole @ z, **TOLERANCE)

    gradient, y = rng.normal(size=z.size), rng.normal(size=len(matrix))
    expected = np.abs(gradient + matrix.T @ y).max()
    assert dual_residual(gradient, f, columns, linear, y) == pytest.approx(expected, rel=1e-12)

    slope, quadratic_slope, bend, model_bend = along(
        gradient, 2.0 * gradient, Rows.of(part.hessian), blocks, columns, z
    )
    assert quadratic_slope == 2.0 * slope == pytest.approx(2.0 * gradient @ z, rel=1e-12)
    assert bend == pytest.approx(z @ part.hessian.toarray() @ z, rel=1e-12)
    assert model_bend == pytest.approx(z @ whole @ z, rel=1e-12)


@pytest.mark.parametrize("beside", [False, True])
def test_an_iterates_numbers_are_those_of_the_program(references: dict[str, Reference], beside: bool) -> None:
    vehicle, rng = VehicleParameters(), np.random.default_rng(5)
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, HORIZON)
    part, columns = LinearQuadraticPart(problem), problem.layout.block_columns
    data = ocp_data(references["figure_8"], 20.0, HORIZON)
    problem.set(data)
    linear, constant, low, high = part.data()
    z = problem.first_guess(data) + 0.1 * rng.normal(size=problem.size)
    residual, jacobian = problem.dynamics.linearize(z)
    y = rng.normal(size=residual.size + part.matrix.shape[0])
    f, rows, extra = problem.dynamics.by_stages(jacobian), Rows.of(part.matrix), rng.normal(size=z.size * beside)
    found = iterate(Rows.of(part.hessian), linear, constant, extra, residual, f, columns, rows, low, high, z, y)
    bent = part.hessian.toarray() @ z
    np.testing.assert_allclose(found.quadratic_gradient, bent + linear, **TOLERANCE)
    np.testing.assert_allclose(found.gradient, bent + linear + (extra if beside else 0.0), **TOLERANCE)
    assert found.cost == pytest.approx(constant + 0.5 * z @ bent + linear @ z, rel=1e-12)
    assert (found.violation, found.primal) == violations(residual, rows, z, low, high)
    dual = dual_residual(found.gradient, f, columns, rows, y)
    assert found.dual == pytest.approx(dual / max(1.0, np.abs(y).max()), rel=1e-12)
    target = dynamics_times(f, columns, z) - residual
    np.testing.assert_allclose(found.low, np.concatenate([target, low]), **TOLERANCE)
    np.testing.assert_allclose(found.high, np.concatenate([target, high]), **TOLERANCE)


def test_violations_are_those_of_both_sides_and_not_a_number_where_a_value_is_not() -> None:
    rows, residual = Rows.of(np.eye(3)), np.array([0.25, -0.5])
    low, high = np.array([0.0, -np.inf, -1.0]), np.array([0.0, 1.0, np.inf])
    assert violations(residual, rows, np.array([-2.0, 4.0, -0.5]), low, high) == (5.75, 3.0)
    assert violations(residual, rows, np.array([0.0, 1.0, 9.0]), low, high) == (0.75, 0.5)
    for at in range(3):
        z = np.zeros(3)
        z[at] = np.nan
        assert np.isnan(violations(residual, rows, z, low, high)).all()
    assert np.isnan(violations(np.array([np.nan, 0.0]), rows, np.zeros(3), low, high)).all()


def test_the_largest_magnitude_is_not_a_number_where_a_value_is_not() -> None:
    assert largest(np.array([1.0, -3.0, 2.0])) == 3.0
    assert largest(np.empty(0)) == 0.0
    for at in range(3):
        values = np.array([1.0, -3.0, 2.0])
        values[at] = np.nan
        assert np.isnan(largest(values))
