"""Offline meta-training of features, prior and noise; with its two objectives the only code that imports torch."""

import dataclasses
import io
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import check_plausible
from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError, one_line
from drift_drake.common.safe_files import write_bytes
from drift_drake.drive.learnt.checkpoint import WEIGHTS, BayesianModel, InvalidCheckpointError, load_model
from drift_drake.drive.learnt.features import (
    INPUT_COUNT,
    MEAN_COUNT,
    STATE_COUNT,
    Network,
    input_scaling,
    network_inputs,
)
from drift_drake.drive.learnt.posterior import block_diagonal, state_blocks
from drift_drake.drive.learnt.quality import choose_sample_weight
from drift_drake.drive.learnt.samples import DRIFTING, Samples, concatenate, content_hash, load_samples
from drift_drake.drive.learnt.torch_network import Parameters, initial_parameters, trainable_numbers
from drift_drake.drive.learnt.training_config import TrainingConfig
from drift_drake.drive.learnt.transfer_objective import TransferObjective
from drift_drake.drive.learnt.window_objective import WindowObjective

SAVE_EVERY = 25  # [epochs] between saves of an unfinished run
DRIFT_COUNT = 200  # samples that stand for what is to be predicted
FIRST_WEIGHT = 0.3  # of a sample, where it is trained
FIRST_SHARE = 0.5  # of a sample's noise, the noise of a stretch's mean


class TrainingDivergedError(DriftDrakeError, ArithmeticError):
    """An objective that is no number any more; the message names the epoch and the remedy."""


def _objective(
    config: TrainingConfig, vehicle: VehicleParameters
) -> tuple[WindowObjective | TransferObjective, list[Samples]]:
    """The configuration's objective, and the tables that are trained on."""
    samples = load_samples(config.data)
    watched = None if config.validation is None else load_samples(config.validation)
    if config.lane is None:
        return WindowObjective(config, samples, watched, vehicle), [samples]
    lane = load_samples(config.lane)
    pair = None
    if watched is not None and config.validation_lane is not None:
        pair = (watched, load_samples(config.validation_lane))
    return TransferObjective(config, (samples, lane), pair, vehicle), [samples, lane]


def train(config: TrainingConfig) -> BayesianModel:
    """Trains a model, writes its checkpoint to `config.output` and returns it.

    A run that was broken off goes on from `<output>.resume` (removed at the end). The record in the checkpoint holds
    the configuration, the data's hash, and the course of the objective on training and validation vehicles.
    """
    torch.set_num_threads(config.threads)
    vehicle = VehicleParameters() if config.vehicle is None else VehicleParameters.from_yaml(config.vehicle)
    check_plausible(vehicle, str(config.vehicle))
    objective, tables = _objective(config, vehicle)
    begun_from = None if config.start is None else load_model(config.start)
    parameters = _first_parameters(config, vehicle, objective.scale, begun_from)
    optimizer, schedule = _optimizer(config, parameters)
    resume = config.output.with_name(config.output.name + ".resume")
    start, spent, history = _resume(resume, config, parameters, optimizer, schedule)
    began = time.monotonic() - spent
    progress = tqdm(range(start, config.epochs), initial=start, total=config.epochs, unit="epoch")
    epoch = start
    for epoch in progress:
        # The stream of an epoch depends on the epoch alone, so that a resumed run draws what an unbroken one does.
        generator = np.random.default_rng([config.seed, epoch])
        mean_loss = _epoch(objective, parameters, optimizer, generator, config.gradient_clip)
        if not math.isfinite(mean_loss):
            raise TrainingDivergedError(f"the objective of epoch {epoch + 1} is {mean_loss}; lower --learning-rate")
        schedule.step()
        if (epoch + 1) % SAVE_EVERY == 0 or epoch + 1 == config.epochs:
            spent_now = round(time.monotonic() - began, 1)
            entry = {"epoch": epoch + 1, "seconds": spent_now, "loss": mean_loss, **objective.watch(parameters)}
            history.append(entry)
            progress.set_postfix({k: f"{v:.2f}" for k, v in entry.items() if k not in ("epoch", "seconds")})
            _save_resume(resume, config, parameters, optimizer, schedule, epoch + 1, time.monotonic() - began, history)
            if config.stop_at is not None and entry.get("validation", math.inf) <= config.stop_at:
                break
        if time.monotonic() - began > config.time_limit:
            break
    record: dict[str, Any] = {
        "config": _plain(config),
        "data": content_hash(concatenate(tables)),
        "samples": sum(len(table.x) for table in tables),
        "epochs": epoch + 1,
        "seconds": round(time.monotonic() - began, 1),
        "history": history,
        "torch": torch.__version__,
        "device": torch.cuda.get_device_name() if objective.scale.is_cuda else "cpu",
    }
    if begun_from is not None:
        record["start"] = begun_from.record
    model = to_model(parameters, objective.scale, vehicle, record, config.adaptive)
    model = dataclasses.replace(model, drifts=drifts_of(tables[0], config.seed))
    if config.lane is None and config.validation is not None and config.temper and config.adaptive:
        weight = choose_sample_weight(model, load_samples(config.validation))
        model = dataclasses.replace(model, sample_weight=np.full(STATE_COUNT, weight))
    model.save(config.output)
    resume.unlink(missing_ok=True)
    return model


