"""Whether a model may be trusted on a car, from the log of its first informative drive."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student

from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import gather
from drift_drake.drive.gathering.plan import Trajectory, plan_drive
from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model, paper_checkpoint
from drift_drake.drive.learnt.features import features, network_inputs
from drift_drake.drive.learnt.posterior import mahalanobis, predict
from drift_drake.drive.learnt.quality import learn, squared_distances
from drift_drake.drive.learnt.samples import Samples, samples_from_log
from drift_drake.gap.choose.choice import Familiar, usual_error, usual_surprise
from experiments.benchmarks.vehicles import draw_effects
from experiments.gathering.familiar import familiar_from, keep_usual

CONFIG = GatheringConfig(steps=12, v_end=11.0, starts=1, max_iterations=30)


@pytest.fixture(scope="module")
def info(model: BayesianModel) -> Trajectory:
    return plan_drive(model, model.prior(), CONFIG, CONFIG.alpha)


def drive(info: Trajectory, effects: Effects) -> Samples:
    return samples_from_log(gather(info, effects, VehicleParameters(), CONFIG, 0)[0], None, 0, 0)


def test_each_sample_is_judged_by_what_those_before_it_taught(model: BayesianModel, info: Trajectory) -> None:

    samples = drive(info, draw_effects("validation", 0, 0))
    found = squared_distances(model, model.prior(), samples)
    last = samples.where(np.array([len(found) - 1]))
    before = learn(model, model.prior(), samples.where(np.arange(len(found) - 1)))
    phi = features(model.network, network_inputs(last.x, last.u, last.u_next))[0]
    y = residual(last.x, last.u, last.x_next, model.vehicle.constants())[0]
    assert found[-1] == pytest.approx(float(mahalanobis(predict(before, model.sigma, phi), y) ** 2))
    assert len(found) == len(samples.vehicle)


def test_a_car_far_beyond_those_trained_on_surprises(model: BayesianModel, info: Trajectory) -> None:
    usual = [float(np.mean(squared_distances(model, model.prior(), drive(info, draw_effects("validation", i, 0)))))
             for i in range(4)]  # fmt: skip
    slow = float(np.mean(squared_distances(model, model.prior(), drive(info, make_effects({"steering_lag": 0.2})))))
    assert slow > 2.0 * max(usual)


def test_the_limit_is_a_predictive_quantile_of_logs() -> None:
    values = np.exp(np.random.default_rng(0).normal(2.0, 0.2, 40))
    familiar = familiar_from(values)
    assert familiar.vehicles == 40
    z = (np.log(familiar.limit(0.05)) - familiar.mean) / (familiar.deviation * np.sqrt(1.0 + 1.0 / 40))
    assert student.sf(z, 39) == pytest.approx(0.05)
    assert familiar.limit(0.01) > familiar.limit(0.05)
    with pytest.raises(ValueError, match="give three or more"):
        familiar_from(values[:2])


def test_the_shipped_models_are_known_and_others_are_not(model: BayesianModel, tmp_path: Path) -> None:
    for shipped in (model, load_model(paper_checkpoint())):
        surprise = usual_surprise(shipped)
        assert surprise is not None
        assert surprise.vehicles >= 20
    assert usual_error().vehicles >= 40
    other = dataclasses.replace(model, prior_mean=model.prior_mean + 1.0)
    assert usual_surprise(other) is None
    file, error, surprise = tmp_path / "lane_trust.json", Familiar(-5.0, 0.1, 6), Familiar(2.0, 0.2, 6)
    keep_usual(model, Familiar(-4.0, 0.1, 5), Familiar(1.0, 0.1, 5), file)
    keep_usual(other, error, surprise, file)
    assert usual_surprise(other, file) == surprise
    assert usual_surprise(model, file) == Familiar(1.0, 0.1, 5)
    assert usual_error(file) == error
