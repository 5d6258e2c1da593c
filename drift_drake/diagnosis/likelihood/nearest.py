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


def nearest(problem: Problem, name: str, fit: Fit, nothing: Fit, magnitudes: dict[str, Interval]) -> dict[str, Any]:
    """The best known hypothesis and free forces judged on held-out blocks, for an answer's details.

    `removes` is the hypothesis's share of the nominal car's squared innovations, `free_forces_remove` that of functions
    of the state beside the car without effects.

    Args:
        name: of the hypothesis, "none" if no effect comes nearer than the car as it is; fit: of it; nothing: of the car
            without effects; magnitudes: of the hypothesis.
    """
    before = squares(problem, np.zeros(problem.nuisances), (), np.ones(problem.count, dtype=bool))
    known = sum(
        squares(problem, theta, fit.names, rows)
        for theta, rows in zip(held_out_thetas(problem, fit), folds(problem), strict=True)
    )
    return {
        "name": name,
        "magnitudes": {effect: dataclasses.asdict(m) for effect, m in magnitudes.items()},
        "removes": 1.0 - known / before,
        "free_forces_remove": 1.0 - free_squares(problem, nothing) / before,
    }


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
