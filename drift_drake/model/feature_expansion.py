"""The features to second order about points z: values, derivatives, and the second derivatives of weighted sums.

The network's are in closed form: with a tanh layer h = tanh(a), d2h = -2 h (1 - h^2) da da'. For those of the physical
inputs see `physical_curvature`.
"""

from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np

from drift_drake.arrays import Array
from drift_drake.model.features import (
    HIDDEN_COUNT,
    INPUT_COUNT,
    Network,
    feature_outputs,
    hidden_layers,
    inputs_and_jacobian,
    output_rows,
)
from drift_drake.model.physical_inputs import physical_curvature


class FeatureExpansion:
    """Features at points z [N, 10], and what is asked for of their derivatives.

    Attributes:
        z: the points; phi: [N, 4, 16].
    """

    def __init__(self, network: Network, z: Array) -> None:
        inputs, self._by_physics = inputs_and_jacobian(z, network.nominal)
        self._network, self.z = network, z
        self._h1, self._h2 = hidden_layers(network, inputs)
        self.phi = feature_outputs(network, self._h2)

    @cached_property
    def tangents(self) -> Array:
        """d phi / dz [N, 10, 4, 16]."""
        slope = 1.0 - self._h2**2
        tangents = _rows_times(self._before_tanh[1] * slope[:, None], output_rows(self._network).T)
        return tangents.reshape(len(self.z), INPUT_COUNT, *self.phi.shape[1:])

    @cached_property
    def _before_tanh(self) -> tuple[Array, Array]:
        """Derivatives by z [N, 10, 128] of what each tanh is taken of."""
        network = self._network
        by_inputs = network.w1 / network.input_scale[:, None]
        first = np.zeros((len(self.z), INPUT_COUNT, HIDDEN_COUNT))
        first[:, : len(by_inputs)] = by_inputs[:INPUT_COUNT]
        if self._by_physics is not None:
            first += _rows_times(np.ascontiguousarray(np.swapaxes(self._by_physics, 1, 2)), by_inputs[INPUT_COUNT:])
        return first, _rows_times(first * (1.0 - self._h1**2)[:, None], network.w2)

    def second(self, weights: Array) -> Array:
        """Second derivatives by z [N, 10, 10] of the features' sums with weights [N, 4, 16]."""
        network, (first, second) = self._network, self._before_tanh
        by_h2 = weights.reshape(len(weights), -1) @ output_rows(network) * (1.0 - self._h2**2)
        by_h1 = by_h2 @ network.w2.T * (1.0 - self._h1**2)
        found = _bent(second, -2.0 * self._h2 * by_h2) + _bent(first, -2.0 * self._h1 * by_h1)
        if network.nominal is not None:
            by_inputs = by_h1 @ network.w1.T / network.input_scale
            found += physical_curvature(self.z, by_inputs[:, INPUT_COUNT:], network.nominal)
        return found


@runtime_checkable
class OfFeatures(Protocol):
    """A cost about points z that is one of the features there: a `CostExpansion` that a model may share work with."""

    at: FeatureExpansion

    def by_features(self) -> Array:
        """Its derivative by the features [N, 4, 16]."""

    def along_features(self) -> Array:
        """Its second derivatives by z [N, 10, 10], as if the features were linear in z."""


class Expansions:
    """The expansion last asked for, kept: a model and a cost of one horizon ask for the same one.

    What is kept is scratch, not state: a result depends on the arguments only.
    """

    def __init__(self, network: Network) -> None:
        self.network = network
        self._last: FeatureExpansion | None = None

    def at(self, z: Array) -> FeatureExpansion:
        """That at points z [N, 10]."""
        if self._last is None or not np.array_equal(self._last.z, z):
            self._last = FeatureExpansion(self.network, z)
        return self._last


class ExpandedMean:
    """What `MeanFunction` is, by the expansion at the points: where second derivatives will be asked for there."""

    def __init__(self, expansions: Expansions, theta: Array) -> None:
        self.network, self.theta, self._expansions = expansions.network, theta, expansions

    def with_theta(self, theta: Array) -> "ExpandedMean":
        """The same features under another theta [4, 16]."""
        return ExpandedMean(self._expansions, theta)

    def value(self, z: Array) -> Array:
        """g [n, 4] at z [n, 10]."""
        return np.asarray(np.sum(self._expansions.at(z).phi * self.theta, axis=-1))

    def linearize(self, z: Array) -> tuple[Array, Array]:
        """g [n, 4] and d g / dz [n, 4, 10] at z [n, 10]."""
        slopes = np.sum(self._expansions.at(z).tangents * self.theta, axis=-1)
        return self.value(z), np.ascontiguousarray(slopes.swapaxes(1, 2))


def _rows_times(rows: Array, matrix: Array) -> Array:
    """Rows [N, 10, m] times a matrix [m, k], as a product of two: NumPy would make one of each point's few rows."""
    return np.asarray((rows.reshape(-1, rows.shape[-1]) @ matrix).reshape(*rows.shape[:-1], -1))


def _bent(rows: Array, weights: Array) -> Array:
    """sum_k weights_k rows_k rows_k' [N, 10, 10] of rows [N, 10, 128] and weights [N, 128]."""
    assert rows.shape[-1] == HIDDEN_COUNT
    return np.asarray((rows * weights[:, None]) @ np.swapaxes(rows, 1, 2))
