"""A gap far beyond the baseline's residuals: hypotheses judged by the errors themselves, at the shortest horizon.

Scores are clipped, and nearly linear around the calibrated car alone. Where a car is off by many times the baseline's
residuals (drifts on a slippery floor of a car that was calibrated in grip), what counts is what removes most of the
errors while no prediction has yet diverged. The scale of what is left is unknown: the likelihood is taken over it.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.special import expit, logsumexp

from drift_drake.car.effects.catalogue import LIMITS
from drift_drake.gap.diagnosis.calibrated.changed_car import judged
from drift_drake.gap.diagnosis.calibrated.posterior import tells_from_zero
from drift_drake.gap.estimation.effort import derivatives_of, is_slow
from drift_drake.gap.estimation.prior import at_end, at_shares, clipped, farther, tried_first
from drift_drake.gap.estimation.reduction import FOLDS, NOTHING_REMOVED, Reduction, reduction_of
from drift_drake.gap.estimation.robust_fit import Criterion, loss
from drift_drake.gap.estimation.scores import Day
from drift_drake.gap.estimation.unknowns import Unknown, added
from drift_drake.gap.estimation.windows import HORIZONS, errors_of_all
from drift_drake.gap.evidence.constants import ELSE, SECOND
from drift_drake.gap.evidence.hypotheses import Hypothesis, concluded, effects_of
from drift_drake.gap.evidence.posterior import UNKNOWN, PosteriorConstants, hypothesis_name
from drift_drake.gap.evidence.ranking import DayRanked, concluded_from, prior
from drift_drake.gap.evidence.search import EXTENSIONS, Search

FAR = 100.0  # mean square of a window, in scales, at which it counts half of what a diverged one does (Geman-McClure)
PER_BLOCK = 4.0  # independent errors in a block of time
SEEDS, PARTNERS = 4, 4  # singles that pairs are grown from, partners each that are fitted jointly
PARTNER_GRID = (-0.8, -0.4, 0.4, 0.8)  # of the reach, for the partner of a single
FEW = (-0.6, 0.6)  # the same of a slow simulator
STEP = 0.05  # of the reach, for derivatives
MOST_WINDOWS, FEWEST = 200, 60  # evenly chosen; of a slow simulator

Kept = np.ndarray | None
Named = tuple[Sequence[str], Sequence[float] | np.ndarray]  # effects and their magnitudes


def predicted(search: Search, *hypotheses: Named) -> list[np.ndarray]:
    """Errors [windows, channels that are used] at the first horizon, in scales, once each of some is added."""
    day = search.day
    cars = [(day.constants, added(day.own, effects_of(names, np.asarray(q), 0.0, day))) for names, q in hypotheses]
    return [in_scales(search, e) for e in errors_of_all(day.runs, cars, search.threads, 1)]


def in_scales(search: Search, e: np.ndarray) -> np.ndarray:
    """Of errors [windows, horizons, channels] those at the first horizon that are used, in scales."""
    used = np.all([run.used for run in search.day.runs], axis=0)
    return np.asarray((e[:, 0] / search.normal.scales[0])[:, used])


def misfits(e: np.ndarray) -> np.ndarray:
    """Saturating misfit [windows] of errors [windows, channels] in scales."""
    return loss(np.mean(e**2, axis=1), FAR)[0]


def nats(search: Search, misfit: float) -> float:
    """Negative log likelihood of a mean misfit whose scale is unknown, but for a constant."""
    return 0.5 * PER_BLOCK * search.day.blocks * float(np.log(max(misfit, 1e-12)))


def least_nats(search: Search) -> float:
    """Those of a car whose errors are the baseline's: no hypothesis may leave fewer."""
    used = np.all([run.used for run in search.day.runs], axis=0)
    return nats(search, float(np.mean(search.normal.level[0][used])))


def mean_misfits(search: Search, *hypotheses: Named) -> list[float]:
    """Mean misfit once each of some hypotheses is added."""
    return [float(np.mean(misfits(e))) for e in predicted(search, *hypotheses)]


