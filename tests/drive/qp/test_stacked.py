"""A horizon's stages stacked: where variables lie, and derivatives of a toy car and cost that are known exactly."""

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

from drift_drake.car.step_model import INPUT_SCALE, STATE_SCALE, StepModel
from drift_drake.drive.qp.stacked import DifferencedExpansion, StackedCost, StackedDynamics, StageLayout

Array = NDArray[np.float64]
HORIZON, OWN = 3, np.array([0.2, 40.0])
SIZES = np.concatenate([STATE_SCALE, OWN, INPUT_SCALE, INPUT_SCALE])  # of (x, u, u_next) [12]
RNG = np.random.default_rng(11)
LINEAR, BENT = RNG.normal(size=(8, 12)), RNG.normal(size=(8, 12, 12))
BENT = BENT + np.swapaxes(BENT, 1, 2)


class Quadratic(StepModel):
    """Eight states in sizes of their own: x_next = S (L w + w' B w / 2) + curvature, w = (x, u, u_next) over sizes."""

    internal_scale = OWN

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        w = np.concatenate([x, u, u_next], axis=1) / SIZES
        found = w @ LINEAR.T + 0.5 * np.einsum("kab,na,nb->nk", BENT, w, w)
        return found * SIZES[:8] + curvature[:, None]


class Cubic:
    """A cost of each stage, sum_k w' C w / 2 + (d w)^3 / 6."""

    counted = 0

    def __init__(self) -> None:
        self.c, self.d = BENT[0], LINEAR[0]

    def _scaled(self, x: Array, u: Array, u_next: Array) -> Array:
        return np.concatenate([x, u, u_next], axis=1) / SIZES

    def value(self, x: Array, u: Array, u_next: Array) -> float:
        w = self._scaled(x, u, u_next)
        return float(0.5 * np.einsum("ab,na,nb", self.c, w, w) + ((w @ self.d) ** 3).sum() / 6.0)

    def gradient(self, x: Array, u: Array, u_next: Array) -> Array:
        w = self._scaled(x, u, u_next)
        return (w @ self.c + 0.5 * (w @ self.d)[:, None] ** 2 * self.d) / SIZES

    def curvature(self, x: Array, u: Array, u_next: Array) -> Array:
        along = self._scaled(x, u, u_next) @ self.d
        return (self.c + along[:, None, None] * np.outer(self.d, self.d)) / np.outer(SIZES, SIZES)

    def expansion(self, x: Array, u: Array, u_next: Array) -> DifferencedExpansion:
        self.counted += 1
        return DifferencedExpansion(self.gradient, x, u, u_next, SIZES)


LAYOUT = StageLayout(OWN, HORIZON)


def trajectory() -> tuple[Array, Array, Array]:
    """(decision vector without slacks, x [4, 8], u [4, 2])."""
    rng = np.random.default_rng(5)
    x, u = rng.normal(size=(4, 8)) * SIZES[:8], rng.normal(size=(4, 2)) * INPUT_SCALE
    return np.append(x / SIZES[:8], u / INPUT_SCALE), x, u


def points(x: Array, u: Array) -> Array:
    """(x_k, u_k, u_{k+1}) over sizes [3, 12]."""
    return np.array([np.concatenate([x[k], u[k], u[k + 1]]) for k in range(HORIZON)]) / SIZES


def test_variables_lie_states_first_then_inputs_then_slacks() -> None:
    """The decision vector is (x_0..x_N, u_0..u_N, slack_1..slack_N)."""
    z, x, u = trajectory()
    found = LAYOUT.split(np.append(z, [7.0, 8.0, 9.0]))
    np.testing.assert_allclose(found[0], x, rtol=1e-14)
    np.testing.assert_allclose(found[1], u, rtol=1e-14)
    np.testing.assert_array_equal(np.concatenate(LAYOUT.stages(z), axis=1), np.array(
        [np.concatenate([found[0][k], found[1][k], found[1][k + 1]]) for k in range(HORIZON)]))  # fmt: skip
    np.testing.assert_allclose(z[LAYOUT.block_columns], points(x, u), rtol=1e-14)
    bound = np.append(z, [7.0, 8.0, 9.0])[LAYOUT.bound_columns]
    for k in range(1, HORIZON + 1):
        np.testing.assert_allclose(bound[k - 1], [*(x[k] / SIZES[:8]), *(u[k] / INPUT_SCALE), 6.0 + k], rtol=1e-14)
    assert (LAYOUT.state_size, LAYOUT.horizon) == (8, HORIZON)
    np.testing.assert_array_equal(LAYOUT.block_scale, SIZES)


