"""How good a learnt model is on vehicles it has not seen: errors, rollouts, calibration, against adaptation points."""

import dataclasses
from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel, PathStep, regression_points
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.features import STATE_COUNT
from drift_drake.drive.learnt.posterior import Posterior, mahalanobis, predict, update_all
from drift_drake.drive.learnt.samples import Samples, concatenate

SAMPLE_WEIGHTS = (1.0, 0.7, 0.5, 0.3, 0.2, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02)
ADAPTED_TO = (10, 100)  # samples, after which a weight is judged


class Stepper(Protocol):
    """Anything that steps the six states, or them and the lagged commands, over an array of points."""

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        """x_next [n, 6 or 8] for x [n, 8]."""


class Split(NamedTuple):
    """One vehicle's samples: those it may adapt to, in the order driven, and the drives it is judged by."""

    adaptation: Samples
    judged: list[Samples]


def split_vehicle(samples: Samples, points: int, rotation: int = 0) -> Split:
    """Whole drives for adaptation until `points` samples are there; the other drives judge.

    Args:
        samples: of one vehicle; rotation: which drive comes first.

    Raises:
        ValueError: the vehicle's drives are too few for both.
    """
    drives = samples.drives()
    rotation %= len(drives)
    drives = drives[rotation:] + drives[:rotation]
    counts = np.cumsum([len(drive.x) for drive in drives])
    used = int(np.searchsorted(counts, points)) + 1
    if used >= len(drives):
        raise ValueError(f"{counts[-1]} samples in {len(drives)} drives are too few to adapt to {points} and judge")
    adaptation = concatenate(drives[:used])
    return Split(adaptation.where(np.arange(points)), drives[used:])


def learn(model: BayesianModel, belief: Posterior, samples: Samples) -> Posterior:
    """The belief after samples (section II of the paper).

    Args:
        model: the learnt model; belief: before; its mean is [4, 16], of the rates of r, v, beta, omega_r (SI).
        samples: n transitions in steps of 0.1 s: x [n, states], u [n, 2] in [rad, N m].

    Examples:
        >>> belief = learn(model, model.prior(), samples_from_log(table, None, vehicle=0, drive=0))
    """
    phi, y = regression_points(model, samples.x, samples.u, samples.u_next, samples.x_next)
    return update_all(belief, model.sigma, phi, y, model.sample_weight)


def squared_distance(
    model: BayesianModel, belief: Posterior, x: Array, u: Array, u_next: Array, x_next: Array
) -> float:
    """Squared Mahalanobis distance of one sample from what a belief predicts (eq. 7), of four degrees of freedom.

    Args:
        x, x_next: states and lagged commands at both ends of a step [8]; u, u_next: commands there [2].
    """
    phi, y = regression_points(model, x, u, u_next, x_next)
    return float(mahalanobis(predict(belief, model.sigma, phi), y) ** 2)


def squared_distances(model: BayesianModel, belief: Posterior, samples: Samples) -> Array:
    """Squared Mahalanobis distances [n] of a drive's samples, each by the belief that has learnt those before it."""
    out = np.empty(len(samples.vehicle))
    for i in range(len(out)):
        out[i] = squared_distance(model, belief, samples.x[i], samples.u[i], samples.u_next[i], samples.x_next[i])
        belief = learn(model, belief, samples.where(np.array([i])))
    return out


def adapted(model: BayesianModel, samples: Samples) -> Posterior:
    """The model's posterior after samples."""
    return learn(model, model.prior(), samples)


def standardized_errors(model: BayesianModel, posterior: Posterior, samples: Samples) -> tuple[Array, Array]:
    """One-step (errors [n, 4], predicted standard deviations [n, 4]) of the learnt states."""
    phi, y = regression_points(model, samples.x, samples.u, samples.u_next, samples.x_next)
    prediction = predict(posterior, model.sigma, phi)
    return y - prediction.mean, np.sqrt(prediction.variance)


def mean_nll(errors: Array, deviations: Array) -> float:
    """Mean of error^2 / Sigma + log Sigma over samples, summed over states: the training objective per sample."""
    return float(np.mean(np.sum((errors / deviations) ** 2 + 2.0 * np.log(deviations), axis=1)))


def predicted_windows(
    model: Stepper, x: Array, commands: Array, starts: NDArray[np.intp], stride: int, steps: int
) -> Iterator[Array]:
    """States [windows, 8] after each of so many steps along a log on a straight path, its commands known.

    Args:
        x: at the starts [windows, 8]; commands: of the log [rows, 2]; starts: rows [windows]; stride: rows of a step.
    """
    for step in range(steps):
        rows = starts + step * stride
        x = model.step(x, commands[rows], commands[rows + stride], np.zeros(len(x)))
        yield x


def step_model(model: BayesianModel, posterior: Posterior, path_step: PathStep = "trapezoid") -> BayesianStepModel:
    """A posterior mean's one-step model (section II of the paper): x [n], u (delta [rad], tau [N m]) to x 0.1 s later.

    Args:
        model: the learnt model; posterior: its belief of the car at hand;
        path_step: how e and dphi take the step: from its start and its end ("trapezoid"), or from its start ("euler").

    Examples:
        >>> mpc = Mpc(step_model(model, model.prior()), car, reference)
    """
    return BayesianStepModel(model.network, posterior.mean, model.vehicle.constants(), path_step)


def choose_sample_weight(model: BayesianModel, samples: Samples) -> float:
    """The weight of a sample, for all states, with which the model predicts other drives of the same vehicles best.

    Each vehicle adapts to its first drives and is judged by the others (each of its drives coming first once); the
    objective is the mean of error^2 / Sigma + log Sigma after each of `ADAPTED_TO` samples.
    """
    splits = []
    for vehicle in np.unique(samples.vehicle):
        own = samples.of_vehicle(vehicle)
        splits += [split_vehicle(own, max(ADAPTED_TO), rotation) for rotation in range(len(own.drives()))]
    losses = []
    for weight in SAMPLE_WEIGHTS:
        weighted = dataclasses.replace(model, sample_weight=np.full(STATE_COUNT, weight))
        total = 0.0
        for split in splits:
            judged = concatenate(split.judged)
            for count in ADAPTED_TO:
                posterior = adapted(weighted, split.adaptation.where(np.arange(count)))
                total += mean_nll(*standardized_errors(weighted, posterior, judged))
        losses.append(total)
    return SAMPLE_WEIGHTS[int(np.argmin(losses))]
