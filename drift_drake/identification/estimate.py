"""The most likely car: the filter's likelihood over all unknowns, its noise scaled to what the innovations show."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.estimation.fit import Linearised, minimise, prior_precision
from drift_drake.estimation.problem import Problem, filter_case, flat

ROUNDS = 5  # of fits, each with the noise that the last one's innovations ask for
SETTLED = 0.02  # of the noise's scale
ITERATIONS = 8  # of a fit
ENOUGH = 0.5  # [nats] of a step that is not worth another


@dataclasses.dataclass(frozen=True)
class Trust:
    """How far the filter trusts the sensors and the model: factors on both standard deviations."""

    noise: float
    process: float


def trusted(problem: Problem, trust: Trust) -> Problem:
    """The problem with its noise levels scaled."""
    return problem.replace(noise=problem.noise * trust.noise, process=problem.process * trust.process**2)


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A mode of the posterior, and the noise that goes with it."""

    names: tuple[str, ...]
    theta: np.ndarray  # as in `diagnosis.problem`
    at: Linearised
    problem: Problem  # scaled by `trust`
    trust: Trust

    @property
    def covariance(self) -> np.ndarray:
        """Of theta, as if the innovations were white and the model right [n, n]."""
        return np.linalg.inv(self.at.jacobian.information + np.diag(prior_precision(self.problem, len(self.theta))))


def mean_square(problem: Problem, theta: np.ndarray, names: Sequence[str]) -> float:
    """Of the innovations that count."""
    return float(np.mean(flat(problem, filter_case(problem, theta, names).innovations) ** 2))


def estimate(problem: Problem, names: Sequence[str], theta: np.ndarray, deafness: float) -> Estimate:
    """Fits under noise whose common scale is such that the innovations have mean square one.

    Args:
        problem: with noise as the logs and the process noise of a well modelled car have it.
        theta: to start from; deafness: noise of the sensors beside that of the process, times as stated.
    """
    scale = 1.0
    for round_number in range(ROUNDS):
        trust = Trust(scale * deafness, scale)
        held = trusted(problem, trust)
        if round_number > 0:
            at = minimise(held, names, theta, ITERATIONS, ENOUGH)
            theta = at.theta
            found = float(np.mean(flat(held, at.filtered.innovations) ** 2))
        else:
            found = mean_square(held, theta, names)
        scale *= float(np.sqrt(found))
        if round_number > 0 and abs(np.sqrt(found) - 1.0) < SETTLED:
            break
    return Estimate(tuple(names), theta, at, held, trust)