def fitted(search: Search, names: Sequence[str], start: Sequence[float] | np.ndarray, kept: Kept = None) -> np.ndarray:
    """Magnitudes [k] of the least misfit near a start, over the windows that are kept [windows] (bool)."""
    ranges = [search.ranges[name] for name in names]
    part = np.full(len(search.day.errors), True) if kept is None else kept

    def errors_with(cars: Sequence[Mapping[str, float]]) -> list[np.ndarray]:
        return [e[part, :, None] for e in predicted(search, *((list(car), list(car.values())) for car in cars))]

    unknowns = [Unknown(name, r.high, np.inf, r.low, r.high, 0.0) for name, r in zip(names, ranges, strict=True)]
    now = in_scales(search, search.day.errors)[part]
    evidence = PER_BLOCK * search.day.blocks / (HORIZONS * float(np.sum(misfits(now))))  # a cost in nats, about
    criterion = Criterion(errors_with, unknowns, evidence, derivatives_of(search.day.constants)[0], STEP)
    first = np.array([clipped(float(x), r) for x, r in zip(start, ranges, strict=True)])
    ones = np.ones((now.shape[1], 1))
    found, _ = criterion.minimised(criterion.at(first, ones, FAR), ones, FAR)
    return np.array([clipped(float(x), r) for x, r in zip(found.theta, ranges, strict=True)])


def hypothesis(search: Search, names: Sequence[str], q: np.ndarray) -> Hypothesis:
    """A fitted hypothesis, its covariance from second differences of its log likelihood."""
    order = np.argsort(names)
    names, q = tuple(names[i] for i in order), q[order]
    ranges = [search.ranges[name] for name in names]
    steps = np.array([STEP * r.high for r in ranges])
    k, unit = len(q), np.eye(len(q))
    corners = [np.ones(k), -np.ones(k)] if k == 2 else []
    around = np.vstack([np.zeros(k), unit, -unit, *corners])
    middle, *rest = (nats(search, misfit) for misfit in mean_misfits(search, *((names, q + x * steps) for x in around)))
    ups, downs, both = rest[:k], rest[k : 2 * k], rest[2 * k :]
    # At a bound, or where it is not convex, the steps themselves are what is known.
    hessian = np.diag([max(up + down - 2.0 * middle, 0.1) for up, down in zip(ups, downs, strict=True)])
    if k == 2:
        mixed = 0.5 * (sum(both) - sum(ups) - sum(downs) + 2.0 * middle)
        largest = 0.9 * float(np.sqrt(hessian[0, 0] * hessian[1, 1]))
        hessian[0, 1] = hessian[1, 0] = float(np.clip(mixed, -largest, largest))
    covariance = np.linalg.inv(hessian) * np.outer(steps, steps)
    return concluded(names, q, covariance, middle, ranges, 0.0)


def judged_by_errors(
    search: Search, constants: PosteriorConstants, progress: Callable[[float], None]
) -> tuple[DayRanked, Reduction]:
    """Probabilities of hypotheses by what they remove, and what the leading known one does.

    The share that the leading one leaves on held-out blocks is the probability of `unknown`. Where the best are at the
    ends of their ranges, those are widened; `search.ranges` of the leading causes are those that were looked at.
    Whether something else is there too is asked of the scores at the car with the leading one in it, as of any gap.
    """
    most = FEWEST if is_slow(search.day.constants) else MOST_WINDOWS
    whole, search = search, search.on(fewer_windows(search.day, most))
    singles, starts = grown_singles(search, lambda share: progress(0.5 * share))
    for _ in range(EXTENSIONS):
        if not widened_at_ends(search, sorted(singles, key=lambda h: h.nats)[:SEEDS]):
            break
        singles, starts = grown_singles(search, lambda share: progress(0.5 * share))
    pairs = list[Hypothesis]()
    if min(h.nats for h in singles) - least_nats(search) > SECOND:
        pairs = followed(search, grown_pairs(search, starts, lambda share: progress(0.5 + 0.3 * share)))
    none = search.none()
    level = nats(search, float(np.mean(misfits(in_scales(search, search.day.errors)))))
    known = [h for h in (*singles, *pairs) if tells_from_zero(h)]
    known.append(dataclasses.replace(none, nats=level, log_evidence=-level))
    values = {hypothesis_name(h.names): h.log_evidence + prior(h, len(search.ranges), constants) for h in known}
    leading = concluded_from(values, known, 0.0).leading
    whole.ranges |= {name: search.ranges[name] for name in leading.names}
    progress(0.8)
    shrinks = held_out_reduction(search, leading)
    found = concluded_from(values, known, float(np.clip(1.0 - shrinks.estimate, 0.0, 1.0)))
    return with_something_else(whole, found, constants.temperature), shrinks


def with_something_else(search: Search, found: DayRanked, temperature: float) -> DayRanked:
    """The same with the probability that something else is there too, where that is more probable than not."""
    if found.verdict == UNKNOWN or not found.leading.names:
        return found
    at = judged(search, [found.leading])
    rest = at[0].left_over if at else None
    if rest is None:
        return found
    more = float(expit(np.log(ELSE) + logsumexp(rest.gain / temperature + search.normal.factors)))
    if more <= 0.5:
        return found
    return dataclasses.replace(found, leading=dataclasses.replace(found.leading, left_over=rest), something_else=more)


