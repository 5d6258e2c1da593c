"""How far the gap shrinks on parts of runs that were not used to fit, with an interval."""

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import Fit, minimise, sensitivity
from drift_drake.gap.estimation.freeform import with_more_process_noise
from drift_drake.gap.estimation.observed import filtered_states
from drift_drake.gap.estimation.problem import Gains, Problem
from drift_drake.gap.estimation.regression import Equations, Responses, equations, summed_equations
from drift_drake.gap.estimation.roll_outs import roll_out
from drift_drake.gap.estimation.run_data import RunData
from drift_drake.gap.estimation.variants import Variant, ready

STATES = ("r", "v", "beta", "omega_r")
HORIZONS = (0.01, 0.1, 0.5, 2.0)  # [s]
EVERY = 10  # rows between restarts
JUDGED = 2  # horizon by which a gap is judged: half a second, which a controller plans over
FOLDS, HELD_OUT = 4, 1.5  # folds of cross-validation, and seconds of the blocks that take turns in being held out
BLOCK = 10  # restarts that are drawn together: a second
RESAMPLES = 400
WORST = 9e4  # noise variances at which a square error is capped: a prediction that far off is lost, however far


def start_rows(run: RunData) -> np.ndarray:
    """Rows that predictions of a run start from; in one piece, as strides would be compiled for anew."""
    return np.ascontiguousarray(np.flatnonzero(run.counted)[::EVERY])


def predicted_ahead(
    problem: Problem,
    theta: np.ndarray,
    names: Sequence[str],
    index: int,
    gains: Gains,
    starts: np.ndarray,
    steps: np.ndarray,
) -> np.ndarray:
    """Measurements of one run that a hypothesis predicts from its own filter's states (`roll_out`)."""
    states = filtered_states(problem, gains, theta, names, index)
    given = ready(problem, index, Variant(theta, names))
    return roll_out(given, problem.runs[index].period, states, starts, steps)


def prediction_squares(
    problem: Problem, theta: np.ndarray, names: Sequence[str], index: int, gains: Gains, starts: np.ndarray
) -> np.ndarray:
    """Squared prediction errors [starts, HORIZONS, STATES] of one run under a hypothesis, in noise variances.

    NaN beyond the run's end or where a channel is missing, infinite where the prediction diverged.

    Args:
        gains: at theta; starts: first rows.
    """
    run = problem.runs[index]
    steps = np.array([max(round(h / run.period), 1) for h in HORIZONS])
    out = predicted_ahead(problem, theta, names, index, gains, starts, steps)
    measured = np.full(out.shape, np.nan)
    for h, step in enumerate(steps):
        inside = starts + step < len(run.y)
        measured[inside, h] = run.y[starts[inside] + step]
    out[np.isfinite(measured) & ~np.isfinite(out)] = np.inf  # no number is no prediction, not a missing measurement
    errors = (measured - out) / problem.noise
    errors[..., ~run.used] = np.nan
    return np.asarray(errors[..., : len(STATES)] ** 2)


@dataclasses.dataclass(frozen=True)
class Reduction:
    """Share of the explainable gap that effects remove on parts of runs that were not fitted."""

    estimate: float
    low: float
    high: float
    by_state: dict[str, float]
    by_horizon: dict[str, float]
    before: list[float]  # mean squares by horizon, in noise variances; NaN where no run is so long
    after: list[float]
    floor: list[float]


NOTHING_REMOVED = Reduction(0.0, 0.0, 0.0, {}, {}, [], [], [])


def resampled(sums: np.ndarray) -> np.ndarray:
    """Sums [RESAMPLES, ...] over blocks [blocks, ...] that are drawn anew, always the same ones."""
    draws = np.random.default_rng(0).integers(0, len(sums), (RESAMPLES, len(sums)))
    return np.asarray(sums[draws].sum(axis=1))


def fold_of(run: RunData) -> np.ndarray:
    """Fold [rows] that each row is held out in: blocks of `HELD_OUT` seconds take turns."""
    return np.asarray((np.arange(len(run.y)) * run.period / HELD_OUT).astype(int) % FOLDS)


def measured_fold(run: RunData) -> np.ndarray:
    """Fold [count] that each of the run's measurements that count is held out in."""
    return np.repeat(fold_of(run)[run.counted], int(np.sum(run.used)))


def folds(problem: Problem) -> list[np.ndarray]:
    """For each fold, which of the measurements that count are held out in it [count] bool."""
    of = np.concatenate([measured_fold(run) for run in problem.runs])
    return [of == fold for fold in range(FOLDS)]


def with_folds(sums: Sequence[Equations], run: RunData, measured: Responses, parameters: int) -> list[Equations]:
    """Normal equations of each fold, with weights that the runs share, and one more run in them.

    Args:
        sums: of the runs before; empty ahead of the first.
    """
    of = measured_fold(run)
    parts = [equations([measured.rows(of == fold)], parameters, shared=True) for fold in range(FOLDS)]
    return [summed_equations(pair) for pair in zip(sums, parts, strict=True)] if sums else parts


def held_out_thetas(problem: Problem, fitted: Fit) -> Iterator[np.ndarray]:
    """For each fold the parameters fitted without its rows, all runs' blocks of which go uncounted."""
    held, names = problem.replace(exactness=fitted.exactness), fitted.names
    # A fit's derivatives do not depend on which rows count: those at the start are made once for all folds.
    jacobian = sensitivity(held, filter_case(held, fitted.theta, names), fitted.theta, names)
    for fold in range(FOLDS):
        runs = [dataclasses.replace(run, counted=run.counted & (fold_of(run) != fold)) for run in problem.runs]
        kept = jacobian.rows([measured_fold(run) != fold for run in problem.runs])
        yield minimise(held.replace(runs=runs), names, fitted.theta, iterations=3, jacobian=kept).theta


