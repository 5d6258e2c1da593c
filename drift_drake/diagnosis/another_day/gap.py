"""Another day's gap in the terms of prediction: how far causes shrink it on held-out blocks, and where it is."""

import numpy as np

from drift_drake.diagnosis.another_day.changed_car import changed_car, slopes_at
from drift_drake.diagnosis.another_day.hypotheses import Hypothesis, Search
from drift_drake.diagnosis.shared.where import onsets, region_of, regions, shares
from drift_drake.estimation.horizons import STATES
from drift_drake.estimation.normal import LOST, WORST, Normal
from drift_drake.estimation.reduction import FOLDS, NOTHING_REMOVED, Reduction, reduction_of


def squares(normal: Normal, e: np.ndarray, cap: float = WORST) -> np.ndarray:
    """Capped squared errors [windows, HORIZONS, states] about the normal ones, in robust scales."""
    return normal.squares(e, cap)[..., : len(STATES)]


def reduction(search: Search, h: Hypothesis, best: Hypothesis) -> Reduction:
    """The share 1 - (after - floor) / (before - floor) at the longest horizon, with a 95 % block-bootstrap interval.

    After: each fold's blocks with the magnitudes that the other folds' scores ask for. Floor: the mean squares of the
    day of calibration, or those of the best hypothesis where they are lower.
    """
    if not h.names:
        return NOTHING_REMOVED
    day = search.day
    before = squares(search.normal, day.errors)
    lowest = squares(search.normal, day.errors_with(best.effects(day)))
    level = search.normal.level[:, : len(STATES)]
    floor = lowest * np.minimum(1.0, level / np.maximum(lowest.mean(axis=0), 1e-12))
    after, there = np.empty_like(before), changed_car(search, h)
    for fold in range(FOLDS):
        held = day.block % FOLDS == fold
        q = held_out_magnitudes(search, there, h, fold)
        after[held] = squares(search.normal, day.errors_with(h.effects(day, q)))[held]
    return reduction_of((before, after, floor), day.block, STATES, day.ahead, -1)


def held_out_magnitudes(search: Search, there: Search, h: Hypothesis, fold: int) -> np.ndarray:
    """Magnitudes that the scores of the other folds' blocks ask for: one Gauss-Newton step from the fit to all.

    Args:
        there: the search at the car with the hypothesis.
    """
    day = search.day
    kept = np.arange(day.blocks) % FOLDS != fold
    at = there.scores({}, kept)
    slopes = slopes_at(there, search, h, h.magnitudes, at, kept)
    hessian = slopes.T @ there.scatter.inverse @ slopes
    moved = h.magnitudes - np.linalg.lstsq(hessian, slopes.T @ there.scatter.inverse @ at, rcond=None)[0]
    ranges = [search.ranges[name] for name in h.names]
    return np.clip(moved, [r.low for r in ranges], [r.high for r in ranges])


def where(search: Search, best: Hypothesis, unexplained: bool = False) -> dict[str, object]:
    """Shares of the gap by state and run, the regions that hold it, and when it sets in (the keys of `where.find_gap`).

    Args:
        unexplained: the gap is what goes beyond the day of calibration, not what `best` removes.
    """
    day = search.day
    before = squares(search.normal, day.errors, LOST if unexplained else WORST)
    normal = search.normal.level[:, : len(STATES)]
    gap = (before - (normal if unexplained else squares(search.normal, day.errors_with(best.effects(day)))))[:, -1]
    by_state = shares({s: float(gap[:, i].sum()) for i, s in enumerate(STATES)})
    by_run = shares({run.name: float(gap[day.run == k].sum()) for k, run in enumerate(day.runs)})
    y = np.concatenate([run.start_y[run.starts] for run in day.runs])
    grip = float(day.constants.friction * day.constants.gravity)
    onset = onsets(
        by_run,
        [(run.name, gap[day.run == k].sum(axis=1), run.starts * run.period) for k, run in enumerate(day.runs)],
    )
    return {
        "states": by_state,
        "runs": by_run,
        "channels": {},
        "regions": regions(gap.sum(axis=1), region_of(y[:, 1], y[:, 0], y[:, 2], grip)),
        "onset": onset,
        "lag": {},
        "horizons": dict(zip(day.ahead, map(float, before.mean(axis=(0, 2))), strict=True)),
    }  # fmt: skip
