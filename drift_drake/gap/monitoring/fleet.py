"""Many cars and days in one model: what all cars lack, what one car lacks, what a day brings.

Each day's whitened scores are normal about their mean by the day's amplitudes (`fleet_days`). The amplitudes are a sum
of the fleet's, its drift, what a day brings to all cars, the car's own and its day's, most of them zero. Terms are
taken in one by one, the one first that gains most evidence on top of those that are in, until none is more probable
than not: a greedy search for the sparse posterior mode (compare Tipping and Faul 2003). The effects that are in are
then laid out over cars and days (`fleet_parts`).
"""

import dataclasses
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from drift_drake.car.effects.catalogue import LIMITS
from drift_drake.gap.estimation.prior import TWO_SIDED
from drift_drake.gap.monitoring.evidence import EvidenceProblem
from drift_drake.gap.monitoring.fleet_days import FleetDay
from drift_drake.gap.monitoring.fleet_parts import Parts, parts_of

Level = Literal["fleet", "drift", "date", "car", "day"]
PRIOR: dict[Level, float] = {"fleet": 0.5, "drift": 0.2, "date": 0.1, "car": 0.2, "day": 0.1}
"""Probability that all cars have an effect at all, from the first day to the last, on one day; that a car has one, or a
car on one day; shared by the effects."""
SHARED: tuple[Level, ...] = ("fleet", "drift", "date")
SHAPE = 0.15  # relative error of what an effect does (see `gap.diagnosis.calibrated.posterior`)
ODD = 4.0  # standard deviations of a day's misfit beyond its expectation, from which on it is an outlier
MOST = 200  # terms
FLAT = 100.0  # times what is believed of an amplitude, where a day is looked at by itself


@dataclasses.dataclass(frozen=True)
class Term:
    """One effect, of all cars, of a car or of its day."""

    level: Level
    owner: str  # "" of all cars, DAY, CAR, or CAR/DAY
    effect: str
    magnitude: float
    low: float  # 95 % interval
    high: float
    probability: float


@dataclasses.dataclass(frozen=True)
class Table:
    """One effect's magnitude over cars and days, and how it is made up."""

    effect: str
    cars: tuple[str, ...]
    days: tuple[str, ...]  # in the order of their names, which is that of time
    magnitudes: np.ndarray  # [cars, days], NaN where a car did not drive
    deviations: np.ndarray  # [cars, days]
    parts: Parts


@dataclasses.dataclass(frozen=True)
class FleetFindings:
    """What was found, and what no term explains."""

    cars: tuple[str, ...]
    days: int
    terms: tuple[Term, ...]
    tables: tuple[Table, ...]  # of the terms' effects, but limits
    outliers: dict[str, float]  # CAR/DAY and its misfit in standard deviations


class _Stack(NamedTuple):
    """All days' whitened scores."""

    w: np.ndarray  # [days, n]
    m: np.ndarray  # [days, n, n]


class _Choice(NamedTuple):
    """A term that is in: a node, and how much it acts on each day."""

    level: Level
    owner: str
    node: int
    share: np.ndarray  # [days]


def fleet_findings(problem: EvidenceProblem, days: Sequence[FleetDay]) -> FleetFindings:
    """What a fleet's days show.

    Raises:
        ValueError: no day.
    """
    if not days:
        raise ValueError("a fleet needs at least one day")
    raw, groups = _Stack(np.stack([day.w for day in days]), np.stack([day.m for day in days])), _groups(days)
    stack = _tempered(problem, raw, [])
    chosen: list[_Choice] = []
    odds: list[float] = []
    while len(chosen) < MOST:
        best, gain = _best(problem, stack, groups, chosen)
        if best is None or gain <= 0.0:
            break
        chosen.append(best)
        odds.append(gain)
        if best.level in SHARED:
            stack = _tempered(problem, raw, [c for c in chosen if c.level in SHARED])
    amplitude, covariance = _fit(problem, stack, chosen)
    terms = [_term(problem, c, amplitude[i], covariance[i, i], odds[i]) for i, c in enumerate(chosen)]
    left = np.sum(_residual(stack, chosen, amplitude) ** 2, axis=1)
    n = stack.w.shape[1]
    excess = (left - n) / np.sqrt(2.0 * n)
    outliers = {f"{day.car}/{day.name}": float(z) for day, z in zip(days, excess, strict=True) if z > ODD}
    cars = tuple(dict.fromkeys(day.car for day in days))
    return FleetFindings(cars, len(days), tuple(terms), _tables(problem, stack, days, chosen), outliers)


def _tables(
    problem: EvidenceProblem, stack: _Stack, days: Sequence[FleetDay], chosen: Sequence[_Choice]
) -> tuple[Table, ...]:
    """The tables of the chosen effects, all of them fitted to each day by itself."""
    node_of = {problem.nodes[c.node].name: c.node for c in reversed(chosen)}
    at = list(node_of.values())
    m = stack.m[:, :, at]
    precision = m.swapaxes(1, 2) @ m + np.diag((FLAT * problem.deviation[at]) ** -2.0)
    covariance = np.linalg.inv(precision)
    found = np.einsum("dij,dsj,ds->di", covariance, m, stack.w)
    cars, names = tuple(dict.fromkeys(day.car for day in days)), tuple(sorted({day.name for day in days}))
    out = list[Table]()
    for i, (effect, node) in enumerate(node_of.items()):
        if effect in LIMITS:
            continue
        q, variances = np.full((2, len(cars), len(names)), np.nan)
        for k, day in enumerate(days):
            place = cars.index(day.car), names.index(day.name)
            q[place] = problem.nodes[node].magnitude * found[k, i]
            variances[place] = problem.nodes[node].magnitude ** 2 * covariance[k, i, i]
        width = abs(problem.nodes[node].magnitude) * float(problem.deviation[node])
        out.append(Table(effect, cars, names, q, np.sqrt(variances), parts_of(q, variances, cars, names, width)))
    return tuple(out)


