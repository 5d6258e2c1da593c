"""What the car is used for, as the objective: after a context of a vehicle's samples, predict others of its samples.

A task is one vehicle, a context (nothing, drives along a straight lane, or some of its drifting) and targets out of
its other drifting drives. With the posterior of eq. (6) after the context, each sample of it counting with a weight w,
the loss is -2 log of the predictive density (7) of each target by itself, and of the mean over each stretch of
consecutive targets: a controller plans two seconds ahead, where what is wrong every time adds up and noise does not. So
the prior learns what a lane tells of a drift, which windows of consecutive samples never ask; and w, which is trained
along for each state, learns how much less n samples of one drive tell than n independent ones.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.features import FEATURE_COUNT, MEAN_COUNT, STATE_COUNT
from drift_drake.drive.learnt.samples import PHASE_STRIDE, Samples, concatenate, mirrored
from drift_drake.drive.learnt.torch_network import (
    Parameters,
    as_tensors,
    coupled_precision,
    padded,
    torch_features,
    training_device,
)
from drift_drake.drive.learnt.training_config import LANE_ROUND, TrainingConfig

Rows = NDArray[np.int64]

CONTEXTS = {"none": 0.1, "lane": 0.55, "drift": 0.35}  # how often a task's context is which
LANE_DRIVES = 3  # of a context, at most
IN_TURN = 0.7  # of lane contexts: a round's first drives in turn
NEWEST = 0.7  # of those: of the last round, whose plans the features of now have made
LONGEST = 160  # [samples] of a context
STRETCH = 10  # consecutive targets whose mean is predicted too
TARGETS = 100  # of a task, at most
SHUFFLED = 0.2  # of drift contexts: samples in no order
LANE_TARGETS = 0.2  # of tasks whose context is not of drifting: targets include a lane drive
WATCHED_TASKS = 256


class Vehicle(NamedTuple):
    """Rows of one vehicle's drives, [phase][drive]."""

    drift: list[list[Rows]]
    lane: list[list[Rows]]


def drives_by_phase(samples: Samples) -> dict[int, list[list[Rows]]]:
    """Rows of each drive, {vehicle: [phase][drive]}."""
    found: dict[int, dict[int, list[Rows]]] = {}
    for rows in np.split(np.arange(len(samples.drive)), np.flatnonzero(np.diff(samples.drive)) + 1):
        phase, vehicle = divmod(int(samples.vehicle[rows[0]]), PHASE_STRIDE)
        found.setdefault(vehicle, {}).setdefault(phase, []).append(rows)
    return {vehicle: [phases[k] for k in sorted(phases)] for vehicle, phases in found.items()}


