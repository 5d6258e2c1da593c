"""The matrices of an SQP iteration times vectors, stage by stage, compiled.

`tests/drive/mpc/test_products.py` holds all to the matrices written out.
"""

from typing import NamedTuple

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.common.arrays import Array, Index
from drift_drake.drive.qp.stages import Stages


@compiled
def cost_times(blocks: Array, z: Array) -> Array:
    """The sum of overlapping blocks [N, n+4, n+4] times a vector, each row's terms in the order of its columns."""
    count, size = blocks.shape[0], blocks.shape[1]
    n = size - 4
    inputs = n * (count + 1)
    out = np.zeros(z.size)
    for k in range(count + 1):
        now, before = inputs + 2 * k, inputs + 2 * (k - 1)
        for i in range(n if k < count else 0):
            total = 0.0
            for j in range(n):
                total += blocks[k, i, j] * z[n * k + j]
            for j in range(4):
                total += blocks[k, i, n + j] * z[now + j]
            out[n * k + i] = total
        for i in range(2):
            total = 0.0
            if k > 0:
                for j in range(n):
                    total += blocks[k - 1, n + 2 + i, j] * z[n * (k - 1) + j]
            if k < count:
                for j in range(n):
                    total += blocks[k, n + i, j] * z[n * k + j]
            if k > 0:
                for j in range(2):
                    total += blocks[k - 1, n + 2 + i, n + j] * z[before + j]
            for j in range(2):
                both = blocks[k - 1, n + 2 + i, n + 2 + j] if k > 0 else 0.0
                both += blocks[k, n + i, n + j] if k < count else 0.0
                total += both * z[now + j]
            if k < count:
                for j in range(2, 4):
                    total += blocks[k, n + i, n + j] * z[now + j]
            out[now + i] = total
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
def dual_residual(gradient: Array, stages: Stages, f: Array, y: Array) -> float:
    """The largest entry of the Lagrangian's gradient; y: multipliers of dynamics, given and bounds."""
    out = gradient.copy()
    columns, values, first = stages.columns, stages.bounds.values, stages.bounds.first
    count, n, size = f.shape
    for k in range(count):
        for i in range(n):
            multiplier = y[k * n + i]
            out[n + k * n + i] -= multiplier
            for j in range(size):
                out[columns[k, j]] += f[k, i, j] * multiplier
    for i in range(n + 2):
        out[columns[0, i]] += y[count * n + i]
    for k in range(count):
        for r in range(first[k], first[k + 1]):
            multiplier = y[count * n + n + 2 + r]
            for j in range(values.shape[1]):
                out[stages.bound_columns[k, j]] += values[r, j] * multiplier
    return largest(out)


@compiled
def violations(residual: Array, stages: Stages, z: Array) -> tuple[float, float]:
    """(sum, largest) violation of the dynamics, given their residual, and of the stages; NaN stays NaN."""
    total, largest = 0.0, 0.0
    for value in residual:
        total += abs(value)
        largest = max(largest, abs(value))
    for i, value in enumerate(stages.given):
        outside = abs(z[stages.columns[0, i]] - value)
        total += outside
        largest = max(largest, outside)
    values, low, high, first = stages.bounds
    for k in range(first.size - 1):
        for r in range(first[k], first[k + 1]):
            value = 0.0
            for j in range(values.shape[1]):
                value += values[r, j] * z[stages.bound_columns[k, j]]
            outside = max(low[r] - value, value - high[r])
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
    target: Array  # of the QP's dynamics [N, n]


@compiled
def iterate(stages: Stages, extra: Array, residual: Array, f: Array, z: Array, y: Array) -> Iterate:
    """The numbers of a point z, y: one call for what are many small ones.

    Args:
        extra: gradient of a cost in addition to the stages', empty without one.
        residual: of the dynamics; f: F_k [N, n, n+4].
    """
    bent = cost_times(stages.hessian, z)
    quadratic = bent + stages.gradient
    gradient = quadratic + extra if extra.size else quadratic
    violation, primal = violations(residual, stages, z)
    # OSQP's multipliers are no more accurate than relative to the largest one.
    dual = dual_residual(gradient, stages, f, y) / max(1.0, largest(y))
    target = (dynamics_times(f, stages.columns, z) - residual).reshape(f.shape[0], f.shape[1])
    cost = stages.constant + 0.5 * float(z @ bent) + float(stages.gradient @ z)
    return Iterate(quadratic, gradient, cost, violation, primal, dual, target)


@compiled
def along(gradient: Array, quadratic_gradient: Array, hessian: Array, blocks: Array, columns: Index,
          direction: Array) -> tuple[float, float, float, float]:  # fmt: skip
    """How the cost changes along a direction: its slope and that of its quadratic part, that one's bend, the QP's."""
    bend = float(direction @ cost_times(hessian, direction))
    model_bend = float(direction @ blocks_times(blocks, columns, direction))
    return float(gradient @ direction), float(quadratic_gradient @ direction), bend, model_bend
