"""Hypotheses judged at the changed car: whether a day's scores are normal once a change has been put into the car.

The search takes the scores' derivatives at the calibrated car, for all hypotheses alike. Under a large change that car
is far off: errors are clipped there that are not once the change is put in, and tyres work elsewhere, so that a wrong
change may seem normal and the right one not. What it leads with is therefore judged at the car with the change in it:
derivatives, clipping and the baseline are taken again there, as Gauss and Newton's method does.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.gap.diagnosis.calibrated.posterior import tells_from_zero
from drift_drake.gap.estimation.baseline import Scatter
from drift_drake.gap.estimation.effort import is_slow
from drift_drake.gap.estimation.normal import LOST, WORST, Normal
from drift_drake.gap.estimation.prior import Range, clipped
from drift_drake.gap.estimation.reduction import FOLDS, NOTHING_REMOVED, STATES, Reduction, reduction_of
from drift_drake.gap.estimation.scores import Day, make_day
from drift_drake.gap.estimation.unknowns import added
from drift_drake.gap.evidence.hypotheses import Hypothesis, added_up, concluded
from drift_drake.gap.evidence.left_over import left_over
from drift_drake.gap.evidence.search import Search
from drift_drake.gap.evidence.where import onsets, region_of, regions, shares

ROUNDS = 3  # cars at most that a hypothesis moves on to
SHARES = (1.0, 0.4)  # of a Gauss-Newton step, until one makes the scores more normal
NEAR = 0.5  # standard deviations of a step, below which the car's derivatives serve
STEP = 0.05  # of the reach, for derivatives of the scores
SINGULAR = 1e12  # condition of the second derivatives, beyond which the logs do not show the magnitudes apart
HOPELESS = 40.0  # nats behind the best hypothesis, from where on none is led further
APART = 0.1
"""Share of a score's variance that it scatters by alone where magnitudes are stated and where it is judged which cause
a gap has (validation logs). Between effects that act alike the scores' contrasts are small, but what the equations lack
is large in them: drivetrain friction differs from rolling resistance by the rim's slip, which is that of other tyres.
"""


@dataclasses.dataclass(frozen=True)
class At:
    """A hypothesis at magnitudes, judged at the car with them."""

    q: np.ndarray  # [k]
    nats: float  # half the squared distance of the scores from normal
    covariance: np.ndarray  # [k, k]
    step: np.ndarray  # [k] of Gauss and Newton
    scores: np.ndarray  # [m] less their normal mean
    slopes: np.ndarray  # [m, k] of these by the magnitudes
    scatter: Scatter


def changed_car(search: Search, h: Hypothesis, q: np.ndarray | None = None, anew: bool = False) -> Search:
    """The search from the car with a hypothesis in it.

    Args:
        q: magnitudes of its causes, if not its own; anew: with derivatives of this very car, not of one that is `near`.
    """
    effects, day, normal = h.effects(search.day, q), search.day, search.normal
    if is_slow(day.constants):  # a simulator of the user's: derivatives are those of the calibrated car
        return search.on(dataclasses.replace(day, errors=day.errors_with(effects), own=added(day.own, effects)))
    key = tuple(sorted(effects))
    then, known = search.judged.get(key, ({}, None))
    if known is not None and not anew and near(then, effects, h):
        return search.on(dataclasses.replace(known, errors=day.errors_with(effects), own=added(day.own, effects)))
    of_kind = day.jacobian[..., day.jacobian.shape[-1] - len(normal.of_kind) :]
    made = make_day(day.runs, day.constants, added(day.own, effects), normal.names, normal.units, normal,
                    search.threads, of_kind)  # fmt: skip
    search.judged[key] = effects, made
    return search.on(made)


def near(then: Mapping[str, float], now: Mapping[str, float], h: Hypothesis) -> bool:
    """Whether a car's derivatives serve at other magnitudes of the same effects."""
    widths = dict(zip(h.names, NEAR * np.sqrt(np.diag(h.covariance)), strict=True))
    return all(abs(now[name] - q) <= widths.get(name, 0.0) for name, q in then.items())


