"""Checkpoints: what is written comes back, and what is no checkpoint says so."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from learnt_models import trainable_count

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.checkpoint import PRECISION_FLOOR, BayesianModel, InvalidCheckpointError, load_model
from drift_drake.drive.learnt.features import Network, features
from drift_drake.drive.learnt.posterior import block_diagonal, predict, state_blocks, update
from drift_drake.drive.learnt.samples import DRIFTING


def test_a_model_that_does_not_couple_the_states_has_the_papers_parameter_count(random_model: BayesianModel) -> None:
    apart = block_diagonal(state_blocks(random_model.precision_factor))
    assert trainable_count(dataclasses.replace(random_model, precision_factor=apart)) == 27_012
    assert trainable_count(random_model) == 27_012 + 64 * 64 - 4 * 16 * 16


def test_a_checkpoint_comes_back(random_model: BayesianModel, tmp_path: Path) -> None:
    single = random_model.network._replace(
        **{name: getattr(random_model.network, name).astype(np.float32).astype(float)
           for name in ("w1", "b1", "w2", "b2", "w_out", "b_out")})  # fmt: skip
    weight = np.array([0.3, 1.0, 0.02, 0.5])
    model = BayesianModel(single, random_model.prior_mean, random_model.precision_factor, random_model.sigma, weight,
                          random_model.vehicle.replace(mass=1700.0), {"epochs": 3})  # fmt: skip
    path = tmp_path / "folder" / "model.npz"
    model.save(path)
    again = load_model(path)
    for ours, theirs in zip(model.network, again.network, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(model.prior_mean, again.prior_mean)
    np.testing.assert_array_equal(model.precision_factor, again.precision_factor)
    np.testing.assert_array_equal(model.sigma, again.sigma)
    np.testing.assert_array_equal(again.sample_weight, weight)
    assert again.vehicle == model.vehicle
    assert again.record == {"epochs": 3}
    z = np.array([0.5, 11.0, -0.5, 16.0, -0.1, 150.0, -0.12, 160.0, -0.08, 140.0])
    np.testing.assert_array_equal(features(model.network, z), features(again.network, z))
    assert path.stat().st_size < 300_000


def test_a_checkpoint_names_drifts_or_none(random_model: BayesianModel, tmp_path: Path) -> None:
    random_model.save(tmp_path / "none.npz")
    assert load_model(tmp_path / "none.npz").drifts is None
    drifts = np.arange(30.0).reshape(3, 10)
    dataclasses.replace(random_model, drifts=drifts).save(tmp_path / "some.npz")
    np.testing.assert_array_equal(load_model(tmp_path / "some.npz").drifts, drifts)


def test_the_shipped_checkpoint_names_drifts_to_both_sides() -> None:
    drifts = load_model().drifts
    assert drifts is not None
    assert drifts.shape == (200, 10)
    assert np.abs(drifts[:, 2]).min() > DRIFTING
    assert 50 < np.count_nonzero(drifts[:, 2] > 0.0) < 150


def test_a_checkpoint_of_before_the_states_were_coupled_predicts_as_it_did(
    random_model: BayesianModel, tmp_path: Path
) -> None:
    """Four factors [4, 16, 16] and one weight for all states."""
    random_model.save(tmp_path / "new.npz")
    with np.load(tmp_path / "new.npz") as stored:
        arrays = {name: stored[name] for name in stored.files}
    factor = np.eye(16) + 0.2 * np.random.default_rng(1).normal(size=(4, 16, 16))
    np.savez(tmp_path / "old.npz", **(arrays | {"precision_factor": factor, "sample_weight": np.float64(0.3)}))
    model = load_model(tmp_path / "old.npz")
    np.testing.assert_array_equal(model.sample_weight, np.full(4, 0.3))
    generator = np.random.default_rng(2)
    phi, y = generator.normal(size=(9, 4, 16)), generator.normal(size=(9, 4)) * model.sigma
    after = model.prior()
    for k in range(8):
        after = update(after, model.sigma, phi[k], y[k], model.sample_weight)
    before, learnt = predict(model.prior(), model.sigma, phi[8]), predict(after, model.sigma, phi[8])
    for i in range(4):
        own = phi[:8, i]
        precision = factor[i] @ factor[i].T + PRECISION_FLOOR * np.eye(16)
        reported = precision + 0.3 * own.T @ own
        mean = np.linalg.solve(reported, precision @ model.prior_mean[i] + 0.3 * own.T @ y[:8, i])
        for found, lam, theta in ((before, precision, model.prior_mean[i]), (learnt, reported, mean)):
            np.testing.assert_allclose(found.mean[i], theta @ phi[8, i], rtol=1e-9)
            variance = model.sigma[i] ** 2 * (1.0 + phi[8, i] @ np.linalg.solve(lam, phi[8, i]))
            np.testing.assert_allclose(found.variance[i], variance, rtol=1e-9)
    np.testing.assert_array_equal(learnt.covariance, np.diag(learnt.variance))
    # Written again, it comes back as a model of today.
    model.save(tmp_path / "again.npz")
    again = load_model(tmp_path / "again.npz")
    np.testing.assert_array_equal(again.precision_factor, model.precision_factor)
    np.testing.assert_array_equal(again.sample_weight, model.sample_weight)


def test_bad_files_are_named(tmp_path: Path) -> None:
    missing, garbage, foreign = (tmp_path / name for name in ("missing.npz", "garbage.npz", "foreign.npz"))
    garbage.write_text("not a zip file")
    np.savez(foreign, numbers=np.zeros(3))
    for path in (missing, garbage, foreign):
        with pytest.raises(InvalidCheckpointError, match=path.name):
            load_model(path)


def test_a_network_with_physical_inputs_comes_back_with_its_car(
    random_model: BayesianModel, physical_network: Network, tmp_path: Path
) -> None:
    model = dataclasses.replace(random_model, network=physical_network, vehicle=VehicleParameters(mass=1700.0))
    model.save(tmp_path / "model.npz")
    again = load_model(tmp_path / "model.npz")
    assert again.network.w1.shape == (18, 128)
    assert again.network.nominal == VehicleParameters(mass=1700.0).constants()


def test_a_network_with_other_inputs_is_refused(random_model: BayesianModel, tmp_path: Path) -> None:
    """16 inputs: z and the physical inputs of before the model knew of lags."""
    old = random_model.network._replace(input_offset=np.zeros(16), input_scale=np.ones(16), w1=np.zeros((16, 128)))
    path = tmp_path / "old.npz"
    dataclasses.replace(random_model, network=old).save(path)
    message = r"old\.npz: its network has 16 inputs, this version's have 8 or 18; train it anew"
    with pytest.raises(InvalidCheckpointError, match=message):
        load_model(path)
