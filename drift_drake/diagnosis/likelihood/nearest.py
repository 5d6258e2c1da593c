"""What an engineer is left with where no known cause explains the gap: the nearest one, and what free forces reach.

Both are judged alike: by how much they take off the nominal car's squared innovations on blocks of the runs that they
were not fitted to.
"""

import dataclasses
from typing import Any

import numpy as np

from drift_drake.estimation.fit import Fit, prior_precision
from drift_drake.estimation.freeform import responses
from drift_drake.estimation.interval import Interval
from drift_drake.estimation.problem import Problem, filter_case, flat
from drift_drake.estimation.reduction import folds, held_out_thetas, with_folds
from drift_drake.estimation.regression import Equations, left_over, regress, solve_equations, summed_equations


@dataclasses.dataclass(frozen=True)
class Nearest:
    """The best known hypothesis beside a verdict of `unknown`, and the free forces' ceiling."""

    name: str  # "none" if no effect comes nearer than the car as it is
    magnitudes: dict[str, Interval]
    removes: float  # share of the nominal car's squared innovations, on blocks that were not fitted
    free_forces_remove: float  # the same of functions of the state beside the car without effects

    def as_data(self) -> dict[str, Any]:
        """Plain data, for an answer's details."""
        return dataclasses.asdict(self)


def nearest(problem: Problem, name: str, fit: Fit, nothing: Fit, magnitudes: dict[str, Interval]) -> Nearest:
    """Judges the best known hypothesis and free forces on held-out blocks.

    Args:
        fit: of the best known hypothesis; nothing: of the car without effects.
    """
    before = squares(problem, np.zeros(problem.nuisances), (), all_rows(problem))
    known = sum(
        squares(problem, theta, fit.names, rows)
        for theta, rows in zip(held_out_thetas(problem, fit), folds(problem), strict=True)
    )
    return Nearest(name, magnitudes, 1.0 - known / before, 1.0 - free_squares(problem, nothing) / before)


def all_rows(problem: Problem) -> np.ndarray:
    """Every measurement that counts [count]."""
    return np.ones(problem.count, dtype=bool)


def squares(problem: Problem, theta: np.ndarray, names: tuple[str, ...], rows: np.ndarray) -> float:
    """Sum of the squared innovations of some measurements [count] under parameters."""
    e = flat(problem, filter_case(problem, theta, names).innovations)[rows]
    return float(e @ e)


def free_squares(problem: Problem, fit: Fit) -> float:
    """Squared innovations that functions of the state leave beside a fit, each fold's under weights from the others."""
    prior, by_fold = prior_precision(problem, len(fit.theta)), list[Equations]()
    for run, measured in zip(problem.runs, responses(problem, fit, "functions"), strict=True):
        by_fold = with_folds(by_fold, run, measured, len(fit.theta))
    whole = summed_equations(by_fold)
    precision = 1.0 / regress(whole, fit.theta, prior).scales[whole.channel_of] ** 2
    left = 0.0
    for fold, held_out in enumerate(by_fold):
        others = summed_equations([part for i, part in enumerate(by_fold) if i != fold])
        found = solve_equations(others, others.gradient + prior * fit.theta, prior, precision)
        left += left_over(held_out, found.own, found.weights)
    return left
