"""The OCP's quadratic programs stage by stage, as the interior-point method takes them."""

import numpy as np

from drift_drake.car.compilation import compiled, copied
from drift_drake.common.arrays import Array, Index
from drift_drake.drive.qp.interior_point import Inequalities, interior_point
from drift_drake.drive.qp.stages import StageBounds, Stages


@compiled
def one_sided(bounds: StageBounds) -> tuple[Inequalities, Index, Array]:
    """The bounds that there are, as inequalities from below; of each the row [M] that it is of, and 1 or -1 [M]."""
    values, low, high, first = bounds
    most, count = 2 * low.size, 0
    place, side, limit, begin = np.empty(most, np.intp), np.empty(most), np.empty(most), np.empty_like(first)
    for k in range(first.size - 1):
        begin[k] = count
        for r in range(first[k], first[k + 1]):
            # The lower bound last, as a slack's own row is.
            for sign, one in ((-1.0, -high[r]), (1.0, low[r])):
                if one != -np.inf:
                    place[count], side[count], limit[count] = r, sign, one
                    count += 1
    begin[-1] = count
    row, softness = np.empty((count, values.shape[1] - 1)), np.empty(count)
    for i in range(count):
        for j in range(row.shape[1]):
            row[i, j] = side[i] * values[place[i], j]
        softness[i] = side[i] * values[place[i], -1]
    return Inequalities(row, softness, limit[:count], begin), place[:count], side[:count]


@compiled
def solve_stages(stages: Stages, f: Array, target: Array, z: Array, tolerance: float) -> tuple[Array, Array, bool, int]:
    """(z, multipliers in OSQP's signs, whether it is solved, iterations) from a decision vector z.

    Args:
        f [N, n, n+4], target [N, n]: of the dynamics F_k z_k - x_{k+1} = target_k.
        tolerance: on the primal residual, the mean complementarity, and the dual residual over the largest multiplier.
    """
    count, n, given, gradient = f.shape[0], f.shape[1], stages.given, stages.gradient
    states, inputs = n * (count + 1), 2 * (count + 1)
    z = z.copy()
    x, u, slack = z[:states].reshape(-1, n), z[states : states + inputs].reshape(-1, 2), z[states + inputs :]
    gx, gu = gradient[:states].reshape(-1, n), gradient[states : states + inputs].reshape(-1, 2)
    copied(given[:n], x[0])
    copied(given[n:], u[0])
    rows, place, side = one_sided(stages.bounds)
    costate, multipliers = np.empty((count + 1, n + 2)), np.empty(place.size)
    iterations, solved = interior_point(
        f,
        stages.hessian,
        gx,
        gu,
        gradient[states + inputs :],
        target,
        rows,
        tolerance,
        x,
        u,
        slack,
        costate,
        multipliers,
    )
    y = np.zeros(count * n + n + 2 + stages.bounds.low.size)
    for k in range(count):
        copied(costate[k + 1, :n], y[k * n : (k + 1) * n])
    copied(-costate[0], y[count * n : count * n + n + 2])
    for i in range(place.size):
        y[count * n + n + 2 + place[i]] -= side[i] * multipliers[i]
    return z, y, solved, iterations
