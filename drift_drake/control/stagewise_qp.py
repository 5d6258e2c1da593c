"""The OCP's quadratic programs stage by stage, as the interior-point method takes them."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drift_drake.control.interior_point import ROWS, interior_point

Array = NDArray[np.float64]


class StagewiseProblem(NamedTuple):
    """min sum_k 1/2 z_k' H_k z_k + linear terms + penalty sum_k slack_k, z_k = (x_k, u_k, u_{k+1}), scaled variables.

    Subject to F_k z_k - x_{k+1} = target_k, the first (x, u) given, bounds on u_1..u_N, and e_k within the lane of
    k = 1..N but for a slack of zero or more.
    """

    f: Array  # [N, n, n+4]
    hessian: Array  # [N, n+4, n+4], positive semidefinite
    gradient_x: Array  # [N+1, n], at zero
    gradient_u: Array  # [N+1, 2], at zero
    penalty: Array  # [N], above zero
    target: Array  # [N, n]
    u_low: Array  # [N, 2]
    u_high: Array  # [N, 2]
    lane: Array  # [N, 2] (e_min, e_max); infinite where there is none


class StagewiseSolution(NamedTuple):
    """The solution, its multipliers, and how it was found."""

    x: Array  # [N+1, n]
    u: Array  # [N+1, 2]
    slack: Array  # [N]
    costate: Array  # [N+1, n+2], of (x_k, u_k); in x_k, k >= 1, the multipliers of the dynamics
    multipliers: Array  # [N, 7], zero or above: lower, upper of u_0, of u_1; e_min, e_max; slack
    iterations: int
    solved: bool


def solve_stagewise(problem: StagewiseProblem, x: Array, u: Array, tolerance: float) -> StagewiseSolution:
    """Solves a QP.

    Args:
        x [N+1, n], u [N+1, 2]: a trajectory to start from, whose first rows are the given state and input.
        tolerance: on the primal residual, the mean complementarity, and the dual residual over the largest multiplier.
    """
    x, u, slack = np.array(x), np.array(u), np.empty(len(problem.f))
    costate, multipliers = np.empty((len(x), x.shape[1] + 2)), np.empty((len(slack), ROWS))
    found = interior_point(*problem, tolerance, x, u, slack, costate, multipliers)
    return StagewiseSolution(x, u, slack, costate, multipliers, *found)


class StagewiseQp:
    """QPs with the rows of an `OptimalControlProblem`: the dynamics, then as in its linear-quadratic part.

    These are the lane (e + slack >= e_min, e - slack <= e_max), initial state, command in force, inputs, slack.
    """

    def __init__(self, horizon: int, state_size: int, blocks: Array, tolerance: float) -> None:
        """Args: blocks: the Hessian's [N, n+4, n+4]; tolerance: see `solve_stagewise`."""
        self._horizon, self._size, self._tolerance = horizon, state_size, tolerance
        self.set_hessian(blocks)
        self._f = np.empty((horizon, state_size, state_size + 4))

    @property
    def row_count(self) -> int:
        """Of equations and inequalities."""
        return self._horizon * (self._size + 5) + self._size + 2

    def set_hessian(self, blocks: Array) -> None:
        """Takes the Hessian as the sum of positive semidefinite stage blocks [N, n+4, n+4]."""
        self._hessian = np.ascontiguousarray(blocks)

    def set_jacobian(self, jacobian: Array) -> None:
        """Takes the dynamics' Jacobian entries, in the order of `StackedDynamics.sparsity`."""
        self._f = jacobian[: self._f.size].reshape(self._f.shape)

    def solve(self, gradient: Array, low: Array, high: Array, z: Array) -> tuple[Array, Array, bool, int]:
        """(z, multipliers in OSQP's sign and order, whether it is solved, iterations), from the decision vector z."""
        count, n = self._horizon, self._size
        states, inputs = n * (count + 1), 2 * (count + 1)
        rows = np.cumsum([0, n * count, count, count, n, 2, 2 * count])
        dynamics, above, below, first_x, first_u, bounds = (slice(*pair) for pair in pairwise(rows))
        problem = StagewiseProblem(
            self._f, self._hessian, gradient[:states].reshape(-1, n),
            gradient[states : states + inputs].reshape(-1, 2), gradient[states + inputs :],
            low[dynamics].reshape(-1, n), low[bounds].reshape(-1, 2), high[bounds].reshape(-1, 2),
            np.stack([low[above], high[below]], axis=1),
        )  # fmt: skip
        x, u = z[:states].reshape(-1, n).copy(), z[states : states + inputs].reshape(-1, 2).copy()
        x[0], u[0] = low[first_x], low[first_u]
        found = solve_stagewise(problem, x, u, self._tolerance)
        y, pushed = np.empty(self.row_count), found.multipliers
        y[dynamics] = found.costate[1:, :n].ravel()
        y[above], y[below] = -pushed[:, 4], pushed[:, 5]
        y[first_x], y[first_u] = -found.costate[0, :n], -found.costate[0, n:]
        y[bounds] = (pushed[:, 1:4:2] - pushed[:, 0:4:2]).ravel()
        y[rows[-1] :] = -pushed[:, 6]
        return np.concatenate([found.x.ravel(), found.u.ravel(), found.slack]), y, found.solved, found.iterations
