"""A cost that is one of the features at a horizon's stages: its derivatives by the stages' variables."""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import NamedTuple

import numpy as np

from drift_drake.arrays import Array
from drift_drake.model.feature_expansion import Expansions, FeatureExpansion
from drift_drake.model.features import Network, network_inputs, places_of_inputs


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
