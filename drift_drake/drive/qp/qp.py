"""The quadratic programs of the SQP: a MathematicalProgram's linear-quadratic part, and one persistent workspace.

The workspace has a fixed sparsity; each subproblem updates numbers only. The program's variables are of order one, so
OSQP's own scaling is off. Its step length rho is fixed and the start is given with each solve, so that a solution
depends on nothing but its arguments and a run replays to the bit.
"""

import dataclasses
import time
import warnings
from typing import Any, Literal, NamedTuple

import numpy as np
import osqp
import scipy.sparse as sparse
from numpy.typing import NDArray
from pydrake.solvers import MathematicalProgram

from drift_drake.common.arrays import Array
from drift_drake.common.interruption import ctrl_c_waits
from drift_drake.drive.qp.interior_point import FIRST_ATTEMPT
from drift_drake.drive.qp.products import blocks_times
from drift_drake.drive.qp.stacked import StackedDynamics
from drift_drake.drive.qp.stagewise_qp import StagewiseQp

QpMethod = Literal["osqp", "osqp then stagewise", "stagewise"]


class LinearQuadraticPart:
    """Costs and linear constraints of a program, low <= A z <= high.

    Rows: linear constraints (each scaled to a largest entry of one), then one row per bounded variable.
    """

    def __init__(self, program: MathematicalProgram) -> None:
        self._program = program
        self.size = program.num_vars()
        self._linear_costs = [(b.evaluator(), self._indices(b)) for b in program.linear_costs()]
        self._linear_constraints = [b.evaluator() for b in program.linear_constraints()]
        self._boxes = [(b.evaluator(), self._indices(b)) for b in program.bounding_box_constraints()]
        self.constant = 0.0
        hessian = sparse.csc_matrix((self.size, self.size))
        gradient = np.zeros(self.size)
        for binding in program.quadratic_costs():
            cost, index = binding.evaluator(), self._indices(binding)
            selection = self._selection(index)
            hessian = hessian + selection.T @ sparse.csc_matrix(cost.Q()) @ selection
            gradient[index] += cost.b()
            self.constant += cost.c()
        self.hessian = sparse.csc_matrix(hessian)
        self._quadratic_gradient = gradient
        self.matrix = self._constraint_matrix()

    def _indices(self, binding: Any) -> NDArray[np.intp]:
        return np.asarray(self._program.FindDecisionVariableIndices(binding.variables()), dtype=np.intp)

    def _selection(self, index: NDArray[np.intp]) -> sparse.csr_matrix:
        """The matrix that picks these variables."""
        return sparse.csr_matrix((np.ones(index.size), (np.arange(index.size), index)), (index.size, self.size))

    def _constraint_matrix(self) -> sparse.csr_matrix:
        blocks = []
        for binding in self._program.linear_constraints():
            index = self._indices(binding)
            block = sparse.coo_matrix(binding.evaluator().get_sparse_A())
            blocks.append(sparse.csr_matrix((block.data, (block.row, index[block.col])), (block.shape[0], self.size)))
        blocks += [self._selection(index) for _, index in self._boxes]
        matrix = sparse.vstack(blocks, format="csr")
        self.row_scale = 1.0 / abs(matrix).max(axis=1).toarray().ravel()
        return sparse.csr_matrix(sparse.diags(self.row_scale) @ matrix)

    def data(self) -> tuple[Array, float, Array, Array]:
        """(gradient at zero, constant, low, high) as the program holds them now."""
        gradient, constant = self._quadratic_gradient.copy(), self.constant
        for cost, index in self._linear_costs:
            gradient[index] += cost.a()
            constant += cost.b()
        low = [c.lower_bound() for c in self._linear_constraints] + [box.lower_bound() for box, _ in self._boxes]
        high = [c.upper_bound() for c in self._linear_constraints] + [box.upper_bound() for box, _ in self._boxes]
        return gradient, constant, np.concatenate(low) * self.row_scale, np.concatenate(high) * self.row_scale


class QpSolution(NamedTuple):
    """A QP's primal and dual solution, and how it was found."""

    z: Array
    y: Array
    status: str  # in OSQP's words
    iterations: int
    second_attempt: bool = False  # the first method, or its first start, did not solve it
    cpu: float = 0.0  # [s] of CPU time; with the wall times the one number that does not replay

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


class BlockHessian:
    """The upper triangle of a sum of overlapping blocks, as OSQP wants it, with a fixed pattern."""

    def __init__(self, columns: NDArray[np.intp], size: int) -> None:
        self.columns = columns
        row = np.broadcast_to(columns[:, :, None], (*columns.shape, columns.shape[1]))
        column = np.swapaxes(row, 1, 2)
        self._upper = row <= column
        key = column[self._upper] * size + row[self._upper]  # in the order of compressed columns
        places, self._entry = np.unique(key, return_inverse=True)
        self._rows, self._columns, self._size = places % size, places // size, size

    def values(self, blocks: Array) -> Array:
        """The entries of the sum, in the order of `matrix`."""
        return np.bincount(self._entry, blocks[self._upper], self._rows.size).astype(float)

    def times(self, blocks: Array, z: Array) -> Array:
        """The sum times a vector."""
        return blocks_times(blocks, self.columns, z)

    def matrix(self, blocks: Array) -> sparse.csc_matrix:
        """The sum's upper triangle, its zeros stored."""
        return sparse.csc_matrix((self.values(blocks), (self._rows, self._columns)), (self._size, self._size))


