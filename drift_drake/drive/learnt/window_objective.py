"""The paper's objective: the sequential negative log-likelihood of windows of samples.

Over a window of T samples of one vehicle it is the sum of -2 log p(x_{k+1} | x_{0:k}) with the posterior of eq. (6)
after the samples before. By the chain rule that sum is the negative log marginal likelihood of the window, which has a
closed form,

    sum_k log Sigma_k + (y_k - mu_k)^2 / Sigma_k
        = T log sigma^2 + log det(Lambda_T) - log det(Lambda_0) + (e^T e - b^T Lambda_T^{-1} b) / sigma^2,

with e = y - Phi mean_0, b = Phi^T e, Lambda_T = Lambda_0 + Phi^T Phi: no loop over time, one 16 x 16 Cholesky
factorisation per window and state. Of a prior that couples the states it is the same with all states' e / sigma in one
vector and one 64 x 64 factorisation per window. `tests/model/test_meta_training.py` holds it to the recursion.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.features import STATE_COUNT
from drift_drake.drive.learnt.samples import Samples, concatenate, mirrored
from drift_drake.drive.learnt.torch_network import (
    Parameters,
    as_tensors,
    coupled_precision,
    padded,
    torch_features,
    training_device,
)
from drift_drake.drive.learnt.training_config import TrainingConfig

LONG = 40  # [samples] longest window that stays within one drive


class EpochWindows:
    """The samples on torch's side, and how an epoch cuts them into windows."""

    def __init__(self, samples: Samples, vehicle: VehicleParameters, physical: bool, device: torch.device) -> None:
        self.inputs, self.y = as_tensors(samples, vehicle, physical, device)
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


def window_nll(parameters: Parameters, phi: torch.Tensor, y: torch.Tensor, mask: torch.Tensor,
               adaptive: bool = True) -> torch.Tensor:  # fmt: skip
    """Sequential negative log-likelihood of windows (twice it, without the 2 pi, as in the paper's objective).

    Args:
        phi: features [w, T, 4, 16]; y: residuals in units of the output scale [w, T, 4]; mask: which entries are
            samples [w, T] (windows may be shorter than T).

    Returns:
        [w, 4], summed over the window; [w], over the states too, where the prior couples them.
    """
    mask = mask.to(y.dtype)
    phi = (phi.to(y.dtype) * mask[..., None, None]).permute(0, 2, 1, 3)  # [w, 4, T, 16]
    error = (y * mask[..., None]).permute(0, 2, 1) - torch.einsum("witf,if->wit", phi, parameters["prior_mean"])
    log_variance = 2.0 * parameters["log_sigma"]
    count = mask.sum(dim=1)[:, None]
    squares = (error * error).sum(dim=-1)
    if not adaptive:
        return count * log_variance + squares * torch.exp(-log_variance)
    prior = coupled_precision(parameters)
    if prior.dim() == 2:
        own = (count * log_variance + squares * torch.exp(-log_variance)).sum(dim=-1)
        return own + _coupled_terms(prior, phi, error * torch.exp(-0.5 * log_variance)[:, None])
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


def _coupled_terms(prior: torch.Tensor, phi: torch.Tensor, error: torch.Tensor) -> torch.Tensor:
    """log det(Lambda_T) - log det(Lambda_0) - b^T Lambda_T^{-1} b [w] of a prior over all states [64, 64].

    Args:
        phi: [w, 4, T, 16]; error: over sigma [w, 4, T].
    """
    observed = torch.diag_embed((phi.transpose(-1, -2) @ phi).permute(0, 2, 3, 1)).permute(0, 3, 1, 4, 2)
    b = torch.einsum("witf,wit->wif", phi, error).reshape(len(phi), -1, 1)
    terms: torch.Tensor = _LogDetLessSquare.apply(prior + observed.reshape(len(phi), *prior.shape), b)
    return terms - torch.logdet(prior)


class _LogDetLessSquare(torch.autograd.Function):
    """log det(A) - b^T A^{-1} b of A [w, n, n], b [w, n, 1].

    With its derivatives in closed form, A^{-1} + x x^T and -2 x for x = A^{-1} b: less than half of what torch's
    backward pass through a Cholesky factorisation takes.
    """

    @staticmethod
    def forward(ctx: Any, matrix: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        factor = torch.linalg.cholesky(matrix)
        inverse = torch.cholesky_inverse(factor)
        x = inverse @ b
        ctx.save_for_backward(inverse, x)
        return 2.0 * torch.log(torch.diagonal(factor, dim1=-2, dim2=-1)).sum(-1) - (b * x).sum(dim=(-1, -2))

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        inverse, x = ctx.saved_tensors
        by_value = gradients[0][:, None, None]
        return by_value * (inverse + x @ x.transpose(-1, -2)), -2.0 * by_value * x


class WindowObjective:
    """Windows of the training vehicles, and of others that are watched."""

    def __init__(
        self, config: TrainingConfig, samples: Samples, watched: Samples | None, vehicle: VehicleParameters
    ) -> None:
        self._config = config
        physical, device = config.physical_inputs, training_device(config.device)
        self._windows = EpochWindows(concatenate([samples, mirrored(samples)]), vehicle, physical, device)
        self._watched = None if watched is None else EpochWindows(watched, vehicle, physical, device)
        self.scale = self._windows.y.std(dim=0)

    def losses(self, parameters: Parameters, generator: np.random.Generator) -> Iterator[tuple[torch.Tensor, int]]:
        """(objective per sample, number of samples) of an epoch's batches."""
        config = self._config
        horizon = int(generator.choice(config.horizons))
        cut = self._windows.cut(horizon, bool(generator.random() < config.shuffled_share), generator)
        order = generator.permutation(len(cut))
        if config.epoch_samples is not None:
            lengths = np.cumsum([len(cut[i]) for i in order])
            order = order[: int(np.searchsorted(lengths, config.epoch_samples)) + 1]
        per_batch = max(1, config.batch // horizon)
        for first in range(0, len(order), per_batch):
            yield self._loss(parameters, self._windows, [cut[i] for i in order[first : first + per_batch]])

    def watch(self, parameters: Parameters) -> dict[str, float]:
        """The objective per sample of the watched vehicles, over windows of 10 and 100 consecutive samples."""
        return {f"validation_{length}": self._evaluate(parameters, length) for length in (10, 100) if self._watched}

    def _evaluate(self, parameters: Parameters, horizon: int) -> float:
        assert self._watched is not None
        cut = self._watched.cut(horizon, False, np.random.default_rng(0))
        with torch.no_grad():
            parts = [self._loss(parameters, self._watched, cut[i : i + 200]) for i in range(0, len(cut), 200)]
        return float(sum(float(loss) * count for loss, count in parts) / sum(count for _, count in parts))

    def _loss(
        self, parameters: Parameters, windows: EpochWindows, batch: list[NDArray[np.int64]]
    ) -> tuple[torch.Tensor, int]:
        # In the density of the physical units.
        index, mask = padded(batch, windows.y.device)
        phi = torch_features(parameters, windows.inputs[index.reshape(-1)]).reshape(*index.shape, STATE_COUNT, -1)
        total = window_nll(parameters, phi, windows.y[index] / self.scale, mask, self._config.adaptive).sum()
        count = sum(len(rows) for rows in batch)
        return total / count + 2.0 * torch.log(self.scale).sum(), count
