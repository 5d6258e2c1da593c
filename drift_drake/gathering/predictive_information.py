"""Information about what is to be predicted, in place of l_info: for plans that teach one thing, drifting, above all.

    l_pred = 1/2 mean_t sum_i log(v_ti before / v_ti after),   v_ti = 1 + phi_i(z_t)' Lambda_i^{-1} phi_i(z_t)

is how many nats a drive tells of the next step at a point z_t where the car will be used, over all points t and states
i: the expected predictive information gain of Bickford Smith et al. ("Prediction-oriented Bayesian active learning",
2023), which for a Gaussian belief depends on where one drives, not on what one measures. l_info counts all that the
features can express, whether a drift will ask for it or not.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drift_drake.gathering.feature_gradient import FeatureGradient
from drift_drake.gathering.information import covariance_after, others_factors
from drift_drake.model.features import Network, features, network_inputs
from drift_drake.model.posterior import weighed

Array = NDArray[np.float64]


class PredictiveInformationCost:
    """-alpha l_pred as a `StageCost`, the covariance updated along the horizon.

    The gradient is exact. The second derivatives within a stage, are those with
    the points' weights 1 / v_t held where they are; between stages they are left out (see `InformationCost`).

    Args:
        network: the features.
        covariance: Lambda^{-1} before the drive [64, 64].
        sample_weight: of one sample in the posterior, by state [4].
        points: z_t [n, 10], where predictions are wanted.
        alpha: weight of the information [1/nat].
    """

    def __init__(self, network: Network, covariance: Array, sample_weight: Array, points: Array, alpha: float) -> None:
        rows = feature_rows(features(network, points))
        self._prepare(network, covariance, sample_weight, rows.reshape(-1, len(covariance)), len(points), alpha)

    def _prepare(
        self, network: Network, covariance: Array, sample_weight: Array, rows: Array, count: int, alpha: float
    ) -> None:
        """With rows [m, 64] of what is to be predicted, by theta / sigma; `count`: what the sum is divided by."""
        # As if samples counted in full: the covariance is scaled by their weight, and the rows against it.
        root = np.repeat(np.sqrt(sample_weight), len(covariance) // len(sample_weight))
        before = weighed(covariance, sample_weight)
        self._network, self._rows, self._count, self._alpha = network, rows / root, count, alpha
        self._precision: Array = np.linalg.inv(before).astype(np.float64)
        self._before = self._spread(before)

    def _spread(self, covariance: Array) -> Array:
        """What is to be narrowed, of which the logarithms count: v of each point and state [4 n]."""
        return 1.0 + np.sum((self._rows @ covariance) * self._rows, axis=1)

    def value(self, x: Array, u: Array, u_next: Array) -> float:
        """-alpha l_pred."""
        return -self._alpha * self.information(x, u, u_next)

    def information(self, x: Array, u: Array, u_next: Array) -> float:
        """l_pred [nat] of a trajectory."""
        after = covariance_after(self._precision, features(self._network, network_inputs(x, u, u_next)))
        return float(0.5 * np.sum(np.log(self._before / self._spread(after))) / self._count)

    def gradient_at(self, x: Array, u: Array, u_next: Array) -> Callable[[Array, Array, Array], Array]:
        """See `StageCost`."""
        phi = features(self._network, network_inputs(x, u, u_next))
        after = covariance_after(self._precision, phi)
        wanted = (self._rows.T / self._spread(after)) @ self._rows / self._count
        # What is left after all stages but one is C = A + P' M P, with A what is left after all of them; so C W C is
        # A W A and terms of rank four. Neither is formed: the points of a stage are multiplied by their factors.
        projected, weighted = others_factors(after, phi)
        by_after = wanted @ after
        seen = after @ by_after
        across = weighted @ by_after + 0.5 * (weighted @ wanted @ np.swapaxes(projected, 1, 2)) @ weighted
        eye, states = np.eye(phi.shape[-2]), range(phi.shape[-2])

        def by_features(phi: Array) -> Array:
            """The information's derivative by the features [N, 4, 16] of a point in each stage."""
            # Phi C W C with C = (others^{-1} + Phi' Phi)^{-1}, by Woodbury's identity.
            by_factor = _by_factors(phi, projected)
            own = _by_matrix(phi, after) + by_factor @ weighted
            told = _by_matrix(phi, seen) + by_factor @ across + _by_factors(phi, across) @ projected
            shrink = np.linalg.inv(eye + _by_features(own, phi))
            rest = told - _by_features(told, phi) @ shrink @ own
            return np.asarray((shrink @ rest).reshape(*phi.shape[:-1], *phi.shape[-2:])[:, states, states])

        # One point of each stage after the other: their products then stay in the processor's cache.
        return FeatureGradient(
            self._network, len(x), lambda phi: -self._alpha * np.stack([by_features(point) for point in phi])
        )


def feature_rows(phi: Array) -> Array:
    """Phi [n, 4, 64] of features phi [n, 4, 16]: those of state i in row i, in that state's place."""
    states = range(phi.shape[1])
    rows = np.zeros((len(phi), len(states), *phi.shape[1:]))
    rows[:, states, states] = phi
    return rows.reshape(len(phi), len(states), -1)


def _by_matrix(phi: Array, matrix: Array) -> Array:
    """Phi A [N, 4, 64] of features phi [N, 4, 16], those of a state in a row of Phi, and one A [64, 64]."""
    states, width = phi.shape[-2:]
    return np.asarray((phi.swapaxes(0, 1) @ matrix.reshape(states, width, -1)).swapaxes(0, 1))


def _by_factors(phi: Array, factors: Array) -> Array:
    """Phi P_k' [N, 4, 4] of features phi [N, 4, 16] and a factor P_k of each stage [N, 4, 64]."""
    return _by_features(factors, phi).swapaxes(1, 2)


def _by_features(rows: Array, phi: Array) -> Array:
    """R Phi' [N, 4, 4] of rows R [N, 4, 64] and features phi [N, 4, 16]."""
    return np.asarray(np.einsum("nijg,njg->nij", rows.reshape(*phi.shape[:-1], *phi.shape[-2:]), phi))
