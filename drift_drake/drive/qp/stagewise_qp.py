"""The OCP's quadratic programs stage by stage, as the interior-point method takes them."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from drift_drake.car.compilation import compiled
from drift_drake.common.arrays import Array, Index
from drift_drake.drive.qp.interior_point import StageRows, interior_point


class LinearRows(NamedTuple):
    """Which rows fix the first state and input, and those of the stages k = 1..N one after the other.

    Each stage's end with its slack's own.
    """

    given: Index  # [n+2], of x_0 and u_0
    place: Index  # [R] of the others, in the program
    values: Array  # [R, n+3], by (x_k, u_k, slack_k)
    first: Index  # [N+1], where the rows of a stage begin


def by_stages(matrix: sparse.csr_matrix, horizon: int, size: int) -> LinearRows:
    """Sorts rows over a decision vector (x_0..x_N, u_0..u_N, slack_1..slack_N), x_k [size], u_k [2].

    Raises:
        ValueError: a row over several stages, one over the first (x, u) other than to fix them, or a slack without one
            of its own.
    """
    stages, carried = np.arange(horizon + 1), size + 2
    stage_of = np.concatenate([np.repeat(stages, size), np.repeat(stages, 2), stages[1:]])
    place_of = np.concatenate([np.tile(np.arange(size), horizon + 1), np.tile([size, size + 1], horizon + 1),
                               np.full(horizon, carried)])  # fmt: skip
    entries = sparse.coo_matrix(matrix)
    values = np.zeros((matrix.shape[0], carried + 1))
    values[entries.row, place_of[entries.col]] = entries.data
    stage = np.zeros(len(values), dtype=np.intp)
    stage[entries.row] = stage_of[entries.col]
    if (stage[entries.row] != stage_of[entries.col]).any():
        raise ValueError("a linear constraint holds variables of several stages; solve this program's QPs with OSQP")
    given = np.flatnonzero(stage == 0)
    given = given[np.argmax(values[given], axis=1).argsort()]
    if not np.array_equal(values[given], np.eye(carried, carried + 1)):
        raise ValueError("the first state and input are to be fixed, each variable by a row of its own")
    own = ~values[:, :carried].any(axis=1) & (values[:, carried] > 0.0)
    place = np.lexsort((own, stage))[given.size :]
    first = np.searchsorted(stage[place], np.arange(1, horizon + 2))
    if not (np.diff(first) > 0).all() or not own[place[first[1:] - 1]].all():
        raise ValueError("each stage's slack needs a bound of its own")
    return LinearRows(given, place, np.ascontiguousarray(values[place]), first)


@compiled
def one_sided(rows: LinearRows, low: Array, high: Array) -> tuple[StageRows, Index, Array]:
    """The bounds that there are, as inequalities from below; of each the row [M] that it is of, and 1 or -1 [M].

    Args:
        low, high: of the program's rows.
    """
    stages, carried = rows.first.size - 1, rows.values.shape[1] - 1
    most = 2 * rows.place.size
    row, softness, bound = np.empty((most, carried)), np.empty(most), np.empty(most)
    first, place, side = np.zeros(stages + 1, np.intp), np.empty(most, np.intp), np.empty(most)
    count = 0
    for k in range(stages):
        for r in range(rows.first[k], rows.first[k + 1]):
            for sign in (-1.0, 1.0):  # the lower bound last, as a slack's own row is
                limit = low[rows.place[r]] if sign > 0.0 else -high[rows.place[r]]
                if limit != -np.inf:
                    row[count] = sign * rows.values[r, :carried]
                    softness[count], bound[count] = sign * rows.values[r, carried], limit
                    place[count], side[count] = rows.place[r], sign
                    count += 1
        first[k + 1] = count
    return StageRows(row[:count], softness[:count], bound[:count], first), place[:count], side[:count]


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