class QpWorkspace:
    """min 1/2 z'P z + q'z over [dynamics Jacobian; linear rows]; the numbers of both change from call to call.

    Two methods: an interior-point method that uses the stages of an OCP, and OSQP, which takes rows over several stages
    too. With `method` "osqp then stagewise" a QP that OSQP does not solve in its iterations goes to the other.
    """

    def __init__(
        self, linear_quadratic: LinearQuadraticPart, dynamics: StackedDynamics, blocks: Array, options: QpOptions
    ) -> None:
        """Starts with the Hessian P of the given stage blocks [N, n+4, n+4]."""
        rows, columns = dynamics.sparsity()
        self.dynamics_rows = dynamics.size
        count = rows.size
        # Numbering the entries before the conversion to CSC tells where each of them lands.
        fixed = sparse.coo_matrix(linear_quadratic.matrix)
        entries = sparse.csc_matrix(
            (
                np.arange(1, count + fixed.nnz + 1, dtype=float),
                (np.concatenate([rows, dynamics.size + fixed.row]), np.concatenate([columns, fixed.col])),
            ),
            (dynamics.size + fixed.shape[0], linear_quadratic.size),
        )
        self._order = entries.data.astype(np.intp) - 1
        self._values = np.concatenate([np.zeros(count), fixed.data])
        self._count = count
        entries.data = np.where(self._order < count, 1.0, self._values[self._order])
        self._matrix = entries
        self.hessian = BlockHessian(dynamics.layout.block_columns, linear_quadratic.size)
        self._stagewise = None
        if "stagewise" in options.method:
            layout = dynamics.layout
            self._stagewise = StagewiseQp(
                layout.horizon, layout.state_size, blocks, linear_quadratic.matrix, options.interior_tolerance
            )
        self._solver = None
        if "osqp" in options.method:
            self._solver = self._osqp(linear_quadratic, blocks, options)

    def _osqp(self, linear_quadratic: LinearQuadraticPart, blocks: Array, options: QpOptions) -> osqp.OSQP:
        _, _, low, high = linear_quadratic.data()
        zeros = np.zeros(self.dynamics_rows)
        solver = osqp.OSQP()
        solver.setup(
            self.hessian.matrix(blocks),
            np.zeros(linear_quadratic.size),
            self._matrix,
            np.concatenate([zeros, low]),
            np.concatenate([zeros, high]),
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
        return solver

    @property
    def matrix(self) -> sparse.csc_matrix:
        """[dynamics; linear rows], with the Jacobian last set."""
        self._matrix.data = self._values[self._order]
        return self._matrix

    def set_jacobian(self, jacobian: Array) -> None:
        """Takes the dynamics' Jacobian entries, in the order of `StackedDynamics.sparsity`."""
        self._values[: self._count] = jacobian
        if self._stagewise is not None:
            self._stagewise.set_jacobian(jacobian)

    def set_hessian(self, blocks: Array) -> None:
        """Takes the Hessian as the sum of positive semidefinite stage blocks [N, n+4, n+4]."""
        if self._solver is not None:
            self._solver.update(Px=self.hessian.values(blocks))
        if self._stagewise is not None:
            self._stagewise.set_hessian(blocks)

    def solve(self, gradient: Array, low: Array, high: Array, z: Array, y: Array, interior: bool = False) -> QpSolution:
        """Solves with the Jacobian last set, the given gradient at zero and row bounds, from (z, y).

        With `interior` OSQP is not tried, where there is the other method. What neither solves has OSQP's iterate.
        """
        start = time.thread_time()
        arguments = gradient, low, high
        if self._solver is None:
            solution = self._interior(*arguments, z)
        elif self._stagewise is None:
            solution = self._first_order(*arguments, z, y)
        elif interior:
            solution = self._interior(*arguments, z)._replace(second_attempt=True)
        else:
            first = solution = self._first_order(*arguments, z, y)
            if first.status != "solved":
                other = self._interior(*arguments, z)
                solution = other if other.status == "solved" else first
                solution = solution._replace(iterations=first.iterations + other.iterations, second_attempt=True)
        return solution._replace(cpu=time.thread_time() - start)

    def _first_order(self, gradient: Array, low: Array, high: Array, z: Array, y: Array) -> QpSolution:
        assert self._solver is not None
        self._solver.update(Ax=self.matrix.data, q=gradient, l=low, u=high)
        self._solver.warm_start(x=z, y=y)
        # OSQP answers Ctrl-C itself: with a line of its own, and as a QP that cannot be solved.
        with warnings.catch_warnings(), ctrl_c_waits():
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            result = self._solver.solve(raise_error=False)
        if result.info.status_val == osqp.SolverStatus.OSQP_SIGINT:  # another thread was given it
            raise KeyboardInterrupt
        return QpSolution(np.array(result.x), np.array(result.y), result.info.status, int(result.info.iter))

    def _interior(self, gradient: Array, low: Array, high: Array, z: Array) -> QpSolution:
        assert self._stagewise is not None
        z, y, solved, count = self._stagewise.solve(gradient, low, high, z)
        status = "solved" if solved else "maximum iterations reached"
        return QpSolution(z, y, status, count, count > FIRST_ATTEMPT)
