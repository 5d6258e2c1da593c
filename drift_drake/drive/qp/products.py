"""The matrices of an SQP iteration times vectors, compiled: those of an OCP by stages, linear rows compressed.

A stage's variables stand in the decision vector at `columns` [N, n+4], see `StageLayout.block_columns`.
`tests/control/test_products.py` holds all to the matrices written out.
"""

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from drift_drake.car.compilation import compiled
from drift_drake.common.arrays import Array, Index


class Rows(NamedTuple):
    """A sparse matrix by rows, as compiled functions take it."""

    values: Array
    columns: NDArray[Any]
    first: NDArray[Any]  # where each row begins, and the end

    @classmethod
    def of(cls, matrix: sparse.csr_matrix) -> "Rows":
        rows = sparse.csr_matrix(matrix)
        return cls(rows.data, rows.indices, rows.indptr)


@compiled
def rows_times(rows: Rows, z: Array) -> Array:
    """The matrix times a vector."""
    out = np.empty(rows.first.size - 1)
    for i in range(out.size):
        total = 0.0
        for entry in range(rows.first[i], rows.first[i + 1]):
            total += rows.values[entry] * z[rows.columns[entry]]
        out[i] = total
    return out


@compiled
def blocks_times(blocks: Array, columns: Index, z: Array) -> Array:
    """The sum of overlapping blocks [N, n+4, n+4] times a vector."""
    out = np.zeros(z.size)
    for k in range(columns.shape[0]):
        for i in range(columns.shape[1]):
            total = 0.0
            for j in range(columns.shape[1]):
                total += blocks[k, i, j] * z[columns[k, j]]
            out[columns[k, i]] += total
    return out


@compiled
def dynamics_times(f: Array, columns: Index, z: Array) -> Array:
    """F_k z_k - x_{k+1} [n N], stage after stage; f: F_k [N, n, n+4]."""
    count, n, size = f.shape
    out = np.empty(count * n)
    for k in range(count):
        for i in range(n):
            row = k * n + i
            total = -z[n + row]
            for j in range(size):
                total += f[k, i, j] * z[columns[k, j]]
            out[row] = total
    return out


@compiled
def largest(values: Array) -> float:
    """The largest magnitude; NaN stays NaN."""
    found = 0.0
    for value in values:
        if not abs(value) <= found:
            found = abs(value)
            if np.isnan(found):
                break
    return found


@compiled
def dual_residual(gradient: Array, f: Array, columns: Index, rows: Rows, y: Array) -> float:
    """The largest entry of the Lagrangian's gradient; y: multipliers of the dynamics and of the linear rows."""
    out = gradient.copy()
    count, n, size = f.shape
    for k in range(count):
        for i in range(n):
            multiplier = y[k * n + i]
            out[n + k * n + i] -= multiplier
            for j in range(size):
                out[columns[k, j]] += f[k, i, j] * multiplier
    for i in range(rows.first.size - 1):
        multiplier = y[count * n + i]
        for entry in range(rows.first[i], rows.first[i + 1]):
            out[rows.columns[entry]] += rows.values[entry] * multiplier
    return float(np.abs(out).max())


@compiled
def violations(residual: Array, rows: Rows, z: Array, low: Array, high: Array) -> tuple[float, float]:
    """(sum, largest) violation of the dynamics, given their residual, and of low <= rows z <= high; NaN stays NaN."""
    total, largest = 0.0, 0.0
    for value in residual:
        total += abs(value)
        largest = max(largest, abs(value))
    for i, value in enumerate(rows_times(rows, z)):
        outside = max(low[i] - value, value - high[i])
        if not outside <= 0.0:
            total += outside
            largest = max(largest, outside)
    return total, largest if total < np.inf else total


class Iterate(NamedTuple):
    """What an SQP iteration knows of the point that it starts from, apart from the Hessian's blocks."""

    quadratic_gradient: Array  # of the cost's quadratic part
    gradient: Array  # of all of it
    cost: float  # its quadratic part
    violation: float
    primal: float  # the largest violation
    dual: float  # the largest entry of the Lagrangian's gradient, relative to the largest multiplier
    low: Array  # bounds of the QP's rows [dynamics; linear rows]
    high: Array


@compiled
def iterate(hessian: Rows, linear: Array, constant: float, extra: Array, residual: Array, f: Array, columns: Index,
            rows: Rows, low: Array, high: Array, z: Array, y: Array) -> Iterate:  # fmt: skip
    """The numbers of a point z, y: one call for what are many small ones.

    Args:
        hessian, linear, constant: the quadratic cost's; extra: gradient of a cost beside it, empty without one.
        residual: of the dynamics; f: F_k [N, n, n+4]; rows: the linear ones, with their bounds low and high.
    """
    bent = rows_times(hessian, z)
    quadratic = bent + linear
    gradient = quadratic + extra if extra.size else quadratic
    violation, primal = violations(residual, rows, z, low, high)
    # OSQP's multipliers are no more accurate than relative to the largest one.
    dual = dual_residual(gradient, f, columns, rows, y) / max(1.0, largest(y))
    target = dynamics_times(f, columns, z) - residual
    cost = constant + 0.5 * float(z @ bent) + float(linear @ z)
    both = np.concatenate((target, low)), np.concatenate((target, high))
    return Iterate(quadratic, gradient, cost, violation, primal, dual, both[0], both[1])


@compiled
def along(gradient: Array, quadratic_gradient: Array, hessian: Rows, blocks: Array, columns: Index,
          direction: Array) -> tuple[float, float, float, float]:  # fmt: skip
    """How the cost changes along a direction: its slope and that of its quadratic part, that one's bend, the QP's."""
    bend = float(direction @ rows_times(hessian, direction))
    model_bend = float(direction @ blocks_times(blocks, columns, direction))
    return float(gradient @ direction), float(quadratic_gradient @ direction), bend, model_bend
