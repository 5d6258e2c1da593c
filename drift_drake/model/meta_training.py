"""Offline meta-training of features, prior and noise; the only file that imports torch (extra `train`).

The objective is the paper's sequential negative log-likelihood: over a window of T samples of one vehicle, the sum of
-2 log p(x_{k+1} | x_{0:k}) with the posterior of eq. (5) after the samples before. By the chain rule that sum is the
negative log marginal likelihood of the window, which has a closed form,

    sum_k log Sigma_k + (y_k - mu_k)^2 / Sigma_k
        = T log sigma^2 + log det(Lambda_T) - log det(Lambda_0) + (e^T e - b^T Lambda_T^{-1} b) / sigma^2,

with e = y - Phi mean_0, b = Phi^T e, Lambda_T = Lambda_0 + Phi^T Phi: no loop over time, one 16 x 16 Cholesky
factorisation per window and state. `tests/model/test_meta_training.py` holds it to the recursion.
"""

import dataclasses
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from drift_drake.model.bayesian_step import residual
from drift_drake.model.checkpoint import PRECISION_FLOOR, BayesianModel
from drift_drake.model.features import (
    FEATURE_COUNT,
    HIDDEN_COUNT,
    INPUT_COUNT,
    INPUT_OFFSET,
    INPUT_SCALE,
    STATE_COUNT,
    Network,
    network_inputs,
)
from drift_drake.model.quality import choose_sample_weight
from drift_drake.model.samples import Samples, concatenate, content_hash, load_samples, mirrored
from drift_drake.model.training_config import TrainingConfig
from drift_drake.vehicle.parameters import VehicleParameters

Array = NDArray[np.float64]
Parameters = dict[str, torch.Tensor]
LONG = 40  # [samples] longest window that stays within one drive
SAVE_EVERY = 25  # [epochs] between saves of an unfinished run


class Windows:
    """The samples on torch's side, and how an epoch cuts them into windows."""

    def __init__(self, samples: Samples, vehicle: VehicleParameters) -> None:
        self.z = torch.as_tensor(network_inputs(samples.x, samples.u, samples.u_next), dtype=torch.float32)
        self.y = torch.as_tensor(residual(samples.x, samples.u, samples.x_next, vehicle.constants()))
        cuts = np.flatnonzero(np.diff(samples.drive)) + 1
        drives = np.split(np.arange(len(samples.drive)), cuts)
        of_vehicle = samples.vehicle[[drive[0] for drive in drives]]
        self._vehicles = [[d for d, v in zip(drives, of_vehicle, strict=True) if v == k] for k in np.unique(of_vehicle)]

    def cut(self, horizon: int, shuffled: bool, generator: np.random.Generator) -> list[NDArray[np.int64]]:
        """Index windows of at most `horizon` samples that cover the table once, at a random phase.

        Windows longer than `LONG` run on through the drives of a vehicle, which come in random order.
        """
        if shuffled:
            groups = [generator.permutation(np.concatenate(drives)) for drives in self._vehicles]
        elif horizon > LONG:
            groups = [
                np.concatenate([drives[i] for i in generator.permutation(len(drives))]) for drives in self._vehicles
            ]
        else:
            groups = [drive for drives in self._vehicles for drive in drives]
        windows = []
        for group in groups:
            phase = int(generator.integers(1, horizon + 1))
            windows += np.split(group, range(phase, len(group), horizon))
        return windows


