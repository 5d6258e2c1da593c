"""The robust fit: true parameters found, spoilt windows that move none, steps within bounds."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.robust_fit import (
    Criterion,
    Predicted,
    bounded_step,
    given_up,
    loss,
    robust_fit,
    robust_scales,
)
from drift_drake.gap.estimation.unknowns import Unknown, unknown
from drift_drake.gap.estimation.windows import HORIZONS, errors, windowed
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth

CAR = VehicleParameters()
TRUE = {"friction_level": -0.1, "rear_stiffness_error": -0.2, "yaw_inertia_error": 0.15}
EVIDENCE = 0.05


@pytest.fixture(scope="module")
def runs():
    deviations = {"friction": -0.1, "rear_stiffness": -0.2, "yaw_inertia": 0.15}
    return [windowed(run) for run in make_case(Truth({}, {}, deviations), CAR, np.random.default_rng(4), 4.0)]


@pytest.fixture(scope="module")
def fitted(runs):
    return fit(runs)


def fit(runs):
    unknowns = [unknown(name, CAR, frozenset()) for name in TRUE]
    return robust_fit(
        lambda cars: [errors(runs, CAR.constants(), make_effects(car)) for car in cars], unknowns, EVIDENCE
    )


def deviations(found):
    priors = np.array([unknown(name, CAR, frozenset()).prior for name in found.names])
    return np.sqrt(np.diag(np.linalg.inv(EVIDENCE * found.information + np.diag(priors**-2))))


def test_finds_the_true_parameters_within_its_deviations(fitted):
    off = fitted.theta - np.array(list(TRUE.values()))
    assert np.all(np.abs(off) < 2.0 * deviations(fitted))
    assert np.all(np.abs(off) < 0.03)
    np.testing.assert_allclose(robust_scales(fitted.errors), fitted.scales, rtol=0.05)


def test_spoilt_windows_move_it_by_less_than_its_deviations(runs, fitted):
    spoilt = []
    for run in runs:
        y, start_y = run.y.copy(), run.start_y.copy()
        # A sensor that hangs for half a second: a twentieth of what is compared.
        for part in (y, start_y):
            part[200:220, 0] += 1.0
        spoilt.append(dataclasses.replace(run, y=y, start_y=start_y))
    again = fit(spoilt)
    assert np.all(np.abs(again.theta - fitted.theta) < deviations(fitted))


@pytest.mark.parametrize("width", [8.0, 100.0])
def test_the_weight_is_the_slope_of_the_loss(width):
    squares = np.array([0.1, 1.0, 10.0, 1000.0])
    _, weights = loss(squares, width)
    slope = (loss(squares + 1e-4, width)[0] - loss(squares - 1e-4, width)[0]) / 2e-4
    np.testing.assert_allclose(weights, slope, rtol=1e-4)
    assert loss(np.array([1e9]), width)[0] == pytest.approx(width)


def test_a_step_keeps_within_bounds_and_frees_the_others():
    hessian = np.array([[2.0, 0.5], [0.5, 1.0]])
    low, high = np.array([0.0, -1.0]), np.array([1.0, 1.0])
    free = bounded_step(hessian, np.array([-0.2, 0.1]), np.array([0.5, 0.0]), low, high, 0.0)
    np.testing.assert_allclose(free, -np.linalg.solve(hessian, [-0.2, 0.1]))
    # The first is at its bound and would leave: the second moves as if alone.
    held = bounded_step(hessian, np.array([1.0, 0.1]), np.array([0.0, 0.0]), low, high, 0.0)
    np.testing.assert_allclose(held, [0.0, -0.1])
    far = np.array([0.9, 0.9]) + bounded_step(hessian, np.array([-9.0, -9.0]), np.array([0.9, 0.9]), low, high, 0.0)
    assert np.all((far >= low) & (far <= high))
    damped = bounded_step(hessian, np.array([-0.2, 0.1]), np.array([0.5, 0.0]), low, high, 10.0)
    assert np.linalg.norm(damped) < np.linalg.norm(free)


def test_what_nothing_depends_on_stays_where_it_is() -> None:
    """A limit that no drive reaches, without a prior: the others move as if it were not there."""
    hessian, low, high = np.diag([4.0, 0.0]), np.zeros(2), np.ones(2)
    step = bounded_step(hessian, np.array([-0.8, 0.0]), np.array([0.5, 0.7]), low, high, 0.0)
    np.testing.assert_allclose(step, [0.2, 0.0])


def linear(slopes: np.ndarray, offsets: np.ndarray) -> Predicted:
    """Errors [windows, HORIZONS, 1] that go with one magnitude: slopes (q - offsets) [windows]."""
    return lambda cars: [np.repeat((slopes * (car["q"] - offsets))[:, None, None], HORIZONS, 1) for car in cars]


def test_the_steps_curvature_is_the_losses_own_where_it_is_convex() -> None:
    """The second derivative of the criterion by differences, of errors that are linear in one unknown."""
    unknowns, scales, width = [Unknown("q", 1.0, 10.0, -9.0, 9.0, 0.0)], np.ones((HORIZONS, 1)), 30.0
    criterion = Criterion(linear(np.array([1.0, 2.0, 0.5]), np.array([0.3, 1.2, -0.8])), unknowns, EVIDENCE)
    at = criterion.at(np.array([0.1]), scales, width)
    part = (criterion.derivatives(at) * np.sqrt(at.weights)[:, None, :, None]).reshape(-1, 1)
    found = criterion.hessian(part.T @ part - given_up(part, at, scales, width))
    low, middle, high = (criterion.at(np.array([0.1 + step]), scales, width).cost for step in (-1e-3, 0.0, 1e-3))
    assert found[0, 0] == pytest.approx((high - 2.0 * middle + low) / 1e-6, rel=1e-4)


def test_windows_that_hang_on_a_magnitude_do_not_hold_its_steps_short() -> None:
    """Wheels that lock: errors that grow as an exponential of it, far beyond what the loss still follows.

    Derivatives are rough and used again, as those of a slow simulator. The others' mean is the answer.
    """
    offsets = 0.5 + 0.3 * np.random.default_rng(0).standard_normal(60)

    def errors_of(q: float) -> np.ndarray:
        beyond = 60.0 * (q - 0.5)
        locked = np.expm1(min(beyond, 300.0)) if beyond > 0.0 else beyond
        return np.concatenate([3.0 * (q - offsets), np.full(6, 10.0 * locked)])

    fit = robust_fit(
        lambda cars: [np.repeat(errors_of(car["q"])[:, None, None], HORIZONS, 1) for car in cars],
        [Unknown("q", 1.0, 1.0, -2.0, 2.0, 0.0)], EVIDENCE, np.array([0.6]), near=0.2, difference=0.1,
    )  # fmt: skip
    assert fit.theta[0] == pytest.approx(np.mean(offsets), abs=0.01)


def test_a_difference_over_a_prediction_that_diverges_is_no_derivative() -> None:
    def predicted(cars):
        return [np.stack([np.full((HORIZONS, 1), car["q"]), np.full((HORIZONS, 1), 1e3 if car["q"] > 0.0 else 0.2)])
                for car in cars]  # fmt: skip

    criterion = Criterion(predicted, [Unknown("q", 1.0, 1.0, -2.0, 2.0, 0.0)], EVIDENCE)
    found = criterion.derivatives(criterion.at(np.zeros(1), np.ones((HORIZONS, 1)), 8.0))
    np.testing.assert_allclose(found[0], 1.0)
    np.testing.assert_array_equal(found[1], 0.0)