def judged(search: Search, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The hypotheses with the magnitudes, covariances and evidence that they have at the car with them, best first.

    Without those whose magnitudes the logs do not show apart there.
    """
    out: list[Hypothesis] = []
    for h in hypotheses:
        whole, limit = _with_additional(h), min((other.nats for other in out), default=np.inf) + HOPELESS
        at = _led(search, whole, limit, 0.0)
        if at is not None:
            ranges = [search.ranges[name] for name in whole.names]
            evidence = concluded(whole.names, at.q, at.covariance, at.nats, ranges, h.follows_load).log_evidence
            by_factor = evidences(at, at.scatter, whole, ranges)
            out.append(dataclasses.replace(
                _moved(h, at), nats=at.nats, log_evidence=evidence, by_factor=by_factor - by_factor[at.scatter.main],
                among=evidences(at, at.scatter.apart(APART), whole, ranges),
                left_over=left_over(at.scores, at.scatter, search.normal.names, at.slopes),
            ))  # fmt: skip
    least = min((h.nats for h in out), default=0.0)
    return sorted((h if h.nats <= least + HOPELESS else at_main(h, search.scatter.main) for h in out),
                  key=lambda h: -h.log_evidence)  # fmt: skip


def evidences(at: At, scatter: Scatter, h: Hypothesis, ranges: Sequence[Range]) -> np.ndarray:
    """Log evidence of a hypothesis at each of the factors [K], with the magnitudes that are most likely there."""
    out = []
    for weight in scatter.inverses:
        gradient, covariance = at.slopes.T @ weight @ at.scores, np.linalg.inv(at.slopes.T @ weight @ at.slopes)
        q = np.array([clipped(float(x), r) for x, r in zip(at.q - covariance @ gradient, ranges, strict=True)])
        s = at.scores + at.slopes @ (q - at.q)
        out.append(concluded(h.names, q, covariance, 0.5 * float(s @ weight @ s), ranges, h.follows_load).log_evidence)
    return np.array(out) - scatter.sizes


def at_main(h: Hypothesis, main: int) -> Hypothesis:
    """A hypothesis far behind the best, which was not led to its most likely magnitudes: as at the main factor."""
    among = None if h.among is None else float(np.asarray(h.among)[main])
    rest = h.left_over and h.left_over._replace(gain=float(np.asarray(h.left_over.gain)[main]))
    return dataclasses.replace(h, by_factor=0.0, among=among, left_over=rest)


def stated(search: Search, h: Hypothesis) -> Hypothesis:
    """A hypothesis with the magnitudes and their covariance that are stated of it; its evidence stays.

    Where contrasts are all that shows a magnitude, it is that of the evidence: an interval that held zero would deny
    what they decide.
    """
    at = _led(search, _with_additional(h), np.inf, APART) if h.names else None
    moved = h if at is None else _moved(h, at)
    return moved if tells_from_zero(moved) else h


def _moved(h: Hypothesis, at: At) -> Hypothesis:
    """A hypothesis at other magnitudes."""
    k = len(h.names)
    additional = dict(zip(h.additional, map(float, at.q[k:]), strict=True))
    return dataclasses.replace(h, magnitudes=at.q[:k], covariance=at.covariance[:k, :k], additional=additional)


def _led(search: Search, h: Hypothesis, limit: float, apart: float) -> At | None:
    """A hypothesis led on to its most likely magnitudes, while it is within a limit [nats]."""
    ranges = [search.ranges[name] for name in h.names]
    at = _at(search, h, h.magnitudes, apart)
    for _ in range(ROUNDS):
        if at is None or at.nats > limit:
            break
        step = np.array([clipped(float(x), r) for x, r in zip(at.q + at.step, ranges, strict=True)]) - at.q
        if np.all(np.abs(step) < NEAR * np.sqrt(np.diag(at.covariance))):
            return dataclasses.replace(at, q=at.q + step)
        trials = (_at(search, h, at.q + share * step, apart, anew=True) for share in SHARES)
        better = next((trial for trial in trials if trial is not None and trial.nats < at.nats), None)
        if better is None:
            break
        at = better
    return at


def _with_additional(h: Hypothesis) -> Hypothesis:
    """What a hypothesis has in addition to its causes, as causes too."""
    return dataclasses.replace(
        h,
        names=(*h.names, *h.additional),
        magnitudes=np.concatenate([h.magnitudes, list(h.additional.values())]),
        additional={},
    )


def _at(search: Search, h: Hypothesis, q: np.ndarray, apart: float, anew: bool = False) -> At | None:
    """A hypothesis judged at the car with the magnitudes q; None where the logs do not show them apart."""
    there = changed_car(search, h, q, anew)
    s, weight = there.scores({}), there.scatter.apart(apart).inverse
    slopes = slopes_at(there, search, h, q, s)
    hessian = slopes.T @ weight @ slopes
    if not np.all(np.isfinite(hessian)) or np.linalg.cond(hessian) > SINGULAR:
        return None
    covariance = np.linalg.inv(hessian)
    return At(q, 0.5 * float(s @ weight @ s), covariance, -covariance @ slopes.T @ weight @ s, s, slopes, there.scatter)


def slopes_at(
    there: Search, search: Search, h: Hypothesis, q: np.ndarray, s: np.ndarray, kept: np.ndarray | None = None
) -> np.ndarray:
    """Derivatives [n, k] of the scores s at the changed car by a hypothesis' magnitudes.

    Args:
        there: the search at the car with the magnitudes q; search: at the calibrated car, whose ranges hold;
        kept: blocks [blocks] (bool) that are summed, if not all.
    """
    slopes = np.empty((len(s), len(q)))
    at = h.effects(search.day, q)
    for i, name in enumerate(h.names):
        step = STEP * search.ranges[name].high
        step = -np.sign(q[i]) * step if abs(q[i]) > step else np.copysign(step, q[i])  # within bounds
        moved = h.effects(search.day, q + step * (np.arange(len(q)) == i))
        change = added_up(moved, {key: -x for key, x in at.items()})
        slopes[:, i] = (there.scores(change, kept) - s) / step
    return slopes


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
    onset = onsets(
        by_run,
        [(run.name, gap[day.run == k].sum(axis=1), run.starts * run.period) for k, run in enumerate(day.runs)],
    )
    return {
        "states": by_state,
        "runs": by_run,
        "channels": {},
        "regions": gap_regions(day, gap),
        "onset": onset,
        "lag": {},
        "horizons": dict(zip(day.ahead, map(float, before.mean(axis=(0, 2))), strict=True)),
    }  # fmt: skip


def left_in(search: Search, h: Hypothesis) -> tuple[dict[str, float], list[str]]:
    """Shares by state of the errors beyond normal that a hypothesis leaves, and the regions that hold them."""
    day, normal = search.day, search.normal
    rest = squares(normal, day.errors_with(h.effects(day)), LOST)[:, -1] - normal.level[-1, : len(STATES)]
    return shares({s: float(rest[:, i].sum()) for i, s in enumerate(STATES)}), gap_regions(day, rest)


def gap_regions(day: Day, gap: np.ndarray) -> list[str]:
    """Operating regions that hold a gap [windows, STATES], the worst first."""
    y = np.concatenate([run.start_y[run.starts] for run in day.runs])
    grip = float(day.constants.friction * day.constants.gravity)
    return regions(gap.sum(axis=1), region_of(y[:, 1], y[:, 0], y[:, 2], grip))
