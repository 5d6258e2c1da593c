"""The learnt features phi_i(z): a tanh network at run time, values and Jacobians in NumPy.

z = (r, v, beta, omega_r, delta_k, tau_k, delta_{k+1}, tau_{k+1}, lagged delta_k, lagged tau_k); two hidden layers of
128 are shared by the four learnt states (r, v, beta, omega_r), each of which has an output layer of 16 features of its
own (section II of Davydov et al.). The paper's network knows the first eight of z. Beyond the paper are the lagged
commands (`command_lag`) and, in addition to z, what the nominal car's tyres say of it (`physical_inputs`): a network is
given both or neither. The output layers are linear, so theta folds into them: for the mean of the model the 64 features
become 4 outputs, and the Jacobian needs 4 reverse rows.
"""

import copy
from functools import cache, cached_property
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.compilation import compiled
from drift_drake.car.parameters import Constants
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.command_lag import LAGGED, TIME_STEP, TYPICAL, as_of_typical_car
from drift_drake.drive.learnt.physical_inputs import (
    PHYSICAL_COUNT,
    PHYSICAL_SCALE,
    physical_curvature,
    with_physical_inputs,
)

INPUT_COUNT = 10
PAPER_COUNT = 8  # of z, in the paper
HIDDEN_COUNT = 128
STATE_COUNT = 4  # learnt states: r, v, beta, omega_r
FEATURE_COUNT = 16
MEAN_COUNT = STATE_COUNT * FEATURE_COUNT  # last-layer parameters
COVARIANCE_COUNT = MEAN_COUNT**2  # entries of their covariance
INPUT_OFFSET = np.array([0.0, 12.0, 0.0, 14.0, 0.0, 120.0, 0.0, 120.0, 0.0, 120.0])
INPUT_SCALE = np.array([0.7, 5.0, 0.4, 6.0, 0.3, 120.0, 0.3, 120.0, 0.3, 120.0])
_NO_PHYSICS = np.empty((0, 0, INPUT_COUNT))


class Network(NamedTuple):
    """Weights of the feature network, and the fixed scaling (inputs - offset) / scale; the paper's has 8 inputs."""

    input_offset: Array  # [8 or 18]
    input_scale: Array  # [8 or 18]
    w1: Array  # [8 or 18, 128]
    b1: Array  # [128]
    w2: Array  # [128, 128]
    b2: Array  # [128]
    w_out: Array  # [4, 128, 16]
    b_out: Array  # [4, 16]
    nominal: Constants | None = None  # the car whose tyres are asked; none: the paper's z alone
    lag: tuple[float, float] = TYPICAL  # [s] of the steering and the torque of the car at hand; not trained

    @property
    def typical(self) -> Array | None:
        """A typical car's z of this one's, as a matrix [10, 10] (`command_lag`); None if its lags are typical."""
        return None if self.lag == TYPICAL else _as_of_typical_car(self.lag)

    def as_typical(self, z: Array) -> Array:
        """z [..., 10] as it would be of a typical car."""
        typical = self.typical
        return z if typical is None else z @ typical.T


@cache
def _as_of_typical_car(lag: tuple[float, float]) -> Array:
    return as_of_typical_car(np.array(lag), TIME_STEP)


def input_scaling(physical: bool) -> tuple[Array, Array]:
    """(offset, scale) of a network's inputs, with or without the physical ones."""
    if not physical:
        return INPUT_OFFSET[:PAPER_COUNT].copy(), INPUT_SCALE[:PAPER_COUNT].copy()
    return np.append(INPUT_OFFSET, np.zeros(PHYSICAL_COUNT)), np.append(INPUT_SCALE, PHYSICAL_SCALE)


def network_inputs(x: Array, u: Array, u_next: Array) -> Array:
    """z [..., 10] from states x [..., 8] and inputs u, u_next [..., 2] at the ends of the step."""
    x = np.asarray(x)
    return np.concatenate([x[..., :STATE_COUNT], u, u_next, x[..., LAGGED]], axis=-1)


