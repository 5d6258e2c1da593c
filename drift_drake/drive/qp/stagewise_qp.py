"""The OCP's quadratic programs stage by stage, as the interior-point method takes them."""

import numpy as np

from drift_drake.common.arrays import Array, Index
from drift_drake.drive.qp.interior_point import Inequalities, interior_point
from drift_drake.drive.qp.stages import StageBounds, Stages


def one_sided(bounds: StageBounds) -> tuple[Inequalities, Index, Array]:
    """The bounds that there are, as inequalities from below; of each the row [M] that it is of, and 1 or -1 [M]."""
    # Of each row the lower bound last, as a slack's own row is.
    limit = np.column_stack([-bounds.high, bounds.low]).ravel()
    found = np.flatnonzero(limit != -np.inf)
    place: Index = found // 2
    side: Array = np.where(found % 2 == 1, 1.0, -1.0)
    values = side[:, None] * bounds.values[place]
    first = np.searchsorted(place, bounds.first)
    return Inequalities(values[:, :-1].copy(), values[:, -1].copy(), limit[found], first), place, side


def solve_stages(stages: Stages, f: Array, target: Array, z: Array, tolerance: float) -> tuple[Array, Array, bool, int]:
    """(z, multipliers in OSQP's signs, whether it is solved, iterations) from a decision vector z.

    Args:
        f [N, n, n+4], target [N, n]: of the dynamics F_k z_k - x_{k+1} = target_k.
        tolerance: on the primal residual, the mean complementarity, and the dual residual over the largest multiplier.
    """
    z, n = z.copy(), stages.state_size
    x, u, slack = stages.split(z)
    x[0], u[0] = stages.given[:n], stages.given[n:]
    rows, place, side = one_sided(stages.bounds)
    costate, multipliers = np.empty((len(x), n + 2)), np.empty(place.size)
    gradient = stages.split(stages.gradient)
    iterations, solved = interior_point(
        f, stages.hessian, *gradient, target, rows, tolerance, x, u, slack, costate, multipliers
    )
    by_row = np.bincount(place, -side * multipliers, stages.bounds.low.size)
    return z, np.concatenate([costate[1:, :n].ravel(), -costate[0], by_row]), solved, iterations
