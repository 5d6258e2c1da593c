"""The robust fit of a toy whose errors are linear in two magnitudes: what it minimises, written out."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from scipy.optimize import minimize

from drift_drake.gap.estimation.robust_fit import WIDTHS, RobustFit, bounded_step, loss, robust_fit, robust_scales
from drift_drake.gap.estimation.unknowns import Unknown

WINDOWS, HORIZONS, CHANNELS = 120, 5, 2
EVIDENCE = 0.1
NAMES = ("mass_error", "friction_level")
TRUE = np.array([0.12, -0.05])


class Toy:
    """Errors [windows, horizons, channels] = noise + J (theta - true), a few of them spoilt; counts predictions."""

    def __init__(self, spoilt: float = 0.0) -> None:
        rng = np.random.default_rng(9)
        self.jacobian = rng.normal(size=(WINDOWS, HORIZONS, CHANNELS, 2)) * [3.0, 10.0]
        self.noise = rng.normal(size=(WINDOWS, HORIZONS, CHANNELS)) * [0.3, 1.0]
        self.noise[:9, :, 0] += spoilt
        self.predictions, self.asked = 0, set()

    def __call__(self, cars: Sequence[Mapping[str, float]]) -> list[np.ndarray]:
        self.predictions += len(cars)
        self.asked |= {car.get(NAMES[0], 0.0) for car in cars}
        return [self.noise + self.jacobian @ (np.array([car.get(n, 0.0) for n in NAMES]) - TRUE) for car in cars]

    def errors(self, theta: np.ndarray) -> np.ndarray:
        return self([dict(zip(NAMES, theta, strict=True))])[0]


def unknowns(low: float = -0.5, high: float = 0.5) -> list[Unknown]:
    return [Unknown(NAMES[0], 0.2, 0.3, low, high, 0.0), Unknown(NAMES[1], 0.1, 0.02, -0.5, 0.5, 0.01)]


PRIOR = np.array([0.3, 0.02])


def cost(toy: Toy, theta: np.ndarray, found: RobustFit) -> float:
    """A power of the likelihood under Geman and McClure's loss w s / (w + s), s a window's mean square, and priors."""
    s = np.mean((toy.errors(theta) / found.scales) ** 2, axis=1)
    return 0.5 * EVIDENCE * HORIZONS * np.sum(WIDTHS[-1] * s / (WIDTHS[-1] + s)) + 0.5 * np.sum((theta / PRIOR) ** 2)


@pytest.mark.parametrize("spoilt", [0.0, 40.0])
def test_the_fit_is_the_minimum_of_losses_and_priors(spoilt: float) -> None:
    toy = Toy(spoilt)
    found = robust_fit(toy, unknowns(), EVIDENCE)
    assert found.names == NAMES
    best = minimize(
        lambda theta: cost(toy, theta, found), TRUE, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}
    )
    deviation = np.sqrt(np.diag(np.linalg.inv(EVIDENCE * found.information + np.diag(PRIOR**-2))))
    assert np.all(np.abs(found.theta - best.x) < 0.1 * deviation)
    assert cost(toy, found.theta, found) - best.fun < 0.01
    np.testing.assert_allclose(found.errors, toy.errors(found.theta), atol=1e-12)
    np.testing.assert_allclose(robust_scales(found.errors), found.scales, rtol=0.05)
    # Gauss and Newton's second derivatives, each window by the weight that its loss's slope gives.
    s = np.mean((found.errors / found.scales) ** 2, axis=1)
    weight = (WIDTHS[-1] / (WIDTHS[-1] + s)) ** 2
    j = toy.jacobian / found.scales[..., None]
    np.testing.assert_allclose(found.information, np.einsum("wc,whci,whcj->ij", weight, j, j), rtol=0.02)


def test_a_bound_holds_the_magnitude_and_frees_the_other() -> None:
    for low, high, at in ((-0.5, 0.05, 0.05), (0.2, 0.5, 0.2)):
        toy = Toy()
        found = robust_fit(toy, unknowns(low, high), EVIDENCE, np.array([0.5 * (low + high), 0.0]))
        assert found.theta[0] == pytest.approx(at, abs=1e-12)
        assert low - 1e-12 < min(toy.asked) <= max(toy.asked) < high + 1e-12  # for derivatives, too
        slope = [cost(toy, found.theta + d, found) - cost(toy, found.theta - d, found) for d in 1e-5 * np.eye(2)]
        assert slope[0] * (1.0 if at == low else -1.0) > 0.0
        assert abs(slope[1]) / 2e-5 < 0.3 / PRIOR[1]


def test_scales_are_those_of_normal_errors_whatever_a_few_are() -> None:
    e = np.random.default_rng(0).normal(size=(20_000, 2, 1)) * [[2.0], [0.5]]
    e[:600] = 1e6
    np.testing.assert_allclose(robust_scales(e).ravel(), [2.0, 0.5], rtol=0.06)


def test_derivatives_are_used_again_near_where_they_are_of() -> None:
    """Two predictions each time; the toy's are the same everywhere."""
    often, once = Toy(), Toy()
    fits = [robust_fit(often, unknowns(), EVIDENCE), robust_fit(once, unknowns(), EVIDENCE, near=1e3)]
    np.testing.assert_allclose(fits[0].theta, fits[1].theta, atol=1e-3)
    assert once.predictions < often.predictions


