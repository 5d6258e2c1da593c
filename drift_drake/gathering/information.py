"""The information gathering objective l_info of Info-OCP (eq. 8), over the horizon's stages.

    l_info = 1/2 sum_k log det(I + Phi_k Lambda^{-1} Phi_k')

which is eq. (8), 1/2 sum_k sum_i log(1 + phi_ik' Lambda_i^{-1} phi_ik), where the prior does not couple the states,

with the covariance of before the drive, as in the paper, or with the covariance that has taken in the stages before k.
That one needs no recursion: by the chain rule of information the sum is 1/2 log det(Lambda^{-1} (Lambda + sum_k Phi_k'
Phi_k)), whatever the stages' order.

Second derivatives along dPhi = D_a, D_b, of a stage alone, with G = (I + Phi C Phi')^{-1} and C = Lambda^{-1}:

    d2 l = tr(G D_a C D_b') - 1/2 tr(G dS_a G dS_b),   dS_a = D_a C Phi' + Phi C D_a'

and of the sum, with what is left of the covariance after all stages, A = (Lambda + sum_k Phi_k' Phi_k)^{-1}:

    d2 l = tr((I - Phi A Phi') D_a A D_b') - tr(D_a A Phi' D_b A Phi').
"""

import numpy as np

from drift_drake.arrays import Array
from drift_drake.gathering.feature_cost import ByFeatures, InformationCost
from drift_drake.gathering.feature_curvature import bent, crossed, met
from drift_drake.model.feature_expansion import Expansions, FeatureExpansion
from drift_drake.model.features import STATE_COUNT, Network
from drift_drake.model.posterior import block_diagonal, spread_of_features


class StageInformation(InformationCost):
    """-alpha l_info as a `StageCost`, of each stage by itself: eq. (8).

    Args:
        network, alpha, expansions: see `InformationCost`.
        covariance: Lambda^{-1} before the drive [64, 64], see `posterior.weighed`.
    """

    def __init__(self, network: Network, covariance: Array, alpha: float, expansions: Expansions | None = None) -> None:
        super().__init__(network, alpha, expansions)
        self._covariance = np.asarray(covariance, dtype=float)

    def of_features(self, phi: Array) -> float:
        """See `InformationCost`."""
        return float(0.5 * np.linalg.slogdet(spread_of_features(self._covariance, phi)[1])[1].sum())

    def by_features(self, at: FeatureExpansion) -> ByFeatures:
        """See `InformationCost`."""
        projected, spread = spread_of_features(self._covariance, at.phi)
        projected = projected.reshape(*spread.shape[:2], -1)
        shrink = inverse(spread)
        gained = shrink @ projected
        unshrunk, shrunk = met(at.tangents, projected), met(at.tangents, gained)  # D_a C Phi', D_a C Phi' G
        second = bent(at.tangents, (shrink, self._covariance)) - crossed(shrunk, shrunk)
        second -= crossed(shrink[:, None] @ shrunk, unshrunk.swapaxes(2, 3))
        return ByFeatures(own_blocks(gained), second)


class UpdatedInformation(InformationCost):
    """-alpha l_info as a `StageCost`, the covariance updated along the horizon; arguments: see `StageInformation`."""

    def __init__(self, network: Network, covariance: Array, alpha: float, expansions: Expansions | None = None) -> None:
        super().__init__(network, alpha, expansions)
        self._precision = inverse(covariance)

    def of_features(self, phi: Array) -> float:
        """See `InformationCost`."""
        after, before = (np.linalg.slogdet(p)[1] for p in (precision_after(self._precision, phi), self._precision))
        return float(0.5 * (after - before))

    def by_features(self, at: FeatureExpansion) -> ByFeatures:
        """See `InformationCost`."""
        after = inverse(precision_after(self._precision, at.phi))
        rows, seen = rows_and_products(after, at.phi)
        ends = met(at.tangents, rows)
        second = bent(at.tangents, (np.eye(STATE_COUNT) - seen, after)) - crossed(ends, ends)
        return ByFeatures(own_blocks(rows), second)


def precision_after(precision: Array, phi: Array) -> Array:
    """Lambda + sum_k Phi_k' Phi_k [64, 64] after stages of features phi [N, 4, 16]."""
    by_state = np.ascontiguousarray(phi.swapaxes(0, 1))
    return np.asarray(precision + block_diagonal(by_state.swapaxes(1, 2) @ by_state), dtype=np.float64)


def inverse(matrix: Array) -> Array:
    """The inverse of matrices [..., m, m]."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def rows_and_products(matrix: Array, phi: Array) -> tuple[Array, Array]:
    """(Phi A [N, 4, 64], Phi A Phi' [N, 4, 4]) of features phi [N, 4, 16] and a matrix A [64, 64]."""
    rows, one_more = spread_of_features(matrix, phi)
    return rows.reshape(*one_more.shape[:2], -1), one_more - np.eye(STATE_COUNT)


def own_blocks(rows: Array) -> Array:
    """What of rows [N, 4, 64] stands where Phi has the features [N, 4, 16]."""
    count, states, _ = rows.shape
    by_state: Array = rows.reshape(count, states, states, -1)[:, range(states), range(states)]
    return by_state
