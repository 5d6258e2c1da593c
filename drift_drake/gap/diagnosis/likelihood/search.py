"""Which hypotheses are worth a full fit, and their fits: singles, then pairs grown from the best singles.

Screening is cheap and under much process noise: innovations then depend less on the past, and fits are less nonlinear.
From each start of each added effect one linearised joint solution predicts the cost; the most promising get a few
re-linearised steps, and the best of those full fits.

How far the vehicle is off its file, in tolerances, is unknown too: every hypothesis is held with deviations of one
tolerance and with deviations of a twentieth (the file is right), and its evidence is the mean of both.
"""

import dataclasses
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from drift_drake.car.lanes import LANES
from drift_drake.common.standard_output import Progress
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import (
    Derivatives,
    Fit,
    conclude,
    cost_of,
    last_derivative,
    minimise,
    moved,
    normal_step,
    parameter_limits,
    prior_precision,
    sensitivity,
)
from drift_drake.gap.estimation.freeform import with_more_process_noise
from drift_drake.gap.estimation.observed import observe_case
from drift_drake.gap.estimation.prior import TOLERANCE_OF, bounds, starts
from drift_drake.gap.estimation.problem import NUISANCES, TOLERANCES, WAITED_FOR, Gains, Problem, flat
from drift_drake.gap.estimation.variants import Variant

EXACTNESSES = (1.0, 0.05)  # of the vehicle file, in tolerances
DECIDED = 15.0  # [nats] by which one exactness is ahead when the other is given up
ADEQUATE = 1.02  # mean square of the innovations up to which a single may be the whole story
NEAR = 100.0  # [nats] behind the best, under coarse process noise, within which candidates get full fits
RENEWALS = 2  # of a candidate's gains
HOPELESS = 40.0  # [nats] by which an exact vehicle file may be predicted to be worse and yet be tried
STEPPED_SINGLES, LEAST_SINGLES, FULL_SINGLES = 10, 3, 6  # additions that get re-linearised steps, full fits
SEEDS, STEPPED_PAIRS, LEAST_PAIRS, FULL_PAIRS = 3, 5, 2, 4  # singles that pairs are grown from; as above
STRETCHED, MOST_HANDED_OVER = 2.5, 3  # tolerances beyond which an effect is tried in a deviation's place; how many
FEW_SEEDS, FEW_PAIRS = 1, 3  # where the best single may be the whole story

TOGETHER = LANES // 2  # candidates whose innovations and last derivatives are computed at once

