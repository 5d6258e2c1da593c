"""Meta-training lowers its objective, its checkpoint is its network, and what cannot go on is one sentence."""

import dataclasses
import errno
from pathlib import Path

import numpy as np
import pytest

from drift_drake.common.errors import InvalidOptionError, OutputError
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.features import (
    FeatureExpansion,
    all_inputs,
    features,
    network_inputs,
)
from drift_drake.drive.learnt.physical_inputs import with_physical_inputs
from drift_drake.drive.learnt.posterior import block_diagonal, predict, state_blocks, update
from drift_drake.drive.learnt.samples import DRIFTING, load_samples
from drift_drake.drive.learnt.training_config import TrainingConfig, with_recipe

torch = pytest.importorskip("torch", reason="training needs the extra `train`")

from drift_drake.drive.learnt import meta_training  # noqa: E402 (needs torch)
from drift_drake.drive.learnt.meta_training import DRIFT_COUNT, TrainingDivergedError, drifts_of, train  # noqa: E402
from drift_drake.drive.learnt.torch_network import (  # noqa: E402
    torch_features,
)


def test_an_objective_that_is_not_finite_ends_the_training(config: TrainingConfig) -> None:
    wild = dataclasses.replace(config, learning_rate=1e3, decay=1.0, epochs=200, gradient_clip=None,
                               output=config.output.with_name("wild.npz"))  # fmt: skip
    with pytest.raises((TrainingDivergedError, torch.linalg.LinAlgError), match=r"lower --learning-rate|linalg"):
        train(wild)
    assert not wild.output.exists()


def test_a_short_training_lowers_the_objective_and_its_checkpoint_is_its_network(config: TrainingConfig) -> None:
    model = train(config)
    history = model.record["history"]
    first = train(dataclasses.replace(config, epochs=1, output=config.output.with_name("first.npz")))
    assert history[-1]["validation_10"] < first.record["history"][-1]["validation_10"] - 1.0
    assert model.record["epochs"] == 30
    assert len(model.record["data"]) == 64
    assert not config.output.with_name("model.npz.resume").exists()
    stored = load_model(config.output)
    np.testing.assert_array_equal(stored.sigma, model.sigma)
    z = network_inputs(*(np.random.default_rng(4).normal(size=(20, n)) for n in (8, 2, 2)))
    parameters = {
        name: torch.as_tensor(getattr(stored.network, name)) for name in ("w1", "b1", "w2", "b2", "w_out", "b_out")
    }
    points = torch.as_tensor(all_inputs(z, stored.network.nominal)).requires_grad_()
    assert points.shape == (20, 18)
    phi = torch_features(parameters, points)
    np.testing.assert_allclose(features(stored.network, z), phi.detach().numpy(), rtol=0, atol=1e-12)
    gradient = torch.autograd.grad(phi[:, 2, 5].sum(), points)[0].numpy()
    gradient = gradient[:, :10] + np.einsum(
        "np,npz->nz", gradient[:, 10:], with_physical_inputs(z, stored.vehicle.constants())[1]
    )
    np.testing.assert_allclose(FeatureExpansion(stored.network, z).tangents[..., 2, 5], gradient, rtol=0, atol=1e-12)
    single = torch_features({name: value.float() for name, value in parameters.items()}, points.detach().float())
    np.testing.assert_allclose(features(stored.network, z), single.numpy(), rtol=0, atol=3e-6)


def test_a_checkpoint_holds_drifting_samples_that_it_was_trained_on(config: TrainingConfig) -> None:
    model, samples = train(dataclasses.replace(config, epochs=1)), load_samples(config.data)
    assert model.drifts is not None
    assert model.drifts.shape == (DRIFT_COUNT, 10)
    table = network_inputs(samples.x, samples.u, samples.u_next)[np.abs(samples.x[:, 2]) > DRIFTING]
    for z in model.drifts[:5]:
        assert np.abs(table - z).max(axis=1).min() < 1e-4
    straight = samples.where(np.abs(samples.x[:, 2]) < DRIFTING)
    assert drifts_of(straight, 0) is None


def test_the_papers_recipe_is_windows_of_ten() -> None:
    config = TrainingConfig()
    plain = with_recipe(config, "paper")
    assert plain.horizons == (10,)
    assert plain.shuffled_share == plain.weight_decay == 0.0
    assert not plain.temper
    assert plain.epoch_samples is None
    assert not with_recipe(config, "fixed").adaptive
    assert with_recipe(config, "transfer") == config
    assert (plain.epochs, plain.learning_rate, plain.decay) == (1000, 1e-3, 0.9975)


def test_options_that_are_given_stay_under_a_recipe() -> None:
    config = dataclasses.replace(TrainingConfig(), epochs=7, decay=0.5)
    assert (with_recipe(config, "paper").epochs, with_recipe(config, "windows").decay) == (7, 0.5)
    with pytest.raises(InvalidOptionError, match=r"--lane runs/other\.npz: --recipe paper has no lane drives"):
        with_recipe(dataclasses.replace(config, lane=Path("runs/other.npz")), "paper")


def test_a_model_that_never_adapts_stays_where_it_is(config: TrainingConfig) -> None:
    model = train(dataclasses.replace(config, adaptive=False, output=config.output.with_name("fixed.npz")))
    prior = model.prior()
    phi = features(model.network, np.array([0.5, 11.0, -0.5, 16.0, -0.1, 150.0, -0.1, 150.0, -0.1, 150.0]))
    prediction = predict(prior, model.sigma, phi)
    np.testing.assert_allclose(prediction.variance, model.sigma**2, rtol=1e-6)
    after = update(prior, model.sigma, phi, prediction.mean + 5.0 * model.sigma)
    np.testing.assert_allclose(after.mean, prior.mean, rtol=0, atol=1e-6)


def test_training_on_tasks_lowers_their_objective_and_goes_on_where_it_was(transfer: TrainingConfig) -> None:
    model = train(transfer)
    first = train(dataclasses.replace(transfer, epochs=1, output=transfer.output.with_name("one.npz")))
    assert model.record["history"][-1]["validation"] < first.record["history"][-1]["validation"] - 1.0
    stored = load_model(transfer.output)
    assert stored.sample_weight.shape == (4,)
    assert (stored.sample_weight > 0.0).all()
    assert (stored.sample_weight < 1.0).all()
    assert len(np.unique(stored.sample_weight)) == 4  # each state's is trained by itself
    coupling = stored.precision_factor - block_diagonal(state_blocks(stored.precision_factor))
    assert np.abs(coupling).max() > 1e-3
    # Begun again from there: the numbers there and back.
    again = dataclasses.replace(transfer, start=transfer.output, output=transfer.output.with_name("further.npz"))
    unchanged = train(dataclasses.replace(again, epochs=0))
    for name in ("prior_mean", "precision_factor", "sigma", "sample_weight"):
        np.testing.assert_allclose(getattr(unchanged, name), getattr(stored, name), rtol=1e-12, atol=1e-15)


def test_a_full_disk_is_one_sentence(config: TrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_path: Path, _data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    monkeypatch.setattr(meta_training, "SAVE_EVERY", 1)
    with pytest.raises(OutputError, match=r"full\.npz\.resume: cannot be written \(No space left"):
        train(dataclasses.replace(config, output=config.output.with_name("full.npz")))
