"""How far the gap shrinks on data that was not used to fit: leave-runs-out, with an interval."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.diagnosis.fit import Fit, fit
from drift_drake.diagnosis.horizons import HORIZONS, JUDGED, STATES, predictions
from drift_drake.diagnosis.problem import NUISANCES, SETTLING_TIME, Problem, RunData
from drift_drake.diagnosis.search import coarse

BLOCK = 10  # restarts that are drawn together: a second
RESAMPLES = 400
WORST = 9e4  # noise variances at which a square error is capped: a prediction that far off is lost, however far


@dataclasses.dataclass(frozen=True)
class Reduction:
    """Share of the explainable gap that effects remove on runs that were not fitted."""

    estimate: float
    low: float
    high: float
    by_state: dict[str, float]
    by_horizon: dict[str, float]
    before: list[float]  # mean squares by horizon, in noise variances
    after: list[float]
    floor: list[float]


def halves(problem: Problem) -> Problem:
    """A single run as two, so that one can be left out."""
    if len(problem.runs) > 1:
        return problem
    run = problem.runs[0]
    middle = len(run.y) // 2
    return problem.replace(runs=[_cut(run, 0, middle, "first half"), _cut(run, middle, len(run.y), "second half")])


def _cut(run: RunData, start: int, stop: int, label: str) -> RunData:
    counted = run.counted[start:stop].copy()
    counted[: int(SETTLING_TIME / run.period)] = False
    return dataclasses.replace(
        run,
        name=f"{run.name}, {label}",
        y=run.y[start:stop],
        delta=run.delta[start:stop],
        tau=run.tau[start:stop],
        counted=counted,
    )


def _own(theta: np.ndarray, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Tolerances and magnitudes of a parameter vector, without what belongs to runs."""
    return theta[: len(NUISANCES)], theta[len(theta) - len(names) :]


def _assemble(tolerances: np.ndarray, runs: int, magnitudes: np.ndarray) -> np.ndarray:
    return np.concatenate([tolerances, np.zeros(2 * runs), magnitudes])


def square_errors(problem: Problem, names: Sequence[str], fitted: Fit, held_out: bool) -> list[np.ndarray]:
    """Squared prediction errors [starts, horizons, states] of each run under effects fitted without that run.

    With `held_out` false the fit to all runs is used for each.
    """
    problem = halves(problem)
    tolerances, magnitudes = _own(fitted.theta, names)
    out = []
    for i, run in enumerate(problem.runs):
        if held_out:
            others = problem.replace(runs=[other for j, other in enumerate(problem.runs) if j != i])
            others = others.replace(exactness=fitted.exactness)
            start = _assemble(tolerances, len(others.runs), magnitudes)
            again = fit(others, names, start, iterations=4)
            theta = _assemble(again.theta[: len(NUISANCES)], 1, again.theta[again.nuisances :])
        else:
            theta = _assemble(tolerances, 1, magnitudes)
        alone = coarse(problem.replace(runs=[run]))
        out.append(np.minimum(predictions(alone, theta, names, 0).squares, WORST))
    return out


def nominal_errors(problem: Problem, fitted: Fit | None) -> list[np.ndarray]:
    """The same under the car without effects; its tolerances as fitted beside the effects, or nominal with None."""
    problem = halves(problem)
    tolerances = np.zeros(len(NUISANCES)) if fitted is None else fitted.theta[: len(NUISANCES)]
    out = []
    for run in problem.runs:
        alone = coarse(problem.replace(runs=[run]))
        out.append(np.minimum(predictions(alone, _assemble(tolerances, 1, np.zeros(0)), (), 0).squares, WORST))
    return out


def reduction(problem: Problem, fitted: Fit, floor_fit: Fit, seed: int = 0) -> Reduction:
    """The share 1 - (after - floor) / (before - floor) at half a second, with a 95 % block-bootstrap interval.

    Args:
        fitted: the effects whose share it is; floor_fit: the best fit to all runs, whose errors are the floor.
    """
    if not fitted.names:
        return Reduction(0.0, 0.0, 0.0, {}, {}, [], [], [])
    before = nominal_errors(problem, fitted)
    after = square_errors(problem, fitted.names, fitted, held_out=True)
    floor = square_errors(problem, floor_fit.names, floor_fit, held_out=False)
    blocks = np.concatenate([_blocks(b, a, f) for b, a, f in zip(before, after, floor, strict=True)])
    rng = np.random.default_rng(seed)
    draws = rng.integers(0, len(blocks), (RESAMPLES, len(blocks)))
    shares = np.array([_share(blocks[d].sum(axis=0)) for d in draws])
    whole = [np.concatenate(part) for part in (before, after, floor)]
    by_state = {
        name: _share(np.array([np.nansum(part[:, JUDGED, i]) for part in whole]))
        for i, name in enumerate(STATES)
        if np.any(np.isfinite(whole[0][:, JUDGED, i]))
    }
    by_horizon = {
        f"{h:g} s": _share(np.array([np.nansum(part[:, i]) for part in whole])) for i, h in enumerate(HORIZONS)
    }
    means = [[float(np.nanmean(part[:, i])) for i in range(len(HORIZONS))] for part in whole]
    low, high = np.quantile(shares, [0.025, 0.975])
    estimate = _share(blocks.sum(axis=0))
    return Reduction(estimate, min(float(low), estimate), max(float(high), estimate), by_state, by_horizon, *means)


def _blocks(before: np.ndarray, after: np.ndarray, floor: np.ndarray) -> np.ndarray:
    """Sums of squares [blocks, 3] over a second of restarts each."""
    sums = np.stack([np.nansum(part[:, JUDGED], axis=-1) for part in (before, after, floor)], axis=-1)
    edges = np.arange(0, len(sums), BLOCK)
    return np.asarray(np.add.reduceat(sums, edges, axis=0))


def _share(sums: np.ndarray) -> float:
    """The share of the gap removed from sums (before, after, floor); zero where there is no gap."""
    before, after, floor = (float(s) for s in sums)
    return float(np.clip(1.0 - (after - floor) / (before - floor), -1.0, 1.0)) if before > floor else 0.0
