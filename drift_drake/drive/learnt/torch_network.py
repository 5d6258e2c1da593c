"""Torch's twin of the feature network and of the prior, for training alone (extra `train`)."""

import math
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import PRECISION_FLOOR, WEIGHTS, BayesianModel
from drift_drake.drive.learnt.features import (
    FEATURE_COUNT,
    HIDDEN_COUNT,
    INPUT_COUNT,
    MEAN_COUNT,
    STATE_COUNT,
    all_inputs,
    input_scaling,
    network_inputs,
)
from drift_drake.drive.learnt.samples import Samples

Parameters = dict[str, torch.Tensor]


def initial_parameters(generator: torch.Generator, physical: bool = False, coupled: bool = False) -> Parameters:
    """The trainable numbers: uniform weights of width 1/sqrt(inputs), identity precision.

    27,012 with the paper's inputs and a precision of each state's own [4, 16, 16]; more with physical inputs, or with
    one precision that couples the states [64, 64].
    """
    inputs_count = len(input_scaling(physical)[0])

    def uniform(*shape: int, inputs: int) -> torch.Tensor:
        return (2.0 * torch.rand(shape, generator=generator) - 1.0) / math.sqrt(inputs)

    parameters = {
        "w1": uniform(inputs_count, HIDDEN_COUNT, inputs=inputs_count),
        "b1": uniform(HIDDEN_COUNT, inputs=inputs_count),
        "w2": uniform(HIDDEN_COUNT, HIDDEN_COUNT, inputs=HIDDEN_COUNT),
        "b2": uniform(HIDDEN_COUNT, inputs=HIDDEN_COUNT),
        "w_out": uniform(STATE_COUNT, HIDDEN_COUNT, FEATURE_COUNT, inputs=HIDDEN_COUNT),
        "b_out": uniform(STATE_COUNT, FEATURE_COUNT, inputs=HIDDEN_COUNT),
        "prior_mean": (0.3 * torch.randn((STATE_COUNT, FEATURE_COUNT), generator=generator)).double(),
        "precision_factor": torch.eye(MEAN_COUNT, dtype=torch.float64)
        if coupled
        else torch.eye(FEATURE_COUNT, dtype=torch.float64).repeat(STATE_COUNT, 1, 1),
        "log_sigma": torch.full((STATE_COUNT,), math.log(0.3), dtype=torch.float64),
    }
    return {name: value.requires_grad_() for name, value in parameters.items()}


def trainable_numbers(model: BayesianModel, scale: torch.Tensor) -> Parameters:
    """The trainable numbers of a model: the inverse of `meta_training.to_model`.

    Args:
        scale: of the residuals [4], which the trainable prior mean and noise are in units of.
    """
    single = {name: torch.as_tensor(getattr(model.network, name), dtype=torch.float32) for name in WEIGHTS}
    parameters = single | {
        "prior_mean": torch.as_tensor(model.prior_mean) / scale[:, None],
        "precision_factor": torch.as_tensor(model.precision_factor),
        "log_sigma": torch.log(torch.as_tensor(model.sigma) / scale),
    }
    if (model.sample_weight < 1.0).any():
        parameters["logit_weight"] = torch.logit(torch.as_tensor(model.sample_weight), eps=1e-6)
    return {name: value.clone().requires_grad_() for name, value in parameters.items()}


def torch_features(parameters: Parameters, inputs: torch.Tensor) -> torch.Tensor:
    """phi [n, 4, 16] at inputs [n, 8 or 16]: torch's twin of `features.features`."""
    scaling = input_scaling(inputs.shape[1] > INPUT_COUNT)
    offset, scale = (torch.as_tensor(a, dtype=inputs.dtype, device=inputs.device) for a in scaling)
    scaled = (inputs - offset) / scale
    hidden = torch.tanh(torch.addmm(parameters["b1"], scaled, parameters["w1"]))
    hidden = torch.tanh(torch.addmm(parameters["b2"], hidden, parameters["w2"]))
    w_out = parameters["w_out"].permute(1, 0, 2).reshape(HIDDEN_COUNT, -1)
    return torch.addmm(parameters["b_out"].reshape(-1), hidden, w_out).reshape(-1, STATE_COUNT, FEATURE_COUNT)


def coupled_precision(parameters: Parameters) -> torch.Tensor:
    """Lambda_0 [4, 16, 16], or [64, 64] where it couples the states."""
    factor = parameters["precision_factor"]
    return factor @ factor.transpose(-1, -2) + PRECISION_FLOOR * torch.eye(factor.shape[-1]).to(factor)


def as_tensors(
    samples: Samples, vehicle: VehicleParameters, physical: bool, device: torch.device
) -> tuple[torch.Tensor, torch.Tensor]:
    """(the network's inputs [n, 8 or 18], residuals of the learnt states [n, 4]) of samples, on the device."""
    z = network_inputs(samples.x, samples.u, samples.u_next)
    inputs = all_inputs(z, vehicle.constants() if physical else None)
    y = residual(samples.x, samples.u, samples.x_next, vehicle.constants())
    return torch.as_tensor(inputs, dtype=torch.float32, device=device), torch.as_tensor(y, device=device)


def padded(rows: Sequence[NDArray[np.int64]], device: torch.device) -> tuple[torch.Tensor, torch.Tensor]:
    """Index arrays of several lengths as one [rows, longest], and which entries count, both on the device."""
    longest = max(1, max(len(row) for row in rows))
    index, mask = np.zeros((len(rows), longest), dtype=np.int64), np.zeros((len(rows), longest), dtype=bool)
    for place, row in enumerate(rows):
        index[place, : len(row)], mask[place, : len(row)] = row, True
    return torch.as_tensor(index, device=device), torch.as_tensor(mask, device=device)


def training_device(wanted: str) -> torch.device:
    """The device that "auto", "cpu" or "cuda" means on this machine.

    Raises:
        InvalidOptionError: "cuda" where torch finds no GPU.
    """
    there = torch.cuda.is_available()
    if wanted == "cuda" and not there:
        raise InvalidOptionError("--device cuda: torch finds no GPU here; choose cpu, or auto")
    return torch.device("cuda" if there and wanted != "cpu" else "cpu")
