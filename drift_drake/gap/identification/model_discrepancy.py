"""The model discrepancy of a calibrated car: forces that it lacks, and the likelihood's tempering exponent.

Innovations that hang together (smoothed sensors, a tyre of another shape) tell less than their number says. The
likelihood is therefore raised to a power below one, such that scores scatter as the information matrix says (the
magnitude adjustment of Pauli, Racugno and Ventura 2011; Ribatet, Cooley and Davison 2012): those of the parameters,
and those of the free-form forces that a diagnosis looks for a gap with. At that power they find nothing on the logs
that the car was calibrated on.

A power alone makes no difference between a discrepancy that is always there and a new gap. So what functions of the
state tell of the first is learnt, and the power is that of what they leave on blocks that they were not fitted to.

The regressors' derivatives are some two hundred numbers for each measurement: they are made twice, run by run, and only
their sums are kept.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.fit import Derivatives, prior_precision
from drift_drake.gap.estimation.freeform import FORCE_CHANNELS, responses
from drift_drake.gap.estimation.problem import ModelDiscrepancy
from drift_drake.gap.estimation.reduction import FOLDS, measured_fold, with_folds
from drift_drake.gap.estimation.regression import (
    SENSORS,
    Equations,
    equations,
    joined_equations,
    regress,
    summed_equations,
)
from drift_drake.gap.estimation.run_data import RunData
from drift_drake.gap.identification.estimate import Estimate

SHORT_BLOCK = 1.0  # [s]
BLOCKS = 24  # that the longer ones leave of all runs


def block_lengths(runs: Sequence[RunData]) -> list[int]:
    """Rows of a short and of a longer block."""
    period = runs[0].period
    duration = sum(int(np.sum(run.counted)) for run in runs) * period
    return [max(round(block / period), 1) for block in (SHORT_BLOCK, max(duration / BLOCKS, SHORT_BLOCK))]


def squared_influence(
    run: RunData, own: np.ndarray, columns: np.ndarray, e: np.ndarray, covariance: np.ndarray, lengths: Sequence[int]
) -> np.ndarray:
    """Squares, summed over the blocks of one run, of what each block moves the parameters by [lengths, n].

    Args:
        own: derivatives of the run's innovations that count by the parameters in `columns` [count, columns]; e: those
            innovations [count]; covariance: of all parameters [n, n].
    """
    score = (own * e[:, None]).reshape(np.sum(run.counted), np.sum(run.used), -1).sum(axis=1)
    influence = score @ covariance[columns]
    if not len(influence):
        return np.zeros((len(lengths), len(covariance)))
    sums = [np.add.reduceat(influence, np.arange(0, len(influence), length)) for length in lengths]
    return np.array([np.sum(part**2, axis=0) for part in sums])


def deviation_factors(covariance: np.ndarray, information: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Factors of at least one [n] on the standard deviations of the parameters, as innovations hang together.

    The sandwich of Huber 1967, over blocks of time as in Liu and Singh 1992.
    What a prior alone holds is not widened: only what the logs show is known less well.

    Args:
        covariance: without this [n, n]; information: J'J of the logs [n, n]; squares: `squared_influence` of all runs.
    """
    variance = np.diag(covariance)
    unseen = np.maximum(variance - np.diag(covariance @ information @ covariance), 0.0)
    return np.asarray(np.maximum(np.sqrt((unseen + squares.max(axis=0)) / variance), 1.0))