def places_of_inputs(size: int) -> NDArray[np.intp]:
    """Where the numbers of z stand in (x, u, u_next) [size + 4]."""
    return np.concatenate([np.arange(STATE_COUNT), size + np.arange(4), np.arange(LAGGED.start, LAGGED.stop)])


def inputs_and_jacobian(z: Array, nominal: Constants | None) -> tuple[Array, Array | None]:
    """The network's inputs [..., 8 or 18], and the derivative of the physical ones, if any, by z [..., 8, 10]."""
    if nominal is None:
        return z[..., :PAPER_COUNT], None
    return with_physical_inputs(z, nominal)


def all_inputs(z: Array, nominal: Constants | None) -> Array:
    """The network's inputs: the paper's z [..., 8], or z [..., 10] and what the nominal car's tyres say of it."""
    return inputs_and_jacobian(z, nominal)[0]


def hidden_layers(network: Network, inputs: Array) -> tuple[Array, Array]:
    """The values [..., 128] of both hidden layers at a network's inputs [..., 8 or 18]."""
    h1 = np.tanh((inputs - network.input_offset) / network.input_scale @ network.w1 + network.b1)
    return h1, np.tanh(h1 @ network.w2 + network.b2)


def feature_outputs(network: Network, h2: Array) -> Array:
    """phi [..., 4, 16] from the last hidden layer [..., 128]."""
    return (h2 @ output_rows(network).T).reshape(*h2.shape[:-1], *network.b_out.shape) + network.b_out


def output_rows(network: Network) -> Array:
    """What each feature takes from the last hidden layer [64, 128]."""
    return network.w_out.transpose(0, 2, 1).reshape(-1, HIDDEN_COUNT)


def features(network: Network, z: Array) -> Array:
    """phi [..., 4, 16] at z [..., 10]."""
    return features_of_typical(network, network.as_typical(z))


def features_of_typical(network: Network, z: Array) -> Array:
    """The same at what z [..., 10] would be of a typical car."""
    return feature_outputs(network, hidden_layers(network, all_inputs(z, network.nominal))[1])


class MeanFunction:
    """g(z) = theta^T phi(z) for one theta, folded into the last layer, with work arrays kept between calls.

    The work arrays are scratch, not state: a call's result depends on its arguments only.
    """

    def __init__(self, network: Network, theta: Array) -> None:
        """Folds theta [4, 16] into the output layers."""
        self._w1 = np.ascontiguousarray(network.w1 / network.input_scale[:, None])
        self._b1 = network.b1 - network.input_offset @ self._w1
        self._w2, self._b2 = np.ascontiguousarray(network.w2), network.b2
        self._w1_t, self._w2_t = np.ascontiguousarray(self._w1.T), np.ascontiguousarray(self._w2.T)
        self._work: dict[int, tuple[Array, ...]] = {}
        self.network = network
        self._fold(theta)

    def _fold(self, theta: Array) -> None:
        self.theta = theta
        self._w3 = np.matmul(self.network.w_out, theta[:, :, None])[:, :, 0]  # [4, 128]
        self._b3 = np.sum(self.network.b_out * theta, axis=1)

    def with_theta(self, theta: Array) -> "MeanFunction":
        """The same features under another theta [4, 16]; shares the weights and the work arrays."""
        other = copy.copy(self)
        other._fold(theta)
        return other

    def with_network(self, network: Network) -> "MeanFunction":
        """The same with a network that differs in its lags alone."""
        other = copy.copy(self)
        other.network = network
        return other

    def _forward(self, inputs: Array) -> tuple[Array, ...]:
        count = inputs.shape[0]
        if count not in self._work:
            hidden = (count, HIDDEN_COUNT)
            self._work[count] = (*(np.empty(hidden) for _ in range(2)),
                                 *(np.empty((STATE_COUNT, *hidden)) for _ in range(2)))  # fmt: skip
        work = self._work[count]
        h1, h2 = work[0], work[1]
        np.matmul(inputs, self._w1, out=h1)
        h1 += self._b1
        np.tanh(h1, out=h1)
        np.matmul(h1, self._w2, out=h2)
        h2 += self._b2
        np.tanh(h2, out=h2)
        return work

    def value(self, z: Array) -> Array:
        """g [n, 4] at z [n, 10]."""
        h2 = self._forward(all_inputs(self.network.as_typical(z), self.network.nominal))[1]
        return h2 @ self._w3.T + self._b3

    def linearize(self, z: Array) -> tuple[Array, Array]:
        """g [n, 4] and d g / dz [n, 4, 10] at z [n, 10], by reverse mode."""
        inputs, by_physics = inputs_and_jacobian(self.network.as_typical(z), self.network.nominal)
        h1, h2, g2, g1 = self._forward(inputs)
        _through_tanh(h2, self._w3[:, None], g2)
        np.matmul(g2.reshape(-1, HIDDEN_COUNT), self._w2_t, out=g1.reshape(-1, HIDDEN_COUNT))
        _through_tanh(h1, g1, g1)
        by_inputs = (g1.reshape(-1, HIDDEN_COUNT) @ self._w1_t).reshape(STATE_COUNT, len(z), -1)
        jacobian = np.zeros((len(z), STATE_COUNT, INPUT_COUNT))
        _gather(by_inputs, _NO_PHYSICS if by_physics is None else by_physics, jacobian)
        if self.network.typical is not None:
            jacobian = jacobian @ self.network.typical
        return h2 @ self._w3.T + self._b3, jacobian


