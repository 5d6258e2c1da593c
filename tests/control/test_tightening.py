"""The predicted standard deviation of e against simulation, and the lane that is left."""

import numpy as np
import pytest

from drift_drake.control.tightening import MAX_SHARE, lateral_deviation, tightened
from drift_drake.control.tracking import lqr_gains
from drift_drake.model.bayesian_step import BayesianStepModel
from drift_drake.model.checkpoint import BayesianModel, load
from drift_drake.model.posterior import Posterior, sample_theta
from drift_drake.reference.trajectory import figure_8
from drift_drake.vehicle.parameters import VehicleParameters

STEPS = 12
SMALL = 1e-4  # of the prior's covariance: where the first order holds


@pytest.fixture(scope="module")
def learnt() -> BayesianModel:
    return load()


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
    predicted = lateral_deviation(model, learnt.network, sigma, belief.covariance, x, u, curvature)

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


def test_what_is_learnt_narrows_it(learnt: BayesianModel, plan: tuple[BayesianStepModel, ...]) -> None:
    model, x, u, curvature = plan
    covariance = learnt.prior().covariance
    wide, narrow = (
        lateral_deviation(model, learnt.network, learnt.sigma, scale * covariance, x, u, curvature)
        for scale in (1.0, 0.01)
    )
    assert (wide[2:] > narrow[2:]).all()
    assert (np.diff(narrow[1:5]) > 0.0).all()


def test_the_lane_stays_open() -> None:
    low, high = tightened(np.full(3, -3.0), np.full(3, 2.0), np.array([0.0, 0.5, 9.0]))
    np.testing.assert_allclose(low, [-3.0, -2.5, -3.0 * (1.0 - MAX_SHARE)])
    np.testing.assert_allclose(high, [2.0, 1.5, 2.0 * (1.0 - MAX_SHARE)])
