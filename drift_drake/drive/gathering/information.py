"""The information gathering objective l_info of Info-OCP (eq. 9), over the horizon's stages.

    l_info = 1/2 sum_k log det(I + Phi_k Lambda^{-1} Phi_k')

which is eq. (9), 1/2 sum_k sum_i log(1 + phi_ik' Lambda_i^{-1} phi_ik), where the prior does not couple the states,

with the covariance of before the drive, as in the paper, or with the covariance that has taken in the stages before k.
That one needs no recursion: by the chain rule of information the sum is 1/2 log det(Lambda^{-1} (Lambda + sum_k Phi_k'
Phi_k)), whatever the stages' order.

Phi [4, 64] has the features of state i in row i, in that state's place, D_a likewise their derivatives by number a of
z.
Second derivatives along dPhi = D_a, D_b, of a stage alone, with G = (I + Phi C Phi')^{-1} and C = Lambda^{-1}:

    d2 l = tr(G D_a C D_b') - 1/2 tr(G dS_a G dS_b),   dS_a = D_a C Phi' + Phi C D_a'

and of the sum, with what is left of the covariance after all stages, A = (Lambda + sum_k Phi_k' Phi_k)^{-1}:

    d2 l = tr((I - Phi A Phi') D_a A D_b') - tr(D_a A Phi' D_b A Phi').
"""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import NamedTuple

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.features import (
    STATE_COUNT,
    Expansions,
    FeatureExpansion,
    Network,
    features,
    network_inputs,
    places_of_inputs,
)
from drift_drake.drive.learnt.posterior import block_diagonal, spread_of_features, state_blocks, weighed


class ByFeatures(NamedTuple):
    """Derivatives of a sum over stages by the features of each of them."""

    first: Array  # [N, 4, 16]
    second: Array  # [N, 10, 10], those by the features along the stage's tangents


class InformationExpansion:
    """A `CostExpansion`, of -alpha times an information, that is one `OfFeatures`."""

    def __init__(self, at: FeatureExpansion, derivatives: ByFeatures, size: int, alpha: float) -> None:
        self.at, self._derivatives, self._size, self._alpha = at, derivatives, size, alpha

    def gradient(self) -> Array:
        found = np.zeros((len(self.at.z), self._size + 4))
        by_z = _flat(self.at.tangents) @ _flat(self.by_features())[:, :, None]
        found[:, places_of_inputs(self._size)] = by_z[:, :, 0]
        return found

    def curvature(self) -> Array:
        size, places = self._size + 4, places_of_inputs(self._size)
        found = np.zeros((len(self.at.z), size, size))
        found[:, places[:, None], places] = self.along_features() + self.at.second(self.by_features())
        return found

    def by_features(self) -> Array:
        return -self._alpha * self._derivatives.first

    def along_features(self) -> Array:
        return -self._alpha * self._derivatives.second


class InformationCost(ABC):
    """-alpha times an information, which is a function of the features, as a `StageCost`.

    Its second derivatives within a stage are mostly negative: the SQP adds them to the cost's and the dynamics' and
    projects the sum, so that its QPs stay convex. Second derivatives between stages the SQP leaves out.

    Args:
        network: the features; covariance: Lambda^{-1} before the drive [64, 64], see `posterior.weighed`.
        alpha: weight of the information [1/nat]; expansions: those of the dynamics, where they are of the same network.
    """

    def __init__(self, network: Network, covariance: Array, alpha: float, expansions: Expansions | None = None) -> None:
        self._covariance, self._alpha = np.asarray(covariance, dtype=float), alpha
        self._expansions = expansions or Expansions(network)

    @cached_property
    def _precision(self) -> Array:
        return inverse(self._covariance)

    @abstractmethod
    def of_features(self, phi: Array) -> float:
        """The information [nat] of features [N, 4, 16]."""

    @abstractmethod
    def by_features(self, at: FeatureExpansion) -> ByFeatures:
        """Its derivatives at the stages' features."""

    def information(self, x: Array, u: Array, u_next: Array) -> float:
        """The information [nat] of a trajectory."""
        return self.of_features(self._expansions.at(network_inputs(x, u, u_next)).phi)

    def value(self, x: Array, u: Array, u_next: Array) -> float:
        """-alpha times the information."""
        return -self._alpha * self.information(x, u, u_next)

    def expansion(self, x: Array, u: Array, u_next: Array) -> InformationExpansion:
        at = self._expansions.at(network_inputs(x, u, u_next))
        return InformationExpansion(at, self.by_features(at), x.shape[1], self._alpha)


