"""The derivatives, by a stage's variables, of a cost that is one of the features there."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drift_drake.model.feature_expansion import FeatureExpansion
from drift_drake.model.features import INPUT_SCALE, Network, features_and_pullback, network_inputs, places_of_inputs
from drift_drake.vehicle.step_model import CURVATURE_STEP

Array = NDArray[np.float64]


class FeatureGradient:
    """A `StageGradient` with second derivatives.

    Args:
        network: the features; stages: N.
        by_features: the cost's derivative by the features [..., N, 4, 16] of all stages, at these.
    """

    def __init__(self, network: Network, stages: int, by_features: Callable[[Array], Array]) -> None:
        self._network, self._stages, self._by_features = network, stages, by_features

    def __call__(self, x: Array, u: Array, u_next: Array) -> Array:
        """See `StageCost.gradient_at`."""
        z = network_inputs(x, u, u_next)
        phi, pullback = features_and_pullback(self._network, z.reshape(-1, self._stages, z.shape[-1]))
        by_z = pullback(self._by_features(phi)).reshape(z.shape)
        gradient = np.zeros((len(z), x.shape[1] + 4))
        gradient[:, places_of_inputs(x.shape[1])] = by_z
        return gradient

    def curvature(self, x: Array, u: Array, u_next: Array) -> Array:
        """Second derivatives [N, n+4, n+4]: the features' own, and differences of `by_features` along them."""
        at = FeatureExpansion(self._network, network_inputs(x, u, u_next))
        steps = CURVATURE_STEP * INPUT_SCALE
        along = np.moveaxis(at.tangents, 1, 0)  # [10, N, 4, 16]
        by_phi = self._by_features(np.concatenate([at.phi[None], at.phi + steps[:, None, None, None] * along]))
        change = np.moveaxis((by_phi[1:] - by_phi[0]) / steps[:, None, None, None], 0, 1)
        by_z = _flat(at.tangents) @ np.swapaxes(_flat(change), 1, 2)
        by_z = 0.5 * (by_z + np.swapaxes(by_z, 1, 2)) + at.second(by_phi[0])
        result, places = np.zeros((len(x), x.shape[1] + 4, x.shape[1] + 4)), places_of_inputs(x.shape[1])
        result[:, places[:, None], places] = by_z
        return result


def _flat(features: Array) -> Array:
    return features.reshape(*features.shape[:2], -1)