def test_a_fit_ends_with_the_step_that_gains_nothing_worth_another() -> None:
    """Near the minimum: scales, where it starts, two derivatives, one step."""
    toy = Toy()
    found = robust_fit(toy, unknowns(), EVIDENCE)
    deviation = np.sqrt(np.diag(np.linalg.inv(EVIDENCE * found.information + np.diag(PRIOR**-2))))
    toy.predictions = 0
    again = robust_fit(toy, unknowns(), EVIDENCE, found.theta + 0.03 * deviation, widths=WIDTHS[-1:])
    assert toy.predictions == 5
    assert np.all(np.abs(again.theta - found.theta) < 0.03 * deviation)


def test_a_start_of_ones_own_is_kept_as_it_is() -> None:
    start = TRUE.copy()
    found = robust_fit(Toy(), unknowns(), EVIDENCE, start, widths=WIDTHS[-1:])
    np.testing.assert_array_equal(start, TRUE)
    assert np.all(np.abs(found.theta - robust_fit(Toy(), unknowns(), EVIDENCE).theta) < 2e-3)


def test_a_loss_is_half_its_width_at_its_width_and_weighs_a_quarter() -> None:
    lost, weight = loss(np.array([0.0, 8.0]), 8.0)
    np.testing.assert_allclose(lost, [0.0, 4.0])
    np.testing.assert_allclose(weight, [1.0, 0.25])


def test_damping_adds_shares_of_the_diagonal() -> None:
    hessian, gradient = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([0.4, -0.3])
    wide = np.full(2, 9.0)
    step = bounded_step(hessian, gradient, np.zeros(2), -wide, wide, 0.5)
    np.testing.assert_allclose(np.array([[3.0, 0.5], [0.5, 1.5]]) @ step, -gradient)


def test_what_is_at_a_bound_leaves_it_inwards_alone() -> None:
    """A magnitude held at its bound leaves the other its own Newton step, without the coupling's part."""
    hessian = np.array([[2.0, 0.5], [0.5, 1.0]])
    low, high, free = np.full(2, -9.0), np.array([1.0, 9.0]), np.array([0.4, -0.3])
    at = np.array([1.0, 0.0])
    for bound, gradient in ((at, free), (-at, -free)):
        lows, highs = (low, high) if bound is at else (-high, -low)
        inwards = bounded_step(hessian, gradient, bound, lows, highs, 0.0)
        np.testing.assert_allclose(hessian @ inwards, -gradient, atol=1e-15)
        held = bounded_step(hessian, -gradient, bound, lows, highs, 0.0)
        np.testing.assert_allclose(held, [0.0, gradient[1]], atol=1e-15)