def widening(runs: Sequence[RunData], jacobian: Derivatives, e: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """The same from derivatives of all runs.

    Args:
        jacobian: of the whitened innovations that count; e: those [count]; covariance: without this [n, n].
    """
    parts = zip(runs, jacobian.blocks, jacobian.columns, jacobian.by_run(e), strict=True)
    lengths = block_lengths(runs)
    squares = sum(squared_influence(*part, covariance, lengths) for part in parts)
    return deviation_factors(covariance, jacobian.information, np.asarray(squares))


@dataclasses.dataclass(frozen=True)
class Looks:
    """Sums over all runs of what a diagnosis looks for a gap with, and of what blocks of time move the fit by."""

    by_fold: list[Equations]  # of functions of the state, each fold's
    pulses: Equations
    squared_influence: np.ndarray  # [block lengths, parameters]


def model_discrepancy(found: Estimate) -> tuple[float, ModelDiscrepancy | None]:
    """The tempering exponent of the calibrated car as it is, and the forces that it lacks; None if of no use."""
    theta, prior = found.theta, prior_precision(found.problem, len(found.theta))
    looks = looked_at(found)
    plain, whole = tempering(found, looks), summed_equations(looks.by_fold)
    precision = 1.0 / regress(whole, theta, prior).scales[whole.channel_of] ** 2
    others = [summed_equations([part for i, part in enumerate(looks.by_fold) if i != fold]) for fold in range(FOLDS)]
    corrected = tempering(found, looked_at(found, [held(of, precision) for of in others]))
    return plain, as_discrepancy(
        found, held(whole, precision), whole.channel_of, corrected
    ) if corrected > plain else None


def looked_at(found: Estimate, weights: Sequence[np.ndarray] = ()) -> Looks:
    """The sums of a fit's innovations, or of what functions of the state leave with these weights in each fold."""
    problem, count = found.problem, len(found.theta)
    by_fold, by_pulse = list[Equations](), list[Equations]()
    lengths, covariance = block_lengths(problem.runs), found.covariance
    squares = np.zeros((len(lengths), count))
    kinds = (responses(problem, found, kind) for kind in ("functions", "pulses"))
    for run, functions, pulses in zip(problem.runs, *kinds, strict=True):
        e, of = functions.residual.copy(), measured_fold(run)
        for fold, some in enumerate(weights):
            e[of == fold] += functions.weights[of == fold] @ some
        by_fold = with_folds(by_fold, run, dataclasses.replace(functions, residual=e), count)
        of_run = equations([dataclasses.replace(pulses, residual=e)], count, shared=False)
        by_pulse = [joined_equations([*by_pulse, of_run])]
        squares += squared_influence(run, functions.own, functions.columns, e, covariance, lengths)
    return Looks(by_fold, by_pulse[0], squares)


def held(of: Equations, precision: np.ndarray) -> np.ndarray:
    """Posterior mean of the weights, which the runs share, the car held as it was calibrated."""
    (weights,) = of.weights
    return -np.linalg.solve(weights.hessian + np.diag(precision), weights.gradient)


def as_discrepancy(found: Estimate, weights: np.ndarray, channel_of: np.ndarray, tempering: float) -> ModelDiscrepancy:
    """The weights by name."""
    used = np.all([run.used for run in found.problem.runs], axis=0)
    names = [name for name, there in zip(CHANNELS, used, strict=True) if there]
    offsets = dict(zip(names, weights[channel_of == SENSORS].tolist(), strict=True))
    forces = {c: weights[channel_of == i].tolist() for i, c in enumerate(FORCE_CHANNELS)}
    return ModelDiscrepancy(forces, offsets, tempering)


def tempering(found: Estimate, looks: Looks) -> float:
    """The power, in (0, 1], at which nothing scatters more than it should."""
    prior, by_function = prior_precision(found.problem, len(found.theta)), summed_equations(looks.by_fold)
    most = float(np.mean(deviation_factors(found.covariance, by_function.own, looks.squared_influence) ** 2))
    free = [q for of in (by_function, looks.pulses) for q in scatter(of, found.theta, prior)]
    return float(1.0 / max(1.0, most, *free))


def scatter(of: Equations, theta: np.ndarray, prior: np.ndarray) -> list[float]:
    """Squared scores of the regressors' weights over those of white innovations, the mean of each channel.

    Where it is one or less, evidence prefers a channel without forces. The fit's own parameters theta, of which `prior`
    has the precisions, make up for what they can.
    """
    covariance = np.linalg.inv(of.own + np.diag(prior))
    step = covariance @ (of.gradient + prior * theta)
    scores, information = [], []
    for part in of.weights:
        own_covariance = covariance[np.ix_(part.columns, part.columns)]
        scores.append(part.gradient - part.cross @ step[part.columns])
        information.append(np.diag(part.hessian) - np.sum((part.cross @ own_covariance) * part.cross, axis=1))
    score, own_information, channels = np.concatenate(scores), np.concatenate(information), of.channel_of
    groups = [channels == channel for channel in np.unique(channels)]
    return [
        float(np.sum(score[g] ** 2) / np.sum(own_information[g])) for g in groups if np.sum(own_information[g]) > 0.0
    ]
