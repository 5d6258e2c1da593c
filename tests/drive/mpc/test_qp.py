"""The SQP's quadratic programs: what OSQP is given, and the interior-point method."""

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
from drift_drake.drive.qp.products import cost_times
from drift_drake.drive.qp.qp import QpOptions, QpSolution, QpWorkspace, constraint_matrix, row_limits
from drift_drake.drive.qp.stages import Stages
from drift_drake.drive.reference.trajectory import Reference

HORIZON = 2
LENGTH = 10  # of the QPs along a reference
FAR = 1e5  # where the slacks have to go: so far that the way there looks like a proof that there is none


def far_away(feasible: bool) -> QpSolution:
    """A QP whose bounds slack_k / FAR >= 1 have a solution, but a far one."""
    vehicle = VehicleParameters()
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, HORIZON)
    options = QpOptions("osqp", 1e-6, 400, polish=False, rho=1.0, feasible=feasible)
    stages, size = problem.stages, problem.layout.state_size
    values, low, lane = stages.bounds.values.copy(), stages.bounds.low.copy(), stages.bounds.first[:-1]
    values[lane], low[lane] = np.eye(size + 3)[-1] / FAR, 1.0
    stages = stages._replace(bounds=stages.bounds._replace(values=values, low=low))
    workspace, zeros = QpWorkspace(stages, options), np.zeros((HORIZON, size))
    start = np.zeros(problem.size), np.zeros(stages.multiplier_count)
    return workspace.solve(stages, np.zeros((HORIZON, size, size + 4)), zeros, *start)


def test_a_solution_far_away_passes_for_none() -> None:
    assert far_away(feasible=False).status == "primal infeasible"


def test_a_qp_known_to_be_feasible_is_not_called_infeasible() -> None:
    solution = far_away(feasible=True)
    assert solution.status == "maximum iterations reached"
    assert solution.usable
    assert solution.z[-HORIZON:].min() > 1.0  # on its way


def test_ctrl_c_during_a_qp_is_not_osqps(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would take it for itself, say so, and leave the QP unsolved."""
    reported, solve = [], osqp.OSQP.solve

    def solving(self: osqp.OSQP, **options: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        result = solve(self, **options)
        reported.append(result.info.status)
        return result

    monkeypatch.setattr(osqp.OSQP, "solve", solving)
    before = signal.signal(signal.SIGINT, lambda *_: reported.append("Ctrl-C"))
    try:
        far_away(feasible=True)
    finally:
        signal.signal(signal.SIGINT, before)
    assert reported == ["maximum iterations reached", "Ctrl-C"]


OPTIONS = QpOptions("stagewise", 1e-4, 1, polish=False, rho=1.0, feasible=True, interior_tolerance=1e-7)


Arguments = tuple[Stages, np.ndarray, np.ndarray]  # stages, F_k, target


def workspace(reference: Reference | None, options: QpOptions = OPTIONS) -> tuple[QpWorkspace, list[Arguments]]:
    """A workspace, and QPs: at places of a reference, or of a lane drive's plan.

    OSQP is cut off at once, unless the options say otherwise. A lane drive's has further rows: slip and its end.
    """
    vehicle = VehicleParameters()
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, LENGTH)
    lane = LaneDrive(steps=LENGTH, v_end=10.0)
    if reference is None:
        bound_slip(problem, lane)
        bound_end(problem)
    qps, arguments = QpWorkspace(problem.stages, options), []
    for s in (20.0, 40.0, 70.0):
        error = np.array([0.1, 0.5, 0.06, 0.5, 3.2, 0.05])  # outside the lane
        if reference is None:
            data = problem_data(lane)
            data = data._replace(x_init=data.x_init + s / 20.0 * error)  # and slipping
        else:
            data = ocp_data(reference, s, LENGTH, error)
        problem.set(data)
        z = problem.first_guess(data)
        residual, f = problem.dynamics.linearize(z)
        target = (constraint_matrix(problem.stages, f) @ z)[: residual.size] - residual
        arguments.append((problem.stages, f, target.reshape(LENGTH, -1)))
    return qps, arguments


def solve(qps: QpWorkspace, arguments: Arguments) -> QpSolution:
    stages = arguments[0]
    return qps.solve(*arguments, np.zeros(stages.gradient.size), np.zeros(stages.multiplier_count))


@pytest.mark.parametrize("name", ["figure_8", None])
def test_the_interior_point_method_meets_the_optimality_conditions(
    references: dict[str, Reference], name: str | None
) -> None:
    """Karush, Kuhn and Tucker's, with OSQP's signs of the multipliers."""
    qps, problems = workspace(name and references[name], OPTIONS)
    for arguments in problems:
        found = solve(qps, arguments)
        assert found.status == "solved"
        stages, f, target = arguments
        matrix, (low, high) = constraint_matrix(stages, f), row_limits(stages, target)
        rows = matrix @ found.z
        stationary = cost_times(stages.hessian, found.z) + stages.gradient + matrix.T @ found.y
        np.testing.assert_allclose(stationary, 0.0, atol=1e-5)
        assert np.maximum(low - rows, rows - high).max() < 1e-5
        # A multiplier acts from the bound that holds.
        assert (np.minimum(np.maximum(found.y, 0.0), high - rows) < 1e-3).all()
        assert (np.minimum(np.maximum(-found.y, 0.0), rows - low) < 1e-3).all()
        assert np.abs(found.y).max() > 1.0


@pytest.mark.parametrize("name", ["figure_8", None])
def test_the_two_methods_agree(references: dict[str, Reference], name: str | None) -> None:
    exact = QpOptions("osqp", 1e-10, 100_000, interior_tolerance=1e-10)
    reference = name and references[name]
    qps, problems = workspace(reference, exact)
    other, _ = workspace(reference, dataclasses.replace(exact, method="stagewise"))
    for arguments in problems:
        stages = arguments[0]
        first, second = solve(qps, arguments), solve(other, arguments)
        assert first.status == second.status == "solved"
        costs = [stages.gradient @ z + 0.5 * z @ cost_times(stages.hessian, z) for z in (first.z, second.z)]
        assert costs[0] == pytest.approx(costs[1], rel=1e-8)
        np.testing.assert_allclose(first.z, second.z, atol=1e-6)


def test_the_interior_point_method_replays_to_the_bit(references: dict[str, Reference]) -> None:
    qps, problems = workspace(references["figure_8"], OPTIONS)
    first = [solve(qps, arguments) for arguments in problems]
    for index in (2, 0, 0, 1, 2, 1):
        again = solve(qps, problems[index])
        np.testing.assert_array_equal(again.z, first[index].z)
        np.testing.assert_array_equal(again.y, first[index].y)


def test_a_qp_without_a_solution_stays_unsolved(references: dict[str, Reference]) -> None:
    qps, problems = workspace(references["figure_8"])
    stages, f, target = problems[0]
    rows, high = stages.bounds.first[1:] - 2, stages.bounds.high.copy()  # of torque
    high[rows] = stages.bounds.low[rows] - 1.0
    stages = stages._replace(bounds=stages.bounds._replace(high=high))
    assert solve(qps, (stages, f, target)).status != "solved"
