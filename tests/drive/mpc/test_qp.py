"""The SQP's quadratic programs: what OSQP is told of them, and the interior-point method beside it."""

import dataclasses
import signal
from typing import Any

import numpy as np
import osqp
import pytest
from control_problems import ocp_data

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.gathering.config import LaneDrive, bound_end, bound_slip, problem_data
from drift_drake.drive.mpc.ocp import OptimalControlProblem
from drift_drake.drive.qp.qp import LinearQuadraticPart, QpMethod, QpOptions, QpSolution, QpWorkspace
from drift_drake.drive.reference.trajectory import Reference

HORIZON = 2
LENGTH = 10  # of the QPs along a reference
STAGE_HESSIAN = OptimalControlProblem(NominalStepModel(VehicleParameters()), VehicleParameters(), 1).stage_hessian()
FAR = 1e5  # where the first states have to go: so far that the way there looks like a proof that there is none


def far_away(feasible: bool) -> QpSolution:
    """A QP whose equations -x_{k+1} / FAR = 1 have a solution, but a far one."""
    vehicle = VehicleParameters()
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, HORIZON)
    part = LinearQuadraticPart(problem)
    blocks = np.tile(problem.stage_hessian(), (HORIZON, 1, 1))
    options = QpOptions("osqp", 1e-6, 400, polish=False, rho=1.0, feasible=feasible)
    workspace = QpWorkspace(part, problem.dynamics, blocks, options)
    rows, columns = problem.dynamics.sparsity()
    following = problem.layout.state_size + rows  # the place of x_{k+1} in the row of its own equation
    workspace.set_jacobian(np.where(columns == following, -1.0 / FAR, 0.0))
    _, _, low, high = part.data()
    ones = np.ones(problem.dynamics.size)
    start = np.zeros(part.size), np.zeros(problem.dynamics.size + low.size)
    return workspace.solve(np.zeros(part.size), np.append(ones, low), np.append(ones, high), *start)


def test_a_solution_far_away_passes_for_none() -> None:
    assert far_away(feasible=False).status == "primal infeasible"


def test_a_qp_known_to_be_feasible_is_not_called_infeasible() -> None:
    solution = far_away(feasible=True)
    assert solution.status == "maximum iterations reached"
    assert solution.usable
    assert solution.z[: 6 * (HORIZON + 1)].min() < -1.0  # on its way