Names = tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A hypothesis on its way to a full fit."""

    names: Names
    theta: np.ndarray
    cost: float


@dataclasses.dataclass(frozen=True)
class Base:
    """A hypothesis that effects are added to: its filter and derivatives."""

    names: Names
    theta: np.ndarray
    gains: Gains
    jacobian: Derivatives


def make_base(problem: Problem, names: Names, theta: np.ndarray) -> Base:
    """The filter and derivatives of a hypothesis that effects will be added to."""
    gains = filter_case(problem, theta, names)
    return Base(names, theta, gains, sensitivity(problem, gains, theta, names))


def predicted_candidates(
    problem: Problem, base: Base, added: Sequence[tuple[str, float]], exactnesses: Sequence[float]
) -> list[list[Candidate]]:
    """One linearised joint solution for each effect added at a magnitude, its cost predicted, for each exactness."""
    ends, steps = list[Variant](), list[float]()
    for name, start in added:
        names, theta = (*base.names, name), np.append(base.theta, start)
        there, step = moved(problem, theta, names, len(theta) - 1, parameter_limits(problem, names)[1])
        ends += [Variant(theta, names), Variant(there, names)]
        steps.append(step)
    found = observe_case(problem, base.gains, ends)
    out = []
    for end, e, there, step in zip(ends[::2], found[::2], found[1::2], steps, strict=True):
        last = (there - e) / step
        information, pull = base.jacobian.bordered(last), np.append(base.jacobian.pull(e), last @ e)
        candidates = []
        for exactness in exactnesses:
            held = problem.replace(exactness=exactness)
            delta, gain = normal_step(held, information, pull, end.theta, end.names, 1e-3)
            cost = 0.5 * float(e @ e) + 0.5 * float(prior_precision(held, len(delta)) @ end.theta**2) - gain
            candidates.append(Candidate(tuple(end.names), end.theta + delta, cost if np.isfinite(cost) else np.inf))
        out.append(candidates)
    return out


def relinearise(problem: Problem, base: Base, candidate: Candidate) -> Candidate:
    """A few Gauss-Newton steps that renew the gains and the added effect's derivative, not the base's."""
    names, theta = candidate.names, candidate.theta
    gains = filter_case(problem, theta, names)
    filtered, cost = gains.filtered, cost_of(problem, gains.filtered, theta)
    for _ in range(RENEWALS):
        e = flat(problem, filtered.innovations)
        last = last_derivative(problem, gains, theta, names)
        information, pull = base.jacobian.bordered(last), np.append(base.jacobian.pull(e), last @ e)
        improved = False
        for damping in (1e-3, 1.0):
            step, gain = normal_step(problem, information, pull, theta, names, damping)
            if gain < 0.5:
                break
            del gains
            gains = filter_case(problem, theta + step, names)
            trial_cost = cost_of(problem, gains.filtered, theta + step)
            if np.isfinite(trial_cost) and trial_cost < cost:
                theta, filtered, cost, improved = theta + step, gains.filtered, trial_cost, True
                break
        if not improved:
            break
    return Candidate(names, theta, cost if np.isfinite(cost) else np.inf)


def best_of(candidates: Sequence[Candidate]) -> list[Candidate]:
    """The best candidate of each hypothesis, whatever the order of its effects; best first."""
    best: dict[frozenset[str], Candidate] = {}
    for candidate in candidates:
        key = frozenset(candidate.names)
        if key not in best or candidate.cost < best[key].cost:
            best[key] = candidate
    return sorted(best.values(), key=lambda c: c.cost)


def additions(
    problem: Problem,
    base: Base,
    names: Sequence[str],
    exactnesses: Sequence[float],
    keep: int,
    pool: ThreadPoolExecutor,
) -> list[list[Candidate]]:
    """The most promising additions of one effect to a base after a few steps, for each exactness, best first."""
    added = [(name, start) for name in names if name not in base.names for start in starts(name, problem.vehicle)]
    added.sort(key=lambda one: one[0] in WAITED_FOR)  # which start at another row: not in one with others
    jobs = [pool.submit(predicted_candidates, problem, base, added[first : first + TOGETHER], exactnesses)
            for first in range(0, len(added), TOGETHER)]  # fmt: skip
    results = [result for job in jobs for result in job.result()]
    out = []
    for i, exactness in enumerate(exactnesses):
        held = problem.replace(exactness=exactness)
        promising = best_of([result[i] for result in results])[:keep]
        out.append(best_of(list(pool.map(lambda c, h=held: relinearise(h, base, c), promising))))
    return out


def canonical(names: Names, theta: np.ndarray) -> tuple[Names, np.ndarray]:
    """Effects in alphabetical order, their magnitudes with them."""
    order = sorted(range(len(names)), key=lambda i: names[i])
    first = len(theta) - len(names)
    return tuple(names[i] for i in order), np.concatenate([theta[:first], theta[first:][order]])


def full(problem: Problem, names: Names, theta: np.ndarray) -> dict[tuple[Names, float], Fit]:
    """Full fits under all exactnesses, started under coarse process noise and the widest tolerances.

    A vehicle file that is believed exact is given up where the quadratic around the first fit puts it far behind.
    """
    names, theta = canonical(names, theta)
    held = problem.replace(exactness=EXACTNESSES[0])
    start = minimise(with_more_process_noise(held), names, theta, iterations=5, enough=1.0).theta
    at = minimise(held, names, start)
    out = {(names, EXACTNESSES[0]): conclude(held, names, at)}
    for exactness in EXACTNESSES[1:]:
        tight = problem.replace(exactness=exactness)
        pull = at.jacobian.pull(flat(problem, at.filtered.innovations))
        step, gain = normal_step(tight, at.jacobian.information, pull, at.theta, names, 0.0)
        loss = cost_of(tight, at.filtered, at.theta) - gain - at.cost
        if loss - TOLERANCES * float(np.log(EXACTNESSES[0] / exactness)) < HOPELESS:
            again = minimise(tight, names, at.theta + step, jacobian=at.jacobian)
            out[names, exactness] = conclude(tight, names, again)
    return out


def full_all(
    problem: Problem, candidates: Sequence[Sequence[Candidate]], least: int, most: int, pool: ThreadPoolExecutor
) -> dict[tuple[Names, float], Fit]:
    """Full fits of the candidates, of which there is a list for each exactness, that lie near the best of theirs."""
    chosen: dict[Names, Candidate] = {}
    for some in candidates:
        for rank, c in enumerate(some[:most]):
            if rank < least or c.cost < some[0].cost + NEAR:
                chosen.setdefault(tuple(sorted(c.names)), c)
    jobs = [pool.submit(full, problem, c.names, c.theta) for c in chosen.values()]
    fits: dict[tuple[Names, float], Fit] = {}
    for job in jobs:
        fits |= job.result()
    return fits


def hypotheses_of(fits: dict[tuple[Names, float], Fit]) -> list[tuple[Fit, float]]:
    """Of each hypothesis its best fit and its log evidence over all exactnesses, best first.

    Args:
        fits: by effects and exactness; `none` has the empty tuple.
    """
    out = []
    for names in {names for names, _ in fits}:
        both = [f for (key, _), f in fits.items() if key == names]
        evidence = float(np.logaddexp.reduce([f.log_evidence for f in both])) - float(np.log(len(EXACTNESSES)))
        out.append((max(both, key=lambda f: f.log_evidence), evidence))
    return sorted(out, key=lambda pair: (-pair[1], pair[0].names))


def search(
    problem: Problem, names: Sequence[str], workers: int = 2, progress: Progress | None = None
) -> list[tuple[Fit, float]]:
    """Fits of `none`, the most promising singles of `names` and pairs of them, with their log evidence; best first."""
    tell = progress or (lambda _stage, _share: None)
    rough = with_more_process_noise(problem)
    start = np.zeros(problem.nuisances)
    with ThreadPoolExecutor(workers) as pool:
        tell("single effects", 0.0)
        nothing = [[Candidate((), start, 0.0)]]
        base = make_base(rough, (), start)
        singles = additions(rough, base, names, EXACTNESSES, STEPPED_SINGLES, pool)
        fits = full_all(problem, nothing, 1, 1, pool) | full_all(problem, singles, LEAST_SINGLES, FULL_SINGLES, pool)
        tell("pairs of effects", 0.5)
        fits |= search_pairs(problem, names, fits, pool)
        tell("pairs of effects", 1.0)
    return hypotheses_of(fits)


def handed_over(problem: Problem, seed: Fit, names: Sequence[str]) -> list[Candidate]:
    """A seed whose vehicle's deviations are stretched, with each such deviation taken over by the effect that it is."""
    out = []
    for name, tolerance in TOLERANCE_OF.items():
        at = NUISANCES.index(tolerance)
        stretched = seed.theta[at]
        if name in names and name not in seed.names and abs(stretched) > STRETCHED:
            theta = seed.theta.copy()
            theta[at] = 0.0
            magnitude = float(np.clip(stretched * problem.tolerance[at], *bounds(name, problem.vehicle)))
            out.append(Candidate((*seed.names, name), np.append(theta, magnitude), -abs(stretched)))
    return sorted(out, key=lambda c: c.cost)[:MOST_HANDED_OVER]


