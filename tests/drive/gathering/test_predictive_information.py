"""Information about drifts to come against the posterior that samples leave, and its plans against SNOPT and IPOPT."""

import numpy as np
import pytest
from control_problems import check_against_referees, check_curvature, check_gradient, lane_ocp, stages

from drift_drake.drive.gathering.information import PredictiveInformation, StageInformation
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.features import features, network_inputs
from drift_drake.drive.learnt.posterior import predict, update_all

ALPHA = 1.7


@pytest.fixture(scope="module")
def points(model: BayesianModel) -> np.ndarray:
    assert model.drifts is not None
    return model.drifts[:12]


@pytest.fixture(scope="module")
def cost(model: BayesianModel, points: np.ndarray) -> PredictiveInformation:
    return PredictiveInformation(model.network, model.prior().covariance, model.sample_weight, points, ALPHA)


def test_the_value_is_by_how_much_predictions_narrow(
    model: BayesianModel, points: np.ndarray, cost: PredictiveInformation
) -> None:
    x, u, u_next = stages(7, 0)
    prior = model.prior()
    phi = features(model.network, network_inputs(x, u, u_next))
    after = update_all(prior, model.sigma, phi, np.zeros((7, 4)), model.sample_weight)
    wanted = features(model.network, points)
    before, left = (predict(belief, model.sigma, wanted).variance for belief in (prior, after))
    expected = 0.5 * np.log(before / left).sum(axis=1).mean()
    assert expected > 0.1
    assert cost.information(x, u, u_next) == pytest.approx(expected, rel=1e-7)
    assert cost.value(x, u, u_next) == pytest.approx(-ALPHA * expected, rel=1e-7)


def test_of_itself_a_sample_tells_less_than_all_it_tells(model: BayesianModel) -> None:
    """One stage, one state, the point is the stage: v falls from 1 + s to 1 + s / (1 + s), s = phi' Lambda^{-1} phi."""
    x, u, u_next = stages(1, 3)
    z = network_inputs(x, u, u_next)
    covariance = 1e-12 * np.eye(64)
    covariance[:16, :16] = model.prior().covariance[:16, :16]
    phi = features(model.network, z)[0, 0]
    s = phi @ covariance[:16, :16] @ phi
    reported = PredictiveInformation(model.network, covariance, np.ones(4), z, 1.0).information(x, u, u_next)
    assert reported == pytest.approx(0.5 * np.log((1.0 + s) ** 2 / (1.0 + 2.0 * s)), rel=1e-4)
    information = StageInformation(model.network, covariance, 1.0).information(x, u, u_next)
    assert reported < information == pytest.approx(0.5 * np.log(1.0 + s), rel=1e-4)


def test_the_derivatives_are_exact(cost: PredictiveInformation) -> None:
    check_gradient(cost, 1e-6)


def test_curvature_is_taken_with_the_points_weights_held(
    model: BayesianModel, points: np.ndarray, cost: PredictiveInformation
) -> None:
    """It is that of the variances weighed as they were where it was asked for."""
    wanted, prior = features(model.network, points), model.prior()

    def variances(x: np.ndarray, u: np.ndarray, u_next: np.ndarray) -> np.ndarray:
        phi = features(model.network, network_inputs(x, u, u_next))
        after = update_all(prior, np.ones(4), phi, np.zeros((len(x), 4)), model.sample_weight)
        return predict(after, np.ones(4), wanted).variance

    weights = 1.0 / variances(*stages(4, 2))
    check_curvature(cost, lambda *at: ALPHA * 0.5 * float(np.sum(weights * variances(*at))) / len(points))


def test_a_drift_tells_more_of_drifts_than_straight_driving(cost: PredictiveInformation, points: np.ndarray) -> None:
    z = points[:1]
    x = np.concatenate([z[:, :4], np.zeros((1, 2)), z[:, 8:]], axis=1)
    straight = np.array([[0.0, 10.0, 0.0, 10.1, 0.0, 0.0, 0.0, 50.0]])
    slow = np.array([[0.0, 50.0]])
    assert cost.information(x, z[:, 4:6], z[:, 6:8]) > 2.0 * cost.information(straight, slow, slow)


def test_the_sqp_finds_what_snopt_and_ipopt_find(model: BayesianModel, points: np.ndarray) -> None:
    covariance = model.prior().covariance
    objective = PredictiveInformation(model.network, covariance, model.sample_weight, points, 2.0)
    check_against_referees(*lane_ocp(model, 6, objective))
