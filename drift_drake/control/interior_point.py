"""The interior-point method behind OSQP: PIQP, which solves each of the controller's QPs in 6 to 30 iterations.

Where OSQP's first-order iterations slow down (a drift whose front tyre slides, a model that is far from the car), the
number of interior-point iterations hardly changes, and the solution is exact. It takes no warm start.
"""

import numpy as np
import piqp
import scipy.sparse as sparse
from numpy.typing import NDArray

Array = NDArray[np.float64]

TOLERANCE = 1e-6  # on the residuals and, ten times that, on the duality gap
MAX_ITERATIONS = 40  # the hardest QP of the training population's cars took 28


class InteriorPointSolver:
    """min 1/2 z'P z + q'z, low <= A z <= high; numbers change from call to call, the pattern does not.

    Rows whose bounds are equal at the start are taken for equations for good.
    """

    def __init__(self, upper: sparse.csc_matrix, matrix: sparse.csc_matrix, low: Array, high: Array) -> None:
        """Args: upper: P's upper triangle; matrix: A, whose pattern alone counts; low, high: to tell the equations."""
        self.hessian = upper
        self._equation = low == high
        self._size = low.size
        # Numbering the entries tells where each of them lands in the two parts.
        numbered = matrix.copy()
        numbered.data = np.arange(1, matrix.nnz + 1, dtype=float)
        rows = numbered.tocsr()
        self._parts = [sparse.csc_matrix(rows[chosen]) for chosen in (self._equation, ~self._equation)]
        self._entries = [part.data.astype(np.intp) - 1 for part in self._parts]
        self._solver = piqp.SparseSolver()
        settings = self._solver.settings
        settings.eps_abs, settings.eps_rel = TOLERANCE, 0.0
        settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = 10.0 * TOLERANCE, TOLERANCE
        settings.max_iter = MAX_ITERATIONS
        self._ready = False

    def solve(self, entries: Array, gradient: Array, low: Array, high: Array) -> tuple[Array, Array, bool, int]:
        """(z, multipliers in OSQP's sign and order, whether it is solved, iterations) for A's entries in its order."""
        for part, index in zip(self._parts, self._entries, strict=True):
            part.data = entries[index]
        equations, rows = self._parts
        data = {
            "P": self.hessian,  # each time: the solver scales its own copy, and rounding would build up in it
            "c": gradient,
            "A": equations,
            "b": low[self._equation],
            "G": rows,
            "h_l": low[~self._equation],
            "h_u": high[~self._equation],
        }
        if not self._ready:
            self._solver.setup(**data)
            self._ready = True
        self._solver.update(**data)
        solved = self._solver.solve() == piqp.PIQP_SOLVED
        result = self._solver.result
        y = np.empty(self._size)
        y[self._equation], y[~self._equation] = result.y, result.z_u - result.z_l
        return np.array(result.x), y, solved, int(result.info.iter)
