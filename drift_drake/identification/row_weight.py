"""What one row of a car's logs is worth, beside a row of a car that the model follows but for white noise.

Innovations that hang together (smoothed sensors, a tyre of another shape) tell less than their number says. The
likelihood is therefore raised to a power below one, such that scores scatter as the information matrix says (the
magnitude adjustment of Pauli, Racugno and Ventura 2011; Ribatet, Cooley and Davison 2012), not only those of the
parameters but also those of the free-form forces that a diagnosis looks for a gap with. At that power they find
nothing on the logs that the car was calibrated on: the misfit of every day is no gap.
"""

import numpy as np

from drift_drake.diagnosis.fit import prior_precision
from drift_drake.diagnosis.freeform import Equations, equations_of
from drift_drake.identification.estimate import Estimate


def row_weight(found: Estimate, widened: np.ndarray) -> float:
    """The row weight, in (0, 1].

    Args:
        found: the calibrated car on its logs; widened: factors on the standard deviations of its parameters that the
            scatter of their scores asks for (`widening`).
    """
    prior = prior_precision(found.problem, len(found.theta))
    free = [scatter(equations_of(found.problem, found, kind), prior) for kind in ("pulses", "functions")]
    return float(1.0 / max(1.0, np.mean(widened**2), *free[0], *free[1]))


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
