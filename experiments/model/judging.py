"""What is said of a model's errors on vehicles that it has not seen."""

from typing import Any

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.features import STATE_COUNT
from drift_drake.drive.learnt.quality import Split, Stepper, adapted, mean_nll, standardized_errors, step_model
from drift_drake.drive.learnt.samples import Samples, concatenate

GAUSSIAN_COVERAGE = (0.6827, 0.9545, 0.9973)  # of 1, 2 and 3 sigma


def step_errors(model: Stepper, samples: Samples) -> Array:
    """One-step errors [n, 6] of a model without uncertainty."""
    x_next = model.step(samples.x, samples.u, samples.u_next, samples.curvature)
    return samples.x_next[:, :6] - x_next[:, :6]


def deviation_coverage(errors: Array, deviations: Array) -> Array:
    """Share of errors within 1, 2 and 3 standard deviations, [3, 4] by state."""
    ratio = np.abs(errors) / deviations
    return np.stack([np.mean(ratio <= k, axis=0) for k in (1.0, 2.0, 3.0)])


def rollout_errors(model: Stepper, drives: list[Samples], steps: int, every: int = 5) -> Array:
    """Errors [n, 6] after `steps` steps under the recorded commands, from a start at every `every`-th sample.

    The model is fed its own predictions; only its first state is measured. Starts too near the end of their drive for
    the whole rollout are left out.
    """
    first, starts = 0, list[int]()
    for drive in drives:
        starts += range(first, first + len(drive.x) - steps + 1, every)
        first += len(drive.x)
    if not starts:
        return np.empty((0, 6))
    samples, rows = concatenate(drives), np.array(starts)
    x = samples.x[rows]
    for step in range(steps):
        x = model.step(x, samples.u[rows + step], samples.u_next[rows + step], samples.curvature[rows + step])
    return samples.x_next[rows + steps - 1, :6] - x[:, :6]


def quality_by_points(model: BayesianModel, vehicles: list[Split], points: tuple[int, ...],
          horizons: tuple[int, ...] = (5, 20)) -> dict[str, Any]:  # fmt: skip
    """Quality against the number of adaptation points, pooled over vehicles.

    Returns:
        for each number of points: "rms" (one-step error by state), "nll", "coverage" (1, 2, 3 sigma by state), and for
        each horizon "rollout_N" (RMS and median size of the error by state after N steps).
    """
    result: dict[str, Any] = {}
    for count in points:
        errors, deviations = [], []
        rollouts: dict[int, list[Array]] = {steps: [] for steps in horizons}
        for split in vehicles:
            posterior = adapted(model, split.adaptation.where(np.arange(count)))
            error, deviation = standardized_errors(model, posterior, concatenate(split.judged))
            errors.append(error)
            deviations.append(deviation)
            for steps in horizons:
                rollouts[steps].append(rollout_errors(step_model(model, posterior), split.judged, steps))
        error, deviation = np.concatenate(errors), np.concatenate(deviations)
        result[str(count)] = {
            "rms": np.sqrt(np.mean(error**2, axis=0)).tolist(),
            "nll": mean_nll(error, deviation),
            "coverage": deviation_coverage(error, deviation).tolist(),
            **{f"rollout_{steps}": rollout_summary(rollouts[steps]) for steps in horizons},
        }
    return result


def judge_stepper(model: Stepper, vehicles: list[Split], horizons: tuple[int, ...] = (5, 20)) -> dict[str, Any]:
    """The same errors of a model that neither adapts nor knows its uncertainty."""
    error = np.concatenate([step_errors(model, concatenate(split.judged)) for split in vehicles])
    return {
        "rms": np.sqrt(np.mean(error[:, :STATE_COUNT] ** 2, axis=0)).tolist(),
        **{
            f"rollout_{steps}": rollout_summary([rollout_errors(model, split.judged, steps) for split in vehicles])
            for steps in horizons
        },
    }


def rollout_summary(parts: list[Array]) -> dict[str, list[float]]:
    """RMS and median size of rollout errors by state; one rollout into a spin can carry an RMS alone."""
    error = np.concatenate(parts)
    return {
        "rms": np.sqrt(np.mean(error**2, axis=0)).tolist(),
        "median": np.median(np.abs(error), axis=0).tolist(),
    }
