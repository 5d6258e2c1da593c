"""The quadratic programs of the SQP: the methods there are, and one persistent workspace."""

import dataclasses
import warnings
from typing import Literal, NamedTuple

import numpy as np
import osqp
import scipy.sparse as sparse

from drift_drake.common.arrays import Array
from drift_drake.common.interruption import ctrl_c_waits
from drift_drake.drive.qp.interior_point import FIRST_ATTEMPT
from drift_drake.drive.qp.stages import Stages, dynamics_pattern
from drift_drake.drive.qp.stagewise_qp import solve_stages

QpMethod = Literal["osqp", "stagewise"]


class QpSolution(NamedTuple):
    """A QP's primal and dual solution, and how it was found."""

    z: Array
    y: Array
    status: str  # in OSQP's words
    iterations: int
    second_attempt: bool = False  # the interior-point method's first start did not solve it

    @property
    def usable(self) -> bool:
        """Whether the iterate may serve as a search direction: solved, or stopped early with a finite iterate."""
        return self.status.startswith(("solved", "maximum iterations")) and bool(np.isfinite(self.z).all())


@dataclasses.dataclass(frozen=True)
class QpOptions:
    """How QPs are solved; tolerances are in the program's scaled variables."""

    method: QpMethod = "stagewise"
    tolerance: float = 1e-9  # OSQP's
    max_iterations: int = 20000  # OSQP's
    polish: bool = True
    rho: float = 0.1
    feasible: bool = False  # every QP is known to have a feasible point
    interior_tolerance: float = 1e-9  # of the interior-point method


class StagesByOsqp:
    """OSQP on rows [dynamics; given; bounds], in matrices of a fixed pattern: each QP updates numbers only.

    The variables are of order one, so OSQP's own scaling is off. Its step length rho is fixed and the start is given
    with each solve, so that a solution depends on nothing but its arguments and a run replays to the bit.
    """

    def __init__(self, stages: Stages, options: QpOptions) -> None:
        columns, size = stages.columns, stages.gradient.size
        row = np.broadcast_to(columns[:, :, None], stages.hessian.shape)
        column = np.swapaxes(row, 1, 2)
        self._upper = row <= column
        key = column[self._upper] * size + row[self._upper]  # in the order of compressed columns
        places, self._place = np.unique(key, return_inverse=True)
        hessian = sparse.csc_matrix((self._hessian(stages.hessian), (places % size, places // size)), (size, size))
        # Numbering the entries before the conversion to compressed columns tells where each of them lands.
        entries = constraint_matrix(stages, np.ones((len(columns), stages.state_size, columns.shape[1])))
        numbers = sparse.csc_matrix((np.arange(1.0, entries.nnz + 1.0), entries.coords), entries.shape)
        self._order = numbers.data.astype(np.intp) - 1
        self._entries = entries.data
        self._solver = osqp.OSQP()
        self._solver.setup(
            hessian,
            np.zeros(size),
            sparse.csc_matrix(entries),
            *row_limits(stages, np.zeros((len(columns), stages.state_size))),
            verbose=False,
            scaling=0,
            rho=options.rho,
            adaptive_rho=False,
            eps_abs=options.tolerance,
            eps_rel=options.tolerance,
            max_iter=options.max_iterations,
            polishing=options.polish,
            check_termination=10,
            # Slow convergence can pass for a certificate of infeasibility: not looked for where there can be none.
            eps_prim_inf=1e-12 if options.feasible else 1e-4,
        )

    def _hessian(self, blocks: Array) -> Array:
        """The entries of the upper triangle of a sum of overlapping blocks, its zeros too."""
        return np.bincount(self._place, blocks[self._upper]).astype(float)

    def solve(self, stages: Stages, f: Array, target: Array, z: Array, y: Array) -> QpSolution:
        """See `QpWorkspace.solve`."""
        self._entries[: f.size] = f.ravel()
        low, high = row_limits(stages, target)
        hessian, matrix = self._hessian(stages.hessian), self._entries[self._order]
        self._solver.update(Px=hessian, Ax=matrix, q=stages.gradient, l=low, u=high)
        self._solver.warm_start(x=z, y=y)
        # OSQP answers Ctrl-C itself: with a line of its own, and as a QP that cannot be solved.
        with warnings.catch_warnings(), ctrl_c_waits():
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            result = self._solver.solve(raise_error=False)
        if result.info.status_val == osqp.SolverStatus.OSQP_SIGINT:  # another thread was given it
            raise KeyboardInterrupt
        return QpSolution(np.array(result.x), np.array(result.y), result.info.status, int(result.info.iter))


def constraint_matrix(stages: Stages, f: Array) -> sparse.coo_matrix:
    """Rows [dynamics; given; bounds]; the entries of F_k [N, n, n+4] come first."""
    count, n, bounds = len(stages.columns), stages.state_size, stages.bounds
    rows, columns = dynamics_pattern(stages.columns)
    given = np.append(np.arange(n), n * (count + 1) + np.arange(2))
    stage = np.repeat(np.arange(count), np.diff(bounds.first))
    row, place = np.nonzero(bounds.values)
    data = np.concatenate([f.ravel(), np.full(count * n, -1.0), np.ones(n + 2), bounds.values[row, place]])
    rows = np.concatenate([rows, count * n + np.arange(n + 2), count * n + n + 2 + row])
    columns = np.concatenate([columns, given, stages.bound_columns[stage[row], place]])
    return sparse.coo_matrix((data, (rows, columns)), (stages.multiplier_count, stages.gradient.size))


def row_limits(stages: Stages, target: Array) -> tuple[Array, Array]:
    """(low, high) of the `constraint_matrix`'s rows."""
    fixed = target.ravel(), stages.given
    return np.concatenate([*fixed, stages.bounds.low]), np.concatenate([*fixed, stages.bounds.high])


class QpWorkspace:
    """Solves QPs of one pattern by an interior-point method that uses their stages, or by OSQP."""

    def __init__(self, stages: Stages, options: QpOptions) -> None:
        self._tolerance = options.interior_tolerance
        self._osqp = StagesByOsqp(stages, options) if options.method == "osqp" else None

    def solve(self, stages: Stages, f: Array, target: Array, z: Array, y: Array) -> QpSolution:
        """Solves the QP of the stages and of the dynamics F_k z_k - x_{k+1} = target_k, from (z, y)."""
        if self._osqp is not None:
            return self._osqp.solve(stages, f, target, z, y)
        z, y, solved, count = solve_stages(stages, f, target, z, self._tolerance)
        status = "solved" if solved else "maximum iterations reached"
        return QpSolution(z, y, status, count, count > FIRST_ATTEMPT)
