"""Which lags of steering and torque a car has, asked of its drives: a bank of them, weighed by their evidence.

Under each pair of lags (`command_lag`) the learnt model is a Bayesian linear regression of its own, whose evidence,
what it expected of the samples before it had learnt from them, is in closed form (Bishop 2006, section 3.5.1). The last
layer cannot learn a lag far from a typical car's: its features are of commands as a typical car follows them.
"""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.bayesian_step import regression_points
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import LAG
from drift_drake.drive.learnt.posterior import Posterior, update_all
from drift_drake.drive.learnt.samples import Samples

STEERING = (0.02, 0.03, float(LAG[0]), 0.07, 0.1, 0.15, 0.2, 0.25, 0.3)  # [s]
TORQUE = (0.02, 0.03, 0.05, 0.075, float(LAG[1]), 0.15, 0.2, 0.3)
_COARSE = product((0.02, 0.05, 0.1, 0.15, 0.2, 0.3), (0.03, 0.1, 0.2))
BANK = np.array([LAG, *(pair for pair in _COARSE if pair != tuple(LAG))])
"""[18, 2] [s], for learning while driving; a typical car's first. What is between two the last layer takes."""


def log_evidence(before: Posterior, after: Posterior, sigma: Array, y: Array, weight: Array) -> float:
    """Log density [nat] of residuals y [n, 4] under the belief before them, less what does not depend on the features.

    A sample that counts with a weight w [4] enters by the w-th power of its density, as it does in the posterior.
    """
    squares = np.sum(weight * (y / sigma) ** 2)
    quadratic = [np.sum(belief.q * belief.mean / sigma[:, None]) for belief in (before, after)]
    volume = [np.linalg.slogdet(belief.covariance)[1] for belief in (before, after)]
    return float(0.5 * (volume[1] - volume[0] - squares - quadratic[0] + quadratic[1]))


class UnderLags(NamedTuple):
    """What drives teach under one pair of lags."""

    model: BayesianModel  # with these lags
    posterior: Posterior
    evidence: float  # see `log_evidence`


def under_lags(model: BayesianModel, samples_of: Callable[[Array], Samples]) -> list[UnderLags]:
    """What drives teach a model under each pair of lags, its own steering lag among them.

    Args:
        samples_of: the drives' samples, their lagged commands behind lags [2] [s].
    """
    found, prior = [], model.prior()
    for pair in product(sorted({*STEERING, float(model.lag[0])}), TORQUE):
        under = model.with_lag(np.array(pair))
        samples = samples_of(under.lag)
        phi, y = regression_points(under, samples.x, samples.u, samples.u_next, samples.x_next)
        after = update_all(prior, model.sigma, phi, y, model.sample_weight)
        found.append(UnderLags(under, after, log_evidence(prior, after, model.sigma, y, model.sample_weight)))
    return found


def learn_with_lags(model: BayesianModel, samples_of: Callable[[Array], Samples]) -> tuple[BayesianModel, Posterior]:
    """(the model with the lags under which drives are likeliest, its posterior after them); see `under_lags`.

    Args:
        model: the learnt model; samples_of: the drives' samples under lags [2] of steering and torque, in s.

    Examples:
        >>> samples_of = lambda lag: samples_from_log(table, None, vehicle=0, drive=0, lag=lag)
        >>> lagged, belief = learn_with_lags(model, samples_of)
    """
    best = max(under_lags(model, samples_of), key=lambda under: under.evidence)
    return best.model, best.posterior
