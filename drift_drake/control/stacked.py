"""What a horizon's stages have in common, stacked over all stages: the dynamics, and costs beyond quadratic ones.

The decision vector is (x_0..x_N, u_0..u_N, ...) in scaled variables; stage k's block is (x_k, u_k, u_{k+1}). Both
stacks are called by Drake's solvers as float or AutoDiffXd; the line-search SQP takes their derivatives directly.
"""

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff

from drift_drake.vehicle.step_model import CURVATURE_STEP, INPUT_SCALE, STATE_SCALE, StepModel, block_scale

Array = NDArray[np.float64]


class StageCost(Protocol):
    """A cost over all stages, for x [N, n], u and u_next [N, 2] (SI)."""

    def value(self, x: Array, u: Array, u_next: Array) -> float:
        """The total."""
        ...

    def gradient_at(self, x: Array, u: Array, u_next: Array) -> Callable[[Array, Array, Array], Array]:
        """The total's derivative by one stage's (x, u, u_next), the other stages held where they are.

        The function returned takes M = (any multiple of N) points, stage after stage, and gives [M, n+4]; at the
        arguments of `gradient_at` itself it is the total's gradient.
        """
        ...


@runtime_checkable
class CurvedGradient(Protocol):
    """What `StageCost.gradient_at` may return: a function that knows its derivatives."""

    def curvature(self, x: Array, u: Array, u_next: Array) -> Array:
        """The total's second derivatives within each stage [N, n+4, n+4], at the arguments of `gradient_at`."""
        ...


class StageLayout:
    """Where the stages' variables lie in the decision vector."""

    def __init__(self, memory_scale: Array, horizon: int) -> None:
        self.horizon = horizon
        self.state_scale = np.concatenate([STATE_SCALE, memory_scale])
        self.state_size = self.state_scale.size
        self.block_scale = block_scale(memory_scale)
        n, stage = self.state_size, np.arange(horizon)[:, None]
        inputs = n * (horizon + 1) + 2 * stage + np.arange(4)
        self.block_columns = np.concatenate([n * stage + np.arange(n), inputs], axis=1)
        """[N, n+4]"""

    def split(self, z: Array) -> tuple[Array, Array]:
        """(x [N+1, n], u [N+1, 2]) in SI units of a decision vector."""
        states = self.state_size * (self.horizon + 1)
        inputs = z[states : states + 2 * (self.horizon + 1)]
        return z[:states].reshape(-1, self.state_size) * self.state_scale, inputs.reshape(-1, 2) * INPUT_SCALE

    def stages(self, z: Array) -> tuple[Array, Array, Array]:
        """(x_k [N, n], u_k [N, 2], u_{k+1} [N, 2]) in SI units."""
        x, u = self.split(z)
        return x[:-1], u[:-1], u[1:]

    def shifted_stages(self, z: Array) -> tuple[Array, Array, Array]:
        """All stages as they are, then with each of their variables moved by `CURVATURE_STEP`: (n+5) N points."""
        n, count = self.state_size, self.state_size + 4
        point = np.concatenate(self.stages(z), axis=1)
        shifts = np.eye(count + 1, count, -1) * CURVATURE_STEP * self.block_scale
        points = (point[None] + shifts[:, None]).reshape(-1, count)
        return points[:, :n], points[:, n : n + 2], points[:, n + 2 :]

    def difference(self, gradients: Array) -> Array:
        """Symmetric second derivatives [N, n+4, n+4] from scaled gradients [(n+5) N, n+4] at the shifted stages."""
        count = self.state_size + 4
        by_shift = gradients.reshape(count + 1, -1, count)
        blocks = np.moveaxis((by_shift[1:] - by_shift[0]) / CURVATURE_STEP, 0, 1)
        symmetric: Array = 0.5 * (blocks + np.swapaxes(blocks, 1, 2))
        return symmetric


