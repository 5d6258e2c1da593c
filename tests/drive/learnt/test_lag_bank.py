"""Which lags a car has, by the evidence of its drives."""

import numpy as np
import pytest

from drift_drake.drive.learnt.bayesian_step import regression_points
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.command_lag import LAG, as_of_typical_car, lagged_commands
from drift_drake.drive.learnt.features import features
from drift_drake.drive.learnt.lag_bank import STEERING, TORQUE, learn_with_lags, log_evidence, under_lags
from drift_drake.drive.learnt.posterior import predict, update, update_all
from drift_drake.drive.learnt.quality import adapted, step_model
from drift_drake.drive.learnt.samples import Samples


@pytest.fixture(scope="module")
def model() -> BayesianModel:
    return load_model()


def driven(model: BayesianModel, lag: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(states [61, 6], commands [61, 2]) of a weave by the model's own car with the given lags, noisy."""
    rng, count = np.random.default_rng(seed), 60
    t = 0.1 * np.arange(count + 1)
    u = np.stack([0.08 * np.sin(2.0 * t) + 0.03 * np.sin(5.0 * t + 1.0), 120.0 + 60.0 * np.sin(1.3 * t)], axis=1)
    step = step_model(model.with_lag(lag), model.prior())
    x = np.concatenate([[0.0, 12.0, 0.0, 12.3, 0.0, 0.0], u[0]])
    states = [x[:6]]
    for k in range(count):
        x = step.step(x[None], u[k][None], u[k + 1][None], np.zeros(1))[0]
        x[:4] += 0.3 * model.sigma * rng.normal(size=4)
        states.append(x[:6])
    return np.array(states), u


def samples_of(states: np.ndarray, u: np.ndarray, lag: np.ndarray) -> Samples:
    x = np.concatenate([states, lagged_commands(0.1 * np.arange(len(u)), u, lag)], axis=1)
    count = len(u) - 1
    return Samples(x[:-1], u[:-1], u[1:], x[1:], np.zeros(count), np.zeros(count, int), np.zeros(count, int))


@pytest.mark.parametrize("lag", [(0.2, 0.05), (0.05, 0.1), (0.1, 0.3), (0.02, 0.02)])
def test_a_car_of_the_bank_is_found(model: BayesianModel, lag: tuple[float, float]) -> None:
    drive = driven(model, np.array(lag), 3)
    taught = under_lags(model, lambda pair: samples_of(*drive, pair))
    evidence = {under.model.network.lag: under.evidence for under in taught}
    assert len(evidence) == len(STEERING) * len(TORQUE)
    best = max(evidence, key=lambda pair: evidence[pair])
    assert best[0] == lag[0]  # of short torque lags six seconds tell little
    assert evidence[best] - evidence[lag] < 0.5
    assert evidence[best] - min(evidence.values()) > 20.0
    found, posterior = learn_with_lags(model, lambda pair: samples_of(*drive, pair))
    alone = adapted(found, samples_of(*drive, found.lag))
    np.testing.assert_array_equal(posterior.mean, alone.mean)
    np.testing.assert_array_equal(found.lag, best)
    assert found.content_hash() == model.content_hash()


def test_the_evidence_is_that_of_the_samples_one_after_the_other(model: BayesianModel) -> None:
    """With weights of one: the product of what each sample's density is, given those before it."""
    samples = samples_of(*driven(model, LAG, 4), LAG)
    phi, y = regression_points(model, samples.x, samples.u, samples.u_next, samples.x_next)
    belief, ones, total = model.prior(), np.ones(4), 0.0
    for features_now, reported in zip(phi, y, strict=True):
        said = predict(belief, model.sigma, features_now)
        error = reported - said.mean
        total -= 0.5 * (error @ np.linalg.solve(said.covariance, error) + np.linalg.slogdet(said.covariance)[1])
        belief = update(belief, model.sigma, features_now, reported)
    total += len(y) * np.sum(np.log(model.sigma))  # which no features change
    after = update_all(model.prior(), model.sigma, phi, y)
    assert log_evidence(model.prior(), after, model.sigma, y, ones) == pytest.approx(total, rel=1e-6)


def test_the_features_of_other_lags_are_those_of_what_a_typical_car_would_be_given(model: BayesianModel) -> None:
    lag, z = np.array([0.15, 0.2]), np.random.default_rng(0).normal(size=(7, 10)) * model.network.input_scale[:10]
    other = model.with_lag(lag)
    np.testing.assert_allclose(
        features(other.network, z), features(model.network, z @ as_of_typical_car(lag, 0.1).T), atol=1e-12
    )
    assert other.drifts is not None
    np.testing.assert_allclose(features(other.network, other.drifts), features(model.network, model.drifts), atol=1e-9)
    back = other.with_lag(LAG)
    assert back.network.typical is None
    np.testing.assert_allclose(back.drifts, model.drifts, atol=1e-9)
    np.testing.assert_array_equal(as_of_typical_car(LAG, 0.1), np.eye(10))


def test_a_checkpoint_holds_no_lags(model: BayesianModel, tmp_path) -> None:
    model.with_lag(np.array([0.2, 0.2])).save(tmp_path / "model.npz")
    found = load_model(tmp_path / "model.npz")
    np.testing.assert_array_equal(found.lag, LAG)
    assert found.content_hash() == model.content_hash()
    np.testing.assert_allclose(found.drifts, model.drifts, rtol=1e-6)
