"""The predicted standard deviation of e against simulation, and the lane that is left."""

import numpy as np
import pytest
from learnt_models import sample_theta
from scipy.linalg import block_diag

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.features import features, network_inputs
from drift_drake.drive.learnt.posterior import Posterior, state_blocks
from drift_drake.drive.mpc.tightening import MAX_SHARE, lateral_deviation, tightened
from drift_drake.drive.mpc.tracking import lqr_gains
from drift_drake.drive.reference.trajectory import figure_8

STEPS = 12
SMALL = 1e-4  # of the prior's covariance: where the first order holds


@pytest.fixture(scope="module")
def learnt() -> BayesianModel:
    return load_model()


@pytest.fixture(scope="module")
def plan(learnt: BayesianModel) -> tuple[BayesianStepModel, np.ndarray, np.ndarray, np.ndarray]:
    """The learnt car's own rollout in a drift: (model, x [N+1, 8], u [N+1, 2], curvature [N])."""
    horizon = figure_8(VehicleParameters()).horizon(5.0, 0.1, STEPS)
    model = BayesianStepModel(learnt.network, learnt.prior().mean, learnt.vehicle.constants(), path_step="trapezoid")
    x = np.hstack([horizon.x_ref[:1], horizon.u_ref[:1]])  # settled lags
    for k in range(STEPS):
        u, u_next = horizon.u_ref[k : k + 1], horizon.u_ref[k + 1 : k + 2]
        x = np.concatenate([x, model.step(x[-1:], u, u_next, horizon.curvature[k : k + 1])])
    return model, x, horizon.u_ref, horizon.curvature


def test_agrees_with_simulated_cars(learnt: BayesianModel, plan: tuple[BayesianStepModel, ...]) -> None:
    """Cars of which each is another theta, under the same feedback and with noise at every step."""
    model, x, u, curvature = plan
    count, generator = 1000, np.random.default_rng(0)
    prior, sigma = learnt.prior(), 0.1 * learnt.sigma
    belief = Posterior(prior.mean, SMALL * prior.covariance, prior.q / SMALL)
    predicted = lateral_deviation(model, sigma, belief.covariance, x, u, curvature)

    _, a, b, b_next = model.linearize(x[:-1], u[:-1], u[1:], curvature)
    gains = lqr_gains(a, b + b_next)
    thetas = sample_theta(belief, sigma, count, generator)
    state = np.repeat(x[:1], count, axis=0)
    found = [0.0]
    for k in range(STEPS):
        correction = (state - x[k]) @ gains[k].T
        advanced = np.concatenate([
            model.with_theta(theta).step(one[None], u[k] + c[None], u[k + 1] + c[None], curvature[k : k + 1])
            for theta, one, c in zip(thetas, state, correction, strict=True)
        ])  # fmt: skip
        advanced[:, :4] += sigma * generator.standard_normal((count, 4))
        state = advanced
        found.append(float(np.std(state[:, 4])))
    assert predicted[0] == 0.0
    # A step's uncertainty reaches e a step late, which matters at the beginning alone.
    np.testing.assert_allclose(predicted[4:], found[4:], rtol=0.25)


def test_is_the_joint_gaussians_first_order(learnt: BayesianModel, plan: tuple[BayesianStepModel, ...]) -> None:
    """Of all 64 numbers, and with a coupling that is felt."""
    model, x, u, curvature = plan
    _, a, b, b_next = model.linearize(x[:-1], u[:-1], u[1:], curvature)
    closed = a + (b + b_next) @ lqr_gains(a, b + b_next)
    phi = features(learnt.network, network_inputs(x[:-1], u[:-1], u[1:]))
    by_theta, process, sensitivities, noises = np.zeros((8, 64)), np.zeros((8, 8)), [np.zeros(64)], [0.0]
    for k in range(STEPS):
        by_theta = closed[k] @ by_theta
        by_theta[:4] += block_diag(*phi[k][:, None])
        process = closed[k] @ process @ closed[k].T
        process[:4, :4] += np.diag(learnt.sigma**2)
        sensitivities.append(by_theta[4])
        noises.append(process[4, 4])
    scale = np.repeat(learnt.sigma, 16)
    factor = np.random.default_rng(2).normal(size=(64, 64))
    # Along one direction, in which each state moves e at the end by as much.
    own = (sensitivities[-1] * scale).reshape(4, 16)
    shared = (own / np.sum(own**2, axis=1, keepdims=True)).ravel() * np.linalg.norm(own)
    covariance = factor @ factor.T + 64.0 * np.outer(shared, shared)
    found = []
    for known in (covariance, block_diag(*state_blocks(covariance))):
        found.append(lateral_deviation(model, learnt.sigma, known, x, u, curvature))
        variance = [(s * scale) @ known @ (s * scale) + noise for s, noise in zip(sensitivities, noises, strict=True)]
        np.testing.assert_allclose(found[-1], np.sqrt(variance), rtol=1e-9)
    assert found[0][-1] > 1.1 * found[1][-1]


def test_what_is_learnt_narrows_it(learnt: BayesianModel, plan: tuple[BayesianStepModel, ...]) -> None:
    model, x, u, curvature = plan
    covariance = learnt.prior().covariance
    wide, narrow = (
        lateral_deviation(model, learnt.sigma, scale * covariance, x, u, curvature) for scale in (1.0, 0.01)
    )
    assert (wide[2:] > narrow[2:]).all()
    assert (np.diff(narrow[1:5]) > 0.0).all()


def test_the_lane_stays_open() -> None:
    low, high = tightened(np.full(3, -3.0), np.full(3, 2.0), np.array([0.0, 0.5, 9.0]))
    np.testing.assert_allclose(low, [-3.0, -2.5, -3.0 * (1.0 - MAX_SHARE)])
    np.testing.assert_allclose(high, [2.0, 1.5, 2.0 * (1.0 - MAX_SHARE)])
