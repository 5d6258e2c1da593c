"""Where the gap is: by state, force channel, run, time, operating region and lag."""

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.freeform import FORCE_CHANNELS
from drift_drake.gap.estimation.observed import filtered_states
from drift_drake.gap.estimation.problem import Problem
from drift_drake.gap.estimation.reduction import HORIZONS, JUDGED, STATES, mean_squares, start_rows
from drift_drake.gap.estimation.regression import Regression

SPEEDS = (0.0, 8.0, 12.0, 16.0, np.inf)  # [m/s]
FRICTION_USES = (0.0, 0.4, 0.7, np.inf)  # of mu g
SLIDING = 0.25  # [rad] of sideslip beyond which the car slides
ONSET = 0.05  # share of a run's gap by which it has set in
LEAST_SHARE = 0.05  # of the gap that a region must hold to be named
LONGEST_LAG = 0.4  # [s]
R_OVER_Q = 30.0  # factor on the noise levels that makes a filter rely on its model


def find_gap(
    problem: Problem, before: Sequence[np.ndarray], floor: Sequence[np.ndarray], lacking: Regression
) -> dict[str, Any]:
    """The `where` of an answer: what the nominal car gets wrong beyond the best fit.

    Shares of the gap by states, runs and force channels each sum to one (or are zero throughout without a gap); regions
    that hold it; onset [s] into each run; lag [s] by which each measured state follows the nominal car's; horizons:
    mean squared errors of the nominal car.

    Args:
        before, floor: squared errors [starts, horizons, states] of each run, of the nominal car and of the best fit;
        lacking: forces that the nominal car lacks.
    """
    judged = [np.nan_to_num((b - f)[:, JUDGED]) for b, f in zip(before, floor, strict=True)]
    by_run = shares({r.name: float(e.sum()) for r, e in zip(problem.runs, judged, strict=True)})
    gaps, places = [], []
    for run, e in zip(problem.runs, judged, strict=True):
        rows = start_rows(run)
        gaps.append((run.name, e.sum(axis=1), rows * run.period))
        places.append(run.y[rows])
    channels = dict.fromkeys(FORCE_CHANNELS, 0.0)
    if len(lacking.weights):
        power = [float(np.sum(lacking.weights[lacking.channel_of == c] ** 2)) for c in range(len(FORCE_CHANNELS))]
        channels = shares(dict(zip(FORCE_CHANNELS, power, strict=True)))
    grip = problem.nominal.friction * problem.nominal.gravity
    region = np.concatenate([region_of(y[:, 1], y[:, 0], y[:, 2], grip) for y in places])
    means = zip(HORIZONS, mean_squares(np.concatenate(before)), strict=True)
    return {
        "states": shares({s: float(sum(e[:, i].sum() for e in judged)) for i, s in enumerate(STATES)}),
        "runs": by_run,
        "channels": channels,
        "regions": regions(np.concatenate([gap for _, gap, _ in gaps]), region),
        "onset": onsets(by_run, gaps),
        "lag": lags(problem),
        "horizons": {f"{h:g} s": mean for h, mean in means if np.isfinite(mean)},
    }


def shares(parts: dict[str, float]) -> dict[str, float]:
    total = sum(max(p, 0.0) for p in parts.values())
    return {name: (max(p, 0.0) / total if total > 0.0 else 0.0) for name, p in parts.items()}


def onsets(by_run: dict[str, float], gaps: Iterable[tuple[str, np.ndarray, np.ndarray]]) -> dict[str, float]:
    """When the gap has set in [s], of each run that holds some of it.

    Args:
        by_run: share of each; gaps: name of a run, its gap and the times [s] of that [starts].
    """
    out = {}
    for name, gap, t in gaps:
        total = np.cumsum(np.maximum(gap, 0.0))
        if by_run[name] > LEAST_SHARE and total[-1] > 0.0:
            out[name] = float(t[int(np.searchsorted(total, ONSET * total[-1]))])
    return out


def region_of(v: np.ndarray, r: np.ndarray, beta: np.ndarray, grip: float) -> np.ndarray:
    """Index [rows] of each row's operating region among `region_names`; `grip` is the friction limit [m/s^2]."""
    lateral = np.abs(v * r) / grip
    speed = np.digitize(np.abs(v), SPEEDS[1:-1])
    use = np.digitize(lateral, FRICTION_USES[1:-1])
    slides = (np.abs(beta) > SLIDING).astype(int)
    return np.asarray((slides * (len(SPEEDS) - 1) + speed) * (len(FRICTION_USES) - 1) + use)


def region_names() -> list[str]:
    """Names of all operating regions, in the order of `region_of`."""
    out = []
    for state in ("grip", "slide"):
        for low, high in itertools.pairwise(SPEEDS):
            speed = f"{low:g}-{high:g} m/s" if np.isfinite(high) else f"over {low:g} m/s"
            for a, b in itertools.pairwise(FRICTION_USES):
                use = f"friction use {a:g}-{b:g}" if np.isfinite(b) else f"friction use over {a:g}"
                out.append(f"{state}, {speed}, {use}")
    return out


def regions(excess: np.ndarray, region: np.ndarray) -> list[str]:
    """Regions that hold a material share of the gap, the worst (by mean excess) first.

    Args:
        excess: squared errors beyond the floor [starts]; region: of each start (`region_of`).
    """
    names = region_names()
    total, count = np.bincount(region, excess, len(names)), np.bincount(region, minlength=len(names))
    gap = float(np.sum(np.maximum(total, 0.0)))
    mean = total / np.maximum(count, 1.0)
    if gap <= 0.0:
        return []
    return [names[i] for i in np.argsort(-mean) if total[i] > LEAST_SHARE * gap]


def lags(problem: Problem) -> dict[str, float]:
    """Delay [s] of each measured state behind the nominal car's prediction, by cross-correlation of their rates."""
    # A filter that hardly listens to the sensors: what the car predicts by itself, kept from diverging.
    model_reliant = problem.replace(noise=problem.noise * R_OVER_Q)
    theta = np.zeros(problem.nuisances)
    gains = filter_case(model_reliant, theta, ())
    scores: dict[str, dict[int, float]] = {}
    for index, run in enumerate(problem.runs):
        states = filtered_states(model_reliant, gains, theta, (), index)
        most = int(LONGEST_LAG / run.period)
        for i, name in enumerate(STATES):
            if run.used[i]:
                found = _correlation(run.y[:, i], states[:, i], most)
                known = scores.setdefault(name, dict.fromkeys(found, 0.0))
                for shift, score in found.items():
                    known[shift] = known.get(shift, 0.0) + score
    period = problem.runs[0].period
    return {name: max(known, key=lambda k: known[k]) * period for name, known in scores.items()}


def _correlation(real: np.ndarray, model: np.ndarray, most: int) -> dict[int, float]:
    """Correlation of two signals' rates by the rows that the first comes later."""
    smooth = np.ones(5) / 5.0
    a = np.gradient(np.convolve(real, smooth, "valid"))
    b = np.gradient(np.convolve(model, smooth, "valid"))
    a, b = a[most:-most], b
    return {shift: float(a @ b[most - shift : most - shift + len(a)]) for shift in range(-most, most + 1)}
