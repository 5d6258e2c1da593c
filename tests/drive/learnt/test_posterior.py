"""The last layer's Bayesian linear regression: the paper's equations state by state where the prior does not couple
the states, and the textbook's regression of all 64 numbers at once where it does."""

import numpy as np
import pytest
from learnt_models import sample_theta
from scipy.linalg import block_diag
from scipy.spatial import distance
from scipy.stats import multivariate_normal

from drift_drake.drive.learnt.posterior import (
    Posterior,
    block_diagonal,
    covariance_norms,
    from_precision,
    mahalanobis,
    predict,
    spread_of_features,
    state_blocks,
    update,
    update_all,
    update_and_density,
    weighed,
)

SIGMA = np.array([0.02, 0.05, 0.01, 0.3])
WEIGHT = np.array([0.3, 1.0, 0.05, 0.6])
SCALE = np.repeat(SIGMA, 16)  # of each of the 64 numbers


def correlated_features(count: int, generator: np.random.Generator) -> np.ndarray:
    """Features [count, 4, 16] with strong correlation and spreads over two decades, as a network's are."""
    mixing = generator.normal(size=(4, 16, 16)) * np.logspace(0.0, -2.0, 16)
    return np.einsum("nig,ifg->nif", generator.normal(size=(count, 4, 16)), mixing)


def coupled(seed: int) -> Posterior:
    generator = np.random.default_rng(seed)
    factor = 0.15 * generator.normal(size=(64, 64))
    return from_precision(SIGMA[:, None] * generator.normal(size=(4, 16)), factor @ factor.T + 1e-2 * np.eye(64), SIGMA)


@pytest.fixture
def prior() -> Posterior:
    """A prior that couples the states."""
    return coupled(1)


@pytest.fixture
def apart() -> Posterior:
    """A prior of states that know nothing of each other, as the paper's."""
    generator = np.random.default_rng(1)
    factor = 0.3 * generator.normal(size=(4, 16, 16))
    precision = factor @ factor.transpose(0, 2, 1) + 1e-2 * np.eye(16)
    return from_precision(generator.normal(size=(4, 16)), block_diag(*precision), SIGMA)


def design(phi: np.ndarray) -> np.ndarray:
    """What the 64 numbers in a row are multiplied with to give all residuals in a row, [4 n, 64], of phi [n, 4, 16]."""
    rows = np.zeros((len(phi), 4, 64))
    for i in range(4):
        rows[:, i, 16 * i : 16 * i + 16] = phi[:, i]
    return rows.reshape(-1, 64)


def joint(belief: Posterior) -> tuple[np.ndarray, np.ndarray]:
    """(mean [64], covariance [64, 64]) of theta itself."""
    return belief.mean.ravel(), SCALE[:, None] * belief.covariance * SCALE