def _tempered(problem: EvidenceProblem, raw: _Stack, shared: Sequence[_Choice]) -> _Stack:
    """Scores less sure by the error of what effects do, the more they explain; not by what all cars have.

    How well a shared term fits is seen on all of them.
    """
    r = _residual(raw, shared, _fit(problem, raw, shared)[0])
    n = raw.w.shape[1]
    a, b = np.einsum("dij,dij->dj", raw.m, raw.m), np.einsum("dij,di->dj", raw.m, r)
    explained = np.max(0.5 * b**2 / np.maximum(a, 1e-12), axis=1)
    root = np.sqrt(1.0 + 2.0 * SHAPE**2 * explained / n)
    return _Stack(raw.w / root[:, None], raw.m / root[:, None, None])


def _groups(days: Sequence[FleetDay]) -> list[tuple[Level, str, np.ndarray]]:
    """Shares [days] that a term may have in each day: a drift's go from 0 on the first to 1 on the last."""
    cars, names = np.array([day.car for day in days]), np.array([day.name for day in days])
    ordered = sorted(set(names.tolist()))
    out: list[tuple[Level, str, np.ndarray]] = []
    if len(set(cars)) > 1:
        out.append(("fleet", "", np.ones(len(days))))
        together = [name for name in ordered if len(set(cars[names == name])) > 1]
        if len(together) > 1:
            out.append(("drift", "", np.searchsorted(ordered, names) / (len(ordered) - 1.0)))
            out += [("date", name, 1.0 * (names == name)) for name in together]
    out += [("car", car, 1.0 * (cars == car)) for car in dict.fromkeys(cars.tolist())]
    for i, day in enumerate(days):
        if np.count_nonzero(cars == day.car) > 1:
            out.append(("day", f"{day.car}/{day.name}", 1.0 * (np.arange(len(days)) == i)))
    return out


def _residual(stack: _Stack, chosen: Sequence[_Choice], amplitude: np.ndarray) -> np.ndarray:
    r = stack.w.copy()
    for c, x in zip(chosen, amplitude, strict=True):
        r -= x * c.share[:, None] * stack.m[:, :, c.node]
    return r


def _fit(problem: EvidenceProblem, stack: _Stack, chosen: Sequence[_Choice]) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes of the chosen terms and their covariance."""
    columns = np.zeros((len(chosen), *stack.w.shape))
    for i, c in enumerate(chosen):
        columns[i] = c.share[:, None] * stack.m[:, :, c.node]
    flat = columns.reshape(len(chosen), stack.w.size)
    nodes = [c.node for c in chosen]
    precision = flat @ flat.T + np.diag(1.0 / problem.deviation[nodes] ** 2)
    covariance = np.linalg.inv(precision) if len(chosen) else np.zeros((0, 0))
    return covariance @ (flat @ stack.w.ravel() + problem.mean[nodes] / problem.deviation[nodes] ** 2), covariance


def _best(
    problem: EvidenceProblem, stack: _Stack, groups: Sequence[tuple[Level, str, np.ndarray]], chosen: Sequence[_Choice]
) -> tuple[_Choice | None, float]:
    """The term that gains most, and its log odds [nats] on top of those that are in."""
    r = _residual(stack, chosen, _fit(problem, stack, chosen)[0])
    score = np.einsum("dij,di->dj", stack.m, r)
    information = np.einsum("dij,dij->dj", stack.m, stack.m)
    taken = {(c.level, c.owner, problem.nodes[c.node].name) for c in chosen}
    effects = np.flatnonzero(problem.member.sum(axis=1))
    limits = np.array([node.name in LIMITS for node in problem.nodes])
    best, most = None, -np.inf
    for level, owner, share in groups:
        b, a = share @ score, share**2 @ information
        precision = a + 1.0 / problem.deviation**2
        x = b / precision
        gain = 0.5 * x**2 * precision - 0.5 * np.log(precision * problem.deviation**2)
        gain += problem.log_prior + np.log(PRIOR[level])
        allowed = ~limits if level == "drift" else problem.signed | (x > 0.0)
        gain = np.where(allowed, gain, -np.inf)
        for i in effects[np.argsort(-gain[effects])][:3]:
            if gain[i] > most and (level, owner, problem.nodes[i].name) not in taken:
                best, most = _Choice(level, owner, int(i), share), float(gain[i])
    return best, most


def _term(problem: EvidenceProblem, c: _Choice, amplitude: float, variance: float, log_odds: float) -> Term:
    node = problem.nodes[c.node]
    half = TWO_SIDED * float(np.sqrt(variance))
    at = (lambda x: node.magnitude * x) if c.level == "drift" else node.magnitude_at
    low, high = sorted(at(float(amplitude) + side * half) for side in (-1.0, 1.0))
    probability = 1.0 / (1.0 + float(np.exp(-min(log_odds, 700.0))))
    return Term(c.level, c.owner, node.name, at(float(amplitude)), low, high, probability)
