"""What the learnt model says of the same logs: its share of the gap, and where it does not know the car.

The Bayesian model (`drive.learnt`) adapts to the blocks that each fold leaves it and predicts the fold's own, as
the physical reduction does: half a second ahead, in the same units. It starts from measured states, not filtered ones,
which costs it a little. A physical verdict that leaves more of the gap than the learnt model does has missed something.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.features import STATE_COUNT, features, network_inputs
from drift_drake.drive.learnt.posterior import Posterior, predict
from drift_drake.drive.learnt.quality import learn, predicted_windows, step_model
from drift_drake.drive.learnt.samples import Samples, concatenate
from drift_drake.gap.estimation.problem import Problem
from drift_drake.gap.estimation.reduction import (
    FOLDS,
    HORIZONS,
    JUDGED,
    WORST,
    at_judged,
    fold_of,
    share_removed,
    start_rows,
)
from drift_drake.gap.estimation.run_data import RunData

STEP = 0.1  # [s] of the model
AHEAD = round(HORIZONS[JUDGED] / STEP)  # steps to the horizon that a gap is judged by
NEEDED = ("r", "v", "beta", "omega_r", "tau_cmd")
LIKE = 0.3  # of each parameter that a car may be off the one that the model was trained about
CELLS = 8  # of the map, each way
MOST_REGIONS = 3


@dataclasses.dataclass(frozen=True)
class Learned:
    """The learnt model's answer; only `sentence` where it has none."""

    sentence: str
    share: float | None = None  # of the gap at half a second, on blocks that it did not adapt to
    share_unadapted: float | None = None
    error_nominal: float | None = None  # mean square at half a second, in noise variances
    error_learned: float | None = None
    error_floor: float | None = None
    regions: tuple[str, ...] = ()  # driven regions where it is uncertain, the worst first
    map: dict[str, Any] = dataclasses.field(default_factory=dict)
    """speed [m/s] and sideslip [rad] edges; deviation [speed, sideslip] in the model's noise levels; count."""


def learned(problem: Problem, before: Sequence[np.ndarray], floor: Sequence[np.ndarray]) -> Learned:
    """The shipped learnt model on a case's runs.

    Args:
        before, floor: squared errors [starts, horizons, states] of the nominal car and of the best fit
            (`reduction.errors_of`).
    """
    model = load_model()
    used = np.all([run.used for run in problem.runs], axis=0)
    missing = [name for name, there in zip(NEEDED, used[:STATE_COUNT], strict=False) if not there]
    missing += ["tau_cmd"] if problem.rim_fed else []
    if missing:
        return Learned(f"The learnt model needs {' and '.join(missing)}, which these logs lack.")
    if any(abs(a - b) > LIKE * abs(b) for a, b in zip(problem.nominal, model.vehicle.constants(), strict=True)):
        return Learned("The learnt model was trained about another kind of car and does not apply to this one.")
    if any(abs(STEP / run.period - round(STEP / run.period)) > 0.01 for run in problem.runs):
        return Learned("The learnt model steps by 0.1 s, which is no whole number of these logs' rows.")
    runs = [_Sampled(run) for run in problem.runs]
    nominal, least = at_judged(before), at_judged(floor)
    adapted = [np.full((*b.shape[:1], STATE_COUNT), np.nan) for b in before]
    for fold in range(FOLDS):
        belief = learn(model, model.prior(), concatenate([run.samples(fold) for run in runs]))
        for run, into in zip(runs, adapted, strict=True):
            held = run.folds[run.starts] == fold
            into[held] = run.errors(model, belief, problem.noise)[held]
    unadapted = [run.errors(model, model.prior(), problem.noise) for run in runs]
    shares = [share_removed(nominal, errors, least) for errors in (adapted, unadapted)]
    whole = learn(model, model.prior(), concatenate([run.samples(None) for run in runs]))
    cells = uncertainty_map(model, whole, concatenate([run.samples(None) for run in runs]))
    regions = uncertain_regions(cells)
    errors = [_mean(nominal), _mean(adapted), _mean(least)]
    sentence = _sentence(shares[0], errors[0], errors[1], regions[0])
    return Learned(sentence, shares[0], shares[1], errors[0], errors[1], errors[2], tuple(regions), cells)


def _sentence(share: float, nominal: float, after: float, region: str) -> str:
    if share > 0.0:
        closes = f"closes {100 * share:.0f} % of the gap on the others"
    else:
        closes = (
            "closes nothing of the gap on the others: half a second ahead its mean square error is "
            f"{after:.3g} noise variances, the nominal car's {nominal:.3g}"
        )
    return f"The learnt model, adapted to the same blocks, {closes}; it is least sure at {region}."


def _mean(parts: Sequence[np.ndarray]) -> float:
    return float(np.nanmean(np.concatenate(parts)))