class StackedDynamics:
    """All dynamics constraints as one, f(x_k, u_k, u_{k+1}) - x_{k+1} = 0, residuals and variables scaled."""

    def __init__(self, model: StepModel, layout: StageLayout) -> None:
        self.model = model
        self.layout = layout
        self.curvature = np.zeros(layout.horizon)
        n, horizon = layout.state_size, layout.horizon
        self.size = n * horizon
        row = n * np.arange(horizon)[:, None, None] + np.arange(n)[:, None]
        rows, columns = np.broadcast_arrays(row, layout.block_columns[:, None])
        self._rows = np.concatenate([rows.ravel(), np.arange(self.size)])
        self._columns = np.concatenate([columns.ravel(), n + np.arange(self.size)])
        self._block_scale = layout.block_scale / layout.state_scale[:, None]

    def sparsity(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """(row, column) of each entry of `linearize`'s Jacobian."""
        return self._rows, self._columns

    def value(self, z: Array) -> Array:
        """The residuals [n N]."""
        x, u = self.layout.split(z)
        residual: Array = (self.model.step(x[:-1], u[:-1], u[1:], self.curvature) - x[1:]) / self.layout.state_scale
        return residual.ravel()

    def linearize(self, z: Array) -> tuple[Array, Array]:
        """(residuals [n N], the Jacobian's entries in the order of `sparsity`)."""
        x, u = self.layout.split(z)
        x_next, a, b, b_next = self.model.linearize(x[:-1], u[:-1], u[1:], self.curvature)
        block = np.concatenate([a, b, b_next], axis=2) * self._block_scale
        residual = ((x_next - x[1:]) / self.layout.state_scale).ravel()
        return residual, np.concatenate([block.ravel(), np.full(self.size, -1.0)])

    def by_stages(self, entries: Array) -> Array:
        """d f_k / d (x_k, u_k, u_{k+1}) [N, n, n+4], scaled, of `linearize`'s entries."""
        return entries[: -self.size].reshape(self.layout.horizon, self.layout.state_size, -1)

    def curvature_blocks(self, z: Array, multipliers: Array) -> Array:
        """Second derivatives of multipliers' residuals by each stage's variables [N, n+4, n+4].

        The model's own, or differences of its exact derivatives, all stages and directions in one batch.
        """
        layout, scale = self.layout, self.layout.block_scale
        weights = multipliers.reshape(-1, layout.state_size) / layout.state_scale
        own = self.model.weighted_curvature(*layout.stages(z), self.curvature, weights)
        if own is not None:
            return own * scale[:, None] * scale
        points = layout.shifted_stages(z)
        repeats = len(points[0]) // layout.horizon
        gradient = self.model.weighted_gradient(
            *points, np.tile(self.curvature, repeats), np.tile(weights, (repeats, 1))
        )
        return layout.difference(gradient * scale)

    def __call__(self, z: NDArray[Any]) -> NDArray[Any]:
        if z.dtype != object:
            return self.value(z)
        value, entries = self.linearize(ExtractValue(z).ravel())
        jacobian = np.zeros((self.size, z.size))
        jacobian[self._rows, self._columns] = entries
        return _chained(value, jacobian, z)


class StackedCost:
    """A `StageCost` as a cost of a MathematicalProgram."""

    def __init__(self, cost: StageCost, layout: StageLayout) -> None:
        self._cost = cost
        self._layout = layout
        self._last: tuple[Array, Callable[[Array, Array, Array], Array]] | None = None  # scratch: see `_gradient_at`

    def value(self, z: Array) -> float:
        """The cost."""
        return self._cost.value(*self._layout.stages(z))

    def gradient(self, z: Array) -> Array:
        """Its derivative by the decision vector (all of it: variables behind the stages' have none)."""
        by_stage = self._gradient_at(z)(*self._layout.stages(z)) * self._layout.block_scale
        return np.bincount(self._layout.block_columns.ravel(), by_stage.ravel(), z.size).astype(float)

    def curvature_blocks(self, z: Array) -> Array:
        """Second derivatives within each stage [N, n+4, n+4]: the cost's own, or differences of the exact gradient."""
        gradient, scale = self._gradient_at(z), self._layout.block_scale
        if isinstance(gradient, CurvedGradient):
            return gradient.curvature(*self._layout.stages(z)) * scale[:, None] * scale
        return self._layout.difference(gradient(*self._layout.shifted_stages(z)) * self._layout.block_scale)

    def _gradient_at(self, z: Array) -> Callable[[Array, Array, Array], Array]:
        """The stages' gradient, kept for the next call: an iterate's curvature is asked for after its gradient."""
        if self._last is None or not np.array_equal(self._last[0], z):
            self._last = z.copy(), self._cost.gradient_at(*self._layout.stages(z))
        return self._last[1]

    def __call__(self, z: NDArray[Any]) -> Any:
        if z.dtype != object:
            return self.value(z)
        values = ExtractValue(z).ravel()
        return _chained(np.array([self.value(values)]), self.gradient(values)[None], z)[0]


def _chained(value: Array, jacobian: Array, z: NDArray[Any]) -> NDArray[Any]:
    """AutoDiffXd of a function with the given value [m] and Jacobian [m, len(z)] at z."""
    gradient = ExtractGradient(z)
    if gradient.size == 0:
        return np.array([AutoDiffXd(v) for v in value])
    return InitializeAutoDiff(value[:, None], jacobian @ gradient).ravel()
