"""Bayesian linear regression on the last layer: prior, recursion, predictions (eqs. 5, 6 and 7 of Davydov et al.).

For each learnt state i a sample adds y_i = theta_i^T phi_i + eps_i, eps_i ~ N(0, sigma_i^2), with y_i = x_{i,k+1} -
h_i(x_k, u_k). In the paper the theta_i of different states know nothing of each other, theta_i ~ N(mean_i, sigma_i^2
Lambda_i^{-1}). Here the prior may couple them: theta / sigma, all 64 numbers, has the covariance Lambda^{-1}. A tyre's
friction shows in all four states, best where the sensors are best, and what the rim speed and the yaw rate tell of it
then reaches the sideslip. With a Lambda of four blocks all of this is the paper's, equation by equation. Points
may have any leading axes, written [...].

A sample may count with a weight w_i below one for state i, as w_i of a sample: Lambda's block grows by w_i phi phi^T.
On a car that the features do not fit exactly, what is left over is alike from one sample to the next, and n samples
tell less than n independent ones would; with w = 1, the paper's, the posterior then grows over-confident.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.compilation import compiled
from drift_drake.common.arrays import Array


class Posterior(NamedTuple):
    """What is believed of theta (section II of Davydov et al.); the prior is the posterior of no data.

    Examples:
        >>> belief = model.prior()
        >>> belief.mean.shape, belief.covariance.shape
        ((4, 16), (64, 64))
    """

    mean: Array  # [4, 16]
    covariance: Array  # Lambda^{-1}, of theta / sigma, [64, 64], states by features in a row
    q: Array  # Q = Lambda (mean / sigma), [4, 16]


class Prediction(NamedTuple):
    """Gaussian one-step prediction of the residual y."""

    mean: Array  # [..., 4]
    covariance: Array  # [..., 4, 4]

    @property
    def variance(self) -> Array:
        """Of each state by itself [..., 4]."""
        return np.diagonal(self.covariance, axis1=-2, axis2=-1)


def from_precision(mean: Array, precision: Array, sigma: Array) -> Posterior:
    """The belief with a mean [4, 16] and a precision Lambda [64, 64] of theta / sigma."""
    scaled = (mean / sigma[:, None]).ravel()
    q = np.einsum("fg,g->f", precision, scaled).reshape(mean.shape)
    return Posterior(np.array(mean, dtype=float), _symmetric(np.linalg.inv(precision)), q)


def update(posterior: Posterior, sigma: Array, phi: Array, y: Array, weight: Array | float = 1.0) -> Posterior:
    """One sample more: eq. (6). See `update_and_density`."""
    return update_and_density(posterior, sigma, phi, y, weight)[0]


def update_and_density(
    posterior: Posterior, sigma: Array, phi: Array, y: Array, weight: Array | float = 1.0
) -> tuple[Posterior, float]:
    """(the belief after one sample more, eq. (6); the log density [nat] of the sample by the belief before).

    The four states come one after the other. Of the density what does not depend on the belief is left out; a sample
    that counts with a weight enters by that power of its density.

    The covariance is updated in Joseph's form, (I - K h^T) P (I - K h^T)^T + K K^T with K = P h / (1 + h^T P h) and h
    the features of one state, zero elsewhere, which equals eq. (6a) and keeps P symmetric and positive definite under
    rounding; the mean by the innovation, which equals Lambda^{-1} Q of eq. (6c) and does not lose digits as Q grows.

    Args:
        sigma: noise scales [4]; phi: features [4, 16]; y: residual x_{k+1} - h(x_k, u_k) of the learnt states [4];
            weight: of the sample, for each state or for all.
    """
    root = np.sqrt(np.broadcast_to(weight, np.shape(sigma)))
    phi, y = root[:, None] * phi, root * y / sigma
    mean, covariance = posterior.mean / sigma[:, None], posterior.covariance.copy()
    density = _take_in(mean.ravel(), covariance, phi, y)
    return Posterior(mean * sigma[:, None], covariance, posterior.q + y[:, None] * phi), density


@compiled
def _take_in(mean: Array, covariance: Array, phi: Array, y: Array) -> float:
    """Updates theta / sigma's mean [64] and covariance by the weighted features [4, 16] and residuals of one sample."""
    states, width = phi.shape
    count, density = states * width, 0.0
    p_h, gain, reduced_h = np.empty(count), np.empty(count), np.empty(count)
    reduced = np.empty((count, count))
    for i in range(states):
        h, own = phi[i], i * width
        for f in range(count):
            p_h[f] = 0.0
            for g in range(width):
                p_h[f] += covariance[f, own + g] * h[g]
        variance, innovation = 1.0, y[i]
        for g in range(width):
            variance += h[g] * p_h[own + g]
            innovation -= mean[own + g] * h[g]
        density -= 0.5 * (np.log(variance) + innovation * innovation / variance)
        for f in range(count):
            gain[f] = p_h[f] / variance
            mean[f] += gain[f] * innovation
        # With A = P - K p_h^T, Joseph's form is A - (A h) K^T + K K^T.
        for f in range(count):
            reduced_h[f] = 0.0
            for g in range(count):
                reduced[f, g] = covariance[f, g] - gain[f] * p_h[g]
            for g in range(width):
                reduced_h[f] += reduced[f, own + g] * h[g]
        for f in range(count):
            for g in range(f + 1):
                one = reduced[f, g] + (gain[f] - reduced_h[f]) * gain[g]
                other = reduced[g, f] + (gain[g] - reduced_h[g]) * gain[f]
                covariance[f, g] = covariance[g, f] = 0.5 * (one + other)
    return density


