"""The filter's innovations are white where the model is right, and frozen gains repeat them."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.observed import observe_case
from drift_drake.gap.estimation.problem import NUISANCES, flat
from drift_drake.gap.estimation.variants import Variant
from drift_drake.gap.logs.noise import white_noise_level

NAMES = ("rear_stiffness_error",)


def true_theta(problem, truth):
    theta = np.zeros(problem.nuisances + 1)
    for i, name in enumerate(NUISANCES):
        if name in truth.deviations:
            theta[i] = truth.deviations[name] / problem.tolerance[i]
    theta[-1] = truth.effects[NAMES[0]]
    return theta


@pytest.fixture(scope="module")
def true_model(stiffness_case):
    truth, runs = stiffness_case
    problem = make_problem(runs, VehicleParameters())
    theta = true_theta(problem, truth)
    return problem, theta, filter_case(problem, theta, NAMES)


def test_innovations_are_white_where_the_model_is_right(true_model):
    problem, _, gains = true_model
    e = np.concatenate([e[run.counted] for run, e in zip(problem.runs, gains.innovations, strict=True)])
    count = e.shape[0]
    assert np.mean(e**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / e.size) + 0.04)
    for channel in range(e.shape[1]):
        lag_one = np.mean(e[1:, channel] * e[:-1, channel])
        assert abs(lag_one) < 4.0 / np.sqrt(count)


def test_a_wrong_model_is_distinguished_from_the_right_one(true_model):
    problem, theta, gains = true_model
    nominal = filter_case(problem, theta[:-1] * 0.0, ())
    right, wrong = (np.mean(flat(problem, g.innovations) ** 2) for g in (gains, nominal))
    assert wrong > right + 0.2


def test_frozen_gains_repeat_the_filter(true_model):
    problem, theta, gains = true_model
    np.testing.assert_allclose(
        observe_case(problem, gains, [Variant(theta, NAMES)])[0], flat(problem, gains.innovations), rtol=1e-9, atol=1e-9
    )


def test_a_missing_column_drops_its_channel_only(stiffness_case):
    truth, runs = stiffness_case
    problem = make_problem([run.without("omega_r", "ax") for run in runs], VehicleParameters())
    gains = filter_case(problem, true_theta(problem, truth), NAMES)
    e = np.concatenate([e[run.counted] for run, e in zip(problem.runs, gains.innovations, strict=True)])
    assert np.all(e[:, [3, 4]] == 0.0)
    assert np.mean(e[:, [0, 1, 2, 5, 6, 7, 8]] ** 2) == pytest.approx(1.0, abs=0.08)


@pytest.mark.parametrize("lost", [("beta",), ("beta", "x", "y", "psi", "ax", "ay")])
def test_a_first_sideslip_is_found_where_none_is_logged(stiffness_case, lost):
    truth, runs = stiffness_case
    problem = make_problem([run.without(*lost) for run in runs], VehicleParameters())
    for run, data in zip(runs, problem.runs, strict=True):
        assert data.y[0, 2] == pytest.approx(run.beta[0], abs=0.12)
    gains = filter_case(problem, true_theta(problem, truth), NAMES)
    e = flat(problem, gains.innovations)
    assert np.mean(e**2) == pytest.approx(1.0, abs=0.1)


def test_noise_level_of_white_noise_on_a_smooth_signal():
    rng = np.random.default_rng(3)
    t = np.arange(4000) * 0.01
    signal = 5.0 * np.sin(2.0 * t) + np.where(t > 20.0, 1.0, 0.0)
    assert white_noise_level(signal + 0.02 * rng.standard_normal(4000)) == pytest.approx(0.02, rel=0.06)
