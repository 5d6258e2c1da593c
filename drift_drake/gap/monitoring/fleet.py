"""Many cars and days in one model: what all cars lack, what one car lacks, what a day brings.

Each day's whitened scores are normal about their information times the day's amplitudes (`evidence.whitened`). The
amplitudes are a sum: of the fleet's, of the car's own and of the day's, most of them zero. Terms are taken in one by
one, the one first that gains most evidence on top of those that are in, until none is more probable than not: a greedy
search for the sparse posterior mode (compare Tipping and Faul 2003).
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import InvalidLogError, case_paths, read_case, read_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.executors import ExecutorConfig, results_of
from drift_drake.gap.estimation.prior import TWO_SIDED
from drift_drake.gap.monitoring.baselines import block_sums
from drift_drake.gap.monitoring.evidence import EvidenceProblem, Sums, no_sums, whitened
from drift_drake.gap.monitoring.monitor import make_monitor
from drift_drake.gap.monitoring.watch import WATCHED, monitor_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Folders = Mapping[tuple[str, str], Path]  # of cars and days
Level = Literal["fleet", "car", "day"]
PRIOR: dict[Level, float] = {"fleet": 0.5, "car": 0.2, "day": 0.1}
"""Probability that a fleet, a car, a day has an effect at all; shared by the effects."""
SHAPE = 0.15  # relative error of what an effect does (see `gap.diagnosis.calibrated.posterior`)
ODD = 4.0  # standard deviations of a day's misfit beyond its expectation, from which on it is an outlier
MOST = 200  # terms
ALL = "all cars"


class FleetDay(NamedTuple):
    car: str
    name: str
    sums: Sums


@dataclasses.dataclass(frozen=True)
class Term:
    """One effect, of the fleet, of a car or of a day."""

    level: Level
    owner: str  # "" of the fleet, a car, or CAR/DAY
    effect: str
    magnitude: float
    low: float  # 95 % interval
    high: float
    probability: float


@dataclasses.dataclass(frozen=True)
class FleetFindings:
    """What was found, and what no term explains."""

    cars: tuple[str, ...]
    days: int
    terms: tuple[Term, ...]
    outliers: dict[str, float]  # CAR/DAY and its misfit in standard deviations


class _Stack(NamedTuple):
    """All days' whitened scores."""

    w: np.ndarray  # [days, n]
    m: np.ndarray  # [days, n, n]


class _Choice(NamedTuple):
    """A term that is in: a node, and the days that it acts on."""

    level: Level
    owner: str
    node: int
    days: np.ndarray  # [days] bool


def fleet_findings(problem: EvidenceProblem, days: Sequence[FleetDay]) -> FleetFindings:
    """What a fleet's days show.

    Raises:
        ValueError: no day.
    """
    if not days:
        raise ValueError("a fleet needs at least one day")
    raw, groups = _stacked(problem, days), _groups(days)
    stack = _tempered(problem, raw, [])
    chosen: list[_Choice] = []
    odds: list[float] = []
    while len(chosen) < MOST:
        best, gain = _best(problem, stack, groups, chosen)
        if best is None or gain <= 0.0:
            break
        chosen.append(best)
        odds.append(gain)
        if best.level == "fleet":
            stack = _tempered(problem, raw, [c for c in chosen if c.level == "fleet"])
    amplitude, covariance = _fit(problem, stack, chosen)
    terms = [_term(problem, c, amplitude[i], covariance[i, i], odds[i]) for i, c in enumerate(chosen)]
    left = np.sum(_residual(stack, chosen, amplitude) ** 2, axis=1)
    n = stack.w.shape[1]
    excess = (left - n) / np.sqrt(2.0 * n)
    outliers = {f"{day.car}/{day.name}": float(z) for day, z in zip(days, excess, strict=True) if z > ODD}
    return FleetFindings(tuple(dict.fromkeys(day.car for day in days)), len(days), tuple(terms), outliers)


def shared_columns(folders: Folders) -> tuple[str, ...]:
    """The measured columns that all runs of a fleet have: days are compared by what the same columns show.

    Raises:
        InvalidLogError: a run cannot be used, or has no torque commands.
    """
    shared = list(WATCHED)
    for folder in folders.values():
        for path in case_paths(folder):
            run = read_run(path)
            if run.tau_cmd is None:
                raise InvalidLogError(f"{path}: has no column tau_cmd, without which no run can be judged; add it")
            shared = [name for name in shared if run.column(name) is not None]
    return tuple(shared)


def day_sums(folder: Path, vehicle: VehicleParameters, own: Effects, used: Sequence[str]) -> Sums:
    """Sums over all runs of a day, each at its own rate and with its own noise."""
    total = no_sums(len(evidence_problem_of(vehicle, own, used).nodes))
    for run in read_case(folder):
        for block in block_sums(monitor_of(run, vehicle, own, used), run):
            total = Sums(*(a + b for a, b in zip(total, block, strict=True)))
    return total


