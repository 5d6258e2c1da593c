"""What training minimises is the likelihood of the recursion that the controller runs."""

from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.features import (
    FEATURE_COUNT,
)
from drift_drake.drive.learnt.posterior import block_diagonal, from_precision, predict, state_blocks, update, update_all
from drift_drake.drive.learnt.samples import load_samples

torch = pytest.importorskip("torch", reason="training needs the extra `train`")

from drift_drake.drive.learnt import meta_training  # noqa: E402 (needs torch)
from drift_drake.drive.learnt.torch_network import (  # noqa: E402
    initial_parameters,
)
from drift_drake.drive.learnt.transfer_objective import STRETCH, Tasks, predictive_nll  # noqa: E402
from drift_drake.drive.learnt.window_objective import _LogDetLessSquare, window_nll  # noqa: E402


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


def test_the_objective_over_windows_is_that_of_a_belief_that_couples_the_states() -> None:
    parameters = initial_parameters(torch.Generator().manual_seed(1), coupled=True)
    factor = np.eye(64) + 0.1 * np.random.default_rng(5).normal(size=(64, 64))
    parameters["precision_factor"] = torch.as_tensor(factor)
    parameters["log_sigma"] = torch.log(torch.tensor([0.3, 0.1, 0.6, 0.2], dtype=torch.float64))
    scale = torch.tensor([0.1, 0.5, 0.05, 2.0], dtype=torch.float64)
    model = meta_training.to_model(parameters, scale, VehicleParameters(), {})
    phi = np.random.default_rng(2).normal(size=(2, 12, 4, FEATURE_COUNT))
    y = np.random.default_rng(3).normal(size=(2, 12, 4)) * scale.numpy()
    mask = np.ones((2, 12), dtype=bool)
    mask[1, 7:] = False
    arguments = (torch.as_tensor(phi), torch.as_tensor(y) / scale, torch.as_tensor(mask))
    loss = window_nll(parameters, *arguments).detach().numpy()
    for w, length in enumerate((12, 7)):
        posterior, total = model.prior(), 0.0
        for k in range(length):
            prediction = predict(posterior, model.sigma, phi[w, k])
            error = y[w, k] - prediction.mean
            total += error @ np.linalg.solve(prediction.covariance, error)
            total += np.linalg.slogdet(prediction.covariance)[1]
            posterior = update(posterior, model.sigma, phi[w, k], y[w, k])
        np.testing.assert_allclose(loss[w] + 2.0 * length * np.log(scale.numpy()).sum(), total, rtol=1e-9)
    blocks = np.eye(16) + 0.2 * np.random.default_rng(5).normal(size=(4, 16, 16))
    apart = parameters | {"precision_factor": torch.as_tensor(blocks)}
    together = parameters | {"precision_factor": torch.as_tensor(block_diagonal(blocks))}
    np.testing.assert_allclose(
        window_nll(together, *arguments).detach().numpy(),
        window_nll(apart, *arguments).sum(dim=1).detach().numpy(), rtol=1e-9,
    )  # fmt: skip


def test_what_couples_the_states_over_windows_is_differentiated_exactly() -> None:
    generator = torch.Generator().manual_seed(3)
    root, b = (torch.randn(2, 5, n, generator=generator, dtype=torch.float64).requires_grad_() for n in (5, 1))

    def terms(root: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        return _LogDetLessSquare.apply(root @ root.transpose(-1, -2) + torch.eye(5), b)

    assert torch.autograd.gradcheck(terms, (root, b))


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