def errors_of(
    problem: Problem, theta: np.ndarray, names: Sequence[str], starts: Sequence[np.ndarray] | None = None
) -> list[np.ndarray]:
    """Squared prediction errors [starts, horizons, states] of each run, capped.

    Args:
        starts: first rows of each run's predictions; `start_rows` by default.
    """
    rough = with_more_process_noise(problem)
    gains = filter_case(rough, theta, names)
    starts = [start_rows(run) for run in problem.runs] if starts is None else starts
    return [np.minimum(prediction_squares(rough, theta, names, i, gains, some), WORST) for i, some in enumerate(starts)]


def held_out_errors(problem: Problem, fitted: Fit) -> list[np.ndarray]:
    """The same, each start predicted by the fit that its fold was held out of."""
    starts = [start_rows(run) for run in problem.runs]
    out = [np.empty((len(rows), len(HORIZONS), len(STATES))) for rows in starts]
    for fold, theta in enumerate(held_out_thetas(problem, fitted)):
        held = [fold_of(run)[rows] == fold for run, rows in zip(problem.runs, starts, strict=True)]
        own = [rows[mask] for rows, mask in zip(starts, held, strict=True)]
        for into, mask, errors in zip(out, held, errors_of(problem, theta, fitted.names, own), strict=True):
            into[mask] = errors
    return out


def without_effects(problem: Problem, fitted: Fit | None) -> list[np.ndarray]:
    """The same under the car without effects; its tolerances as fitted with the effects, or nominal with None."""
    theta = np.zeros(problem.nuisances) if fitted is None else fitted.theta[: problem.nuisances]
    return errors_of(problem, theta, ())


def reduction(problem: Problem, fitted: Fit, floor_fit: Fit) -> Reduction:
    """The share 1 - (after - floor) / (before - floor) at half a second, with a 95 % block-bootstrap interval.

    Args:
        fitted: the effects whose share it is; floor_fit: the best fit to all runs, whose errors are the floor.
    """
    if not fitted.names:
        return NOTHING_REMOVED
    before = without_effects(problem, fitted)
    after = held_out_errors(problem, fitted)
    floor = errors_of(problem, floor_fit.theta, floor_fit.names)
    # A second of restarts each, run by run.
    firsts = np.cumsum([0, *(-(-len(part) // BLOCK) for part in before)])
    block = np.concatenate([first + np.arange(len(part)) // BLOCK for first, part in zip(firsts, before, strict=False)])
    parts = [np.concatenate(part) for part in (before, after, floor)]
    return reduction_of(parts, block, STATES, [f"{h:g} s" for h in HORIZONS], JUDGED)


def reduction_of(
    parts: Sequence[np.ndarray], block: np.ndarray, states: Sequence[str], ahead: Sequence[str], judged: int
) -> Reduction:
    """Shares of the gap that are removed; at the judged horizon with a 95 % block-bootstrap interval.

    Args:
        parts: squared errors before, after, and of the floor [starts, horizons, states], NaN where there is none;
        block: of each start [starts]; states, ahead: names of states and horizons.
    """
    sums = np.stack([np.bincount(block, np.nansum(part[:, judged], axis=-1)) for part in parts], axis=-1)
    low, high = np.quantile([removed_share(*drawn) for drawn in resampled(sums)], [0.025, 0.975])
    estimate = removed_share(*sums.sum(axis=0))
    by_state = {
        name: removed_share(*(float(np.nansum(part[:, judged, i])) for part in parts))
        for i, name in enumerate(states)
        if np.any(np.isfinite(parts[0][:, judged, i]))
    }
    by_horizon = {
        name: removed_share(*(float(np.nansum(part[:, i])) for part in parts))
        for i, name in enumerate(ahead)
        if np.any(np.isfinite(parts[0][:, i]))
    }
    means = [mean_squares(part) for part in parts]
    return Reduction(estimate, min(float(low), estimate), max(float(high), estimate), by_state, by_horizon, *means)


def mean_squares(errors: np.ndarray) -> list[float]:
    """Mean squared error of each horizon from errors [starts, horizons, states]; NaN where no run is so long."""
    there = np.isfinite(errors)
    counts = there.sum(axis=(0, 2))
    sums = np.where(there, errors, 0.0).sum(axis=(0, 2))
    return [float(total / count) if count else float("nan") for total, count in zip(sums, counts, strict=True)]


def at_judged(errors: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Errors [starts, states] half a second ahead, of those of all horizons."""
    return [part[:, JUDGED] for part in errors]


def share_removed(before: Sequence[np.ndarray], after: Sequence[np.ndarray], floor: Sequence[np.ndarray]) -> float:
    """Share of the gap at half a second that `after` removes, from the squared errors there of all runs."""
    return removed_share(*(sum(float(np.nansum(run)) for run in part) for part in (before, after, floor)))


def removed_share(before: float, after: float, floor: float) -> float:
    """The share of the gap that is removed, from sums of squares; zero where there is no gap."""
    return float(np.clip(1.0 - (after - floor) / (before - floor), -1.0, 1.0)) if before > floor else 0.0
