"""The SQP's quadratic programs: what OSQP is told of them."""

import numpy as np

from drift_drake.control.ocp import OptimalControlProblem
from drift_drake.control.qp import LinearQuadraticPart, QpSolution, QpWorkspace
from drift_drake.control.step_model import NominalStepModel
from drift_drake.vehicle.parameters import VehicleParameters

HORIZON = 2
FAR = 1e5  # where the first states have to go: so far that the way there looks like a proof that there is none


def far_away(feasible: bool) -> QpSolution:
    """A QP whose equations -x_{k+1} / FAR = 1 have a solution, but a far one."""
    vehicle = VehicleParameters()
    problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, HORIZON)
    part = LinearQuadraticPart(problem.program)
    blocks = np.tile(problem.stage_hessian(), (HORIZON, 1, 1))
    workspace = QpWorkspace(part, problem.dynamics, blocks, 1e-6, 400, False, 1.0, feasible)
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