def _first_parameters(
    config: TrainingConfig, vehicle: VehicleParameters, scale: torch.Tensor, start: BayesianModel | None
) -> Parameters:
    """The numbers to begin with: drawn at random, but for those of a model that training starts from."""
    generator, device, scale = torch.Generator().manual_seed(config.seed), scale.device, scale.cpu()
    parameters = initial_parameters(generator, config.physical_inputs, config.coupled or config.lane is not None)
    if start is not None:
        parameters |= _started(start, parameters, scale, config, vehicle)
    if config.lane is not None:
        share = torch.full((STATE_COUNT,), math.log(FIRST_SHARE), dtype=torch.float64, requires_grad=True)
        parameters["log_share"] = share
    if config.lane is not None and "logit_weight" not in parameters:
        logit = math.log(FIRST_WEIGHT / (1.0 - FIRST_WEIGHT))
        parameters["logit_weight"] = torch.full((STATE_COUNT,), logit, dtype=torch.float64, requires_grad=True)
    # Drawn on the CPU, so that every device begins with the same numbers.
    parameters = {name: value.detach().to(device).requires_grad_() for name, value in parameters.items()}
    if not config.tyres:
        known = torch.ones(len(parameters["w1"]), 1, device=device)
        known[INPUT_COUNT:] = 0.0
        with torch.no_grad():
            parameters["w1"] *= known
        parameters["w1"].register_hook(torch.utils.hooks.unserializable_hook(lambda gradient: gradient * known))
    return parameters


def _optimizer(config: TrainingConfig, parameters: Parameters) -> tuple[Any, Any]:
    """The optimizer, whose weight decay is the network's alone, and the schedule of its learning rate."""
    network_names = ("w1", "w2", "w_out")
    optimizer = torch.optim.AdamW(
        [
            {"params": [parameters[name] for name in network_names], "weight_decay": config.weight_decay},
            {"params": [p for name, p in parameters.items() if name not in network_names], "weight_decay": 0.0},
        ],
        lr=config.learning_rate,
    )
    return optimizer, torch.optim.lr_scheduler.ExponentialLR(optimizer, config.decay)


def _epoch(
    objective: WindowObjective | TransferObjective, parameters: Parameters, optimizer: Any,
    generator: np.random.Generator, gradient_clip: float | None,
) -> float:  # fmt: skip
    """One pass over the data; the mean loss of a sample."""
    total, count = torch.zeros(()), 0
    for loss, size in objective.losses(parameters, generator):
        optimizer.zero_grad()
        loss.backward()
        if gradient_clip is not None:
            torch.nn.utils.clip_grad_norm_(list(parameters.values()), gradient_clip)
        optimizer.step()
        # Not read before the end: a GPU works on while this process goes ahead.
        total, count = total.to(loss.device) + loss.detach() * size, count + size
    return float(total) / count


def drifts_of(samples: Samples, seed: int) -> Array | None:
    """z [`DRIFT_COUNT`, 10] of drifting samples, drawn at random; None where nothing drifts."""
    drifting = np.flatnonzero(np.abs(samples.x[:, 2]) > DRIFTING)
    if not len(drifting):
        return None
    rows = np.random.default_rng(seed).choice(drifting, DRIFT_COUNT)
    # In single precision, as a checkpoint holds them.
    return network_inputs(samples.x[rows], samples.u[rows], samples.u_next[rows]).astype(np.float32).astype(float)