def test_ctrl_c_during_a_qp_is_not_osqps(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would take it for itself, say so, and leave the QP unsolved."""
    told, solve = [], osqp.OSQP.solve

    def solving(self: osqp.OSQP, **options: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        result = solve(self, **options)
        told.append(result.info.status)
        return result

    monkeypatch.setattr(osqp.OSQP, "solve", solving)
    before = signal.signal(signal.SIGINT, lambda *_: told.append("Ctrl-C"))
    try:
        far_away(feasible=True)
    finally:
        signal.signal(signal.SIGINT, before)
    assert told == ["maximum iterations reached", "Ctrl-C"]


OPTIONS = QpOptions("stagewise", 1e-4, 1, polish=False, rho=1.0, feasible=True, interior_tolerance=1e-7)


def workspace(reference: Reference | None, options: QpOptions = OPTIONS) -> tuple[QpWorkspace, list[tuple[Any, ...]]]:
    """A workspace, and QPs' arguments (first the Jacobian): at places of a reference, or of a lane drive's plan.

    OSQP is cut off at once, unless the options say otherwise. A lane drive's has further rows: slip and its end.
    """
    vehicle = VehicleParameters()
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, LENGTH)
    lane = LaneDrive(steps=LENGTH, v_end=10.0)
    if reference is None:
        bound_slip(problem, lane)
        bound_end(problem)
    part = LinearQuadraticPart(problem)
    qps = QpWorkspace(part, problem.dynamics, np.tile(STAGE_HESSIAN, (LENGTH, 1, 1)), options)
    arguments = []
    for s in (20.0, 40.0, 70.0):
        error = np.array([0.1, 0.5, 0.06, 0.5, 3.2, 0.05])  # outside the lane
        if reference is None:
            data = problem_data(lane)
            data = data._replace(x_init=data.x_init + s / 20.0 * error)  # and slipping
        else:
            data = ocp_data(reference, s, LENGTH, error)
        problem.set(data)
        z = problem.first_guess(data)
        residual, jacobian = problem.dynamics.linearize(z)
        gradient, _, low, high = part.data()
        qps.set_jacobian(jacobian)
        target = (qps.matrix @ z)[: residual.size] - residual
        start = np.zeros(part.size), np.zeros(target.size + low.size)
        arguments.append((jacobian, gradient, np.append(target, low), np.append(target, high), *start))
    return qps, arguments


def solve(qps: QpWorkspace, arguments: tuple[Any, ...], interior: bool = False) -> QpSolution:
    qps.set_jacobian(arguments[0])
    return qps.solve(*arguments[1:], interior)


@pytest.mark.parametrize("name", ["figure_8", None])
@pytest.mark.parametrize(
    ("method", "interior"), [("stagewise", False), ("osqp then stagewise", False), ("osqp then stagewise", True)]
)
def test_the_interior_point_method_meets_the_optimality_conditions(
    references: dict[str, Reference], method: QpMethod, interior: bool, name: str | None
) -> None:
    """Karush, Kuhn and Tucker's, with OSQP's signs of the multipliers."""
    qps, problems = workspace(name and references[name], dataclasses.replace(OPTIONS, method=method))
    for arguments in problems:
        found = solve(qps, arguments, interior)
        assert found.status == "solved"
        assert method == "stagewise" or found.second_attempt
        matrix = qps.matrix
        gradient, low, high = arguments[1:4]
        rows = matrix @ found.z
        blocks = np.tile(STAGE_HESSIAN, (LENGTH, 1, 1))
        stationary = qps.hessian.times(blocks, found.z) + gradient + matrix.T @ found.y
        np.testing.assert_allclose(stationary, 0.0, atol=1e-5)
        assert np.maximum(low - rows, rows - high).max() < 1e-5
        # A multiplier pushes from the bound that holds.
        assert (np.minimum(np.maximum(found.y, 0.0), high - rows) < 1e-3).all()
        assert (np.minimum(np.maximum(-found.y, 0.0), rows - low) < 1e-3).all()
        assert np.abs(found.y).max() > 1.0


@pytest.mark.parametrize("name", ["figure_8", None])
def test_the_two_methods_agree(references: dict[str, Reference], name: str | None) -> None:
    exact = QpOptions("osqp", 1e-10, 100_000, interior_tolerance=1e-10)
    reference = name and references[name]
    qps, problems = workspace(reference, exact)
    other, _ = workspace(reference, dataclasses.replace(exact, method="stagewise"))
    blocks = np.tile(STAGE_HESSIAN, (LENGTH, 1, 1))
    for arguments in problems:
        first, second = solve(qps, arguments), solve(other, arguments)
        assert first.status == second.status == "solved"
        costs = [arguments[1] @ z + 0.5 * z @ qps.hessian.times(blocks, z) for z in (first.z, second.z)]
        assert costs[0] == pytest.approx(costs[1], rel=1e-8)
        np.testing.assert_allclose(first.z, second.z, atol=1e-6)


def test_the_interior_point_method_replays_to_the_bit(references: dict[str, Reference]) -> None:
    qps, problems = workspace(references["figure_8"], dataclasses.replace(OPTIONS, method="osqp then stagewise"))
    first = [solve(qps, arguments) for arguments in problems]
    for index in (2, 0, 0, 1, 2, 1):
        again = solve(qps, problems[index])
        np.testing.assert_array_equal(again.z, first[index].z)
        np.testing.assert_array_equal(again.y, first[index].y)


def test_a_qp_without_a_solution_stays_unsolved(references: dict[str, Reference]) -> None:
    qps, problems = workspace(references["figure_8"])
    jacobian, gradient, low, high, *start = problems[0]
    inputs = slice(-3 * LENGTH, -LENGTH)
    low[inputs], high[inputs] = 1.0, -1.0
    assert solve(qps, (jacobian, gradient, low, high, *start)).status != "solved"
