"""The misfit of every day that is left in a calibrated car: forces that it lacks, and what one row is then worth.

Innovations that hang together (smoothed sensors, a tyre of another shape) tell less than their number says. The
likelihood is therefore raised to a power below one, such that scores scatter as the information matrix says (the
magnitude adjustment of Pauli, Racugno and Ventura 2011; Ribatet, Cooley and Davison 2012): those of the parameters,
and those of the free-form forces that a diagnosis looks for a gap with. At that power they find nothing on the logs
that the car was calibrated on.

A power alone makes no difference between a misfit that is the same every day and a new one. So what functions of the
state tell of the first is learnt, and the power is that of what they leave on blocks that they were not fitted to.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.estimation.derivatives import Derivatives
from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.estimation.fit import prior_precision
from drift_drake.estimation.freeform import FORCE_CHANNELS, responses
from drift_drake.estimation.problem import Everyday
from drift_drake.estimation.reduction import folds
from drift_drake.estimation.regression import SENSORS, Equations, Responses, equations, regress
from drift_drake.identification.estimate import Estimate
from drift_drake.identification.widening import widening


def everyday_misfit(found: Estimate) -> tuple[float, Everyday | None]:
    """The row weight of the calibrated car as it is, and the forces that it lacks; None if they bring nothing."""
    problem, theta, prior = found.problem, found.theta, prior_precision(found.problem, len(found.theta))
    by_function, by_pulse = list(responses(problem, found, "functions")), list(responses(problem, found, "pulses"))
    plain = row_weight(found, by_function, by_pulse)
    of = equations(by_function, len(theta), shared=True)
    precision = 1.0 / regress(of, theta, prior).scales[of.channel_of] ** 2
    edges = np.cumsum([len(run.residual) for run in by_function])[:-1]
    left = [run.residual.copy() for run in by_function]
    for rows in folds(problem):
        parts = np.split(rows, edges)
        kept = [run.rows(~part) for run, part in zip(by_function, parts, strict=True)]
        weights = held(equations(kept, len(theta), shared=True), precision)
        for run, part, into in zip(by_function, parts, left, strict=True):
            into[part] += run.weights[part] @ weights
    beside = row_weight(found, replaced(by_function, left), replaced(by_pulse, left))
    return plain, as_everyday(found, held(of, precision), of.channel_of, beside) if beside > plain else None


def held(of: Equations, precision: np.ndarray) -> np.ndarray:
    """Posterior mean of the weights, which the runs share, the car held as it was calibrated."""
    (weights,) = of.weights
    return -np.linalg.solve(weights.hessian + np.diag(precision), weights.gradient)


def replaced(runs: Sequence[Responses], residuals: Sequence[np.ndarray]) -> list[Responses]:
    """The responses with other innovations."""
    return [dataclasses.replace(run, residual=e) for run, e in zip(runs, residuals, strict=True)]


def as_everyday(found: Estimate, weights: np.ndarray, channel_of: np.ndarray, row_weight: float) -> Everyday:
    """The weights by name."""
    used = np.all([run.used for run in found.problem.runs], axis=0)
    names = [name for name, there in zip(CHANNELS, used, strict=True) if there]
    offsets = dict(zip(names, weights[channel_of == SENSORS].tolist(), strict=True))
    forces = {c: weights[channel_of == i].tolist() for i, c in enumerate(FORCE_CHANNELS)}
    return Everyday(forces, offsets, row_weight)


def row_weight(found: Estimate, by_function: Sequence[Responses], by_pulse: Sequence[Responses]) -> float:
    """The power, in (0, 1], at which nothing scatters more than it should.

    Args:
        by_function, by_pulse: responses to the regressors that a diagnosis looks for a gap with.
    """
    count = len(found.theta)
    prior = prior_precision(found.problem, count)
    jacobian = Derivatives([run.own for run in by_function], [run.columns for run in by_function], count)
    e = np.concatenate([run.residual for run in by_function])
    most = float(np.mean(widening(found.problem.runs, jacobian, e, found.covariance) ** 2))
    looks = equations(by_function, count, shared=True), equations(by_pulse, count, shared=False)
    free = [q for of in looks for q in scatter(of, found.theta, prior)]
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
        told = covariance[np.ix_(part.columns, part.columns)]
        scores.append(part.gradient - part.cross @ step[part.columns])
        information.append(np.diag(part.hessian) - np.sum((part.cross @ told) * part.cross, axis=1))
    return mean_squares(np.concatenate(scores), np.concatenate(information), of.channel_of)


def mean_squares(score: np.ndarray, information: np.ndarray, channel_of: np.ndarray) -> list[float]:
    """Of each channel's scores, over their information."""
    groups = [channel_of == channel for channel in np.unique(channel_of)]
    seen = [group for group in groups if np.sum(information[group]) > 0.0]
    return [float(np.sum(score[group] ** 2) / np.sum(information[group])) for group in seen]
