"""The OCP's quadratic programs stage by stage, as the interior-point method takes them."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from drift_drake.arrays import Array
from drift_drake.control.interior_point import StageRows, interior_point
from drift_drake.control.stage_rows import by_stages, one_sided


class StagewiseProblem(NamedTuple):
    """min sum_k 1/2 z_k' H_k z_k + linear terms + penalty sum_k slack_k, z_k = (x_k, u_k, u_{k+1}), scaled variables.

    Subject to F_k z_k - x_{k+1} = target_k, the first (x, u) given, and the inequalities of k = 1..N.
    """

    f: Array  # [N, n, n+4]
    hessian: Array  # [N, n+4, n+4], positive semidefinite
    gradient_x: Array  # [N+1, n], at zero
    gradient_u: Array  # [N+1, 2], at zero
    penalty: Array  # [N], above zero
    target: Array  # [N, n]
    rows: StageRows


class StagewiseSolution(NamedTuple):
    """The solution, its multipliers, and how it was found."""

    x: Array  # [N+1, n]
    u: Array  # [N+1, 2]
    slack: Array  # [N]
    costate: Array  # [N+1, n+2], of (x_k, u_k); in x_k, k >= 1, the multipliers of the dynamics
    multipliers: Array  # [M] of the inequalities, zero or above
    iterations: int
    solved: bool


def solve_stagewise(problem: StagewiseProblem, x: Array, u: Array, tolerance: float) -> StagewiseSolution:
    """Solves a QP.

    Args:
        x [N+1, n], u [N+1, 2]: a trajectory to start from, whose first rows are the given state and input.
        tolerance: on the primal residual, the mean complementarity, and the dual residual over the largest multiplier.
    """
    x, u, slack = np.array(x), np.array(u), np.empty(len(problem.f))
    costate, multipliers = np.empty((len(x), x.shape[1] + 2)), np.empty(problem.rows.bound.size)
    found = interior_point(*problem, tolerance, x, u, slack, costate, multipliers)
    return StagewiseSolution(x, u, slack, costate, multipliers, *found)


class StagewiseQp:
    """QPs in the decision vector of an `OptimalControlProblem`, with rows [dynamics; linear rows].

    Of the linear rows, low <= row z <= high, each may hold the variables of one stage: (x_k, u_k, slack_k).
    """

    def __init__(
        self, horizon: int, state_size: int, blocks: Array, linear_rows: sparse.csr_matrix, tolerance: float
    ) -> None:
        """Args: blocks: the Hessian's [N, n+4, n+4]; tolerance: see `solve_stagewise`.

        Raises:
            ValueError: rows of another kind; the message says which.
        """
        self._horizon, self._size, self._tolerance = horizon, state_size, tolerance
        self.set_hessian(blocks)
        self._f = np.empty((horizon, state_size, state_size + 4))
        self._rows = by_stages(linear_rows, horizon, state_size)

    def set_hessian(self, blocks: Array) -> None:
        """Takes the Hessian as the sum of positive semidefinite stage blocks [N, n+4, n+4]."""
        self._hessian = np.ascontiguousarray(blocks)

    def set_jacobian(self, jacobian: Array) -> None:
        """Takes the dynamics' Jacobian entries, in the order of `StackedDynamics.sparsity`."""
        self._f = jacobian[: self._f.size].reshape(self._f.shape)

    def solve(self, gradient: Array, low: Array, high: Array, z: Array) -> tuple[Array, Array, bool, int]:
        """(z, multipliers in OSQP's sign and order, whether it is solved, iterations), from the decision vector z."""
        count, n = self._horizon, self._size
        states, inputs, equations = n * (count + 1), (n + 2) * (count + 1), n * count
        target, low, high = low[:equations].reshape(-1, n), low[equations:], high[equations:]
        rows, place, side = one_sided(self._rows, low, high)
        problem = StagewiseProblem(
            self._f, self._hessian, gradient[:states].reshape(-1, n), gradient[states:inputs].reshape(-1, 2),
            gradient[inputs:], target, rows,
        )  # fmt: skip
        x, u = z[:states].reshape(-1, n).copy(), z[states:inputs].reshape(-1, 2).copy()
        given = low[self._rows.given]
        x[0], u[0] = given[:n], given[n:]
        found = solve_stagewise(problem, x, u, self._tolerance)
        by_row = np.bincount(place, -side * found.multipliers, low.size).astype(float)
        by_row[self._rows.given] = -found.costate[0]
        y = np.concatenate([found.costate[1:, :n].ravel(), by_row])
        return np.concatenate([found.x.ravel(), found.u.ravel(), found.slack]), y, found.solved, found.iterations
