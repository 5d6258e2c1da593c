"""Of learnt models: what tests ask of them and nothing else does."""

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.checkpoint import WEIGHTS, BayesianModel
from drift_drake.drive.learnt.posterior import Posterior


def sample_theta(posterior: Posterior, sigma: Array, count: int, generator: np.random.Generator) -> Array:
    """`count` models theta [count, 4, 16] drawn from one posterior (no leading axes)."""
    factor = np.linalg.cholesky(posterior.covariance)
    normal = generator.standard_normal((count, len(factor)))
    return posterior.mean + sigma[:, None] * (normal @ factor.T).reshape(count, *posterior.mean.shape)


def trainable_count(model: BayesianModel) -> int:
    """Number of trainable parameters: network, prior mean and precision, noise scales (27,012 in the paper; its
    network's inputs are z alone, and its prior does not couple the states)."""
    weights = sum(np.size(getattr(model.network, name)) for name in WEIGHTS)
    return weights + model.prior_mean.size + int(np.count_nonzero(model.precision_factor)) + model.sigma.size
