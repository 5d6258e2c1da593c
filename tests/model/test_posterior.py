"""The last layer's Bayesian linear regression against its textbook batch form."""

import numpy as np
import pytest

from drift_drake.model.posterior import (
    Posterior,
    covariance_norms,
    from_precision,
    mahalanobis,
    predict,
    sample_theta,
    update,
    update_all,
)

SIGMA = np.array([0.02, 0.05, 0.01, 0.3])


def correlated_features(count: int, generator: np.random.Generator) -> np.ndarray:
    """Features [count, 4, 16] with strong correlation and spreads over two decades, as a network's are."""
    mixing = generator.normal(size=(4, 16, 16)) * np.logspace(0.0, -2.0, 16)
    return np.einsum("nig,ifg->nif", generator.normal(size=(count, 4, 16)), mixing)


@pytest.fixture
def prior() -> Posterior:
    generator = np.random.default_rng(1)
    factor = 0.3 * generator.normal(size=(4, 16, 16))
    return from_precision(generator.normal(size=(4, 16)), factor @ factor.transpose(0, 2, 1) + 1e-2 * np.eye(16))


def test_one_update_is_equation_5(prior: Posterior) -> None:
    generator = np.random.default_rng(2)
    phi, y = correlated_features(1, generator)[0], generator.normal(size=4)
    after = update(prior, phi, y)
    for i in range(4):
        gain = prior.covariance[i] @ phi[i]
        covariance = prior.covariance[i] - np.outer(gain, gain) / (1.0 + phi[i] @ gain)
        q = prior.q[i] + y[i] * phi[i]
        np.testing.assert_allclose(after.covariance[i], covariance, rtol=0, atol=1e-9 * np.abs(covariance).max())
        np.testing.assert_allclose(after.q[i], q, rtol=1e-12)
        np.testing.assert_allclose(after.mean[i], covariance @ q, rtol=0, atol=1e-8)


def test_recursion_equals_batch_regression_after_ten_thousand_updates(prior: Posterior) -> None:
    generator = np.random.default_rng(3)
    phi = correlated_features(10_000, generator)
    truth = generator.normal(size=(4, 16))
    y = np.einsum("nif,if->ni", phi, truth) + SIGMA * generator.normal(size=(len(phi), 4))
    recursive = prior
    for k in range(len(phi)):
        recursive = update(recursive, phi[k], y[k])
    precision = np.linalg.inv(prior.covariance) + np.einsum("nif,nig->ifg", phi, phi)
    mean = np.linalg.solve(precision, prior.q[..., None] + np.einsum("nif,ni->if", phi, y)[..., None])[..., 0]
    covariance = np.linalg.inv(precision)
    scale = np.abs(covariance).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(recursive.mean, mean, rtol=0, atol=1e-9)
    np.testing.assert_allclose(recursive.covariance / scale, covariance / scale, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(recursive.covariance, recursive.covariance.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(recursive.covariance).min() > 0.0
    batch = update_all(prior, phi, y)
    np.testing.assert_allclose(batch.mean, mean, rtol=0, atol=1e-10)
    np.testing.assert_allclose(batch.covariance, recursive.covariance, rtol=0, atol=1e-9 * scale.max())


def test_a_weight_counts_as_so_much_of_a_sample(prior: Posterior) -> None:
    generator = np.random.default_rng(7)
    phi, y = correlated_features(20, generator), generator.normal(size=(20, 4))
    recursive = prior
    for k in range(20):
        for _ in range(2):
            recursive = update(recursive, phi[k], y[k], weight=0.5)
    whole = update_all(prior, phi, y)
    half = update_all(update_all(prior, phi, y, weight=0.5), phi, y, weight=0.5)
    for part in (recursive, half):
        np.testing.assert_allclose(part.mean, whole.mean, rtol=0, atol=1e-8)
        np.testing.assert_allclose(part.covariance, whole.covariance, rtol=0, atol=1e-8)
        np.testing.assert_allclose(part.q, whole.q, rtol=1e-9, atol=1e-9)


def test_a_batch_of_posteriors_updates_as_each_alone(prior: Posterior) -> None:
    generator = np.random.default_rng(4)
    phi, y = correlated_features(3, generator), generator.normal(size=(3, 4))
    stacked = Posterior(*(np.stack([part] * 3) for part in prior))
    together = update(stacked, phi, y)
    for j in range(3):
        for whole, alone in zip(together, update(prior, phi[j], y[j]), strict=True):
            np.testing.assert_allclose(whole[j], alone, rtol=1e-12, atol=1e-12)


def test_prediction_is_equation_6_and_samples_spread_like_it(prior: Posterior) -> None:
    generator = np.random.default_rng(5)
    phi = correlated_features(4, generator)
    prediction = predict(prior, SIGMA, phi)
    spread = np.einsum("nif,ifg,nig->ni", phi, prior.covariance, phi)
    np.testing.assert_allclose(prediction.mean, np.einsum("nif,if->ni", phi, prior.mean), rtol=1e-12)
    np.testing.assert_allclose(prediction.variance, SIGMA**2 * (1.0 + spread), rtol=1e-12)
    theta = sample_theta(prior, SIGMA, 20_000, generator)
    values = np.einsum("nif,sif->sni", phi, theta)
    deviation = SIGMA * np.sqrt(spread)
    np.testing.assert_allclose((values.mean(axis=0) - prediction.mean) / deviation, 0.0, atol=0.04)
    np.testing.assert_allclose(values.std(axis=0) / deviation, 1.0, atol=0.03)
    np.testing.assert_allclose(mahalanobis(prediction, prediction.mean + 2.0 * np.sqrt(prediction.variance)), 4.0)


def test_covariance_norms_fall_with_data(prior: Posterior) -> None:
    norms, total = covariance_norms(prior)
    np.testing.assert_allclose(norms, [np.linalg.eigvalsh(c).max() for c in prior.covariance])
    assert total == pytest.approx(norms.sum())
    generator = np.random.default_rng(6)
    phi = correlated_features(50, generator)
    after, _ = covariance_norms(update_all(prior, phi, generator.normal(size=(50, 4))))
    assert (after < norms).all()