def initial_parameters(generator: torch.Generator) -> Parameters:
    """The 27,012 trainable numbers: uniform weights of width 1/sqrt(inputs), identity precision."""

    def uniform(*shape: int, inputs: int) -> torch.Tensor:
        return (2.0 * torch.rand(shape, generator=generator) - 1.0) / math.sqrt(inputs)

    parameters = {
        "w1": uniform(INPUT_COUNT, HIDDEN_COUNT, inputs=INPUT_COUNT),
        "b1": uniform(HIDDEN_COUNT, inputs=INPUT_COUNT),
        "w2": uniform(HIDDEN_COUNT, HIDDEN_COUNT, inputs=HIDDEN_COUNT),
        "b2": uniform(HIDDEN_COUNT, inputs=HIDDEN_COUNT),
        "w_out": uniform(STATE_COUNT, HIDDEN_COUNT, FEATURE_COUNT, inputs=HIDDEN_COUNT),
        "b_out": uniform(STATE_COUNT, FEATURE_COUNT, inputs=HIDDEN_COUNT),
        "prior_mean": (0.3 * torch.randn((STATE_COUNT, FEATURE_COUNT), generator=generator)).double(),
        "precision_factor": torch.eye(FEATURE_COUNT, dtype=torch.float64).repeat(STATE_COUNT, 1, 1),
        "log_sigma": torch.full((STATE_COUNT,), math.log(0.3), dtype=torch.float64),
    }
    return {name: value.requires_grad_() for name, value in parameters.items()}


def torch_features(parameters: Parameters, z: torch.Tensor) -> torch.Tensor:
    """phi [n, 4, 16] at z [n, 8]: torch's twin of `features.features`."""
    scaled = (z - torch.as_tensor(INPUT_OFFSET, dtype=z.dtype)) / torch.as_tensor(INPUT_SCALE, dtype=z.dtype)
    hidden = torch.tanh(torch.addmm(parameters["b1"], scaled, parameters["w1"]))
    hidden = torch.tanh(torch.addmm(parameters["b2"], hidden, parameters["w2"]))
    w_out = parameters["w_out"].permute(1, 0, 2).reshape(HIDDEN_COUNT, -1)
    return torch.addmm(parameters["b_out"].reshape(-1), hidden, w_out).reshape(-1, STATE_COUNT, FEATURE_COUNT)


def window_nll(parameters: Parameters, phi: torch.Tensor, y: torch.Tensor, mask: torch.Tensor,
               adaptive: bool = True) -> torch.Tensor:  # fmt: skip
    """Sequential negative log-likelihood of windows (twice it, without the 2 pi, as in the paper's objective).

    Args:
        phi: features [w, T, 4, 16]; y: residuals in units of the output scale [w, T, 4]; mask: which entries are
            samples [w, T] (windows may be shorter than T).

    Returns:
        [w, 4], summed over the window.
    """
    mask = mask.to(y.dtype)
    phi = (phi.to(y.dtype) * mask[..., None, None]).permute(0, 2, 1, 3)  # [w, 4, T, 16]
    error = (y * mask[..., None]).permute(0, 2, 1) - torch.einsum("witf,if->wit", phi, parameters["prior_mean"])
    log_variance = 2.0 * parameters["log_sigma"]
    count = mask.sum(dim=1)[:, None]
    squares = (error * error).sum(dim=-1)
    if not adaptive:
        return count * log_variance + squares * torch.exp(-log_variance)
    factor = parameters["precision_factor"]
    floor = PRECISION_FLOOR * torch.eye(FEATURE_COUNT, dtype=y.dtype)
    prior = factor @ factor.transpose(-1, -2) + floor
    prior_factor = torch.linalg.cholesky(prior)
    posterior_factor = torch.linalg.cholesky(prior + phi.transpose(-1, -2) @ phi)
    projected = torch.linalg.solve_triangular(
        posterior_factor, torch.einsum("witf,wit->wif", phi, error)[..., None], upper=False
    )[..., 0]
    log_det = 2.0 * (
        torch.log(torch.diagonal(posterior_factor, dim1=-2, dim2=-1)).sum(-1)
        - torch.log(torch.diagonal(prior_factor, dim1=-2, dim2=-1)).sum(-1)
    )
    return count * log_variance + log_det + (squares - (projected * projected).sum(-1)) * torch.exp(-log_variance)