class Tasks:
    """The samples of drifts and of lane drives on torch's side, mirrored too, and how a task is drawn from them."""

    def __init__(
        self, drift: Samples, lane: Samples, vehicle: VehicleParameters, physical: bool, device: torch.device
    ) -> None:
        tables = [drift, lane, mirrored(drift), mirrored(lane)]
        offsets = np.concatenate([[0], np.cumsum([len(table.x) for table in tables])])
        self.inputs, self.y = as_tensors(concatenate(tables), vehicle, physical, device)
        drifts, lanes = drives_by_phase(drift), drives_by_phase(lane)

        def moved(phases: list[list[Rows]], offset: int) -> list[list[Rows]]:
            return [[rows + offset for rows in drives] for drives in phases]

        self._vehicles = [
            Vehicle(moved(drifts[k], offsets[2 * side]), moved(lanes[k], offsets[2 * side + 1]))
            for side in (0, 1)
            for k in sorted(set(drifts) & set(lanes))
        ]

    def draw(self, generator: np.random.Generator) -> tuple[Rows, Rows]:
        """Rows of a task's context and of its targets."""
        vehicle = self._vehicles[generator.integers(len(self._vehicles))]
        kind = generator.choice(list(CONTEXTS), p=list(CONTEXTS.values()))
        drives = generator.permutation(len(vehicle.drift[0]))

        def picked(phases: list[list[Rows]], which: NDArray[np.int64]) -> Rows:
            return np.concatenate([phases[generator.integers(len(phases))][k] for k in which])

        context = np.zeros(0, dtype=np.int64)
        if kind == "lane":
            count = generator.integers(1, LANE_DRIVES + 1)
            which = generator.permutation(len(vehicle.lane[0]))
            if generator.random() < IN_TURN:
                last = max(0, len(which) // LANE_ROUND - 1)
                chosen = last if generator.random() < NEWEST else generator.integers(last + 1)
                which = np.arange(LANE_ROUND * chosen, len(which))
            context = picked(vehicle.lane, which[:count])[:LONGEST]
        elif kind == "drift" and len(drives) > 1:
            used = generator.integers(1, len(drives))
            context = picked(vehicle.drift, drives[:used])
            if generator.random() < SHUFFLED:
                context = generator.permutation(context)
            context = context[: int(np.exp(generator.uniform(np.log(5.0), np.log(LONGEST))))]
            drives = drives[used:]
        targets = [picked(vehicle.drift, drives[[k]]) for k in range(len(drives))]
        if kind != "drift" and generator.random() < LANE_TARGETS:
            targets.append(picked(vehicle.lane, generator.integers(len(vehicle.lane[0]), size=1)))
        return context, _stretches(targets, generator)


def _stretches(drives: list[Rows], generator: np.random.Generator) -> Rows:
    """`TARGETS` rows at most: whole stretches of `STRETCH` consecutive rows out of drives, in random order."""
    whole = []
    for rows in drives:
        rows = rows[generator.integers(STRETCH) :]
        whole.append(rows[: len(rows) - len(rows) % STRETCH].reshape(-1, STRETCH))
    return generator.permutation(np.concatenate(whole))[: TARGETS // STRETCH].ravel()


def predictive_nll(
    parameters: Parameters,
    context: tuple[torch.Tensor, torch.Tensor, torch.Tensor],
    targets: tuple[torch.Tensor, torch.Tensor, torch.Tensor],
) -> tuple[torch.Tensor, torch.Tensor]:
    """-2 log of the predictive density (without the 2 pi), after the context.

    Args:
        context, targets: (features [b, n, 4, 16], residuals in units of the output scale [b, n, 4], which entries are
            samples [b, n]); the numbers n of the two differ.

    Returns:
        (of each target [b, n, 4], zero where there is no sample; of each stretch's mean [b, n // STRETCH, 4], whose
        noise is exp(`log_share`) of a sample's, for targets that come in whole stretches).
    """
    phi, y, mask = context
    weight = torch.sigmoid(parameters["logit_weight"])[:, None]
    sigma = torch.exp(parameters["log_sigma"])[:, None]
    phi = (phi.to(y.dtype) * mask[..., None, None]).permute(0, 2, 1, 3)  # [b, 4, n, 16]
    error = (y.permute(0, 2, 1) - torch.einsum("bitf,if->bit", phi, parameters["prior_mean"])) / sigma
    count = len(phi)
    own = torch.diag_embed((weight[..., None] * phi.transpose(-1, -2) @ phi).permute(0, 2, 3, 1))  # [b, 16, 16, 4, 4]
    observed = own.permute(0, 3, 1, 4, 2).reshape(count, MEAN_COUNT, MEAN_COUNT)
    # `cholesky` itself would wait for a GPU, to look whether it failed.
    factor, failed = torch.linalg.cholesky_ex(coupled_precision(parameters) + observed)
    factor = factor.masked_fill((failed > 0)[:, None, None], torch.nan)
    projected = (weight * torch.einsum("bitf,bit->bif", phi, error)).reshape(count, MEAN_COUNT, 1)
    shift = torch.cholesky_solve(projected, factor).reshape(count, STATE_COUNT, FEATURE_COUNT)
    mean = parameters["prior_mean"] + sigma * shift
    unit = torch.eye(MEAN_COUNT).to(factor).expand(count, -1, -1)
    whole = torch.cholesky_solve(unit, factor).reshape(count, STATE_COUNT, FEATURE_COUNT, STATE_COUNT, FEATURE_COUNT)
    covariance = torch.diagonal(whole, dim1=1, dim2=3).permute(0, 3, 1, 2)  # of each state [b, 4, 16, 16]
    phi, y, mask = targets
    phi = phi.to(y.dtype).permute(0, 2, 1, 3)
    error = y.permute(0, 2, 1) - torch.einsum("bitf,bif->bit", phi, mean)

    def nll(phi: torch.Tensor, error: torch.Tensor, share: torch.Tensor | float) -> torch.Tensor:
        log_variance = torch.log(share + ((phi @ covariance) * phi).sum(-1)) + 2.0 * parameters["log_sigma"][:, None]
        return (error**2 * torch.exp(-log_variance) + log_variance).permute(0, 2, 1)

    single = nll(phi, error, 1.0) * mask[..., None]
    number = mask.shape[1] // STRETCH
    first = mask[:, ::STRETCH][:, :number]

    def mean_of(values: torch.Tensor) -> torch.Tensor:
        return values[:, :, : number * STRETCH].unflatten(2, (number, STRETCH)).mean(3)

    stretches = nll(mean_of(phi), mean_of(error), torch.exp(2.0 * parameters["log_share"])[:, None])
    return single, stretches * first[..., None]


class TransferObjective:
    """Tasks of the training vehicles, and of others that are watched."""

    def __init__(
        self,
        config: TrainingConfig,
        samples: tuple[Samples, Samples],
        watched: tuple[Samples, Samples] | None,
        vehicle: VehicleParameters,
    ) -> None:
        """Args: samples, watched: (drifting drives, lane drives)."""
        self._config = config
        physical, device = config.physical_inputs, training_device(config.device)
        self._tasks = Tasks(*samples, vehicle, physical, device)
        self._watched = None if watched is None else Tasks(*watched, vehicle, physical, device)
        self.scale = self._tasks.y.std(dim=0)

    def losses(self, parameters: Parameters, generator: np.random.Generator) -> Iterator[tuple[torch.Tensor, int]]:
        """(objective per target, number of targets) of an epoch's batches."""
        for _ in range(self._config.epoch_batches):
            yield self._loss(parameters, self._tasks, self._config.batch_tasks, generator)

    def watch(self, parameters: Parameters) -> dict[str, float]:
        """The objective of the watched vehicles, over always the same tasks."""
        if self._watched is None:
            return {}
        with torch.no_grad():
            loss, _ = self._loss(parameters, self._watched, WATCHED_TASKS, np.random.default_rng(0))
        return {"validation": float(loss), "weight": float(torch.sigmoid(parameters["logit_weight"].detach()).mean())}

    def _loss(
        self, parameters: Parameters, tasks: Tasks, count: int, generator: np.random.Generator
    ) -> tuple[torch.Tensor, int]:
        contexts, targets = zip(*(tasks.draw(generator) for _ in range(count)), strict=True)
        device = tasks.y.device
        index, mask = zip(padded(contexts, device), padded(targets, device), strict=True)
        phi = torch_features(parameters, tasks.inputs[torch.cat([rows.reshape(-1) for rows in index])])
        parts = [
            (part.reshape(*rows.shape, STATE_COUNT, -1), tasks.y[rows] / self.scale, valid)
            for part, rows, valid in zip(phi.split([rows.numel() for rows in index]), index, mask, strict=True)
        ]
        single, stretches = predictive_nll(parameters, parts[0], parts[1])
        number = sum(len(rows) for rows in targets)
        # In the density of the physical units, as the objective over windows.
        loss = (single.sum() + STRETCH * stretches.sum()) / number + 4.0 * torch.log(self.scale).sum()
        return loss, number
