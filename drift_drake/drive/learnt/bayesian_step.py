"""The controller's one-step model f_theta(x_k, u_k, u_{k+1}) = h(x_k, u_k) + theta^T phi(z_k) and its Jacobians.

h is one Euler step of the nominal car with h_4 = 0: the wheel speed is learnt whole. The path coordinates e and dphi
have no learnt part (g_5 = g_6 = 0); two rules for their step are offered:

- "euler", the paper's: rates of the nominal car at the start of the step. The course rate then holds the *nominal*
  car's beta_dot and forces, whatever has been learnt.
- "trapezoid": the course advances by what the learnt model says of the body, beta_{k+1} - beta_k + dt (r_k +
  r_{k+1}) / 2, and the path terms use the mean of v and of dphi over the step. On held-out vehicles, after 100 samples,
  the median error of e falls from 8.0 to 1.4 cm over 0.5 s and from 0.87 to 0.12 m over 2 s, that of dphi over 2 s from
  0.091 to 0.012 rad (`experiments.model.quality`). The closed loop uses this one.
"""

import copy
from collections.abc import Sequence
from functools import cache
from typing import Literal

import numpy as np
from pydrake.systems.framework import LeafSystem

from drift_drake.car.parameters import Constants
from drift_drake.car.single_track.motion import linearize
from drift_drake.car.step_model import CURVATURE_STEP, CostExpansion, StepModel, block_scale
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import LAG, TIME_STEP, CommandLag, lag_factors
from drift_drake.drive.learnt.compiled_step import Lags, curved_steps, linearized_steps, steps
from drift_drake.drive.learnt.features import (
    MEAN_COUNT,
    STATE_COUNT,
    ExpandedMean,
    Expansions,
    FeatureExpansion,
    MeanFunction,
    Network,
    OfFeatures,
    features_of_typical,
    network_inputs,
    places_of_inputs,
)

PathStep = Literal["euler", "trapezoid"]


def euler_step(x: Array, u: Array, curvature: Array, nominal: Constants) -> Array:
    """h(x, u) [..., 6] for x [..., 6], u [..., 2], curvature [...]: Euler, with h_4 = 0."""
    rates, _, _ = linearize(x, u, curvature, nominal)
    h = np.asarray(x) + TIME_STEP * rates
    h[..., 3] = 0.0
    return h


def residual(x: Array, u: Array, x_next: Array, nominal: Constants) -> Array:
    """y [..., 4] = x_{k+1} - h(x_k, u_k) of the learnt states: what the last layer is fitted to.

    u_k is what a typical car would have to be given (`command_lag`): the command [..., 2], if the lags are typical.
    """
    state = np.zeros((*np.shape(x)[:-1], 6))
    state[..., :STATE_COUNT] = np.asarray(x)[..., :STATE_COUNT]
    h = euler_step(state, u, np.zeros(state.shape[:-1]), nominal)
    return np.asarray(x_next)[..., :STATE_COUNT] - h[..., :STATE_COUNT]


def regression_points(model: BayesianModel, x: Array, u: Array, u_next: Array, x_next: Array) -> tuple[Array, Array]:
    """(features phi [..., 4, 16], residuals y [..., 4]) of samples: what the last layer is fitted to.

    Args:
        x, x_next: states and lagged commands at both ends of a step [..., 8]; u, u_next: commands there [..., 2].
    """
    return _points_of(model, model.network.as_typical(network_inputs(x, u, u_next)), x, x_next)


def bank_points(
    models: Sequence[BayesianModel], x: Array, u: Array, u_next: Array, x_next: Array
) -> tuple[Array, Array]:
    """The same [K, 4, 16], [K, 4] of one sample for each of K models that differ in their lags alone.

    Args:
        x: its state with the commands behind each model's lags [K, 8]; u, u_next [2]; x_next [6 or more].
    """
    each = np.ones((len(models), 1))
    z = network_inputs(x, each * u, each * u_next)
    typical = np.array([model.network.as_typical(row) for model, row in zip(models, z, strict=True)])
    return _points_of(models[0], typical, x, x_next)


def _points_of(model: BayesianModel, typical: Array, x: Array, x_next: Array) -> tuple[Array, Array]:
    """`regression_points`, z [..., 10] being a typical car's."""
    given = typical[..., STATE_COUNT : STATE_COUNT + 2]
    return features_of_typical(model.network, typical), residual(x, given, x_next, model.vehicle.constants())


@cache
def _lags_of(lag: tuple[float, float]) -> Lags:
    """The factors of a step under lags of steering and torque [s]."""
    pair = np.array(lag)
    return Lags(*lag_factors(TIME_STEP, pair), LAG / pair)


