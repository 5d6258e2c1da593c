"""A program's linear rows, low <= row z <= high, as inequalities of its stages."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from drift_drake.arrays import Array, Index
from drift_drake.control.interior_point import StageRows
from drift_drake.vehicle.compilation import compiled


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