@compiled
def _through_tanh(h: Array, by_h: Array, out: Array) -> None:
    """Derivatives [4, n, 128] by a from those by h = tanh(a), h [n, 128], by_h [4, n or 1, 128]."""
    for i in range(out.shape[0]):
        for n in range(out.shape[1]):
            row = by_h[i, n if by_h.shape[1] > 1 else 0]
            for k in range(out.shape[2]):
                out[i, n, k] = (1.0 - h[n, k] * h[n, k]) * row[k]


@compiled
def _gather(by_inputs: Array, by_physics: Array, out: Array) -> None:
    """Writes derivatives by z [n, 4, 10] into zeros, from those by all inputs [4, n, inputs], physical ones too."""
    states, count, size = by_inputs.shape
    direct = min(size, out.shape[2])
    for n in range(count):
        for i in range(states):
            row = out[n, i]
            for j in range(direct):
                row[j] = by_inputs[i, n, j]
            for m in range(size - direct):
                factor = by_inputs[i, n, direct + m]
                for j in range(row.size):
                    row[j] += factor * by_physics[n, m, j]


class FeatureExpansion:
    """Features at points z [N, 10], and what is asked for of their derivatives.

    The network's are in closed form: with a tanh layer h = tanh(a), d2h = -2 h (1 - h^2) da da'. For those of the
    physical inputs see `physical_curvature`.

    Attributes:
        z: the points; phi: [N, 4, 16].
    """

    def __init__(self, network: Network, z: Array) -> None:
        self._typical = network.as_typical(z)
        inputs, self._by_physics = inputs_and_jacobian(self._typical, network.nominal)
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
        if network.typical is not None:
            first = network.typical.T @ first
        return first, _rows_times(first * (1.0 - self._h1**2)[:, None], network.w2)

    def second(self, weights: Array) -> Array:
        """Second derivatives by z [N, 10, 10] of the features' sums with weights [N, 4, 16]."""
        network, (first, second) = self._network, self._before_tanh
        by_h2 = weights.reshape(len(weights), -1) @ output_rows(network) * (1.0 - self._h2**2)
        by_h1 = by_h2 @ network.w2.T * (1.0 - self._h1**2)
        found = _bent(second, -2.0 * self._h2 * by_h2) + _bent(first, -2.0 * self._h1 * by_h1)
        if network.nominal is not None:
            by_inputs = by_h1 @ network.w1.T / network.input_scale
            bent = physical_curvature(self._typical, by_inputs[:, INPUT_COUNT:], network.nominal)
            found += bent if network.typical is None else network.typical.T @ bent @ network.typical
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

    def with_network(self, network: Network) -> "ExpandedMean":
        """The same with a network that differs in its lags alone."""
        return ExpandedMean(Expansions(network), self.theta)

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
