"""Bayesian linear regression on the last layer: prior, recursion, predictions (eqs. 3, 5 and 6 of Davydov et al.).

For each learnt state i, theta_i ~ N(mean_i, sigma_i^2 Lambda_i^{-1}), and a sample adds
y_i = theta_i^T phi_i + eps, eps ~ N(0, sigma_i^2), with y_i = x_{i,k+1} - h_i(x_k, u_k). All arrays may carry leading
axes (a batch of posteriors), written [...].

A sample may count with a weight w below one, as w of a sample: Lambda grows by w phi phi^T and Q by w y phi. On a car
that the features do not fit exactly, what is left over is alike from one sample to the next, and n samples tell less
than n independent ones would; with w = 1, the paper's, the posterior then grows over-confident.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Posterior(NamedTuple):
    """What is believed of theta; the prior is the posterior of no data."""

    mean: Array  # [..., 4, 16]
    covariance: Array  # Lambda^{-1}, [..., 4, 16, 16], without the factor sigma^2
    q: Array  # Q = Lambda mean, [..., 4, 16]


class Prediction(NamedTuple):
    """Gaussian one-step prediction of the residual y."""

    mean: Array  # [..., 4]
    variance: Array  # [..., 4]


def from_precision(mean: Array, precision: Array) -> Posterior:
    """The belief with a mean [..., 4, 16] and a precision Lambda [..., 4, 16, 16]."""
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    covariance = 0.5 * (covariance + np.swapaxes(covariance, -1, -2))
    return Posterior(np.array(mean, dtype=float), covariance, np.einsum("...fg,...g->...f", precision, mean))


def update(posterior: Posterior, phi: Array, y: Array, weight: float = 1.0) -> Posterior:
    """One sample more: eq. (5).

    The covariance is updated in Joseph's form, (I - K phi^T) P (I - K phi^T)^T + K K^T with K = P phi / (1 + phi^T P
    phi), which equals eq. (5a) and keeps P symmetric and positive definite under rounding; the mean by the innovation,
    which equals Lambda^{-1} Q of eq. (5c) and does not lose digits as Q grows.

    Args:
        phi: features [..., 4, 16]; y: residual x_{k+1} - h(x_k, u_k) of the learnt states [..., 4]; weight: of the
            sample.
    """
    mean, covariance, q = posterior
    phi, y = np.sqrt(weight) * phi, np.sqrt(weight) * y
    p_phi = np.einsum("...fg,...g->...f", covariance, phi)
    spread = 1.0 + np.sum(phi * p_phi, axis=-1, keepdims=True)
    gain = p_phi / spread
    innovation = y[..., None] - np.sum(mean * phi, axis=-1, keepdims=True)
    # With A = P - K p_phi^T, Joseph's form is A - (A phi) K^T + K K^T.
    reduced = covariance - gain[..., :, None] * p_phi[..., None, :]
    reduced_phi = np.einsum("...fg,...g->...f", reduced, phi)
    joseph = reduced + (gain - reduced_phi)[..., :, None] * gain[..., None, :]
    joseph = 0.5 * (joseph + np.swapaxes(joseph, -1, -2))
    return Posterior(mean + gain * innovation, joseph, q + y[..., None] * phi)


def update_all(posterior: Posterior, phi: Array, y: Array, weight: float = 1.0) -> Posterior:
    """Many samples at once: the batch form, phi [n, 4, 16] and y [n, 4], equal to n calls of `update`."""
    precision = np.linalg.inv(posterior.covariance) + weight * np.einsum("nif,nig->ifg", phi, phi)
    q = posterior.q + weight * np.einsum("ni,nif->if", y, phi)
    mean = np.linalg.solve(precision, q[..., None])[..., 0]
    covariance = np.linalg.inv(precision)
    return Posterior(mean, 0.5 * (covariance + np.swapaxes(covariance, -1, -2)), q)


def predict(posterior: Posterior, sigma: Array, phi: Array) -> Prediction:
    """Mean and variance of the next residual, eq. (6) without h: sigma [4], phi [..., 4, 16]."""
    p_phi = np.einsum("...fg,...g->...f", posterior.covariance, phi)
    spread = 1.0 + np.sum(phi * p_phi, axis=-1)
    return Prediction(np.sum(posterior.mean * phi, axis=-1), sigma * sigma * spread)


def sample_theta(posterior: Posterior, sigma: Array, count: int, generator: np.random.Generator) -> Array:
    """`count` models theta [count, 4, 16] drawn from one posterior (no leading axes)."""
    factor = np.linalg.cholesky(posterior.covariance)
    normal = generator.standard_normal((count, *posterior.mean.shape))
    return posterior.mean + sigma[:, None] * np.einsum("ifg,nig->nif", factor, normal)


def covariance_norms(posterior: Posterior) -> tuple[Array, Array]:
    """||Lambda_i^{-1}||_2 of each state [..., 4], and their sum [...] (Table I of the paper)."""
    norms = np.linalg.norm(posterior.covariance, ord=2, axis=(-2, -1))
    return norms, np.sum(norms, axis=-1)


def mahalanobis(prediction: Prediction, y: Array) -> Array:
    """Distance [...] of a residual y [..., 4] from its prediction, over the four independent states."""
    return np.sqrt(np.sum((y - prediction.mean) ** 2 / prediction.variance, axis=-1))
