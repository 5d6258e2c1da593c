"""The regression run by run against dense linear algebra over all runs."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from drift_drake.gap.estimation.regression import (
    Responses,
    _definite,
    equations,
    left_over,
    regress,
    solve_equations,
    summed_equations,
)

PARAMETERS, SHARED = 9, 3  # own parameters, of which the first are every run's
CHANNELS = np.array([0, 0, 1, 1, 2, 4])


def runs(shared):
    """Three runs; each also has two own parameters of its own."""
    rng = np.random.default_rng(0)
    force = rng.normal(size=CHANNELS.size)
    out = []
    for i, rows in enumerate((60, 40, 50)):
        columns = np.array([*range(SHARED), SHARED + 2 * i, SHARED + 2 * i + 1])
        d, j = rng.normal(size=(rows, CHANNELS.size)), rng.normal(size=(rows, columns.size))
        force = force if shared else rng.normal(size=CHANNELS.size)
        out.append(Responses(d, CHANNELS, j, columns, rng.normal(size=rows) + 3.0 * d @ force))
    return out


def dense(parts, shared):
    """(derivatives by [own parameters, weights], innovations, channel of each weight)."""
    own = np.zeros((sum(len(part.residual) for part in parts), PARAMETERS))
    weights = np.zeros((len(own), CHANNELS.size * (1 if shared else len(parts))))
    at = 0
    for i, part in enumerate(parts):
        rows = slice(at, at + len(part.residual))
        own[rows, part.columns] = part.own
        first = 0 if shared else CHANNELS.size * i
        weights[rows, first : first + CHANNELS.size] = part.weights
        at += len(part.residual)
    channel_of = np.tile(CHANNELS, weights.shape[1] // CHANNELS.size)
    return np.hstack([own, weights]), np.concatenate([part.residual for part in parts]), channel_of


@pytest.mark.parametrize("shared", [False, True])
def test_the_mode_is_that_of_the_dense_equations(shared):
    parts = runs(shared)
    of = equations(parts, PARAMETERS, shared)
    jacobian, e, channel_of = dense(parts, shared)
    np.testing.assert_array_equal(of.channel_of, channel_of)
    rng = np.random.default_rng(1)
    prior, precision = rng.uniform(0.1, 2.0, PARAMETERS), rng.uniform(0.1, 2.0, channel_of.size)
    theta = rng.normal(size=PARAMETERS)
    gradient = of.gradient + prior * theta
    found = solve_equations(of, gradient, prior, precision)
    matrix = jacobian.T @ jacobian + np.diag(np.append(prior, precision))
    right = jacobian.T @ e + np.append(prior * theta, np.zeros(channel_of.size))
    expected = -np.linalg.solve(matrix, right)
    got = np.concatenate([found.own, *found.weights])
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.variance, np.diag(np.linalg.inv(matrix))[PARAMETERS:], rtol=1e-9)
    evidence = -0.5 * right @ expected - 0.5 * np.linalg.slogdet(matrix)[1] + 0.5 * np.sum(np.log(precision))
    assert found.log_evidence == pytest.approx(evidence, rel=1e-9)
    left = e + jacobian @ expected
    assert left_over(of, found.own, found.weights) == pytest.approx(left @ left, rel=1e-9)


@pytest.mark.parametrize("shared", [False, True])
def test_what_the_weights_remove_is_found(shared):
    """All of the innovations but noise of one are the weights'."""
    of = equations(runs(shared), PARAMETERS, shared)
    found = regress(of, np.zeros(PARAMETERS), np.ones(PARAMETERS))
    assert found.gain > 100.0
    assert found.removed == pytest.approx(1.0 - 150.0 / of.squares, abs=0.1)
    assert found.scales[3] == 1.0  # of a channel without weights
    assert found.weights.size == of.channel_of.size