def widened_at_ends(search: Search, hypotheses: Sequence[Hypothesis]) -> set[str]:
    """Widens `search.ranges` of causes whose magnitudes are at an end; their names.

    A gap this large may well go beyond what is usual, and a second cause would make up for what the first may not be.
    """
    ends = {name for h in hypotheses for name, q in zip(h.names, h.magnitudes, strict=True)
            if at_end(float(q), search.ranges[name])}  # fmt: skip
    wider = {name: farther(name, search.ranges[name], search.vehicle) for name in ends - LIMITS}
    wider = {name: r for name, r in wider.items() if r != search.ranges[name]}
    search.ranges |= wider
    return set(wider)


def followed(search: Search, pairs: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Pairs fitted farther out while the best is at an end of a range, which is widened for all that have the cause."""
    pairs = list(pairs)
    for _ in range(EXTENSIONS if pairs else 0):
        wider = widened_at_ends(search, [min(pairs, key=lambda h: h.nats)])
        if not wider:
            break
        pairs = [hypothesis(search, h.names, fitted(search, h.names, h.magnitudes)) if wider & set(h.names) else h
                 for h in pairs]  # fmt: skip
    return pairs


def grown_singles(
    search: Search, progress: Callable[[float], None]
) -> tuple[list[Hypothesis], dict[str, tuple[float, float]]]:
    """The best single effects, and of every one the best magnitude of a grid with its misfit, best first."""
    starts = {}
    for done, (name, r) in enumerate(search.ranges.items()):
        tried = sorted({clipped(q, r) for q in tried_first(r, is_slow(search.day.constants))})
        misfit, q = min(zip(mean_misfits(search, *(((name,), (q,)) for q in tried)), tried, strict=True))
        starts[name] = q, misfit
        progress((done + 1) / len(search.ranges))
    best = dict(sorted(starts.items(), key=lambda item: item[1][1]))
    with ThreadPoolExecutor(search.threads) as pool:
        leading = list(best)[: 2 * SEEDS]
        out = list(pool.map(lambda name: hypothesis(search, [name], fitted(search, [name], [best[name][0]])), leading))
    return out, best


def grown_pairs(
    search: Search, starts: Mapping[str, tuple[float, float]], progress: Callable[[float], None]
) -> list[Hypothesis]:
    """Pairs of the best singles with the partners that remove most in addition, jointly fitted."""

    def fit(job: tuple[tuple[str, ...], list[float]]) -> Hypothesis:
        return hypothesis(search, job[0], fitted(search, *job))

    shares, jobs, out = FEW if is_slow(search.day.constants) else PARTNER_GRID, dict[tuple[str, ...], list[float]](), []
    for seed in list(starts)[:SEEDS]:
        tried = [(other, clipped(q, r)) for other, r in search.ranges.items() if other != seed
                 for q in at_shares(r, [q for q in shares if q > 0.0 or r.low < 0.0])]  # fmt: skip
        left = mean_misfits(search, *(((seed, other), (starts[seed][0], q)) for other, q in tried))
        best = {other: (misfit, other, q) for misfit, (other, q) in sorted(zip(left, tried, strict=True), reverse=True)}
        for _, other, q in sorted(best.values())[:PARTNERS]:  # the least of each, as the last counts
            if (other, seed) not in jobs:
                jobs[seed, other] = [starts[seed][0], q]
    with ThreadPoolExecutor(search.threads) as pool:
        for done, h in enumerate(pool.map(fit, jobs.items())):
            out.append(h)
            progress((done + 1) / len(jobs))
    return out


def fewer_windows(day: Day, most: int) -> Day:
    """The day with at most so many windows, evenly chosen."""
    every = max(int(np.ceil(len(day.errors) / most)), 1)
    of_run = np.concatenate([np.arange(len(run.starts)) for run in day.runs])
    return day.kept(of_run % every == 0)


def held_out_reduction(search: Search, h: Hypothesis) -> Reduction:
    """Share of the misfit that a hypothesis removes on blocks that were not fitted, with a 95 % interval."""
    day = search.day
    if not h.names:
        return NOTHING_REMOVED
    before, after = (misfits(e) for e in (in_scales(search, day.errors), *predicted(search, (h.names, h.magnitudes))))
    for fold in range(FOLDS):
        held = day.block % FOLDS == fold
        if np.any(held) and np.any(~held):
            q = fitted(search, h.names, h.magnitudes, ~held)
            after[held] = misfits(predicted(search, (h.names, q))[0])[held]
    parts = [part[:, None, None] for part in (before, after, np.zeros_like(before))]
    return reduction_of(parts, day.block, (), day.ahead[:1], 0)
