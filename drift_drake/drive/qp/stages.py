"""An OCP's quadratic program as a record of its stages: what `drive.mpc.ocp` makes, and what the solvers take.

The decision vector is (x_0..x_N, u_0..u_N, slack_1..slack_N), x_k [n], u_k [2], in scaled variables.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.common.arrays import Array, Index


class StageRows(NamedTuple):
    """Linear rows of one kind, low <= values (x_k, u_k, slack_k) <= high."""

    what: str
    stage: Index  # [R], k = 1..N of each row
    values: Array  # [R, n+3]
    low: Array  # [R]
    high: Array  # [R]


class StageBounds(NamedTuple):
    """All rows, those of stages k = 1..N one after the other. Those of a stage end with its slack's own bound."""

    values: Array  # [R, n+3], each scaled to a largest entry of one
    low: Array  # [R]
    high: Array  # [R]
    first: Index  # [N+1], where the rows of a stage begin; in the end R

    @classmethod
    def of(cls, kinds: Sequence[StageRows], horizon: int) -> "StageBounds":
        """Sorts rows to their stages; within a stage the kinds keep their order."""
        stage = np.concatenate([rows.stage for rows in kinds])
        values = np.concatenate([rows.values for rows in kinds])
        low, high = (np.concatenate(bounds) for bounds in zip(*((rows.low, rows.high) for rows in kinds), strict=True))
        order, scale = np.argsort(stage, kind="stable"), 1.0 / np.abs(values).max(axis=1)
        first = np.searchsorted(stage[order], np.arange(1, horizon + 2))
        return cls((values * scale[:, None])[order], (low * scale)[order], (high * scale)[order], first)


class Stages(NamedTuple):
    """min constant + gradient' z + sum_k 1/2 z_k' H_k z_k, z_k = (x_k, u_k, u_{k+1}), but for the dynamics.

    Subject to (x_0, u_0) = given and the bounds.
    """

    columns: Index  # [N, n+4], where z_k stands in the decision vector z
    bound_columns: Index  # [N, n+3], where (x_k, u_k, slack_k) of k = 1..N does
    hessian: Array  # H_k [N, n+4, n+4]
    gradient: Array  # at zero
    constant: float
    given: Array  # [n+2]
    bounds: StageBounds

    @property
    def state_size(self) -> int:
        """Number n of a stage's states."""
        return self.columns.shape[1] - 4

    @property
    def multiplier_count(self) -> int:
        """Of the dynamics, of what is given and of the bounds: the multipliers' order, OSQP's signs."""
        return len(self.columns) * self.state_size + self.given.size + self.bounds.low.size

    def split(self, z: Array) -> tuple[Array, Array, Array]:
        """(x [N+1, n], u [N+1, 2], slack [N]) of a decision vector, or of a gradient: views."""
        count, size = self.columns.shape
        states, n = (size - 4) * (count + 1), size - 4
        return z[:states].reshape(-1, n), z[states:-count].reshape(-1, 2), z[-count:]


def dynamics_pattern(columns: Index) -> tuple[Index, Index]:
    """(row, column) of each entry of the dynamics' Jacobian: those of F_k [N, n, n+4], then of -x_{k+1} [N n]."""
    count, n = len(columns), columns.shape[1] - 4
    row = np.arange(count * n)
    rows, columns = np.broadcast_arrays(row.reshape(count, n, 1), columns[:, None])
    return np.concatenate([rows.ravel(), row]), np.concatenate([columns.ravel(), n + row])
