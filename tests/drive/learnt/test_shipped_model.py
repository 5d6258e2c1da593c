"""The checkpoint that comes with the package, on a fresh drive of vehicles that it was not trained on."""

import numpy as np
import pytest
from learnt_models import trainable_count

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.features import features, network_inputs
from drift_drake.drive.learnt.posterior import covariance_norms
from drift_drake.drive.learnt.quality import adapted, standardized_errors, step_model
from drift_drake.drive.learnt.samples import MIRROR_STATE, Samples, concatenate, mirrored, samples_from_log
from drift_drake.drive.loop.drive import Drive
from drift_drake.drive.manoeuvres.drivers import ROW_PERIOD
from drift_drake.drive.reference.equilibrium import drift_equilibrium
from experiments.benchmarks.drifters import HoldDriver, dither, wander
from experiments.benchmarks.vehicles import draw_effects
from experiments.model.judging import deviation_coverage, rollout_errors


@pytest.fixture(scope="module")
def model() -> BayesianModel:
    return load_model()


@pytest.fixture(scope="module")
def drives() -> list[tuple[Samples, Samples]]:
    """Of three vehicles with seeds of their own: a drift to the left to adapt to, one to the right to be judged by."""
    car = VehicleParameters()
    found = []
    for vehicle in range(3):
        parts = []
        for side in (1.0, -1.0):
            generator = np.random.default_rng([vehicle, int(side + 1.0)])
            drift = drift_equilibrium(car, side * 18.0, -side * 0.6)
            holder = HoldDriver(car, drift, wander(5.0, generator, np.array([0.03, 10.0]), 0.3))
            effects = draw_effects("held_out", vehicle, seed=77)
            drive = Drive(car, holder, 1, ROW_PERIOD, dither(5.0, generator), holder.initial_command(), effects)
            state = np.array([drift.r, drift.v, drift.beta, drift.omega_r, 0.0, 0.0])
            table, _ = drive.run(state, 0.0, 5.0, seed=vehicle)
            parts.append(samples_from_log(table, None, vehicle, len(parts)))
        found.append((parts[0], parts[1]))
    return found


def test_it_is_the_papers_network_with_more_inputs_and_believes_in_the_nominal_car(model: BayesianModel) -> None:
    # The paper's 27,012, the weights of ten more inputs, and the states' couplings.
    assert trainable_count(model) == 27_012 + 10 * 128 + 64 * 64 - 4 * 16 * 16
    assert model.vehicle == VehicleParameters()
    assert len(model.record["data"]) == 64
    assert model.sample_weight.shape == (4,)
    assert (model.sample_weight > 0.0).all()
    assert (model.sample_weight <= 1.0).all()
    assert np.linalg.eigvalsh(model.prior().covariance).min() > 0.0


def test_it_predicts_better_than_the_nominal_car_and_better_still_once_adapted(
    model: BayesianModel, drives: list[tuple[Samples, Samples]]
) -> None:
    nominal, prior, after = [], [], []
    for adaptation, judged in drives:
        nominal.append(rollout_errors(NominalStepModel(model.vehicle), [judged], 5, 2))
        prior.append(rollout_errors(step_model(model, model.prior()), [judged], 5, 2))
        after.append(rollout_errors(step_model(model, adapted(model, adaptation)), [judged], 5, 2))
    nominal_rms, prior_rms, after_rms = (
        np.sqrt(np.mean(np.concatenate(parts)[:, :4] ** 2, axis=0)) for parts in (nominal, prior, after)
    )
    assert (prior_rms < nominal_rms).all()
    # Adapting to left turns helps in right ones; r and beta are what a drift hangs on.
    assert (after_rms[[0, 2, 3]] < 0.9 * prior_rms[[0, 2, 3]]).all()


def test_it_knows_what_it_does_not_know(model: BayesianModel, drives: list[tuple[Samples, Samples]]) -> None:
    for count in (0, 50):
        errors, deviations = zip(
            *(
                standardized_errors(model, adapted(model, first.where(np.arange(count))), second)
                for first, second in drives
            ),
            strict=True,
        )
        found = deviation_coverage(np.concatenate(errors), np.concatenate(deviations))
        assert (found[2] > 0.95).all()
        # Before adaptation a vehicle's errors are all alike, and three of them say little about one sigma.
        assert count == 0 or (found[0] > 0.5).all()


def test_data_shrink_its_covariance(model: BayesianModel, drives: list[tuple[Samples, Samples]]) -> None:
    _, before = covariance_norms(model.prior())
    _, after = covariance_norms(adapted(model, concatenate(list(drives[0]))))
    assert after < before


def test_its_mean_is_nearly_mirror_symmetric(model: BayesianModel, drives: list[tuple[Samples, Samples]]) -> None:
    samples = drives[0][0]
    mirror = mirrored(samples)

    def mean(s: Samples) -> np.ndarray:
        phi = features(model.network, network_inputs(s.x, s.u, s.u_next))
        return np.sum(phi * model.prior_mean, axis=-1)

    difference = mean(mirror) - MIRROR_STATE[:4] * mean(samples)
    _, deviation = standardized_errors(model, model.prior(), samples)
    assert np.sqrt(np.mean((difference / deviation) ** 2)) < 1.0