class _Sampled:
    """One run at the model's step."""

    def __init__(self, run: RunData) -> None:
        self.run, self.rows, self.folds = run, round(STEP / run.period), fold_of(run)
        self.starts = start_rows(run)
        self._u = np.column_stack([run.delta, run.tau])
        path, lagged = np.zeros((len(run.y), 2)), lagged_commands(run.period * np.arange(len(run.y)), self._u)
        self._x = np.concatenate([run.y[:, :STATE_COUNT], path, lagged], axis=1)

    def samples(self, without: int | None) -> Samples:
        """All samples that count and do not touch a fold."""
        first = np.flatnonzero(self.run.counted)
        first = first[:: self.rows]
        first = first[first + self.rows < len(self._x)]
        if without is not None:
            first = first[(self.folds[first] != without) & (self.folds[first + self.rows] != without)]
        last = first + self.rows
        none, zeros = np.zeros(len(first)), np.zeros(len(first), dtype=np.int64)
        return Samples(self._x[first], self._u[first], self._u[last], self._x[last], none, zeros, zeros)

    def errors(self, model: BayesianModel, belief: Posterior, noise: np.ndarray) -> np.ndarray:
        """Squared errors [starts, 4] half a second ahead, in noise variances; NaN where the run ends sooner."""
        out = np.full((len(self.starts), STATE_COUNT), np.nan)
        inside = self.starts + AHEAD * self.rows < len(self._x)
        rows = self.starts[inside]
        *_, x = predicted_windows(step_model(model, belief), self._x[rows], self._u, rows, self.rows, AHEAD)
        ends = rows + AHEAD * self.rows
        squares = ((self._x[ends, :STATE_COUNT] - x[:, :STATE_COUNT]) / noise[:STATE_COUNT]) ** 2
        out[inside] = np.minimum(squares, WORST)
        return out


def uncertainty_map(model: BayesianModel, belief: Posterior, samples: Samples) -> dict[str, Any]:
    """The model's predictive deviation over speed and sideslip, and how many samples lie where.

    A cell's deviation is the root mean square over its samples and the learnt states, in the model's noise levels;
    where there is no sample, that of the nearest one moved to the cell's middle.
    """
    place = samples.x[:, [1, 2]]
    low, high = place.min(axis=0), place.max(axis=0) + 1e-9
    speed, sideslip = (np.linspace(low[i], high[i], CELLS + 1) for i in range(2))
    at = np.minimum(((place - low) / (high - low) * CELLS).astype(int), CELLS - 1)
    count = np.zeros((CELLS, CELLS), dtype=int)
    np.add.at(count, (at[:, 0], at[:, 1]), 1)
    total = np.zeros((CELLS, CELLS))
    np.add.at(total, (at[:, 0], at[:, 1]), _relative_variance(model, belief, samples))
    empty = np.argwhere(count == 0)
    middle = np.column_stack([(speed[:-1] + speed[1:])[empty[:, 0]], (sideslip[:-1] + sideslip[1:])[empty[:, 1]]]) / 2.0
    distance = np.linalg.norm((middle[:, None] - place[None]) / (high - low), axis=-1)
    moved = samples.where(np.argmin(distance, axis=1))
    slip = moved.x[:, 3] - moved.x[:, 1]
    x = moved.x.copy()
    x[:, 1], x[:, 2], x[:, 3] = middle[:, 0], middle[:, 1], middle[:, 0] + slip
    variance = total / np.maximum(count, 1)
    variance[empty[:, 0], empty[:, 1]] = _relative_variance(model, belief, moved._replace(x=x))
    return {
        "speed": speed.tolist(),
        "sideslip": sideslip.tolist(),
        "deviation": np.sqrt(variance).tolist(),
        "count": count.tolist(),
    }


def _relative_variance(model: BayesianModel, belief: Posterior, samples: Samples) -> np.ndarray:
    """Predictive variances over noise variances, the mean of the learnt states [n]."""
    phi = features(model.network, network_inputs(samples.x, samples.u, samples.u_next))
    return np.asarray(np.mean(predict(belief, model.sigma, phi).variance / model.sigma**2, axis=-1))


def uncertain_regions(cells: dict[str, Any]) -> list[str]:
    """Driven cells with the largest predictive deviation, in words."""
    speed, sideslip = cells["speed"], cells["sideslip"]
    deviation, count = np.array(cells["deviation"]), np.array(cells["count"])
    worst = np.argsort(-np.where(count > 0, deviation, 0.0), axis=None)[: min(MOST_REGIONS, int(np.sum(count > 0)))]
    return [
        f"{speed[i]:.1f} to {speed[i + 1]:.1f} m/s and sideslip {sideslip[j]:.2g} to {sideslip[j + 1]:.2g} rad "
        f"({deviation[i, j]:.2f} noise levels, from {count[i, j]} of {count.sum()} samples)"
        for i, j in (np.unravel_index(flat, count.shape) for flat in worst)
    ]
