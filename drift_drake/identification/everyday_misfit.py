"""The misfit of every day that is left in a calibrated car: forces that it lacks, and what one row is then worth.

Innovations that hang together (smoothed sensors, a tyre of another shape) tell less than their number says. The
likelihood is therefore raised to a power below one, such that scores scatter as the information matrix says (the
magnitude adjustment of Pauli, Racugno and Ventura 2011; Ribatet, Cooley and Davison 2012): those of the parameters,
and those of the free-form forces that a diagnosis looks for a gap with. At that power they find nothing on the logs
that the car was calibrated on.

A power alone makes no difference between a misfit that is the same every day and a new one. So what functions of the
state tell of the first is learnt, and the power is that of what they leave on blocks that they were not fitted to.
"""

from collections.abc import Sequence

import numpy as np

from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.estimation.fit import prior_precision
from drift_drake.estimation.freeform import FORCE_CHANNELS, SENSORS, Equations, Responses, equations, regress, responses
from drift_drake.estimation.problem import Everyday
from drift_drake.estimation.reduction import folds
from drift_drake.identification.estimate import Estimate
from drift_drake.identification.widening import widening


def everyday_misfit(found: Estimate) -> tuple[float, Everyday | None]:
    """The row weight of the calibrated car as it is, and the forces that it lacks; None if they bring nothing."""
    problem = found.problem
    by_function, by_pulse = responses(problem, found, "functions"), responses(problem, found, "pulses")
    plain = row_weight(found, [by_function, by_pulse])
    runs, channel_of = by_function
    scales = regress(problem, found, equations(problem, found, runs, channel_of)).scales
    precision = 1.0 / scales[channel_of] ** 2
    edges = np.cumsum([len(run.residual) for run in runs])[:-1]
    left = [run.residual.copy() for run in runs]
    for rows in folds(problem):
        parts = np.split(rows, edges)
        weights = held(found, [run.rows(~part) for run, part in zip(runs, parts, strict=True)], channel_of, precision)
        for run, part, into in zip(runs, parts, left, strict=True):
            into[part] += run.weights[part] @ weights
    weights = held(found, runs, channel_of, precision)
    beside = row_weight(found, [(replaced(some, left), of) for some, of in (by_function, by_pulse)])
    return plain, as_everyday(found, weights, channel_of, beside) if beside > plain else None


def held(found: Estimate, runs: Sequence[Responses], channel_of: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """Posterior mean of the weights, the car held as it was calibrated."""
    of = equations(found.problem, found, runs, channel_of)
    return -np.linalg.solve(of.hessian[of.own :, of.own :] + np.diag(precision), of.gradient[of.own :])


def replaced(runs: Sequence[Responses], residuals: Sequence[np.ndarray]) -> list[Responses]:
    """The responses with other innovations."""
    return [Responses(run.weights, run.own, e) for run, e in zip(runs, residuals, strict=True)]


def as_everyday(found: Estimate, weights: np.ndarray, channel_of: np.ndarray, row_weight: float) -> Everyday:
    """The weights by name."""
    used = np.all([run.used for run in found.problem.runs], axis=0)
    names = [name for name, there in zip(CHANNELS, used, strict=True) if there]
    offsets = dict(zip(names, weights[channel_of == SENSORS].tolist(), strict=True))
    forces = {c: weights[channel_of == i].tolist() for i, c in enumerate(FORCE_CHANNELS)}
    return Everyday(forces, offsets, row_weight)


def row_weight(found: Estimate, looks: Sequence[tuple[list[Responses], np.ndarray]]) -> float:
    """The power, in (0, 1], at which nothing scatters more than it should.

    Args:
        looks: responses to the regressors that a diagnosis looks for a gap with.
    """
    prior = prior_precision(found.problem, len(found.theta))
    runs = looks[0][0]
    jacobian, e = (np.concatenate(parts) for parts in zip(*((run.own, run.residual) for run in runs), strict=True))
    most = float(np.mean(widening(found.problem.runs, jacobian, e, found.covariance) ** 2))
    free = [scatter(equations(found.problem, found, *look), prior) for look in looks]
    return float(1.0 / max(1.0, most, *(q for part in free for q in part)))


def scatter(of: Equations, prior: np.ndarray) -> list[float]:
    """Squared scores of the regressors' weights over those of white innovations, the mean of each channel.

    Where it is one or less, evidence prefers a channel without forces. The fit's own parameters, of which `prior` has
    the precisions, make up for what they can.
    """
    own = of.own
    solved = np.linalg.solve(of.hessian[:own, :own] + np.diag(prior), of.hessian[:own, own:])
    score = of.gradient[own:] - solved.T @ of.gradient[:own]
    information = np.diag(of.hessian)[own:] - np.sum(of.hessian[:own, own:] * solved, axis=0)
    groups = [of.channel_of == channel for channel in np.unique(of.channel_of)]
    seen = [group for group in groups if np.sum(information[group]) > 0.0]
    return [float(np.sum(score[group] ** 2) / np.sum(information[group])) for group in seen]
