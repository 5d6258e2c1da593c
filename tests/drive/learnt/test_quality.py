"""Measures of quality, on cases whose answer is known."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import norm

from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.features import features, network_inputs
from drift_drake.drive.learnt.posterior import state_blocks, update
from drift_drake.drive.learnt.quality import (
    SAMPLE_WEIGHTS,
    adapted,
    choose_sample_weight,
    learn,
    mean_nll,
    split_vehicle,
    standardized_errors,
    step_model,
)
from drift_drake.drive.learnt.samples import Samples, concatenate
from experiments.model.judging import (
    GAUSSIAN_COVERAGE,
    deviation_coverage,
    judge_stepper,
    quality_by_points,
    rollout_errors,
    rollout_summary,
)


class Drifting:
    """Adds 1 to every state at every step."""

    def step(self, x: np.ndarray, u: np.ndarray, u_next: np.ndarray, curvature: np.ndarray) -> np.ndarray:  # noqa: ARG002
        return x + 1.0


def drive(count: int, number: int, generator: np.random.Generator) -> Samples:
    centre, spread = np.array([0.4, 11.0, -0.5, 17.0, 0.0, 0.0]), np.array([0.2, 1.0, 0.1, 1.0, 0.3, 0.1])
    x = centre + spread * generator.normal(size=(count + 1, 6))
    u = np.array([-0.2, 150.0]) + np.array([0.1, 30.0]) * generator.normal(size=(count + 1, 2))
    x = np.hstack([x, lagged_commands(0.1 * np.arange(count + 1), u)])
    return Samples(x[:-1], u[:-1], u[1:], x[1:], np.zeros(count), np.zeros(count, dtype=int), np.full(count, number))


@pytest.fixture(scope="module")
def full_weight(random_model: BayesianModel) -> BayesianModel:
    return dataclasses.replace(random_model, sample_weight=np.ones(4))


@pytest.fixture(scope="module")
def believed(random_model: BayesianModel) -> Samples:
    """Drives of a car that is exactly one draw from the model's prior, noise included."""
    generator = np.random.default_rng(0)
    prior = random_model.prior()
    factor = np.linalg.cholesky(prior.covariance)
    theta = prior.mean + random_model.sigma[:, None] * (factor @ generator.standard_normal(64)).reshape(4, 16)
    parts = []
    for number in range(6):
        samples = drive(60, number, generator)
        x_next = step_model(random_model, prior._replace(mean=theta)).step(
            samples.x, samples.u, samples.u_next, samples.curvature
        )
        x_next[:, :4] += random_model.sigma * generator.standard_normal((60, 4))
        parts.append(samples._replace(x_next=x_next))
    return concatenate(parts)


def test_whole_drives_are_split(believed: Samples) -> None:
    split = split_vehicle(believed, 100)
    np.testing.assert_array_equal(split.adaptation.x, believed.x[:100])
    assert [int(part.drive[0]) for part in split.judged] == [2, 3, 4, 5]
    rotated = split_vehicle(believed, 60, rotation=4)
    assert set(rotated.adaptation.drive) == {4}
    assert [int(part.drive[0]) for part in rotated.judged] == [5, 0, 1, 2, 3]
    with pytest.raises(ValueError, match="360 samples in 6 drives are too few"):
        split_vehicle(believed, 320)


def test_a_right_model_is_calibrated_and_adaptation_takes_its_error_to_the_noise(
    full_weight: BayesianModel, believed: Samples
) -> None:
    random_model = full_weight
    split = split_vehicle(believed, 100)
    judged = concatenate(split.judged)
    result = quality_by_points(random_model, [split], (0, 100), horizons=(1,))
    np.testing.assert_allclose(result["100"]["rms"], random_model.sigma, rtol=0.35)
    assert (np.array(result["0"]["rms"]) > 1.5 * np.array(result["100"]["rms"])).all()
    assert result["100"]["nll"] < result["0"]["nll"]
    np.testing.assert_allclose(result["100"]["coverage"], np.tile([[0.683], [0.954], [0.997]], 4), atol=0.07)
    error, deviation = standardized_errors(random_model, adapted(random_model, split.adaptation), judged)
    np.testing.assert_allclose(np.sqrt(np.mean(error**2, axis=0)), result["100"]["rms"])
    # One step of a rollout is a one-step prediction.
    rollout = rollout_errors(step_model(random_model, adapted(random_model, split.adaptation)), split.judged, 1, 1)
    np.testing.assert_allclose(rollout[:, :4], error, rtol=0, atol=1e-10)
    assert result["100"]["nll"] == pytest.approx(mean_nll(error, deviation))