def update_all(posterior: Posterior, sigma: Array, phi: Array, y: Array, weight: Array | float = 1.0) -> Posterior:
    """Many samples at once: the batch form, phi [n, 4, 16] and y [n, 4], equal to n calls of `update`."""
    weight = np.broadcast_to(weight, np.shape(sigma))
    shape = posterior.mean.shape
    precision = np.linalg.inv(posterior.covariance) + block_diagonal(
        weight[:, None, None] * np.einsum("nif,nig->ifg", phi, phi)
    )
    q = posterior.q + weight[:, None] * np.einsum("ni,nif->if", y / sigma, phi)
    mean = np.linalg.solve(precision, q.ravel()).reshape(shape) * sigma[:, None]
    return Posterior(mean, _symmetric(np.linalg.inv(precision)), q)


def predict(posterior: Posterior, sigma: Array, phi: Array) -> Prediction:
    """Mean and covariance of the next residual, eq. (7) without h: sigma [4], phi [..., 4, 16]."""
    spread = spread_of_features(posterior.covariance, phi)[1]
    return Prediction(np.sum(posterior.mean * phi, axis=-1), sigma[:, None] * spread * sigma)


def spread_of_features(covariance: Array, phi: Array) -> tuple[Array, Array]:
    """(Phi Lambda^{-1} [..., 4, 4, 16], I + Phi Lambda^{-1} Phi^T [..., 4, 4]).

    Row i of Phi holds the features of state i in that state's place and zeros elsewhere.

    Args:
        covariance: Lambda^{-1} [64, 64]; phi: features [..., 4, 16].
    """
    points = np.ascontiguousarray(phi).reshape(-1, *phi.shape[-2:])
    projected, spread = np.empty((*points.shape[:2], len(covariance))), np.empty((*points.shape[:2], phi.shape[-2]))
    _spread(np.ascontiguousarray(covariance), points, projected, spread)
    return projected.reshape(*phi.shape[:-1], *phi.shape[-2:]), spread.reshape(*phi.shape[:-1], -1)


@compiled
def _spread(covariance: Array, phi: Array, projected: Array, spread: Array) -> None:
    """`spread_of_features` of points phi [M, 4, 16]."""
    count, states, width = phi.shape
    for m in range(count):
        for i in range(states):
            row = projected[m, i]
            row[:] = 0.0
            for f in range(width):
                factor, through = phi[m, i, f], covariance[i * width + f]
                for j in range(states * width):
                    row[j] += factor * through[j]
            for j in range(states):
                total = 1.0 if i == j else 0.0
                for g in range(width):
                    total += row[j * width + g] * phi[m, j, g]
                spread[m, i, j] = total


def covariance_norms(posterior: Posterior) -> tuple[Array, float]:
    """||Lambda_i^{-1}||_2 of each state's own block [4], and their sum (Table I of the paper)."""
    norms = state_norms(posterior.covariance)
    return norms, float(np.sum(norms))


def state_norms(covariance: Array) -> Array:
    """The spectral norm of each state's own block [..., 4] of a covariance [..., 64, 64]."""
    return np.linalg.norm(state_blocks(covariance), ord=2, axis=(-2, -1)).astype(float)


def mahalanobis(prediction: Prediction, y: Array) -> Array:
    """Distance [...] of a residual y [..., 4] from its prediction."""
    error = y - prediction.mean
    return np.sqrt(np.sum(error * np.linalg.solve(prediction.covariance, error[..., None])[..., 0], axis=-1))


def weighed(covariance: Array, weight: Array) -> Array:
    """The covariance [64, 64] under which a sample of weight 1 tells what one of the given weights [4] tells."""
    root = np.repeat(np.sqrt(weight), len(covariance) // len(weight))
    return root[:, None] * covariance * root


def block_diagonal(blocks: Array) -> Array:
    """[64, 64] of the states' own blocks [4, 16, 16]."""
    states, count = blocks.shape[:2]
    whole = np.zeros((states, count, states, count))
    whole[range(states), :, range(states)] = blocks
    return whole.reshape(states * count, states * count)


def state_blocks(covariance: Array) -> Array:
    """Each state's own block [..., 4, 16, 16] of a covariance [..., 64, 64]."""
    states, count = 4, covariance.shape[-1] // 4
    by_states = covariance.reshape(*covariance.shape[:-2], states, count, states, count)
    return np.moveaxis(np.diagonal(by_states, axis1=-4, axis2=-2), -1, -3)


def _symmetric(matrix: NDArray[np.floating[Any]]) -> Array:
    return np.asarray(0.5 * (matrix + np.swapaxes(matrix, -1, -2)), dtype=np.float64)