@pytest.mark.parametrize("shared", [False, True])
def test_the_gain_is_the_ratio_of_two_normal_densities(shared):
    """Of all innovations, with and without the regressors, at the prior scales that are found: about the best ones."""
    parts = runs(shared)
    jacobian, e, channel_of = dense(parts, shared)
    prior = np.random.default_rng(1).uniform(0.1, 2.0, PARAMETERS)
    found = regress(equations(parts, PARAMETERS, shared), np.zeros(PARAMETERS), prior)
    own, weights = jacobian[:, :PARAMETERS], jacobian[:, PARAMETERS:]
    alone = np.eye(len(e)) + own @ np.diag(1.0 / prior) @ own.T

    def gain(scales):
        whole = alone + (weights * scales[channel_of] ** 2) @ weights.T
        densities = [multivariate_normal(cov=covariance).logpdf(e) for covariance in (whole, alone)]
        return densities[0] - densities[1]

    assert found.gain == pytest.approx(gain(found.scales), rel=1e-6)
    for channel in np.unique(channel_of):
        for factor in (0.8, 1.25):
            moved = found.scales.copy()
            moved[channel] *= factor
            assert gain(moved) < found.gain + 1e-3
    np.testing.assert_array_equal(found.channel_of, channel_of)
    mode = np.linalg.solve(
        jacobian.T @ jacobian + np.diag(np.append(prior, 1.0 / found.scales[channel_of] ** 2)), -jacobian.T @ e
    )
    np.testing.assert_allclose(found.weights, mode[PARAMETERS:], rtol=1e-6, atol=1e-9)
    left = e + jacobian @ mode
    assert found.removed == pytest.approx(1.0 - left @ left / (e @ e), rel=1e-9)


def test_innovations_without_a_cause_leave_the_weights_at_nothing():
    """The scales go towards zero, and no evidence is gained."""
    noise = [
        Responses(part.weights, CHANNELS, part.own, part.columns, 1e-6 * np.ones_like(part.residual))
        for part in runs(False)
    ]
    found = regress(equations(noise, PARAMETERS, False), np.zeros(PARAMETERS), np.ones(PARAMETERS))
    assert -0.5 < found.gain <= 0.0
    assert np.all(found.scales[[0, 1, 2, 4]] < 0.1)


def test_equations_of_shared_weights_add_up():
    parts = runs(shared=True)
    whole, added = (
        equations(parts, PARAMETERS, True),
        summed_equations([equations([p], PARAMETERS, True) for p in parts]),
    )
    np.testing.assert_allclose(added.own, whole.own)
    np.testing.assert_allclose(added.weights[0].cross, whole.weights[0].cross)
    np.testing.assert_allclose(added.weights[0].gradient, whole.weights[0].gradient)
    assert added.squares == pytest.approx(whole.squares)


def test_rounding_does_not_take_the_information_below_the_priors():
    """A direction that a weak prior alone holds, next to one of 1e13 times its information: the rest is rounding."""
    prior = np.array([1.0, 1e-6])
    matrix = np.array([[1.0 + 1e13, 1e6 * np.sqrt(1e13)], [1e6 * np.sqrt(1e13), 1e12]])
    matrix[1, 1] -= 1.0  # beyond what is left of 1e-6
    found = _definite(matrix, prior)
    assert np.linalg.eigvalsh(matrix)[0] <= 0.0
    assert np.linalg.eigvalsh(found / np.sqrt(np.outer(prior, prior)))[0] > 0.0
    plain = np.diag([3.0, 2.0])
    assert _definite(plain, prior) is plain


def test_of_an_information_that_rounding_made_indefinite_what_is_above_the_prior_stays():
    prior = np.array([100.0, 1e-4, 0.5])
    spoilt = prior * [4.0, -1e-9, 1.5]
    np.testing.assert_allclose(_definite(np.diag(spoilt), prior), np.diag(prior * [4.0, 1.0, 1.5]), rtol=1e-12)
