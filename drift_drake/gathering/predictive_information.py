"""Information about what is to be predicted, in place of l_info: for plans that teach one thing, drifting, above all.

    l_pred = 1/2 mean_t sum_i log(v_ti before / v_ti after),   v_ti = 1 + phi_i(z_t)' Lambda_i^{-1} phi_i(z_t)

is how many nats a drive tells of the next step at a point z_t where the car will be used, over all points t and states
i: the expected predictive information gain of Bickford Smith et al. ("Prediction-oriented Bayesian active learning",
2023), which for a Gaussian belief depends on where one drives, not on what one measures. l_info counts all that the
features can express, whether a drift will ask for it or not.

Second derivatives along dPhi_k = D_a, D_b are those of -1/2 tr(W A): A = (Lambda + sum_k Phi_k' Phi_k)^{-1} is what is
left of the covariance, and the weights W = mean_t sum_i phi_i(z_t) phi_i(z_t)' / v_ti are held. With B = A W A

    d2 l = tr((I - Phi A Phi') D_a B D_b') - tr(Phi B Phi' D_a A D_b') - tr(D_a A Phi' D_b B Phi')
           - tr(D_a B Phi' D_b A Phi').
"""

from abc import abstractmethod

import numpy as np

from drift_drake.arrays import Array
from drift_drake.gathering.feature_cost import ByFeatures, InformationCost, inverse
from drift_drake.gathering.information import (
    bent,
    crossed,
    met,
    own_blocks,
    precision_after,
    rows_and_products,
)
from drift_drake.model.feature_expansion import Expansions, FeatureExpansion
from drift_drake.model.features import STATE_COUNT, Network, features
from drift_drake.model.posterior import block_diagonal, state_blocks, weighed


class NarrowingCost(InformationCost):
    """-alpha 1/2 mean log(v before / v after) as a `StageCost`, v linear in what is left of the covariance.

    The gradient is exact. The second derivatives are those with the weights 1 / v held where they are.

    Args:
        network, alpha, expansions: see `InformationCost`.
        covariance: Lambda^{-1} before the drive [64, 64].
        sample_weight: of one sample in the posterior, by state [4].
    """

    count: int = 1
    """What the sum is divided by."""

    def __init__(
        self,
        network: Network,
        covariance: Array,
        sample_weight: Array,
        alpha: float,
        expansions: Expansions | None = None,
    ) -> None:
        # As if samples counted in full: the covariance is scaled by their weight, and what is wanted against it.
        super().__init__(network, weighed(covariance, sample_weight), alpha, expansions)
        self._before = self.spread(self._covariance)
        self._last: tuple[Array, tuple[Array, Array]] | None = None  # scratch: see `_left`

    @abstractmethod
    def spread(self, covariance: Array) -> Array:
        """What is to be narrowed, v [m], under a covariance [64, 64] (scaled by the samples' weight)."""

    @abstractmethod
    def wanted(self, spread: Array) -> Array:
        """W [64, 64], with which tr(W A) is the mean of v under A, each over its `spread`, but for constants."""

    def of_features(self, phi: Array) -> float:
        return float(0.5 * np.log(self._before / self._left(phi)[1]).sum() / self.count)

    def _left(self, phi: Array) -> tuple[Array, Array]:
        """(What is left of the covariance A [64, 64], v under it), kept for the same features' derivatives."""
        last = self._last
        if last is None or last[0] is not phi:
            after = inverse(precision_after(self._precision, phi))
            last = self._last = phi, (after, self.spread(after))
        return last[1]

    def by_features(self, at: FeatureExpansion) -> ByFeatures:
        left, spread = self._left(at.phi)
        told = left @ self.wanted(spread) @ left  # B
        rows, seen = rows_and_products(left, at.phi)
        told_rows, told_seen = rows_and_products(told, at.phi)
        ends, told_ends = met(at.tangents, rows), met(at.tangents, told_rows)
        second = bent(at.tangents, (np.eye(STATE_COUNT) - seen, told), (-told_seen, left))
        across = crossed(ends, told_ends)
        return ByFeatures(own_blocks(told_rows), second - across - across.swapaxes(1, 2))


class PredictiveInformation(NarrowingCost):
    """-alpha l_pred as a `StageCost`, the covariance updated along the horizon.

    Args:
        network, covariance, sample_weight, alpha, expansions: see `NarrowingCost`.
        points: z_t [n, 10], where predictions are wanted.
    """

    def __init__(
        self,
        network: Network,
        covariance: Array,
        sample_weight: Array,
        points: Array,
        alpha: float,
        expansions: Expansions | None = None,
    ) -> None:
        phi = features(network, points) / np.sqrt(sample_weight)[:, None]
        self._rows, self.count = np.ascontiguousarray(phi.swapaxes(0, 1)), len(points)  # [4, n, 16]
        super().__init__(network, covariance, sample_weight, alpha, expansions)

    def spread(self, covariance: Array) -> Array:
        """See `NarrowingCost`: v of all states and points [4 n]."""
        return (1.0 + np.sum((self._rows @ state_blocks(covariance)) * self._rows, axis=2)).ravel()

    def wanted(self, spread: Array) -> Array:
        weighted = self._rows / spread.reshape(*self._rows.shape[:2], 1)
        return block_diagonal(weighted.swapaxes(1, 2) @ self._rows) / self.count


def feature_rows(phi: Array) -> Array:
    """Phi [n, 4, 64] of features phi [n, 4, 16]: those of state i in row i, in that state's place."""
    states = range(phi.shape[1])
    rows = np.zeros((len(phi), len(states), *phi.shape[1:]))
    rows[:, states, states] = phi
    return rows.reshape(len(phi), len(states), -1)