def days_of(
    folders: Folders, vehicle: VehicleParameters, own: Effects, used: Sequence[str],
    run_on: ExecutorConfig | None = None,
) -> list[FleetDay]:  # fmt: skip
    """All days; workers, on other machines perhaps, read the same folders. Without them, one after another."""
    job, paths = functools.partial(day_sums, vehicle=vehicle, own=own, used=used), list(folders.values())
    sums = [job(path) for path in paths] if run_on is None else results_of(run_on, job, paths, "day")
    return [FleetDay(car, day, total) for (car, day), total in zip(folders, sums, strict=True)]


def evidence_problem_of(vehicle: VehicleParameters, own: Effects, used: Sequence[str]) -> EvidenceProblem:
    """What is judged of days with these measured columns."""
    return make_monitor(vehicle, own, used).problem


def _stacked(problem: EvidenceProblem, days: Sequence[FleetDay]) -> _Stack:
    recent = Sums(*(np.stack([getattr(day.sums, name) for day in days]) for name in Sums._fields))
    return _Stack(*whitened(problem, recent, no_sums(len(problem.nodes), len(days))))


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
    """Sets of days that a term may act on."""
    cars = np.array([day.car for day in days])
    out: list[tuple[Level, str, np.ndarray]] = []
    if len(set(cars)) > 1:
        out.append(("fleet", "", np.ones(len(days), dtype=bool)))
    out += [("car", car, cars == car) for car in dict.fromkeys(cars.tolist())]
    for i, day in enumerate(days):
        if np.count_nonzero(cars == day.car) > 1:
            out.append(("day", f"{day.car}/{day.name}", np.arange(len(days)) == i))
    return out


def _residual(stack: _Stack, chosen: Sequence[_Choice], amplitude: np.ndarray) -> np.ndarray:
    r = stack.w.copy()
    for c, x in zip(chosen, amplitude, strict=True):
        r[c.days] -= x * stack.m[c.days, :, c.node]
    return r


def _fit(problem: EvidenceProblem, stack: _Stack, chosen: Sequence[_Choice]) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes of the chosen terms and their covariance."""
    columns = np.zeros((len(chosen), *stack.w.shape))
    for i, c in enumerate(chosen):
        columns[i, c.days] = stack.m[c.days, :, c.node]
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
    best, most = None, -np.inf
    for level, owner, which in groups:
        b, a = score[which].sum(axis=0), information[which].sum(axis=0)
        precision = a + 1.0 / problem.deviation**2
        x = b / precision
        gain = 0.5 * x**2 * precision - 0.5 * np.log(precision * problem.deviation**2)
        gain += problem.log_prior + np.log(PRIOR[level])
        gain = np.where(problem.signed | (x > 0.0), gain, -np.inf)
        for i in effects[np.argsort(-gain[effects])][:3]:
            if gain[i] > most and (level, owner, problem.nodes[i].name) not in taken:
                best, most = _Choice(level, owner, int(i), which), float(gain[i])
    return best, most


def _term(problem: EvidenceProblem, c: _Choice, amplitude: float, variance: float, log_odds: float) -> Term:
    node = problem.nodes[c.node]
    half = TWO_SIDED * float(np.sqrt(variance))
    ends = sorted(node.magnitude_at(float(amplitude) + side * half) for side in (-1.0, 1.0))
    probability = 1.0 / (1.0 + float(np.exp(-min(log_odds, 700.0))))
    return Term(c.level, c.owner, node.name, node.magnitude_at(float(amplitude)), ends[0], ends[1], probability)


def draw_fleet(found: FleetFindings) -> "Figure":
    """Cars by effects, magnitudes in shares of their practical range.

    Rows: all cars, and the cars that have something of their own; columns: effects; a cell:
    the magnitude.
    """
    from matplotlib.figure import Figure  # slow to import

    effects = list(dict.fromkeys(term.effect for term in found.terms)) or ["none"]
    owners = [ALL, *dict.fromkeys(term.owner for term in found.terms if term.level != "fleet")]
    values, labels = np.zeros((len(owners), len(effects))), {}
    for term in found.terms:
        at = owners.index(term.owner or ALL), effects.index(term.effect)
        values[at] = term.magnitude / max(abs(CATALOGUE[term.effect].low), abs(CATALOGUE[term.effect].high))
        labels[at] = f"{term.magnitude:+.3g}"
    figure = Figure(figsize=(2.0 + 1.1 * len(effects), 1.8 + 0.35 * len(owners)), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(values, cmap="RdBu_r", vmin=-1.0, vmax=1.0, aspect="auto")
    for (row, column), text in labels.items():
        axes.text(column, row, text, ha="center", va="center", color="white" if abs(values[row, column]) > 0.6 else "k")
    axes.set_xticks(range(len(effects)), effects, rotation=30, ha="right")
    axes.set_yticks(range(len(owners)), owners)
    axes.set_title(f"{len(found.cars)} cars, {found.days} days: what is missing from the simulator")
    figure.colorbar(image, ax=axes, label="magnitude, of the practical range")
    return figure
