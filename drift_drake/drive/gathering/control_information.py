"""Information about a task, in place of l_info: for plans that teach what the control of one reference will need.

What is left unknown of theta disturbs the closed loop along the reference at every step. To first order the deviation
from it is

    d_{k+1} = (A_k + B_k K_k) d_k + E_k Phi_k (theta - mean),   d_0 = 0,

with E_k a learnt state's step error as it enters the whole state, K_k the gains of a linear feedback. theta errs by the
same amount at all steps, so that d_k = S_k (theta - mean) and the expected cost of not knowing it is

    J = sum_k E d_k' Q d_k = tr(H Lambda^{-1}),   H = sum_k S_k' Q S_k   (in units of theta / sigma).

l_control = 1/2 log((J_noise + J before) / (J_noise + J after)), with J_noise what the steps' own noise costs. H is the
model-task Hessian of experiment design for control (Wagenmaker et al., "Task-optimal exploration in linear dynamical
systems", 2021; Lee et al., "Active learning for control-oriented identification of nonlinear systems", 2024).
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.drive.gathering.information import NarrowingCost, feature_rows
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.features import MEAN_COUNT, Expansions, features, network_inputs
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.mpc.tracking import lqr_gains
from drift_drake.drive.reference.trajectory import Reference, figure_8


class Task(NamedTuple):
    """A reference in time, 0.1 s apart."""

    x: Array  # states and lagged commands [N+1, 8]
    u: Array  # [N+1, 2]
    curvature: Array  # [N] [1/m]


def task_along(reference: Reference) -> Task:
    """One lap of a reference, or all of an open one."""
    length = reference.path.length if reference.path.closed else reference.distance
    along = reference.horizon(0.0, DT, int(float(reference.time(length)) / DT))
    lagged = lagged_commands(DT * np.arange(len(along.u_ref)), along.u_ref)
    return Task(np.concatenate([along.x_ref, lagged], axis=1), along.u_ref, along.curvature)


@cache
def figure_8_task(parameters: VehicleParameters) -> Task:
    """The figure-8 that the experiments drive."""
    return task_along(figure_8(parameters))


def sensitivities(model: BayesianModel, believed: BayesianStepModel, task: Task, weights: Array) -> tuple[Array, float]:
    """What an error of the last layer, and the noise, do to a task.

    Args:
        believed: the model with what is believed of theta; weights: Q's diagonal [6].

    Returns:
        (rows sqrt(Q) S_k of all steps [6 N, 64], by theta / sigma; J_noise).
    """
    x, u, u_next = task.x[:-1], task.u[:-1], task.u[1:]
    _, a, b, b_next = believed.linearize(x, u, u_next, task.curvature)
    closed = a + (b + b_next) @ lqr_gains(a, b + b_next)
    enters = believed.disturbance(x, u, u_next, task.curvature) * model.sigma
    moved = enters @ feature_rows(features(model.network, network_inputs(x, u, u_next)))
    deviation, noise = np.zeros((8, MEAN_COUNT)), np.zeros((8, 8))
    root = np.sqrt(weights)
    rows, cost = np.empty((len(x), len(weights), MEAN_COUNT)), 0.0
    for k in range(len(x)):
        deviation = closed[k] @ deviation + moved[k]
        noise = closed[k] @ noise @ closed[k].T + enters[k] @ enters[k].T
        rows[k] = root[:, None] * deviation[: len(weights)]
        cost += float(weights @ np.diagonal(noise)[: len(weights)])
    return rows.reshape(-1, MEAN_COUNT), cost


class ControlInformation(NarrowingCost):
    """-alpha l_control as a `StageCost`: for plans that teach what the control of one reference will need.

    Args:
        model: features and noise; believed: its step with what is believed of theta.
        covariance: Lambda^{-1} before the drive [64, 64].
        task: what is to be controlled; weights: Q's diagonal [6].
        alpha, expansions: see `InformationCost`.
    """

    def __init__(
        self, model: BayesianModel, believed: BayesianStepModel, covariance: Array, task: Task, weights: Array,
        alpha: float, expansions: Expansions | None = None,
    ) -> None:  # fmt: skip
        rows, self._noise = sensitivities(model, believed, task, weights)
        rows = rows / np.repeat(np.sqrt(model.sample_weight), MEAN_COUNT // len(model.sample_weight))
        self._hessian = rows.T @ rows
        super().__init__(model.network, covariance, model.sample_weight, alpha, expansions)

    def spread(self, covariance: Array) -> Array:
        """J_noise + tr(H Lambda^{-1}), of all steps together [1]."""
        return np.array([self._noise + np.sum(self._hessian * covariance)])

    def wanted(self, spread: Array) -> Array:
        return self._hessian / spread
