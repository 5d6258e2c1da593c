"""What a horizon's stages have in common, stacked over all stages: the dynamics, and costs beyond quadratic ones.

The decision vector is (x_0..x_N, u_0..u_N, ...) in scaled variables; stage k's block is (x_k, u_k, u_{k+1}). Both
stacks are called by Drake's solvers as float or AutoDiffXd; the line-search SQP takes their derivatives directly.
"""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff

from drift_drake.car.step_model import CURVATURE_STEP, INPUT_SCALE, STATE_SCALE, CostExpansion, StepModel, block_scale
from drift_drake.common.arrays import Array
from drift_drake.drive.qp.stages import dynamics_pattern


class StageCost(Protocol):
    """A cost over all stages, for x [N, n], u and u_next [N, 2] (SI)."""

    def value(self, x: Array, u: Array, u_next: Array) -> float:
        """The total."""

    def expansion(self, x: Array, u: Array, u_next: Array) -> CostExpansion:
        """The total to second order."""


class DifferencedExpansion:
    """A `CostExpansion` whose second derivatives are differences of an exact gradient.

    Args:
        gradient: of M = (any multiple of N) points, stage after stage, [M, n+4]; the other stages stay where they are.
        x, u, u_next: the trajectory; scale: of (x, u, u_next) [n+4], see `block_scale`.
    """

    def __init__(
        self, gradient: Callable[[Array, Array, Array], Array], x: Array, u: Array, u_next: Array, scale: Array
    ) -> None:
        self._gradient, self._scale = gradient, scale
        self._points, self._size = np.concatenate([x, u, u_next], axis=1), x.shape[1]

    def _at(self, points: Array) -> Array:
        n = self._size
        return self._gradient(points[:, :n], points[:, n : n + 2], points[:, n + 2 :])

    def gradient(self) -> Array:
        return self._at(self._points)

    def curvature(self) -> Array:
        count, steps = self._scale.size, CURVATURE_STEP * self._scale
        shifts = np.concatenate([np.zeros((1, count)), np.diag(steps)])
        found = self._at((self._points + shifts[:, None]).reshape(-1, count)).reshape(count + 1, -1, count)
        bent = np.moveaxis((found[1:] - found[0]) / steps[:, None, None], 0, 1)
        return 0.5 * (bent + np.swapaxes(bent, 1, 2))


class StageLayout:
    """Where the stages' variables lie in the decision vector."""

    def __init__(self, internal_scale: Array, horizon: int) -> None:
        self.horizon = horizon
        self.state_scale = np.concatenate([STATE_SCALE, internal_scale])
        self.state_size = self.state_scale.size
        self.block_scale = block_scale(internal_scale)
        n, stage = self.state_size, np.arange(horizon)[:, None]
        inputs = n * (horizon + 1) + 2 * stage + np.arange(4)
        self.block_columns = np.concatenate([n * stage + np.arange(n), inputs], axis=1)
        """[N, n+4]"""
        carried = np.concatenate([n + self.block_columns[:, :n], inputs[:, 2:]], axis=1)  # (x_k, u_k), k = 1..N
        self.bound_columns = np.append(carried, (n + 2) * (horizon + 1) + stage, axis=1)
        """[N, n+3]"""

    def split(self, z: Array) -> tuple[Array, Array]:
        """(x [N+1, n], u [N+1, 2]) in SI units of a decision vector."""
        states = self.state_size * (self.horizon + 1)
        inputs = z[states : states + 2 * (self.horizon + 1)]
        return z[:states].reshape(-1, self.state_size) * self.state_scale, inputs.reshape(-1, 2) * INPUT_SCALE

    def stages(self, z: Array) -> tuple[Array, Array, Array]:
        """(x_k [N, n], u_k [N, 2], u_{k+1} [N, 2]) in SI units."""
        x, u = self.split(z)
        return x[:-1], u[:-1], u[1:]