def _started(
    model: BayesianModel, fresh: Parameters, scale: torch.Tensor, config: TrainingConfig, vehicle: VehicleParameters
) -> Parameters:
    """The numbers of the model that training starts from.

    Raises:
        InvalidCheckpointError: its network's inputs or its nominal car are others; the message names the file and the
            remedy.
    """
    if model.vehicle != vehicle:
        raise InvalidCheckpointError(
            f"{config.start}: its nominal car is not the one that training is set up for; give that car's file as "
            "--vehicle, or start from another checkpoint"
        )
    numbers = trainable_numbers(model, scale)
    if numbers["w1"].shape != fresh["w1"].shape:
        raise InvalidCheckpointError(
            f"{config.start}: its network has {len(numbers['w1'])} inputs, training is set up for {len(fresh['w1'])}; "
            "start from another checkpoint, or change physical_inputs"
        )
    if config.lane is None:  # windows choose the weight of a sample at the end
        numbers.pop("logit_weight", None)
    if config.lane is None and not config.coupled:
        factor = numbers["precision_factor"].detach()
        blocks = state_blocks(factor.numpy())
        if not np.array_equal(block_diagonal(blocks), factor.numpy()):
            raise InvalidCheckpointError(
                f"{config.start}: its prior couples the states; windows start from one that does not"
            )
        numbers["precision_factor"] = torch.tensor(blocks, requires_grad=True)
    return numbers


def to_model(parameters: Parameters, scale: torch.Tensor, vehicle: VehicleParameters, record: dict[str, Any],
             adaptive: bool = True) -> BayesianModel:  # fmt: skip
    """The trained numbers in physical units: the output scale goes into the prior mean and sigma, Lambda is free of it.

    A model that never adapts has a precision so large that samples do not move it.
    """
    numbers = {name: value.detach().cpu().double().numpy() for name, value in parameters.items()}
    output_scale = scale.cpu().double().numpy()
    weights = {name: numbers[name] for name in WEIGHTS}
    factor = numbers["precision_factor"] if adaptive else 1e6 * np.eye(MEAN_COUNT)
    if factor.ndim == 3:
        factor = block_diagonal(factor)
    physical = len(weights["w1"]) > INPUT_COUNT
    return BayesianModel(
        Network(*input_scaling(physical), **weights, nominal=vehicle.constants() if physical else None),
        prior_mean=numbers["prior_mean"] * output_scale[:, None],
        precision_factor=factor,
        sigma=np.exp(numbers["log_sigma"]) * output_scale,
        sample_weight=1.0 / (1.0 + np.exp(-numbers["logit_weight"]))
        if "logit_weight" in numbers
        else np.ones(STATE_COUNT),
        vehicle=vehicle,
        record=record,
    )


def _plain(config: TrainingConfig) -> dict[str, Any]:
    # The record names files, not the folders of the machine that trained.
    return {k: v.name if isinstance(v, Path) else v for k, v in dataclasses.asdict(config).items()}


def _save_resume(path: Path, config: TrainingConfig, parameters: Parameters, optimizer: Any, schedule: Any,
                 epoch: int, spent: float, history: list[dict[str, Any]]) -> None:  # fmt: skip
    state = {"config": json.dumps(_plain(config)), "parameters": parameters, "optimizer": optimizer.state_dict(),
             "schedule": schedule.state_dict(), "epoch": epoch, "spent": spent, "history": history}  # fmt: skip
    data = io.BytesIO()  # PyTorch's own writer answers a full disk with an assertion
    torch.save(state, data)
    write_bytes(path, data.getvalue())


def _resume(path: Path, config: TrainingConfig, parameters: Parameters, optimizer: Any, schedule: Any
            ) -> tuple[int, float, list[dict[str, Any]]]:  # fmt: skip
    """Restores a broken-off run: (epochs done, seconds spent, history); another configuration starts anew.

    So does a file that cannot be read.
    """
    if not path.exists():
        return 0, 0.0, []
    try:
        state = torch.load(path, weights_only=True, map_location="cpu")
        same = state["config"] == json.dumps(_plain(config))
    except Exception as error:  # zip, pickle and torch raise a dozen kinds on a damaged file
        print(f"{path}: cannot be read ({one_line(error)}); training starts anew", file=sys.stderr)
        return 0, 0.0, []
    if not same:
        return 0, 0.0, []
    with torch.no_grad():
        for name, value in state["parameters"].items():
            parameters[name].copy_(value)
    optimizer.load_state_dict(state["optimizer"])
    schedule.load_state_dict(state["schedule"])
    return state["epoch"], state["spent"], state["history"]
