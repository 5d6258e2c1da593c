"""Differentiation against closed forms and against the posterior written out as one linear system."""

import numpy as np
import pytest

from drift_drake.gap.logs.importing.smoothing import (
    START_VARIANCE,
    UNINFORMED,
    _likelihood,
    _smoothed,
    noise_of,
    smooth,
)


def recorded(noise, seed=0, count=1500, period=0.01):
    t = np.arange(count) * period
    z = np.sin(t) + 0.3 * np.sin(4.0 * t)
    rate, acceleration = np.cos(t) + 1.2 * np.cos(4.0 * t), -np.sin(t) - 4.8 * np.sin(4.0 * t)
    return t, z + noise * np.random.default_rng(seed).standard_normal(count), (z, rate, acceleration)


def exact_posterior(steps, z, ratio):
    """Mean and variance of all states, from the information matrix of the whole stretch at once; and the evidence's
    quadratic form."""
    n = len(z)
    information, right = np.zeros((3 * n, 3 * n)), np.zeros(3 * n)
    information[:3, :3] += np.diag(1.0 / np.array(START_VARIANCE))
    for k in range(1, n):
        h = steps[k]
        f = np.array([[1.0, h, h * h / 2], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
        # Of a random walk of the acceleration, integrated twice: the integral of g g' with g = (s^2 / 2, s, 1).
        q = ratio * np.array([[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]])
        step = np.hstack([-f, np.eye(3)])
        information[3 * k - 3 : 3 * k + 3, 3 * k - 3 : 3 * k + 3] += step.T @ np.linalg.solve(q, step)
    for k in np.flatnonzero(np.isfinite(z)):
        information[3 * k, 3 * k] += 1.0
        right[3 * k] += z[k]
    covariance = np.linalg.inv(information)
    return (covariance @ right).reshape(n, 3), np.diag(covariance).reshape(n, 3)


def test_smoother_is_the_posterior_of_all_readings():
    generator = np.random.default_rng(1)
    steps = generator.uniform(0.5, 1.5, 25)
    z = np.cumsum(generator.standard_normal(25))
    z[[6, 7, 8, 20]] = np.nan
    mean, variance = _smoothed(steps, z, 0.03)
    exact_mean, exact_variance = exact_posterior(steps, z, 0.03)
    np.testing.assert_allclose(mean, exact_mean, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(variance, exact_variance, rtol=1e-6, atol=1e-7)


def test_innovations_are_white_where_the_model_is_true():
    generator = np.random.default_rng(2)
    count, ratio = 4000, 1e-3
    jerk = np.sqrt(ratio) * generator.standard_normal((count, 8)) * np.sqrt(8.0)
    acceleration = np.cumsum(jerk.ravel() / 8.0)
    rate = np.cumsum(acceleration / 8.0)
    z = np.cumsum(rate / 8.0)[::8] + generator.standard_normal(count)
    chi2, _, used = _likelihood(np.ones(count), z, ratio, 0)
    assert used == count - UNINFORMED
    assert chi2 / used == pytest.approx(1.0, abs=0.07)


@pytest.mark.parametrize("noise", [1e-5, 1e-3, 3e-2])
def test_noise_and_derivatives(noise):
    t, z, exact = recorded(noise)
    found = smooth(t, z)
    assert found.noise == pytest.approx(noise, rel=0.08)
    middle = slice(30, -30)
    for order, values in enumerate((found.value, found.rate, found.acceleration)):
        error = (values[:, 0] - exact[order])[middle]
        # A motion smoother than white jerk is estimated better than promised, never much worse.
        assert 0.2 < np.std(error) / np.median(found.std[middle, order]) < 1.2


def test_rate_does_not_depend_on_units_of_value_and_time():
    t, z, _ = recorded(1e-3)
    one, other = smooth(t, z), smooth(t * 1e3 + 1.7e9, z * 1e4 + 5e5)
    np.testing.assert_allclose(other.rate * 1e-1, one.rate, atol=2e-3)
    assert other.noise == pytest.approx(1e4 * one.noise, rel=1e-3)
    assert other.bandwidth == pytest.approx(one.bandwidth * 1e-3, rel=0.02)


def test_missing_readings_are_bridged_and_known_less_well():
    t, z, exact = recorded(1e-3)
    z[700:740] = np.nan
    found = smooth(t, z)
    assert np.all(np.isfinite(found.rate))
    assert np.max(np.abs(found.rate[700:740, 0] - exact[1][700:740])) < 4.0 * np.max(found.std[700:740, 1])
    assert found.std[720, 1] > 2.0 * found.std[500, 1]


def test_several_columns_share_the_noise():
    t, z, _ = recorded(1e-3)
    both = smooth(t, np.stack([z, recorded(1e-3, seed=5)[1]], axis=1))
    assert both.value.shape == (len(t), 2)
    assert both.noise == pytest.approx(1e-3, rel=0.06)


def test_vibration_is_noise_where_the_bandwidth_is_given():
    t, z, exact = recorded(1e-5)
    shaken = z + 2e-3 * np.sin(2.0 * np.pi * 14.0 * t)
    free, bounded = smooth(t, shaken), smooth(t, shaken, highest=4.0)
    assert free.bandwidth > 10.0
    assert bounded.bandwidth <= 4.05
    assert np.std(free.rate[50:-50, 0] - exact[1][50:-50]) > 0.1
    assert np.std(bounded.rate[50:-50, 0] - exact[1][50:-50]) < 0.02
    assert bounded.noise == pytest.approx(2e-3 / np.sqrt(2.0), rel=0.2)


def test_a_motion_at_rest_has_no_rate():
    found = smooth(np.arange(50) * 0.01, np.full(50, 2.5))
    np.testing.assert_allclose(found.value, 2.5)
    np.testing.assert_allclose(found.rate, 0.0, atol=1e-9)


def test_too_few_readings():
    with pytest.raises(ValueError, match="10 readings cannot be differentiated"):
        smooth(np.arange(10) * 0.01, np.arange(10.0))


def test_a_channel_of_zeros_has_no_noise_and_warns_of_nothing():
    """Its likelihood has no largest value; warnings are errors here."""
    assert noise_of(np.arange(50) * 0.01, np.zeros(50)) == 0.0
