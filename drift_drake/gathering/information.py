"""The information gathering objective -alpha l_info of Info-OCP (eq. 8), as a cost over the horizon's stages.

    l_info = 1/2 sum_k log det(I + Phi_k Lambda^{-1} Phi_k')

which is eq. (8), 1/2 sum_k sum_i log(1 + phi_ik' Lambda_i^{-1} phi_ik), where the prior does not couple the states,

with the covariance of before the drive, as in the paper, or with the covariance that has taken in the stages before k.
That one needs no recursion: by the chain rule of information the sum is 1/2 log det(Lambda^{-1} (Lambda + sum_k Phi_k'
Phi_k)), whatever the stages' order.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drift_drake.gathering.feature_gradient import FeatureGradient
from drift_drake.model.features import STATE_COUNT, Network, features, information_by_features, network_inputs
from drift_drake.model.posterior import block_diagonal, spread_of_features

Array = NDArray[np.float64]


class InformationCost:
    """-alpha l_info as a `StageCost`, with exact gradients through features and covariance.

    Its second derivatives within a stage are mostly negative: the SQP adds them to the cost's and the dynamics' and
    projects the sum, so that its QPs stay convex. Between stages the variant with updates has second derivatives too;
    the SQP leaves those out.

    Args:
        network: the features.
        covariance: Lambda^{-1} before the drive [64, 64], see `posterior.weighed`.
        alpha: weight of the information [1/nat].
        updated: update the covariance along the horizon.
    """

    def __init__(self, network: Network, covariance: Array, alpha: float, updated: bool = False) -> None:
        self._network = network
        self._covariance = np.asarray(covariance, dtype=float)
        self._precision = np.linalg.inv(self._covariance)
        self._alpha = alpha
        self._updated = updated

    def value(self, x: Array, u: Array, u_next: Array) -> float:
        """-alpha l_info."""
        return -self._alpha * self.information(x, u, u_next)

    def information(self, x: Array, u: Array, u_next: Array) -> float:
        """l_info [nat] of a trajectory."""
        phi = features(self._network, network_inputs(x, u, u_next))
        if not self._updated:
            return float(0.5 * np.linalg.slogdet(spread_of_features(self._covariance, phi)[1])[1].sum())
        after = covariance_after(self._precision, phi)
        return float(-0.5 * (np.linalg.slogdet(after)[1] + np.linalg.slogdet(self._precision)[1]))

    def gradient_at(self, x: Array, u: Array, u_next: Array) -> Callable[[Array, Array, Array], Array]:
        """See `StageCost`."""
        covariance = self._covariance
        if self._updated:
            phi = features(self._network, network_inputs(x, u, u_next))
            covariance = after_others(covariance_after(self._precision, phi), phi)
        return FeatureGradient(
            self._network, len(x), lambda phi: -self._alpha * information_by_features(covariance, phi)
        )


def covariance_after(precision: Array, phi: Array) -> Array:
    """What is left of the covariance [64, 64] after stages of features phi [N, 4, 16]."""
    return np.asarray(np.linalg.inv(precision + block_diagonal(np.einsum("nif,nig->ifg", phi, phi))), dtype=np.float64)


def after_others(after: Array, phi: Array) -> Array:
    """What is left of the covariance after all stages but one, for each of these [N, 64, 64]."""
    projected, weighted = others_factors(after, phi)
    return np.asarray(after + np.swapaxes(projected, 1, 2) @ weighted, dtype=np.float64)


def others_factors(after: Array, phi: Array) -> tuple[Array, Array]:
    """(P, M P) [N, 4, 64], with which A + P' M P is what is left of the covariance after all stages but one.

    A stage is taken out of the covariance after all of them, `after` A [64, 64], by Woodbury's identity.
    """
    projected, spread = spread_of_features(after, phi)
    projected = projected.reshape(*projected.shape[:-2], -1)
    left = 2.0 * np.eye(STATE_COUNT) - spread  # I - Phi A Phi'
    return projected, np.asarray(np.linalg.solve(left, projected), dtype=np.float64)
