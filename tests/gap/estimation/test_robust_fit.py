"""The robust fit: true parameters found, spoilt windows that move none, steps within bounds."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.robust_fit import bounded_step, loss, robust_fit, robust_scales
from drift_drake.gap.estimation.unknowns import unknown
from drift_drake.gap.estimation.windows import errors, windowed
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
