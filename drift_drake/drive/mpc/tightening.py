"""The lane narrowed by how far from the plan the car may be, by the model's own uncertainty.

Along a plan, the deviation of the state from its prediction follows, to first order,

    d_{k+1} = (A_k + B_k K_k) d_k + G_k (theta - theta_mean) + w_k,   d_0 = 0,

with the last layer's features in G_k (row i: phi_i(z_k) for theta_i), theta the *same* at every step, theta / sigma ~
N(mean / sigma, Lambda^{-1}), and w_k ~ N(0, diag(sigma^2)) new at every step. K_k is a time-varying LQR feedback
about the plan: the controller plans anew long before the horizon's end, and without feedback a drift's deviations grow
without bound. The uncertainty of a step reaches the path's coordinates from the next step on.

The margin of stage k is kappa standard deviations of e, evaluated along the last solution (shifted to now), so that the
QP stays what it is and its lane's bounds alone move. It is cut off at `MAX_SHARE` of the way to the path.
"""

from typing import NamedTuple

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.learnt.features import FEATURE_COUNT, MEAN_COUNT, STATE_COUNT, features, network_inputs
from drift_drake.drive.mpc.tracking import lqr_gains

MAX_SHARE = 0.8
LATERAL = 4  # index of e


class LaneTightening(NamedTuple):
    """What it takes in addition to the posterior's covariance."""

    sigma: Array  # noise scale of each learnt state [4]
    kappa: float  # standard deviations of e


def lateral_deviation(
    model: BayesianStepModel, sigma: Array, covariance: Array, x: Array, u: Array, curvature: Array
) -> Array:
    """Predicted standard deviation of e [N+1] [m] along a plan.

    Args:
        model: one step of the car as believed; sigma: noise scale of each learnt state [4].
        covariance: Lambda^{-1} [64, 64]; x: states [N+1, 8]; u: inputs [N+1, 2]; curvature: [N] [1/m].
    """
    _, a, b, b_next = model.linearize(x[:-1], u[:-1], u[1:], curvature)
    b = b + b_next
    closed = a + b @ lqr_gains(a, b)
    phi = features(model.network, network_inputs(x[:-1], u[:-1], u[1:]))
    factor = np.linalg.cholesky(covariance).reshape(STATE_COUNT, FEATURE_COUNT, -1)
    spread = np.einsum("i,kif,ifw->kiw", sigma, phi, factor)  # of one step's learnt states by whitened theta
    size = a.shape[1]
    noise, process = np.zeros((size, size)), np.zeros((size, size))
    noise[range(STATE_COUNT), range(STATE_COUNT)] = sigma**2
    sensitivity = np.zeros((size, MEAN_COUNT))
    variance = np.zeros(len(x))
    for k in range(len(x) - 1):
        sensitivity = closed[k] @ sensitivity
        sensitivity[:STATE_COUNT] += spread[k]
        process = closed[k] @ process @ closed[k].T + noise
        variance[k + 1] = np.sum(sensitivity[LATERAL] ** 2) + process[LATERAL, LATERAL]
    return np.sqrt(variance)


def tightened(e_min: Array, e_max: Array, margin: Array) -> tuple[Array, Array]:
    """Lane bounds [N+1] [m] moved inwards by a margin [N+1], each by `MAX_SHARE` of its own size at most."""
    low, high = (np.minimum(margin, MAX_SHARE * np.abs(bound)) for bound in (e_min, e_max))
    return e_min + low, e_max - high