class StackedDynamics:
    """All dynamics constraints as one, f(x_k, u_k, u_{k+1}) - x_{k+1} = 0, residuals and variables scaled."""

    def __init__(self, model: StepModel, layout: StageLayout) -> None:
        self.model = model
        self.layout = layout
        self.curvature = np.zeros(layout.horizon)
        self.size = layout.state_size * layout.horizon
        self._block_scale = layout.block_scale / layout.state_scale[:, None]

    def value(self, z: Array) -> Array:
        """The residuals [n N]."""
        x, u = self.layout.split(z)
        residual: Array = (self.model.step(x[:-1], u[:-1], u[1:], self.curvature) - x[1:]) / self.layout.state_scale
        return residual.ravel()

    def linearize(self, z: Array) -> tuple[Array, Array]:
        """(residuals [n N], F_k = d f_k / d (x_k, u_k, u_{k+1}) [N, n, n+4])."""
        x, u = self.layout.split(z)
        x_next, *jacobians = self.model.linearize(x[:-1], u[:-1], u[1:], self.curvature)
        f = np.concatenate(jacobians, axis=2) * self._block_scale
        return ((x_next - x[1:]) / self.layout.state_scale).ravel(), f

    def curvature_blocks(self, z: Array, multipliers: Array, cost: "StackedCost | None" = None) -> Array:
        """Second derivatives of multipliers' residuals, and of a cost, by each stage's variables [N, n+4, n+4].

        The model's own, or differences of its exact derivatives, all stages and directions in one batch.
        """
        layout, scale = self.layout, self.layout.block_scale
        weights = multipliers.reshape(-1, layout.state_size) / layout.state_scale
        stages = layout.stages(z)
        at = (*stages, self.curvature, weights)
        expansion = cost.expansion(z) if cost else None
        found = self.model.curvature_with(*at, expansion) if expansion else self.model.weighted_curvature(*at)
        if found is None:
            found = DifferencedExpansion(self._weighted(weights), *stages, scale).curvature()
            found = found + expansion.curvature() if expansion else found
        return found * scale[:, None] * scale

    def _weighted(self, weights: Array) -> Callable[[Array, Array, Array], Array]:
        def gradient(x: Array, u: Array, u_next: Array) -> Array:
            repeats = len(x) // len(weights)
            curvature, weight = np.tile(self.curvature, repeats), np.tile(weights, (repeats, 1))
            return self.model.weighted_gradient(x, u, u_next, curvature, weight)

        return gradient

    def __call__(self, z: NDArray[Any]) -> NDArray[Any]:
        if z.dtype != object:
            return self.value(z)
        value, f = self.linearize(ExtractValue(z).ravel())
        jacobian = np.zeros((self.size, z.size))
        jacobian[dynamics_pattern(self.layout.block_columns)] = np.append(f, np.full(self.size, -1.0))
        return _chained(value, jacobian, z)


class StackedCost:
    """A `StageCost` as a cost of a MathematicalProgram."""

    def __init__(self, cost: StageCost, layout: StageLayout) -> None:
        self._cost = cost
        self._layout = layout
        self._last: tuple[Array, CostExpansion] | None = None  # scratch: see `expansion`

    def value(self, z: Array) -> float:
        return self._cost.value(*self._layout.stages(z))

    def gradient(self, z: Array) -> Array:
        """Its derivative by the decision vector (all of it: variables behind the stages' have none)."""
        by_stage = self.expansion(z).gradient() * self._layout.block_scale
        return np.bincount(self._layout.block_columns.ravel(), by_stage.ravel(), z.size).astype(float)

    def expansion(self, z: Array) -> CostExpansion:
        """The cost to second order, kept for the next call: an iterate's curvature is asked for after its gradient."""
        if self._last is None or not np.array_equal(self._last[0], z):
            self._last = z.copy(), self._cost.expansion(*self._layout.stages(z))
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