@pytest.fixture
def dynamics() -> StackedDynamics:
    stacked = StackedDynamics(Quadratic(), LAYOUT)
    stacked.curvature = np.array([0.3, -0.2, 0.1])
    return stacked


def test_dynamics_are_the_models_steps_to_the_next_states(dynamics: StackedDynamics) -> None:
    z, x, u = trajectory()
    w = points(x, u)
    ends = w @ LINEAR.T + 0.5 * np.einsum("kab,na,nb->nk", BENT, w, w) + dynamics.curvature[:, None] / SIZES[:8]
    residual = (ends - x[1:] / SIZES[:8]).ravel()
    np.testing.assert_allclose(dynamics.value(z), residual, rtol=1e-12, atol=1e-12)
    found, f = dynamics.linearize(z)
    np.testing.assert_allclose(found, residual, rtol=1e-12, atol=1e-12)
    slopes = LINEAR + np.einsum("kab,nb->nka", BENT, w)
    np.testing.assert_allclose(f, slopes, rtol=1e-5, atol=1e-7)

    way = np.random.default_rng(6).normal(size=(z.size, 2))
    on_autodiff = dynamics(InitializeAutoDiff(z[:, None], way).ravel())
    wanted = [
        np.einsum("nkj,nj->nk", slopes, d[LAYOUT.block_columns]).ravel() - d[8 : 8 * (HORIZON + 1)] for d in way.T
    ]
    np.testing.assert_allclose(ExtractValue(on_autodiff).ravel(), residual, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(ExtractGradient(on_autodiff), np.transpose(wanted), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("with_cost", [False, True])
def test_second_derivatives_are_the_weighted_ones_of_each_stage(dynamics: StackedDynamics, with_cost: bool) -> None:
    z, x, u = trajectory()
    multipliers = np.random.default_rng(7).normal(size=8 * HORIZON)
    found = dynamics.curvature_blocks(z, multipliers, StackedCost(Cubic(), LAYOUT) if with_cost else None)
    wanted = np.einsum("nk,kab->nab", multipliers.reshape(HORIZON, 8), BENT)
    if with_cost:
        wanted = wanted + Cubic().curvature(x[:-1], u[:-1], u[1:]) * np.outer(SIZES, SIZES)
    np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-3)


def test_differences_of_a_gradient_are_symmetric_second_derivatives() -> None:
    """Exactly symmetric, as solvers take them, and right to the differences' error."""
    _, x, u = trajectory()
    at, cost = (x[:-1], u[:-1], u[1:]), Cubic()
    expansion = DifferencedExpansion(cost.gradient, *at, SIZES)
    np.testing.assert_array_equal(expansion.gradient(), cost.gradient(*at))
    bent = expansion.curvature()
    np.testing.assert_array_equal(bent, np.swapaxes(bent, 1, 2))
    scale = np.outer(SIZES, SIZES)
    np.testing.assert_allclose(bent * scale, cost.curvature(*at) * scale, rtol=1e-4, atol=1e-4)


def test_a_cost_is_the_stages_sum_and_its_derivative_theirs() -> None:
    cost = Cubic()
    stacked, (z, x, u) = StackedCost(cost, LAYOUT), trajectory()
    z = np.append(z, [7.0, 8.0, 9.0])  # slacks, which it does not know
    assert stacked.value(z) == pytest.approx(cost.value(x[:-1], u[:-1], u[1:]), rel=1e-12)
    gradient, step = stacked.gradient(z), 1e-5
    numeric = [(stacked.value(z + step * e) - stacked.value(z - step * e)) / (2.0 * step) for e in np.eye(z.size)]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(gradient[-HORIZON:], 0.0)
    on_autodiff = stacked(InitializeAutoDiff(z).ravel())
    assert on_autodiff.value() == stacked.value(z)
    np.testing.assert_allclose(on_autodiff.derivatives(), gradient, rtol=1e-12)


def test_a_costs_expansion_is_made_once_for_each_point() -> None:
    cost = Cubic()
    stacked, (z, *_) = StackedCost(cost, LAYOUT), trajectory()
    first = stacked.gradient(z)
    stacked.expansion(z)
    assert cost.counted == 1
    z[0] += 1.0
    assert not np.allclose(stacked.gradient(z), first)
    assert cost.counted == 2
