"""How well cars predict parts of the logs that were not fitted, by state and horizon."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.gap.estimation.problem import NUISANCES, Problem
from drift_drake.gap.estimation.reduction import (
    BLOCK,
    HORIZONS,
    JUDGED,
    STATES,
    errors_of,
    fold_of,
    resampled,
    start_rows,
)

LONGEST_JUDGED = HORIZONS[JUDGED]  # [s]
FOLD = 0  # that is held out: every fourth block


def in_fold(problem: Problem) -> list[np.ndarray]:
    """Rows [rows] of each run that are held out."""
    return [fold_of(run) == FOLD for run in problem.runs]


def without_fold(problem: Problem) -> Problem:
    """The problem with the held-out rows uncounted."""
    runs = [
        dataclasses.replace(run, counted=run.counted & ~held)
        for run, held in zip(problem.runs, in_fold(problem), strict=True)
    ]
    return problem.replace(runs=runs)


@dataclasses.dataclass(frozen=True)
class HeldOut:
    """Root mean square errors [horizons][states] in the states' units, and their change at the judged horizon."""

    horizons: tuple[float, ...]
    states: tuple[str, ...]
    before: list[list[float]]
    after: list[list[float]]
    ratio: float  # of the errors after to those before at the judged horizon, states in noise levels
    low: float  # 95 %
    high: float
    by_state: list[tuple[float, float]]  # the same ratio's 95 % interval, state by state

    @property
    def judged(self) -> float:
        """The horizon [s] that the ratio is of: half a second, or less for a small car."""
        return min(self.horizons[-1], LONGEST_JUDGED)

    @property
    def worse(self) -> tuple[str, ...]:
        """States that are predicted worse at the judged horizon, beyond what the logs leave open."""
        return tuple(state for state, (low, _) in zip(self.states, self.by_state, strict=True) if low > 1.0)


def judged_states(problem: Problem) -> list[int]:
    """States that all runs measure and the car itself predicts: where the rim speed is fed, not the speeds."""
    fed = ("v", "omega_r") if problem.rim_fed else ()
    return [i for i, s in enumerate(STATES) if s not in fed and all(run.used[i] for run in problem.runs)]


def squares_of(problem: Problem, theta: np.ndarray, names: Sequence[str], held: bool) -> list[np.ndarray]:
    """Squared errors [starts, horizons, states], in noise variances, of starts inside or outside the held-out rows."""
    errors = errors_of(problem, theta, names)
    return [
        part[rows[start_rows(run)] == held][..., judged_states(problem)]
        for run, rows, part in zip(problem.runs, in_fold(problem), errors, strict=True)
    ]


def judged_by(
    validation: Problem, fitted: Problem, before: tuple[np.ndarray, Sequence[str]],
    after: tuple[np.ndarray, Sequence[str]],
) -> HeldOut:  # fmt: skip
    """Errors on runs of which nothing was fitted.

    Args:
        validation: these runs; fitted: the others; before, after: theta of `fitted` and effects of two cars.
    """
    squares = []
    for theta, names in (before, after):
        car, effects = theta[: len(NUISANCES)], theta[fitted.nuisances :]
        own = np.concatenate([car, np.zeros(validation.nuisances - len(NUISANCES)), effects])
        errors = errors_of(validation, own, names)
        squares.append([part[..., judged_states(validation)] for part in errors])
    return held_out_rows(validation, *squares)


def held_out_error(squares: Sequence[np.ndarray]) -> float:
    """Mean square error half a second ahead, over the states."""
    return float(np.nanmean(np.concatenate(squares)[:, JUDGED]))


def held_out_rows(problem: Problem, before: Sequence[np.ndarray], after: Sequence[np.ndarray]) -> HeldOut:
    """The held-out figure from squared errors of two cars, with an interval from resampled blocks."""
    used = judged_states(problem)
    sums = np.concatenate([_blocks(b, a) for b, a in zip(before, after, strict=True) if len(b)])
    sums = sums[sums[:, 0].sum(axis=-1) > 0.0]  # a run's last restarts have no row half a second on: no blocks to draw
    by_state = resampled(sums)
    totals = by_state.sum(axis=-1)
    low, high = np.quantile(np.sqrt(totals[:, 1] / totals[:, 0]), [0.025, 0.975])
    total = sums.sum(axis=(0, 2))
    ends = np.quantile(np.sqrt(by_state[:, 1] / by_state[:, 0]), [0.025, 0.975], axis=0).T

    def table(parts: Sequence[np.ndarray]) -> list[list[float]]:
        rms = np.sqrt(np.nanmean(np.concatenate(parts), axis=0)) * problem.noise[used]
        return [[float(q) for q in row] for row in rms]

    return HeldOut(HORIZONS, tuple(STATES[i] for i in used), table(before), table(after),
                   float(np.sqrt(total[1] / total[0])), float(low), float(high),
                   [(float(a), float(b)) for a, b in ends])  # fmt: skip


def _blocks(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Sums of squares [blocks, 2, states] half a second ahead, over a block of restarts each."""
    sums = np.stack([np.nan_to_num(part[:, JUDGED]) for part in (before, after)], axis=1)
    return np.asarray(np.add.reduceat(sums, np.arange(0, len(sums), BLOCK), axis=0))