def inverse(matrix: Array) -> Array:
    """The inverse of matrices [..., m, m]."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _flat(features: Array) -> Array:
    """[..., 64] of features, or of their derivatives, [..., 4, 16]."""
    return features.reshape(*features.shape[:-2], -1)


def bent(tangents: Array, *terms: tuple[Array, Array]) -> Array:
    """Sum of tr(L D_a A D_b') [N, 10, 10]; tangents [N, 10, 4, 16], terms: (L [N, 4, 4], A), all symmetric."""
    states, width = tangents.shape[2:]
    by_state = np.ascontiguousarray(np.moveaxis(tangents, 2, 0)).reshape(states, -1, width)
    flat = (*tangents.shape[:2], states * width)
    mixed = np.zeros(flat)
    for left, matrix in terms:
        products = by_state @ matrix.reshape(states, width, -1)  # row j of D_a A [4, 10 N, 64]
        _mix(products, left, width, mixed.reshape(-1, states * width))
    return mixed @ tangents.reshape(flat).swapaxes(1, 2)


@compiled
def _mix(products: Array, left: Array, width: int, out: Array) -> None:
    """Adds what of L D_a A stands where D_b has entries."""
    states, count = products.shape[0], out.shape[0]
    each = count // left.shape[0]
    for m in range(count):
        factors, row = left[m // each], out[m]
        for j in range(states):
            through = products[j, m]
            for i in range(states):
                factor, first = factors[i, j], i * width
                for g in range(first, first + width):
                    row[g] += factor * through[g]


@compiled
def met(tangents: Array, rows: Array) -> Array:
    """D_a R' [N, 10, 4, 4] of rows R [N, 4, 64]."""
    count, directions, states, width = tangents.shape
    out = np.empty((count, directions, states, states))
    for n in range(count):
        for a in range(directions):
            for i in range(states):
                for j in range(states):
                    total = 0.0
                    for f in range(width):
                        total += tangents[n, a, i, f] * rows[n, j, i * width + f]
                    out[n, a, i, j] = total
    return out


def crossed(first: Array, second: Array) -> Array:
    """tr(F_a S_b) [N, 10, 10] of factors [N, 10, 4, 4]."""
    flat = (*first.shape[:2], -1)
    return first.reshape(flat) @ second.swapaxes(2, 3).reshape(flat).swapaxes(1, 2)


class StageInformation(InformationCost):
    """-alpha l_info as a `StageCost`, of each stage by itself: eq. (9)."""

    def of_features(self, phi: Array) -> float:
        return float(0.5 * np.linalg.slogdet(spread_of_features(self._covariance, phi)[1])[1].sum())

    def by_features(self, at: FeatureExpansion) -> ByFeatures:
        projected, spread = spread_of_features(self._covariance, at.phi)
        projected = projected.reshape(*spread.shape[:2], -1)
        shrink = inverse(spread)
        gained = shrink @ projected
        unshrunk, shrunk = met(at.tangents, projected), met(at.tangents, gained)  # D_a C Phi', D_a C Phi' G
        second = bent(at.tangents, (shrink, self._covariance)) - crossed(shrunk, shrunk)
        second -= crossed(shrink[:, None] @ shrunk, unshrunk.swapaxes(2, 3))
        return ByFeatures(own_blocks(gained), second)


class UpdatedInformation(InformationCost):
    """-alpha l_info as a `StageCost`, the covariance updated along the horizon."""

    def of_features(self, phi: Array) -> float:
        after, before = (np.linalg.slogdet(p)[1] for p in (precision_after(self._precision, phi), self._precision))
        return float(0.5 * (after - before))

    def by_features(self, at: FeatureExpansion) -> ByFeatures:
        after = inverse(precision_after(self._precision, at.phi))
        rows, seen = rows_and_products(after, at.phi)
        ends = met(at.tangents, rows)
        second = bent(at.tangents, (np.eye(STATE_COUNT) - seen, after)) - crossed(ends, ends)
        return ByFeatures(own_blocks(rows), second)


def precision_after(precision: Array, phi: Array) -> Array:
    """Lambda + sum_k Phi_k' Phi_k [64, 64] after stages of features phi [N, 4, 16]."""
    by_state = np.ascontiguousarray(phi.swapaxes(0, 1))
    return np.asarray(precision + block_diagonal(by_state.swapaxes(1, 2) @ by_state), dtype=np.float64)


def rows_and_products(matrix: Array, phi: Array) -> tuple[Array, Array]:
    """(Phi A [N, 4, 64], Phi A Phi' [N, 4, 4]) of features phi [N, 4, 16] and a matrix A [64, 64]."""
    rows, one_more = spread_of_features(matrix, phi)
    return rows.reshape(*one_more.shape[:2], -1), one_more - np.eye(STATE_COUNT)


def own_blocks(rows: Array) -> Array:
    """What of rows [N, 4, 64] stands where Phi has the features [N, 4, 16]."""
    count, states, _ = rows.shape
    return rows.reshape(count, states, states, -1)[:, range(states), range(states)]


class PredictiveInformation(InformationCost):
    """-alpha l_pred as a `StageCost`, for plans that teach one thing, drifting, above all.

        l_pred = 1/2 mean_t sum_i log(v_ti before / v_ti after),   v_ti = 1 + phi_i(z_t)' Lambda_i^{-1} phi_i(z_t)

    is how many nats a drive tells of the next step at points z_t where the car will be used: the expected predictive
    information gain of Bickford Smith et al. ("Prediction-oriented Bayesian active learning", 2023), which for a
    Gaussian belief depends on where one drives, not on what one measures.

    The gradient is exact. The second derivatives along dPhi_k = D_a, D_b are those of -1/2 tr(W A) with the weights W,
    each v's share over v, held where they are, A = (Lambda + sum_k Phi_k' Phi_k)^{-1} and B = A W A:

        d2 l = tr((I - Phi A Phi') D_a B D_b') - tr(Phi B Phi' D_a A D_b') - tr(D_a A Phi' D_b B Phi')
               - tr(D_a B Phi' D_b A Phi').

    Args:
        network, alpha, expansions: see `InformationCost`.
        covariance: Lambda^{-1} before the drive [64, 64].
        sample_weight: of one sample in the posterior, by state [4].
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
        # As if samples counted in full: the covariance is scaled by their weight, and what is wanted against it.
        super().__init__(network, weighed(covariance, sample_weight), alpha, expansions)
        phi = features(network, points) / np.sqrt(sample_weight)[:, None]
        self._rows, self._count = np.ascontiguousarray(phi.swapaxes(0, 1)), len(points)  # [4, n, 16]
        self._before = self._spread(self._covariance)
        self._last: tuple[Array, tuple[Array, Array]] | None = None  # scratch: see `_left`

    def _spread(self, covariance: Array) -> Array:
        """v of all states and points [4 n] under a covariance [64, 64] (scaled by the samples' weight)."""
        return (1.0 + np.sum((self._rows @ state_blocks(covariance)) * self._rows, axis=2)).ravel()

    def of_features(self, phi: Array) -> float:
        return float(0.5 * np.log(self._before / self._left(phi)[1]).sum() / self._count)

    def _left(self, phi: Array) -> tuple[Array, Array]:
        """(What is left of the covariance A [64, 64], v under it), kept for the same features' derivatives."""
        last = self._last
        if last is None or last[0] is not phi:
            after = inverse(precision_after(self._precision, phi))
            last = self._last = phi, (after, self._spread(after))
        return last[1]

    def by_features(self, at: FeatureExpansion) -> ByFeatures:
        left, spread = self._left(at.phi)
        by_spread = self._rows / spread.reshape(*self._rows.shape[:2], 1)
        wanted = block_diagonal(by_spread.swapaxes(1, 2) @ self._rows) / self._count  # W
        weighted = left @ wanted @ left  # B
        rows, seen = rows_and_products(left, at.phi)
        weighted_rows, weighted_seen = rows_and_products(weighted, at.phi)
        ends, weighted_ends = met(at.tangents, rows), met(at.tangents, weighted_rows)
        second = bent(at.tangents, (np.eye(STATE_COUNT) - seen, weighted), (-weighted_seen, left))
        across = crossed(ends, weighted_ends)
        return ByFeatures(own_blocks(weighted_rows), second - across - across.swapaxes(1, 2))