def conditioned(belief: Posterior, phi: np.ndarray, y: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`joint` of what is believed after samples, by the gain of all of them at once; a weight widens the noise."""
    mean, covariance = joint(belief)
    rows, noise = design(phi), np.diag(np.tile(SIGMA**2 / weight, len(phi)))
    gain = np.linalg.solve(rows @ covariance @ rows.T + noise, rows @ covariance).T
    return mean + gain @ (y.ravel() - rows @ mean), covariance - gain @ rows @ covariance


def assert_believes(belief: Posterior, mean: np.ndarray, covariance: np.ndarray, tolerance: float) -> None:
    """In units of the noise; the covariance in units of its greatest entry."""
    found = joint(belief)
    np.testing.assert_allclose(found[0] / SCALE, mean / SCALE, rtol=0, atol=tolerance)
    expected = covariance / np.outer(SCALE, SCALE)
    np.testing.assert_allclose(belief.covariance, expected, rtol=0, atol=tolerance * np.abs(expected).max())
    np.testing.assert_array_equal(belief.covariance, belief.covariance.T)


@pytest.mark.parametrize("weight", [np.ones(4), WEIGHT])
def test_without_coupling_one_update_is_equation_5_state_by_state(apart: Posterior, weight: np.ndarray) -> None:
    generator = np.random.default_rng(2)
    phi, y = correlated_features(1, generator)[0], generator.normal(size=4)
    after = update(apart, SIGMA, phi, y, weight)
    for i in range(4):
        own = slice(16 * i, 16 * i + 16)
        before = apart.covariance[own, own]
        gain = before @ phi[i]
        covariance = before - weight[i] * np.outer(gain, gain) / (1.0 + weight[i] * phi[i] @ gain)
        q = np.linalg.solve(before, apart.mean[i]) + weight[i] * y[i] * phi[i]  # the paper's, sigma times ours
        np.testing.assert_allclose(after.covariance[own, own], covariance, rtol=0, atol=1e-9 * np.abs(covariance).max())
        np.testing.assert_allclose(after.q[i], q / SIGMA[i], rtol=1e-9)
        np.testing.assert_allclose(after.mean[i], covariance @ q, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(after.covariance, block_diag(*state_blocks(after.covariance)))


@pytest.mark.parametrize("weight", [np.ones(4), WEIGHT])
def test_without_coupling_many_samples_are_four_regressions(apart: Posterior, weight: np.ndarray) -> None:
    generator = np.random.default_rng(12)
    phi, y = correlated_features(30, generator), generator.normal(size=(30, 4))
    after = update_all(apart, SIGMA, phi, y, weight)
    for i in range(4):
        own = slice(16 * i, 16 * i + 16)
        before = np.linalg.inv(apart.covariance[own, own])
        precision = before + weight[i] * phi[:, i].T @ phi[:, i]
        mean = np.linalg.solve(precision, before @ apart.mean[i] + weight[i] * phi[:, i].T @ y[:, i])
        np.testing.assert_allclose(after.mean[i], mean, rtol=0, atol=1e-8)
        covariance = np.linalg.inv(precision)
        np.testing.assert_allclose(after.covariance[own, own], covariance, rtol=0, atol=1e-9 * np.abs(covariance).max())
    np.testing.assert_array_equal(after.covariance, block_diag(*state_blocks(after.covariance)))


def test_without_coupling_prediction_is_equation_6(apart: Posterior) -> None:
    generator = np.random.default_rng(5)
    phi = correlated_features(4, generator)
    prediction = predict(apart, SIGMA, phi)
    spread = np.einsum("nif,ifg,nig->ni", phi, state_blocks(apart.covariance), phi)
    np.testing.assert_allclose(prediction.mean, np.einsum("nif,if->ni", phi, apart.mean), rtol=1e-12)
    np.testing.assert_allclose(prediction.variance, SIGMA**2 * (1.0 + spread), rtol=1e-12)
    np.testing.assert_array_equal(prediction.covariance, np.eye(4) * prediction.covariance)
    np.testing.assert_allclose(mahalanobis(prediction, prediction.mean + 2.0 * np.sqrt(prediction.variance)), 4.0)
    np.testing.assert_allclose(covariance_norms(apart)[0], [
        np.linalg.eigvalsh(apart.covariance[k : k + 16, k : k + 16]).max() for k in (0, 16, 32, 48)])  # fmt: skip


@pytest.mark.parametrize("weight", [np.ones(4), WEIGHT])
def test_updates_are_the_joint_regression_of_all_states(prior: Posterior, weight: np.ndarray) -> None:
    generator = np.random.default_rng(8)
    phi = correlated_features(25, generator)
    y = np.einsum("nif,if->ni", phi, prior.mean) + 3.0 * SIGMA * generator.normal(size=(25, 4))
    recursive = prior
    for k in range(25):
        recursive = update(recursive, SIGMA, phi[k], y[k], weight)
    together = update_all(prior, SIGMA, phi, y, weight)
    mean, covariance = conditioned(prior, phi, y, weight)
    for belief in (recursive, together):
        assert_believes(belief, mean, covariance, 1e-8)
        np.testing.assert_allclose(
            belief.q.ravel(), np.linalg.solve(belief.covariance, mean / SCALE), rtol=1e-6, atol=1e-6
        )
    blocks = from_precision(prior.mean, np.linalg.inv(block_diag(*state_blocks(prior.covariance))), SIGMA)
    without = update_all(blocks, SIGMA, phi, y, weight)
    assert np.abs((without.mean - together.mean) / SIGMA[:, None]).max() > 0.3  # what the coupling tells


@pytest.mark.parametrize("weight", [np.ones(4), WEIGHT])
def test_the_density_of_a_sample_is_the_predictions_normal_density(prior: Posterior, weight: np.ndarray) -> None:
    """Of all four states at once, by SciPy, but for the noise's own density, which is the same for every belief."""
    generator = np.random.default_rng(10)
    mean, covariance = joint(prior)
    noise = SIGMA**2 / weight
    for _ in range(3):
        phi = correlated_features(1, generator)
        y = np.einsum("if,if->i", phi[0], prior.mean) + 3.0 * SIGMA * generator.normal(size=4)
        rows = design(phi)
        expected = multivariate_normal(rows @ mean, rows @ covariance @ rows.T + np.diag(noise)).logpdf(y)
        density = update_and_density(prior, SIGMA, phi[0], y, weight)[1]
        assert density == pytest.approx(expected + 0.5 * np.sum(np.log(2.0 * np.pi * noise)), rel=1e-9)


def test_a_belief_of_a_mean_and_a_precision_holds_their_product() -> None:
    generator = np.random.default_rng(17)
    mean, factor = generator.normal(size=(4, 16)), generator.normal(size=(64, 64))
    precision = factor @ factor.T + np.eye(64)
    belief = from_precision(mean, precision, SIGMA)
    np.testing.assert_allclose(belief.q.ravel(), precision @ (mean.ravel() / SCALE), rtol=1e-9)
    np.testing.assert_allclose(belief.covariance @ precision, np.eye(64), atol=1e-8)


def test_recursion_equals_batch_regression_after_thousands_of_updates(prior: Posterior) -> None:
    generator = np.random.default_rng(3)
    phi = correlated_features(3_000, generator)
    truth = SIGMA[:, None] * generator.normal(size=(4, 16))
    y = np.einsum("nif,if->ni", phi, truth) + SIGMA * generator.normal(size=(len(phi), 4))
    recursive = prior
    for k in range(len(phi)):
        recursive = update(recursive, SIGMA, phi[k], y[k], WEIGHT)
    # Least squares of the whitened samples and of the prior's own rows.
    factor = np.linalg.cholesky(np.linalg.inv(prior.covariance)).T
    root = np.tile(np.sqrt(WEIGHT), len(phi))
    rows = np.concatenate([factor, root[:, None] * design(phi)])
    right = np.concatenate([factor @ (prior.mean.ravel() / SCALE), root * (y / SIGMA).ravel()])
    mean = SCALE * np.linalg.lstsq(rows, right, rcond=None)[0]
    covariance = SCALE[:, None] * np.linalg.inv(rows.T @ rows) * SCALE
    assert_believes(recursive, mean, covariance, 1e-9)
    assert np.linalg.eigvalsh(recursive.covariance).min() > 0.0
    assert_believes(update_all(prior, SIGMA, phi, y, WEIGHT), mean, covariance, 1e-9)


def test_an_update_loses_no_digits_where_next_to_nothing_was_known() -> None:
    """A variance of 1e10, of which one feature's sample leaves about one: a difference of both would be off by 1e-6."""
    phi, own = np.zeros((4, 16)), 5 + 16 * np.arange(4)
    phi[:, 5] = [3.0, 0.7, 1.1, 0.3]
    broad = Posterior(np.zeros((4, 16)), 1e10 * np.eye(64), np.zeros((4, 16)))
    left = update(broad, SIGMA, phi, np.zeros(4)).covariance
    np.testing.assert_allclose(left[own, own], 1.0 / (1e-10 + phi[:, 5] ** 2), rtol=1e-12)


def test_samples_of_one_state_move_the_others_as_the_conditional_says(prior: Posterior, apart: Posterior) -> None:
    generator = np.random.default_rng(9)
    phi, y = correlated_features(6, generator), 0.5 * generator.normal(size=(6, 4))
    reported = 2
    own = slice(16 * reported, 16 * reported + 16)
    weight = np.zeros(4)
    weight[reported] = 0.7
    mean, covariance = joint(prior)
    # The regression of the one state by itself, and the other states given its theta.
    features = phi[:, reported]
    precision = np.linalg.inv(covariance[own, own])
    own_covariance = np.linalg.inv(precision + 0.7 * features.T @ features / SIGMA[reported] ** 2)
    own_mean = own_covariance @ (precision @ mean[own] + 0.7 * features.T @ y[:, reported] / SIGMA[reported] ** 2)
    slope = covariance[:, own] @ precision
    expected = mean + slope @ (own_mean - mean[own])
    narrowed = covariance - slope @ (covariance[own, own] - own_covariance) @ slope.T
    recursive = prior
    for k in range(6):
        recursive = update(recursive, SIGMA, phi[k], y[k], weight)
    for belief in (recursive, update_all(prior, SIGMA, phi, y, weight)):
        assert_believes(belief, expected, narrowed, 1e-8)
    moved = np.abs((recursive.mean - prior.mean) / SIGMA[:, None]).max(axis=1)
    assert (moved > 0.1).all()
    # What the other states measured is not heard, and without coupling they stay where they are.
    others = np.arange(4) != reported
    shifted = y + 5.0 * others
    np.testing.assert_array_equal(update(prior, SIGMA, phi[0], shifted[0], weight).mean,
                                  update(prior, SIGMA, phi[0], y[0], weight).mean)  # fmt: skip
    after = update(apart, SIGMA, phi[0], y[0], weight)
    np.testing.assert_allclose(after.mean[others], apart.mean[others], rtol=1e-15)
    np.testing.assert_array_equal(state_blocks(after.covariance)[others], state_blocks(apart.covariance)[others])


def test_a_weight_counts_as_so_much_of_a_sample(prior: Posterior) -> None:
    generator = np.random.default_rng(7)
    phi, y = correlated_features(20, generator), SIGMA * generator.normal(size=(20, 4))
    # A state's share in two portions: half and half, or unequal, of a state each.
    for first, second in ((0.5, 0.5), (WEIGHT, 1.0 - WEIGHT)):
        recursive = prior
        for k in range(20):
            for share in (first, second):
                recursive = update(recursive, SIGMA, phi[k], y[k], weight=share)
        whole = update_all(prior, SIGMA, phi, y)
        parts = update_all(update_all(prior, SIGMA, phi, y, weight=first), SIGMA, phi, y, weight=second)
        for part in (recursive, parts):
            np.testing.assert_allclose(part.mean, whole.mean, rtol=0, atol=1e-8)
            np.testing.assert_allclose(part.covariance, whole.covariance, rtol=0, atol=1e-8)
            np.testing.assert_allclose(part.q, whole.q, rtol=1e-9, atol=1e-9)


def test_predictions_of_many_points_are_as_each_alone(prior: Posterior) -> None:
    generator = np.random.default_rng(4)
    phi, y = correlated_features(6, generator).reshape(2, 3, 4, 16), generator.normal(size=(2, 3, 4))
    together = predict(prior, SIGMA, phi)
    distances = mahalanobis(together, y)
    assert together.covariance.shape == (2, 3, 4, 4)
    for place in np.ndindex(2, 3):
        alone = predict(prior, SIGMA, phi[place])
        np.testing.assert_allclose(together.mean[place], alone.mean, rtol=1e-12)
        np.testing.assert_allclose(together.covariance[place], alone.covariance, rtol=1e-12)
        np.testing.assert_allclose(together.variance[place], np.diag(alone.covariance), rtol=1e-12)
        np.testing.assert_allclose(distances[place], mahalanobis(alone, y[place]), rtol=1e-10)


def test_samples_of_theta_spread_as_predictions_do(prior: Posterior) -> None:
    generator = np.random.default_rng(5)
    phi = correlated_features(4, generator)
    prediction = predict(prior, SIGMA, phi)
    count = 20_000
    theta = sample_theta(prior, SIGMA, count, generator)
    values = np.einsum("nif,sif->nsi", phi, theta) + SIGMA * generator.standard_normal((count, 4))
    correlations = []
    for n in range(4):
        deviation = np.sqrt(prediction.variance[n])
        np.testing.assert_allclose((values[n].mean(axis=0) - prediction.mean[n]) / deviation, 0.0, atol=0.04)
        correlation = prediction.covariance[n] / np.outer(deviation, deviation)
        found = np.cov(values[n].T) / np.outer(deviation, deviation)
        np.testing.assert_allclose(found, correlation, rtol=0, atol=0.04)
        correlations.append(np.abs(correlation - np.eye(4)).max())
    assert max(correlations) > 0.3  # states that are predicted together are off together


def test_predictions_and_their_distances_are_the_dense_formulas(prior: Posterior) -> None:
    generator = np.random.default_rng(13)
    phi = correlated_features(3, generator)
    prediction = predict(prior, SIGMA, phi)
    y = prediction.mean + 2.0 * SIGMA * generator.normal(size=(3, 4))
    found = mahalanobis(prediction, y)
    for n in range(3):
        rows = design(phi[n : n + 1])
        covariance = rows @ joint(prior)[1] @ rows.T + np.diag(SIGMA**2)
        np.testing.assert_allclose(prediction.covariance[n], covariance, rtol=1e-10, atol=1e-14)
        np.testing.assert_array_equal(prediction.variance[n], np.diag(prediction.covariance[n]))
        expected = distance.mahalanobis(y[n], design(phi[n : n + 1]) @ prior.mean.ravel(), np.linalg.inv(covariance))
        assert found[n] == pytest.approx(expected, rel=1e-9)
        projected, spread = spread_of_features(prior.covariance, phi[n])
        np.testing.assert_allclose(projected.reshape(4, 64), rows @ prior.covariance, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(spread, rows @ prior.covariance @ rows.T + np.eye(4), rtol=1e-10, atol=1e-12)


def test_weighed_samples_under_a_weighed_covariance_count_in_full(prior: Posterior) -> None:
    generator = np.random.default_rng(14)
    phi, y = correlated_features(5, generator), SIGMA * generator.normal(size=(5, 4))
    after = update_all(prior, SIGMA, phi, y, WEIGHT).covariance
    scaled = prior._replace(covariance=weighed(prior.covariance, WEIGHT))
    np.testing.assert_allclose(
        weighed(after, WEIGHT), update_all(scaled, SIGMA, phi, y).covariance, rtol=1e-8, atol=1e-8
    )
    np.testing.assert_allclose(weighed(weighed(after, WEIGHT), 1.0 / WEIGHT), after, rtol=1e-14)
    np.testing.assert_array_equal(weighed(after, np.ones(4)), after)
    assert weighed(after, WEIGHT)[20, 40] == pytest.approx(np.sqrt(WEIGHT[1] * WEIGHT[2]) * after[20, 40], rel=1e-14)


def test_blocks_there_and_back(prior: Posterior) -> None:
    blocks = np.random.default_rng(15).normal(size=(4, 16, 16))
    np.testing.assert_array_equal(block_diagonal(blocks), block_diag(*blocks))
    np.testing.assert_array_equal(state_blocks(block_diagonal(blocks)), blocks)
    own = state_blocks(prior.covariance)
    for i in range(4):
        np.testing.assert_array_equal(own[i], prior.covariance[16 * i : 16 * i + 16, 16 * i : 16 * i + 16])
    many = np.random.default_rng(16).normal(size=(2, 3, 64, 64))
    assert state_blocks(many).shape == (2, 3, 4, 16, 16)
    np.testing.assert_array_equal(state_blocks(many)[1, 2], state_blocks(many[1, 2]))


def test_covariance_norms_fall_with_data(prior: Posterior) -> None:
    norms, total = covariance_norms(prior)
    np.testing.assert_allclose(norms, [
        np.linalg.eigvalsh(prior.covariance[k : k + 16, k : k + 16]).max() for k in (0, 16, 32, 48)])  # fmt: skip
    assert total == pytest.approx(norms.sum())
    generator = np.random.default_rng(6)
    phi = correlated_features(50, generator)
    after, _ = covariance_norms(update_all(prior, SIGMA, phi, generator.normal(size=(50, 4))))
    assert (after < norms).all()