def search_pairs(
    problem: Problem, names: Sequence[str], fits: dict[tuple[Names, float], Fit], pool: ThreadPoolExecutor
) -> dict[tuple[Names, float], Fit]:
    """Full fits of the most promising pairs that contain one of the best singles."""
    rough = with_more_process_noise(problem)
    best = max(fits.values(), key=lambda f: f.log_evidence)
    adequate = best.mean_square < ADEQUATE
    exactnesses: tuple[float, ...] = EXACTNESSES
    if adequate:
        evidence = {
            x: max((f.log_evidence for (_, held), f in fits.items() if held == x), default=-np.inf) for x in EXACTNESSES
        }
        exactnesses = tuple(x for x in EXACTNESSES if evidence[x] > max(evidence.values()) - DECIDED)
    seeds: list[Fit] = []
    for f in sorted((f for f in fits.values() if f.names), key=lambda f: -f.log_evidence):
        if f.names not in [s.names for s in seeds]:
            seeds.append(f)
    pairs: list[list[Candidate]] = [[] for _ in exactnesses]
    for seed in seeds[: FEW_SEEDS if adequate else SEEDS]:
        grown = additions(rough, make_base(rough, seed.names, seed.theta), names, exactnesses, STEPPED_PAIRS, pool)
        pairs = [best_of([*some, *more]) for some, more in zip(pairs, grown, strict=True)]
    found = full_all(problem, pairs, LEAST_PAIRS, FEW_PAIRS if adequate else FULL_PAIRS, pool)
    new = [c for c in handed_over(problem, best, names) if tuple(sorted(c.names)) not in {key for key, _ in found}]
    for result in pool.map(lambda c: full(problem, c.names, c.theta), new):
        found |= result
    return found