def _padded(windows: list[NDArray[np.int64]]) -> tuple[torch.Tensor, torch.Tensor]:
    longest = max(len(window) for window in windows)
    index, mask = np.zeros((len(windows), longest), dtype=np.int64), np.zeros((len(windows), longest), dtype=bool)
    for row, window in enumerate(windows):
        index[row, : len(window)], mask[row, : len(window)] = window, True
    return torch.as_tensor(index), torch.as_tensor(mask)


def _batch_loss(
    parameters: Parameters, windows: Windows, batch: list[NDArray[np.int64]], scale: torch.Tensor, adaptive: bool
) -> tuple[torch.Tensor, int]:
    """(objective per sample, in the physical units' density; number of samples)."""
    index, mask = _padded(batch)
    phi = torch_features(parameters, windows.z[index.reshape(-1)]).reshape(*index.shape, STATE_COUNT, FEATURE_COUNT)
    total = window_nll(parameters, phi, windows.y[index] / scale, mask, adaptive).sum()
    count = int(mask.sum())
    return total / count + 2.0 * torch.log(scale).sum(), count


def train(config: TrainingConfig) -> BayesianModel:
    """Trains a model, writes its checkpoint to `config.output` and returns it.

    A run that was broken off goes on from `<output>.resume` (removed at the end). The record in the checkpoint holds
    the configuration, the data's hash, and the objective over windows of 10 and 100 samples on training and validation
    vehicles.
    """
    torch.set_num_threads(config.threads)
    vehicle = VehicleParameters() if config.vehicle is None else VehicleParameters.from_yaml(config.vehicle)
    samples = load_samples(config.data)
    windows = Windows(concatenate([samples, mirrored(samples)]), vehicle)
    watched = None if config.validation is None else Windows(load_samples(config.validation), vehicle)
    scale = windows.y.std(dim=0)
    parameters = initial_parameters(torch.Generator().manual_seed(config.seed))
    network_names = ("w1", "w2", "w_out")
    optimizer = torch.optim.AdamW(
        [
            {"params": [parameters[name] for name in network_names], "weight_decay": config.weight_decay},
            {"params": [p for name, p in parameters.items() if name not in network_names], "weight_decay": 0.0},
        ],
        lr=config.learning_rate,
    )
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, config.decay)
    resume = config.output.with_name(config.output.name + ".resume")
    start, spent, history = _resume(resume, config, parameters, optimizer, schedule)
    began = time.monotonic() - spent
    progress = tqdm(range(start, config.epochs), initial=start, total=config.epochs, unit="epoch")
    epoch = start
    for epoch in progress:
        # The stream of an epoch depends on the epoch alone, so that a resumed run cuts the windows of an unbroken one.
        generator = np.random.default_rng([config.seed, epoch])
        horizon = int(generator.choice(config.horizons))
        cut = windows.cut(horizon, bool(generator.random() < config.shuffled_share), generator)
        order = generator.permutation(len(cut))
        per_batch = max(1, config.batch // horizon)
        total, count = 0.0, 0
        if config.epoch_samples is not None:
            lengths = np.cumsum([len(cut[i]) for i in order])
            order = order[: int(np.searchsorted(lengths, config.epoch_samples)) + 1]
        for first in range(0, len(order), per_batch):
            batch = [cut[i] for i in order[first : first + per_batch]]
            loss, size = _batch_loss(parameters, windows, batch, scale, config.adaptive)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total, count = total + float(loss.detach()) * size, count + size
        schedule.step()
        if (epoch + 1) % SAVE_EVERY == 0 or epoch + 1 == config.epochs:
            entry = {"epoch": epoch + 1, "horizon": horizon, "loss": total / count}
            if watched is not None:
                for length in (10, 100):
                    entry[f"validation_{length}"] = evaluate(parameters, watched, scale, length, config.adaptive)
            history.append(entry)
            progress.set_postfix({k: f"{v:.2f}" for k, v in entry.items() if k != "epoch"})
            _save_resume(resume, config, parameters, optimizer, schedule, epoch + 1, time.monotonic() - began, history)
        if time.monotonic() - began > config.time_limit:
            break
    record: dict[str, Any] = {
        "config": _plain(config),
        "data": content_hash(samples),
        "samples": len(samples.x),
        "epochs": epoch + 1,
        "seconds": round(time.monotonic() - began, 1),
        "history": history,
        "torch": torch.__version__,
    }
    model = to_model(parameters, scale, vehicle, record, config.adaptive)
    if config.validation is not None and config.temper and config.adaptive:
        weight = choose_sample_weight(model, load_samples(config.validation))
        model = dataclasses.replace(model, sample_weight=weight)
    model.save(config.output)
    resume.unlink(missing_ok=True)
    return model


def evaluate(parameters: Parameters, windows: Windows, scale: torch.Tensor, horizon: int, adaptive: bool) -> float:
    """The objective per sample over windows of `horizon` consecutive samples."""
    cut = windows.cut(horizon, False, np.random.default_rng(0))
    with torch.no_grad():
        parts = [_batch_loss(parameters, windows, cut[i : i + 200], scale, adaptive) for i in range(0, len(cut), 200)]
    return float(sum(float(loss) * count for loss, count in parts) / sum(count for _, count in parts))


def to_model(parameters: Parameters, scale: torch.Tensor, vehicle: VehicleParameters, record: dict[str, Any],
             adaptive: bool = True) -> BayesianModel:  # fmt: skip
    """The trained numbers in physical units: the output scale goes into the prior mean and sigma, Lambda is free of it.

    A model that never adapts has a precision so large that samples do not move it.
    """
    numbers = {name: value.detach().double().numpy() for name, value in parameters.items()}
    output_scale = scale.double().numpy()
    weights = {name: numbers[name] for name in ("w1", "b1", "w2", "b2", "w_out", "b_out")}
    factor = numbers["precision_factor"] if adaptive else 1e6 * np.tile(np.eye(FEATURE_COUNT), (STATE_COUNT, 1, 1))
    return BayesianModel(
        Network(INPUT_OFFSET.copy(), INPUT_SCALE.copy(), **weights),
        prior_mean=numbers["prior_mean"] * output_scale[:, None],
        precision_factor=factor,
        sigma=np.exp(numbers["log_sigma"]) * output_scale,
        sample_weight=1.0,
        vehicle=vehicle,
        record=record,
    )


def _plain(config: TrainingConfig) -> dict[str, Any]:
    # The record names files, not the folders of the machine that trained.
    return {k: v.name if isinstance(v, Path) else v for k, v in dataclasses.asdict(config).items()}


def _save_resume(path: Path, config: TrainingConfig, parameters: Parameters, optimizer: Any, schedule: Any,
                 epoch: int, spent: float, history: list[dict[str, Any]]) -> None:  # fmt: skip
    partial = path.with_name(path.name + ".part")
    path.parent.mkdir(parents=True, exist_ok=True)
    state = {"config": json.dumps(_plain(config)), "parameters": parameters, "optimizer": optimizer.state_dict(),
             "schedule": schedule.state_dict(), "epoch": epoch, "spent": spent, "history": history}  # fmt: skip
    torch.save(state, partial)
    partial.replace(path)


def _resume(path: Path, config: TrainingConfig, parameters: Parameters, optimizer: Any, schedule: Any
            ) -> tuple[int, float, list[dict[str, Any]]]:  # fmt: skip
    """Restores a broken-off run: (epochs done, seconds spent, history); another configuration starts anew."""
    if not path.exists():
        return 0, 0.0, []
    state = torch.load(path, weights_only=True)
    if state["config"] != json.dumps(_plain(config)):
        return 0, 0.0, []
    with torch.no_grad():
        for name, value in state["parameters"].items():
            parameters[name].copy_(value)
    optimizer.load_state_dict(state["optimizer"])
    schedule.load_state_dict(state["schedule"])
    return state["epoch"], state["spent"], state["history"]