def test_a_gaussians_coverage_is_the_normal_distributions() -> None:
    assert pytest.approx(norm.cdf([1.0, 2.0, 3.0]) - norm.cdf([-1.0, -2.0, -3.0]), abs=1e-4) == GAUSSIAN_COVERAGE


def test_summaries_are_over_the_rollouts_by_state() -> None:
    errors = np.array([[3.0, 0.0], [-4.0, 1.0], [0.0, -2.0], [0.0, 3.0]])
    found = rollout_summary([errors[:1], errors[1:]])
    assert found["rms"] == pytest.approx([2.5, np.sqrt(3.5)])
    assert found["median"] == pytest.approx([1.5, 1.5])
    assert mean_nll(np.array([[1.0, 2.0]]), np.array([[2.0, 0.5]])) == pytest.approx(
        0.25 + 16.0 + 2.0 * np.log(2.0) + 2.0 * np.log(0.5)
    )


def test_coverage_counts() -> None:
    errors = np.array([[0.5], [1.5], [-2.5], [3.5]])
    np.testing.assert_array_equal(deviation_coverage(errors, np.ones((4, 1))), [[0.25], [0.5], [0.75]])


def test_rollouts_feed_on_themselves() -> None:
    samples = drive(12, 0, np.random.default_rng(1))
    errors = rollout_errors(Drifting(), [samples], steps=5, every=3)
    expected = [samples.x_next[k + 4] - samples.x[k] - 5.0 for k in (0, 3, 6)]
    np.testing.assert_allclose(errors, np.array(expected)[:, :6])  # lagged commands are known, not predicted
    assert rollout_errors(Drifting(), [samples], steps=13).shape == (0, 6)
    twice = concatenate([samples, samples._replace(drive=samples.drive + 1)])
    summary = judge_stepper(Drifting(), [split_vehicle(twice, 5)], horizons=(5,))
    np.testing.assert_allclose(summary["rms"], np.sqrt(np.mean((samples.x_next - samples.x - 1.0)[:, :4] ** 2, axis=0)))


def test_judging_uses_the_features_of_the_network(random_model: BayesianModel, believed: Samples) -> None:
    phi = features(random_model.network, network_inputs(believed.x, believed.u, believed.u_next))
    _, deviation = standardized_errors(random_model, random_model.prior(), believed)
    spread = np.einsum("nif,ifg,nig->ni", phi, state_blocks(random_model.prior().covariance), phi)
    np.testing.assert_allclose(deviation, random_model.sigma * np.sqrt(1.0 + spread))


def test_learning_weighs_each_state_by_its_own_weight(random_model: BayesianModel, believed: Samples) -> None:
    few = believed.where(np.arange(20))
    expected = random_model.prior()
    for k in range(20):
        phi = features(random_model.network, network_inputs(few.x[k], few.u[k], few.u_next[k]))
        y = residual(few.x[k], few.u[k], few.x_next[k], random_model.vehicle.constants())
        expected = update(expected, random_model.sigma, phi, y, random_model.sample_weight)
    found = adapted(random_model, few)
    np.testing.assert_allclose(found.mean, expected.mean, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=0, atol=1e-9)
    again = learn(random_model, adapted(random_model, few.where(np.arange(20) < 7)), few.where(np.arange(20) >= 7))
    np.testing.assert_allclose(again.mean, found.mean, rtol=0, atol=1e-9)


def test_a_sample_counts_in_full_at_the_most() -> None:
    assert SAMPLE_WEIGHTS[0] == 1.0
    assert (np.diff([*SAMPLE_WEIGHTS, 0.0]) < 0.0).all()


def test_a_right_model_is_given_full_weight_and_a_wrong_one_less(full_weight: BayesianModel, believed: Samples) -> None:
    twice = concatenate([believed, believed._replace(vehicle=believed.vehicle + 1, drive=believed.drive + 6)])
    right = choose_sample_weight(full_weight, twice)
    # Half of the drives shifted one way and half the other: an error that does not average out within a drive.
    shift = np.zeros((len(twice.x), 8))
    shift[:, :4] = np.where(twice.drive % 2 == 0, 3.0, -3.0)[:, None] * full_weight.sigma
    wrong = choose_sample_weight(full_weight, twice._replace(x_next=twice.x_next + shift))
    assert right >= 0.5
    assert wrong <= 0.3
