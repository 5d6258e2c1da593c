"""Meta-training: its objective is the paper's, its checkpoint is its network, and a broken-off run goes on."""

import dataclasses
import errno
from pathlib import Path

import numpy as np
import pytest

from drift_drake.errors import InvalidOptionError, OutputError
from drift_drake.model.bayesian_step import residual
from drift_drake.model.checkpoint import InvalidCheckpointError, load_model
from drift_drake.model.features import (
    FEATURE_COUNT,
    STATE_COUNT,
    all_inputs,
    feature_jacobian,
    features,
    network_inputs,
)
from drift_drake.model.physical_inputs import physical_inputs
from drift_drake.model.posterior import block_diagonal, from_precision, predict, state_blocks, update, update_all
from drift_drake.model.samples import DRIFTING, Samples, load_samples, save_samples
from drift_drake.model.training_config import TrainingConfig, with_recipe
from drift_drake.vehicle.parameters import VehicleParameters

torch = pytest.importorskip("torch", reason="training needs the extra `train`")

from drift_drake.model import meta_training  # noqa: E402 (needs torch)
from drift_drake.model.meta_training import DRIFT_COUNT, TrainingDivergedError, drifts_of, train  # noqa: E402
from drift_drake.model.torch_network import (  # noqa: E402
    initial_parameters,
    torch_features,
    trainable_numbers,
    training_device,
)
from drift_drake.model.transfer_objective import STRETCH, Tasks, predictive_nll  # noqa: E402
from drift_drake.model.window_objective import WindowObjective, window_nll  # noqa: E402


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three cars that differ in grip, in random states of a drift: noisy steps of a made-up residual."""
    generator = np.random.default_rng(0)
    car = VehicleParameters().constants()
    parts = []
    for vehicle in range(3):
        count = 60
        x = np.zeros((count, 6))
        x[:, :4] = np.array([0.4, 11.0, -0.5, 16.0]) + np.array([0.2, 1.0, 0.2, 2.0]) * generator.normal(
            size=(count, 4)
        )
        u = np.array([-0.1, 150.0]) + np.array([0.1, 40.0]) * generator.normal(size=(count, 2))
        x = np.hstack([x, u])  # settled lags
        truth = car._replace(friction=0.8 + 0.1 * vehicle)
        x_next = x.copy()
        x_next[:, :4] -= residual(x, u, x, truth)
        x_next[:, 3] = x[:, 3] + 0.002 * (u[:, 1] - 150.0)
        x_next[:, :4] += np.array([0.01, 0.05, 0.005, 0.1]) * generator.normal(size=(count, 4))
        parts.append(Samples(x, u, u, x_next, np.zeros(count), np.full(count, vehicle),
                             2 * vehicle + (np.arange(count) >= 30)))  # fmt: skip
    path = tmp_path_factory.mktemp("table") / "train.npz"
    save_samples(Samples(*(np.concatenate(columns) for columns in zip(*parts, strict=True))), path)
    return path


@pytest.fixture(scope="module")
def config(table: Path, tmp_path_factory: pytest.TempPathFactory) -> TrainingConfig:
    output = tmp_path_factory.mktemp("model") / "model.npz"
    return TrainingConfig(
        data=table, output=output, validation=table, lane=None, epochs=30, batch=128, threads=1, horizons=(5, 20),
        temper=False, learning_rate=1e-3,
    )  # fmt: skip


def test_objective_is_the_sequential_likelihood_of_the_recursion() -> None:
    generator = torch.Generator().manual_seed(1)
    parameters = initial_parameters(generator)
    blocks = np.eye(16) + 0.2 * np.random.default_rng(5).normal(size=(4, 16, 16))
    parameters["precision_factor"] = torch.as_tensor(blocks)
    scale = torch.tensor([0.1, 0.5, 0.05, 2.0], dtype=torch.float64)
    model = meta_training.to_model(parameters, scale, VehicleParameters(), {})
    phi = np.random.default_rng(2).normal(size=(2, 12, 4, FEATURE_COUNT))
    y = np.random.default_rng(3).normal(size=(2, 12, 4)) * scale.numpy()
    mask = np.ones((2, 12), dtype=bool)
    mask[1, 7:] = False  # a window cut short by the end of its drive
    loss = window_nll(
        parameters, torch.as_tensor(phi), torch.as_tensor(y) / scale, torch.as_tensor(mask)
    ).detach().numpy()  # fmt: skip
    for w, length in enumerate((12, 7)):
        posterior, total = model.prior(), np.zeros(4)
        for k in range(length):
            prediction = predict(posterior, model.sigma, phi[w, k])
            total += (y[w, k] - prediction.mean) ** 2 / prediction.variance + np.log(prediction.variance)
            posterior = update(posterior, model.sigma, phi[w, k], y[w, k])
        np.testing.assert_allclose(loss[w] + 2.0 * length * np.log(scale.numpy()), total, rtol=1e-9)


def test_parameters_number_as_in_the_paper() -> None:
    coupling = 64 * 64 - 4 * 16 * 16
    for physical, coupled, count in (
        (False, False, 27_012),
        (True, False, 27_012 + 10 * 128),
        (True, True, 27_012 + 10 * 128 + coupling),
    ):
        parameters = initial_parameters(torch.Generator().manual_seed(0), physical, coupled)
        assert sum(value.numel() for value in parameters.values()) == count


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU here")
def test_without_a_gpu_auto_is_the_cpu_and_cuda_is_refused(config: TrainingConfig) -> None:
    assert training_device("auto").type == training_device("cpu").type == "cpu"
    with pytest.raises(InvalidOptionError, match="--device cuda: torch finds no GPU here; choose cpu, or auto"):
        train(dataclasses.replace(config, device="cuda"))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU here")
def test_a_gpu_computes_the_same_objective(config: TrainingConfig) -> None:
    losses = {}
    for device in ("cpu", "cuda"):
        output = config.output.with_name(f"{device}.npz")
        losses[device] = train(dataclasses.replace(config, epochs=3, device=device, output=output)).record["history"]
    assert losses["cuda"][-1]["loss"] == pytest.approx(losses["cpu"][-1]["loss"], abs=1e-2)


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
        "np,npz->nz", gradient[:, 10:], physical_inputs(z, stored.vehicle.constants())[1]
    )
    np.testing.assert_allclose(feature_jacobian(stored.network, z)[1][:, 2, 5], gradient, rtol=0, atol=1e-12)
    single = torch_features({name: value.float() for name, value in parameters.items()}, points.detach().float())
    np.testing.assert_allclose(features(stored.network, z), single.numpy(), rtol=0, atol=3e-6)


def test_a_broken_off_run_goes_on_to_the_same_model(config: TrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = train(dataclasses.replace(config, output=config.output.with_name("whole.npz")))
    broken = dataclasses.replace(config, output=config.output.with_name("broken.npz"))
    calls = iter(range(10_000))
    step = WindowObjective._loss

    def interrupted(*arguments):
        if next(calls) == 120:
            raise KeyboardInterrupt
        return step(*arguments)

    monkeypatch.setattr(WindowObjective, "_loss", interrupted)
    monkeypatch.setattr(meta_training, "SAVE_EVERY", 5)
    with pytest.raises(KeyboardInterrupt):
        train(broken)
    monkeypatch.setattr(WindowObjective, "_loss", step)
    assert broken.output.with_name("broken.npz.resume").exists()
    resumed = train(broken)
    np.testing.assert_array_equal(resumed.network.w2, whole.network.w2)
    np.testing.assert_array_equal(resumed.precision_factor, whole.precision_factor)


def test_training_goes_on_from_a_checkpoint(config: TrainingConfig) -> None:
    first = train(dataclasses.replace(config, epochs=4))
    again = dataclasses.replace(config, start=config.output, output=config.output.with_name("again.npz"), epochs=0)
    unchanged = train(again)  # no epoch: the numbers there and back
    for name in ("w1", "b2", "w_out"):
        np.testing.assert_array_equal(
            getattr(unchanged.network, name), getattr(load_model(config.output).network, name)
        )
    for name in ("prior_mean", "precision_factor", "sigma"):
        np.testing.assert_allclose(getattr(unchanged, name), getattr(first, name), rtol=1e-12, atol=1e-15)
    further = train(dataclasses.replace(again, epochs=4))
    assert np.abs(further.network.w1 - first.network.w1).max() > 1e-4
    assert further.record["start"]["epochs"] == 4
    with pytest.raises(InvalidCheckpointError, match=r"model\.npz: its network has 18 inputs, .* for 8"):
        train(dataclasses.replace(again, physical_inputs=False))
    other = config.output.with_name("other.npz")
    dataclasses.replace(first, vehicle=first.vehicle.replace(mass=1.1 * first.vehicle.mass)).save(other)
    with pytest.raises(InvalidCheckpointError, match=r"other\.npz: its nominal car is not the one .* as --vehicle"):
        train(dataclasses.replace(again, start=other))


def test_a_weight_of_one_is_gone_on_from(config: TrainingConfig) -> None:
    model = train(dataclasses.replace(config, epochs=0))
    weights = np.array([0.2, 1.0, 0.5, 0.1])
    scale = torch.ones(STATE_COUNT, dtype=torch.float64)
    logit = trainable_numbers(dataclasses.replace(model, sample_weight=weights), scale)["logit_weight"]
    np.testing.assert_allclose(torch.sigmoid(logit).detach().numpy(), weights, atol=1e-5)


def test_a_checkpoint_holds_drifting_samples_that_it_was_trained_on(config: TrainingConfig) -> None:
    model, samples = train(dataclasses.replace(config, epochs=1)), load_samples(config.data)
    assert model.drifts is not None
    assert model.drifts.shape == (DRIFT_COUNT, 10)
    table = network_inputs(samples.x, samples.u, samples.u_next)[np.abs(samples.x[:, 2]) > DRIFTING]
    for z in model.drifts[:5]:
        assert np.abs(table - z).max(axis=1).min() < 1e-4
    straight = samples.where(np.abs(samples.x[:, 2]) < DRIFTING)
    assert drifts_of(straight, 0) is None


def test_the_papers_recipe_is_windows_of_ten(config: TrainingConfig) -> None:
    plain = with_recipe(config, "paper")
    assert plain.horizons == (10,)
    assert plain.shuffled_share == plain.weight_decay == 0.0
    assert not plain.temper
    assert plain.epoch_samples is None
    assert not with_recipe(config, "fixed").adaptive
    assert with_recipe(config, "transfer") == config
    assert (plain.epochs, plain.learning_rate, plain.decay) == (1000, 1e-3, 0.9975)


def test_a_model_that_never_adapts_stays_where_it_is(config: TrainingConfig) -> None:
    model = train(dataclasses.replace(config, adaptive=False, output=config.output.with_name("fixed.npz")))
    prior = model.prior()
    phi = features(model.network, np.array([0.5, 11.0, -0.5, 16.0, -0.1, 150.0, -0.1, 150.0, -0.1, 150.0]))
    prediction = predict(prior, model.sigma, phi)
    np.testing.assert_allclose(prediction.variance, model.sigma**2, rtol=1e-6)
    after = update(prior, model.sigma, phi, prediction.mean + 5.0 * model.sigma)
    np.testing.assert_allclose(after.mean, prior.mean, rtol=0, atol=1e-6)


@pytest.fixture(scope="module")
def transfer(config: TrainingConfig) -> TrainingConfig:
    return dataclasses.replace(
        config, lane=config.data, validation_lane=config.data, epoch_batches=5, batch_tasks=8, learning_rate=2e-3,
        output=config.output.with_name("transfer.npz"),
    )  # fmt: skip


def test_the_loss_of_a_task_is_the_predictive_density_after_its_context() -> None:
    parameters = initial_parameters(torch.Generator().manual_seed(1), coupled=True)
    factor = np.eye(64) + 0.1 * np.random.default_rng(5).normal(size=(64, 64))
    parameters["precision_factor"] = torch.as_tensor(factor)
    parameters["log_sigma"] = torch.log(torch.tensor([0.3, 0.1, 0.6, 0.2], dtype=torch.float64))
    parameters["logit_weight"] = torch.tensor([-0.5, 1.0, -3.0, 0.2], dtype=torch.float64)
    scale = torch.tensor([0.1, 0.5, 0.05, 2.0], dtype=torch.float64)
    model = meta_training.to_model(parameters, scale, VehicleParameters(), {})
    np.testing.assert_allclose(model.sample_weight, 1.0 / (1.0 + np.exp([0.5, -1.0, 3.0, -0.2])))
    np.testing.assert_array_equal(model.precision_factor, factor)
    generator = np.random.default_rng(2)
    phi, y = generator.normal(size=(2, 9, 4, FEATURE_COUNT)), generator.normal(size=(2, 9, 4)) * scale.numpy()
    mask = np.ones((2, 9), dtype=bool)
    mask[1, 5:] = False  # a shorter context
    parameters["log_share"] = torch.log(torch.tensor([0.5, 0.8, 0.3, 1.0], dtype=torch.float64))
    count = 2 * STRETCH
    target_phi, target_y = generator.normal(size=(2, count, 4, FEATURE_COUNT)), generator.normal(size=(2, count, 4))
    single, stretches = predictive_nll(
        parameters,
        (torch.as_tensor(phi), torch.as_tensor(y) / scale, torch.as_tensor(mask)),
        (torch.as_tensor(target_phi), torch.as_tensor(target_y) / scale, torch.ones(2, count)),
    )  # fmt: skip
    for task, length in enumerate((9, 5)):
        posterior = model.prior()
        for k in range(length):
            posterior = update(posterior, model.sigma, phi[task, k], y[task, k], model.sample_weight)
        prediction = predict(posterior, model.sigma, target_phi[task])
        expected = (target_y[task] - prediction.mean) ** 2 / prediction.variance + np.log(prediction.variance)
        np.testing.assert_allclose(single[task].detach().numpy() + 2.0 * np.log(scale.numpy()), expected, rtol=1e-8)
        for place in range(2):
            rows = slice(place * STRETCH, (place + 1) * STRETCH)
            middle = predict(posterior, model.sigma, target_phi[task, rows].mean(axis=0))
            # The belief is as unsure of a mean's features as of a sample's; the noise of a mean is less.
            variance = middle.variance - model.sigma**2 * (1.0 - np.array([0.5, 0.8, 0.3, 1.0]) ** 2)
            error = target_y[task, rows].mean(axis=0) - middle.mean
            found = stretches[task, place].detach().numpy() + 2.0 * np.log(scale.numpy())
            np.testing.assert_allclose(found, error**2 / variance + np.log(variance), rtol=1e-8)
        alone = model.prior()  # what the context tells without the coupling
        alone = alone._replace(covariance=block_diagonal(state_blocks(alone.covariance)))
        alone = from_precision(alone.mean, np.linalg.inv(alone.covariance), model.sigma)
        alone = update_all(alone, model.sigma, phi[task, :length], y[task, :length], model.sample_weight)
        difference = predict(alone, model.sigma, target_phi[task]).mean - prediction.mean
        assert np.abs(difference / np.sqrt(prediction.variance)).max() > 0.1


def test_targets_are_of_the_contexts_vehicle_and_never_in_the_context(table: Path) -> None:
    drift = load_samples(table)
    tasks = Tasks(drift, drift._replace(x=drift.x + 0.001), VehicleParameters(), True, torch.device("cpu"))
    rows_of = len(drift.x)
    vehicle = np.concatenate([drift.vehicle, drift.vehicle, drift.vehicle + 10, drift.vehicle + 10])
    kinds = set()
    for seed in range(200):
        context, targets = tasks.draw(np.random.default_rng(seed))
        assert len(targets) > 0
        assert not set(context) & set(targets[(targets // rows_of) % 2 == 0])
        assert len(set(vehicle[np.concatenate([context, targets])])) == 1
        kinds.add("none" if not len(context) else "lane" if context[0] // rows_of % 2 else "drift")
    assert kinds == {"none", "lane", "drift"}


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


def test_windows_do_not_start_from_a_prior_that_couples_the_states(
    config: TrainingConfig, transfer: TrainingConfig
) -> None:
    coupled = train(dataclasses.replace(transfer, epochs=1, output=transfer.output.with_name("coupled.npz")))
    begun = dataclasses.replace(
        config, start=transfer.output.with_name("coupled.npz"), epochs=0, output=config.output.with_name("begun.npz")
    )
    message = r"coupled\.npz: its prior couples the states; windows start from one that does not"
    with pytest.raises(InvalidCheckpointError, match=message):
        train(begun)
    # Without its coupling it is taken, and its samples count as windows find.
    apart = block_diagonal(state_blocks(coupled.precision_factor))
    dataclasses.replace(coupled, precision_factor=apart).save(begun.output.with_name("apart.npz"))
    taken = train(dataclasses.replace(begun, start=begun.output.with_name("apart.npz")))
    np.testing.assert_array_equal(taken.precision_factor, apart)
    np.testing.assert_array_equal(taken.sample_weight, np.ones(4))


def test_tasks_couple_a_prior_that_windows_have_trained(config: TrainingConfig, transfer: TrainingConfig) -> None:
    first = train(dataclasses.replace(config, epochs=2, output=config.output.with_name("windows.npz")))
    begun = dataclasses.replace(
        transfer, start=config.output.with_name("windows.npz"), output=config.output.with_name("tasks.npz"), epochs=0
    )
    taken = train(begun)
    np.testing.assert_allclose(taken.precision_factor, first.precision_factor, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(taken.sample_weight, meta_training.FIRST_WEIGHT)
    further = train(dataclasses.replace(begun, epochs=2))
    assert np.abs(further.precision_factor - block_diagonal(state_blocks(further.precision_factor))).max() > 1e-4


def test_a_full_disk_is_one_sentence(config: TrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_path: Path, _data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    monkeypatch.setattr(meta_training, "SAVE_EVERY", 1)
    with pytest.raises(OutputError, match=r"full\.npz\.resume: cannot be written \(No space left"):
        train(dataclasses.replace(config, output=config.output.with_name("full.npz")))