class BayesianStepModel(StepModel):
    """One step of the learnt car over the arrays of a horizon, for one theta.

    Its state is the paper's (r, v, beta, omega_r, e, dphi) and the lagged commands (`command_lag`). A cost that asks
    for the features at the same points may share its `expansions`.
    """

    internal_scale: Array = np.array([0.3, 100.0])  # of the lagged commands

    def __init__(
        self,
        network: Network,
        theta: Array,
        nominal: Constants,
        path_step: PathStep = "trapezoid",
    ) -> None:
        """Args: theta: last-layer parameters [4, 16], as a rule the posterior mean; nominal: the car inside h."""
        self._mean: MeanFunction | ExpandedMean = MeanFunction(network, theta)
        self.expansions = Expansions(network)
        self._nominal = nominal
        self._lag = _lags_of(network.lag)
        self._trapezoid = path_step == "trapezoid"
        self._offset = np.zeros(STATE_COUNT)

    @property
    def network(self) -> Network:
        """The features, under the lags that are believed."""
        return self._mean.network

    @property
    def lag(self) -> Array:
        """Of steering and torque [2] [s]."""
        return np.array(self.network.lag)

    def with_theta(self, theta: Array) -> "BayesianStepModel":
        """The model with another theta [4, 16] or [64] (the features and work arrays are shared).

        Four numbers more [68] are an offset of the learnt states over a step, added to what theta says of it; two more
        [70] the lags of steering and torque [s].
        """
        other = copy.copy(self)
        flat, end = np.ravel(theta), MEAN_COUNT + STATE_COUNT
        last_layer, offset, lag = flat[:MEAN_COUNT], flat[MEAN_COUNT:end], flat[end:]
        other._mean = self._mean.with_theta(last_layer.reshape(STATE_COUNT, -1))
        other._offset = offset if offset.size else np.zeros(STATE_COUNT)
        if lag.size and not np.array_equal(lag, self._mean.network.lag):
            network = self._mean.network._replace(lag=(float(lag[0]), float(lag[1])))
            other._lag, other._mean = _lags_of(network.lag), other._mean.with_network(network)
            other.expansions = Expansions(network)
        return other

    def expanded(self) -> "BayesianStepModel":
        """The same model for programs that ask for second derivatives at each point: one expansion serves them all."""
        other = copy.copy(self)
        other._mean = ExpandedMean(self.expansions, self._mean.theta)
        return other

    def observer(self, period: float) -> LeafSystem:
        return CommandLag(period, self.lag)

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        """x_{k+1} [n, 8] for states x [n, 8], inputs at both ends of the step [n, 2] and path curvature [n] [1/m]."""
        points, x_next = _points(x, u, u_next, curvature), np.empty((len(x), 8))
        g = self._mean.value(network_inputs(x, u, u_next)) + self._offset
        steps(points, g, self._nominal, self._lag, self._trapezoid, x_next)
        return x_next

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        """The step and its Jacobians.

        Returns:
            (x_{k+1} [n, 8], A = d/dx [n, 8, 8], B = d/du_k [n, 8, 2], B_next = d/du_{k+1} [n, 8, 2]).
        """
        points, x_next = _points(x, u, u_next, curvature), np.empty((len(x), 8))
        jacobian = np.empty((len(x), 8, 12))
        g, slope = self._mean.linearize(network_inputs(x, u, u_next))
        linearized_steps(points, g + self._offset, slope, self._nominal, self._lag, self._trapezoid, x_next,
                          jacobian)  # fmt: skip
        return x_next, jacobian[:, :, :8], jacobian[:, :, 8:10], jacobian[:, :, 10:]

    def weighted_curvature(self, x: Array, u: Array, u_next: Array, curvature: Array, weights: Array) -> Array:
        """See `StepModel`.

        The learnt part's own second derivatives are `FeatureExpansion`'s; all others are differences of the exact
        derivatives with the learnt part linear, for which no network is asked.
        """
        at, bent, by_features = self._curvature(x, u, u_next, curvature, weights)
        return _with_features(bent, at.second(by_features))

    def curvature_with(
        self, x: Array, u: Array, u_next: Array, curvature: Array, weights: Array, cost: CostExpansion
    ) -> Array:
        """See `StepModel`: the features' second derivatives are taken once, by the sum's derivative by them."""
        at, bent, by_features = self._curvature(x, u, u_next, curvature, weights)
        if not isinstance(cost, OfFeatures) or cost.at is not at:
            return _with_features(bent, at.second(by_features)) + cost.curvature()
        return _with_features(bent, cost.along_features() + at.second(by_features + cost.by_features()))

    def _curvature(
        self, x: Array, u: Array, u_next: Array, curvature: Array, weights: Array
    ) -> tuple[FeatureExpansion, Array, Array]:
        """(expansion, second derivatives with linear features [N, 12, 12], first ones by the features [N, 4, 16])."""
        at, mean = self.expansions.at(network_inputs(x, u, u_next)), ExpandedMean(self.expansions, self._mean.theta)
        g, by_z = mean.linearize(at.z)
        bent, by_g = np.empty((len(x), 12, 12)), np.empty((len(x), STATE_COUNT))
        curved_steps(_points(x, u, u_next, curvature), g + self._offset, by_z, np.ascontiguousarray(weights),
                     self._nominal, self._lag, self._trapezoid, CURVATURE_STEP * block_scale(self.internal_scale), bent,
                     by_g)  # fmt: skip
        return at, bent, by_g[:, :, None] * mean.theta


def _with_features(bent: Array, by_z: Array) -> Array:
    places = places_of_inputs(8)
    bent[:, places[:, None], places] += by_z
    return bent


def _points(x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
    """Rows (x, u, u_next, curvature) [n, 13], as `compiled_step` takes them."""
    return np.concatenate([x, u, u_next, curvature[:, None]], axis=1)
