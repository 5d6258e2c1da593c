"""Joint Gauss-Newton over a hypothesis' magnitudes and the vehicle's tolerances, and its Laplace evidence."""

import dataclasses
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from scipy.special import log_ndtr

from drift_drake.car.effects.catalogue import LIMITS, REFERENCE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filter_state import SUBSTEPS
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.observed import observe_case, observe_each
from drift_drake.gap.estimation.prior import bounds, is_gap, log_density, scale
from drift_drake.gap.estimation.problem import (
    NUISANCES,
    START_MATTERS,
    TOLERANCES,
    Filtered,
    Gains,
    Problem,
    car,
    counted,
    flat,
    run_commands,
)
from drift_drake.gap.estimation.variants import Variant

MAGNITUDE_STEP = 2e-3  # of a magnitude's scale
LEAST_SHARE = 0.1  # of a constant of the vehicle file
CONVERGED = 0.05  # [nats] of predicted gain below which a fit has converged
LIMITER = NUISANCES.index("limiter_settling")
MOST_COARSE = 0.01  # [s] between rows up to which derivatives take one Runge-Kutta step a row
FLAT = 1e-6  # precision of a magnitude's prior, which keeps what the data do not show from being singular
MOST_AT_BOUNDS = 6  # parameters that a step may fix at their bounds, one after the other
STALE = 2.0  # [nats] of gain below which derivatives are not worth renewing


@dataclasses.dataclass(frozen=True)
class Derivatives:
    """The derivatives J [count, parameters], by blocks: a run's own parameters move no other run's innovations."""

    blocks: Sequence[np.ndarray]  # of each run [its count, its columns]
    columns: Sequence[np.ndarray]  # parameters that the columns of each run's block are of
    parameters: int

    @cached_property
    def information(self) -> np.ndarray:
        """J'J [parameters, parameters]."""
        out = np.zeros((self.parameters, self.parameters))
        for block, columns in zip(self.blocks, self.columns, strict=True):
            out[np.ix_(columns, columns)] += block.T @ block
        return out

    def pull(self, e: np.ndarray) -> np.ndarray:
        """J'e [parameters] of innovations e [count]."""
        out = np.zeros(self.parameters)
        for block, columns, part in zip(self.blocks, self.columns, self.by_run(e), strict=True):
            out[columns] += block.T @ part
        return out

    def by_run(self, e: np.ndarray) -> Iterator[np.ndarray]:
        """The parts of e [count, ...] that are of each run."""
        at = 0
        for block in self.blocks:
            yield e[at : at + len(block)]
            at += len(block)

    def rows(self, kept: Sequence[np.ndarray]) -> "Derivatives":
        """Those of some of each run's innovations [its count] bool."""
        blocks = [block[mask] for block, mask in zip(self.blocks, kept, strict=True)]
        return Derivatives(blocks, self.columns, self.parameters)

    def bordered(self, last: np.ndarray) -> np.ndarray:
        """The information [parameters + 1, parameters + 1] with one more parameter, of derivatives `last` [count]."""
        cross = np.append(self.pull(last), last @ last)
        out = np.empty((len(cross), len(cross)))
        out[:-1, :-1], out[-1], out[:, -1] = self.information, cross, cross
        return out

    def dense(self) -> np.ndarray:
        """J [count, parameters]."""
        out = np.zeros((sum(len(block) for block in self.blocks), self.parameters))
        for part, block, columns in zip(self.by_run(out), self.blocks, self.columns, strict=True):
            part[:, columns] = block
        return out


@dataclasses.dataclass(frozen=True)
class Fit:
    names: tuple[str, ...]
    theta: np.ndarray  # nuisances, then magnitudes
    cost: float  # half the squared innovations, half the log determinant, half the squared nuisances
    covariance: np.ndarray  # of theta
    log_evidence: float
    mean_square: float  # of the innovations that count
    iterations: int
    exactness: float = 1.0  # of the vehicle's deviations, believed in this fit

    @property
    def nuisances(self) -> int:
        return len(self.theta) - len(self.names)

    @property
    def magnitudes(self) -> dict[str, float]:
        return dict(zip(self.names, (float(q) for q in self.theta[self.nuisances :]), strict=True))

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the fitted magnitudes."""
        sigma = np.sqrt(np.diag(self.covariance)[self.nuisances :])
        return dict(zip(self.names, (float(q) for q in sigma), strict=True))


def no_effects(problem: Problem) -> Fit:
    """The vehicle file's car as a fit: no effects, no deviations."""
    count = problem.nuisances
    return Fit((), np.zeros(count), 0.0, np.eye(count), 0.0, 0.0, 0)


def parameter_limits(problem: Problem, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of all parameters; of nuisances, that no constant of the car may fall below a tenth of its file's."""
    pairs = [problem.range_of(name) for name in names]
    low, high = np.full(problem.nuisances, -30.0), np.full(problem.nuisances, 30.0)
    with np.errstate(divide="ignore"):
        low[: len(NUISANCES)] = np.maximum(low[: len(NUISANCES)], (LEAST_SHARE - 1.0) / problem.tolerance)
    return np.concatenate([low, [a for a, _ in pairs]]), np.concatenate([high, [b for _, b in pairs]])


def cost_of(problem: Problem, filtered: Filtered, theta: np.ndarray) -> float:
    """Negative log posterior, up to constants, of parameters whose filter gave these innovations."""
    e = flat(problem, filtered.innovations)
    prior = prior_precision(problem, len(theta))
    with np.errstate(over="ignore"):  # of parameters with which a car is lost: as bad as can be
        return 0.5 * float(e @ e) + 0.5 * filtered.logdet + 0.5 * float(prior @ theta**2)


def sensitivity(problem: Problem, gains: Gains, theta: np.ndarray, names: Sequence[str]) -> Derivatives:
    """Derivatives of the innovations that count, under frozen gains, by one-sided differences."""
    parts = [run_sensitivity(problem, gains, theta, names, i) for i in range(len(problem.runs))]
    return Derivatives([block for block, _ in parts], [columns for _, columns in parts], len(theta))


def run_sensitivity(
    problem: Problem, gains: Gains, theta: np.ndarray, names: Sequence[str], index: int
) -> tuple[np.ndarray, np.ndarray]:
    """Those of one run [its count, columns], and the parameters that the columns are by; `gains` are those at theta.

    Parameters that do nothing under these effects are left out: of the commands before the first row, of a limiter.
    """
    limited = not LIMITS.isdisjoint(names)
    shared = [column for column in range(len(NUISANCES)) if limited or column != LIMITER]
    starts = [
        len(NUISANCES) + 2 * index + kind for kind, under in enumerate(START_MATTERS) if under.intersection(names)
    ]
    columns = [*shared, *starts, *range(problem.nuisances, len(theta))]
    run, effects, high = problem.runs[index], car(problem, theta, names)[1], parameter_limits(problem, names)[1]
    commands = run_commands(problem, index, theta, effects)
    there, steps = zip(*(moved(problem, theta, names, column, high) for column in columns), strict=True)
    variants = [Variant(theta, names, commands=commands)]
    for column, at in zip(columns, there, strict=True):  # the first are deviations of the car, behind its actuators
        variants.append(Variant(at, names, commands=commands if column < LIMITER else None))
    e = observe_each(problem, gains, index, variants, substeps=enough_steps(problem, theta, names))
    by = (e[1:] - e[0]) / np.array(steps)[:, None, None]
    return counted(problem, run, np.moveaxis(by, 0, -1)).reshape(-1, len(columns)), np.array(columns)


def enough_steps(problem: Problem, theta: np.ndarray, names: Sequence[str]) -> int:
    """Runge-Kutta steps a row that derivatives take."""
    fine = all(round(run.period, 6) <= MOST_COARSE for run in problem.runs)
    return 1 if fine and car(problem, theta, names)[1].tyre_relaxation == 0.0 else SUBSTEPS


def last_derivative(problem: Problem, gains: Gains, theta: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """The same by the last parameter [count]."""
    there, step = moved(problem, theta, names, len(theta) - 1, parameter_limits(problem, names)[1])
    ends = [Variant(theta, names), Variant(there, names)]
    e = observe_case(problem, gains, ends, enough_steps(problem, theta, names))
    return np.asarray((e[1] - e[0]) / step)


def moved(
    problem: Problem, theta: np.ndarray, names: Sequence[str], column: int, high: np.ndarray
) -> tuple[np.ndarray, float]:
    """Parameters a step further in one of them, within its bound `high`, and the step."""
    first = problem.nuisances
    step = problem.step if column < first else MAGNITUDE_STEP * problem.unit_of(names[column - first])
    step = step if theta[column] + step <= high[column] else -step
    there = theta.copy()
    there[column] += step
    return there, step


def prior_precision(problem: Problem, count: int) -> np.ndarray:
    """Normal priors of the nuisances, all but flat ones of the magnitudes: precisions [count]."""
    out = np.full(count, FLAT)
    out[: problem.nuisances] = 1.0
    out[:TOLERANCES] = 1.0 / problem.exactness**2
    return out


def normal_step(
    problem: Problem, information: np.ndarray, pull: np.ndarray, theta: np.ndarray, names: Sequence[str], damping: float
) -> tuple[np.ndarray, float]:
    """Damped Gauss-Newton step within the bounds, and the gain [nats] that it promises.

    Args:
        information: J'J [n, n] and pull: J'e [n], of the innovations e and their derivatives J.
    """
    prior = prior_precision(problem, len(theta))
    hessian = information + np.diag(prior)
    gradient = pull + prior * theta
    low, high = parameter_limits(problem, names)
    free = np.ones(len(theta), dtype=bool)
    step = np.zeros(len(theta))
    for _ in range(MOST_AT_BOUNDS):
        step[:] = 0.0
        h = hessian[np.ix_(free, free)]
        try:
            step[free] = -np.linalg.solve(h + damping * np.diag(np.diag(h)), gradient[free])
        except np.linalg.LinAlgError:  # a filter that diverged has no derivatives: no step, and no gain from it
            return np.zeros(len(theta)), 0.0
        outside = free & ((theta + step < low) | (theta + step > high))
        at_bound = outside & ((theta <= low) | (theta >= high))
        if not np.any(at_bound):
            break
        free &= ~at_bound
    step = np.clip(theta + step, low, high) - theta
    return step, -float(gradient @ step + 0.5 * step @ hessian @ step)


@dataclasses.dataclass
class Linearised:
    """A fit in progress: parameters, their innovations, and derivatives that may lag behind by a small step."""

    theta: np.ndarray
    filtered: Filtered
    cost: float
    jacobian: Derivatives
    iterations: int = 0


def minimise(
    problem: Problem,
    names: Sequence[str],
    theta: np.ndarray,
    iterations: int = 6,
    enough: float = CONVERGED,
    jacobian: Derivatives | None = None,
) -> Linearised:
    """Levenberg-Marquardt from a start, re-linearised (gains and derivatives) as it moves.

    Args:
        enough: gain [nats] below which it stops; jacobian: derivatives near the start, if they are known.
    """
    theta = np.clip(theta, *parameter_limits(problem, names))
    gains = filter_case(problem, theta, names)
    jacobian = sensitivity(problem, gains, theta, names) if jacobian is None else jacobian
    at = Linearised(theta, gains.filtered, cost_of(problem, gains.filtered, theta), jacobian)
    del jacobian
    damping = 1e-4
    for _ in range(iterations):
        at.iterations += 1
        pull, drop, gain = at.jacobian.pull(flat(problem, at.filtered.innovations)), 0.0, 0.0
        for _ in range(6):
            step, gain = normal_step(problem, at.jacobian.information, pull, at.theta, names, damping)
            if gain < enough:
                break
            del gains  # of the largest arrays there is one at a time: logs may be long
            gains = filter_case(problem, at.theta + step, names)
            trial_cost = cost_of(problem, gains.filtered, at.theta + step)
            if np.isfinite(trial_cost) and trial_cost < at.cost:
                drop = at.cost - trial_cost
                at.theta, at.filtered, at.cost = at.theta + step, gains.filtered, trial_cost
                break
            damping = max(10.0 * damping, 1e-3)
        if drop < enough:
            break
        if drop > 0.5 * gain:
            damping *= 0.1
        if drop > max(STALE, enough):
            del at.jacobian
            at.jacobian = sensitivity(problem, gains, at.theta, names)
    return at


def conclude(problem: Problem, names: Sequence[str], at: Linearised) -> Fit:
    """The fit's covariance and its Laplace evidence, magnitudes truncated to their bounds."""
    theta, e = at.theta, flat(problem, at.filtered.innovations)
    prior = prior_precision(problem, len(theta))
    hessian = at.jacobian.information + np.diag(prior)
    unit = np.concatenate([np.ones(problem.nuisances), [scale(name, problem.vehicle) for name in names]])
    unit[:TOLERANCES] = problem.exactness
    covariance = np.linalg.inv(hessian * np.outer(unit, unit)) * np.outer(unit, unit)
    mode = theta - covariance @ (at.jacobian.pull(e) + prior * theta)
    log_evidence = -at.cost + laplace_terms(hessian, covariance, theta, mode, names, problem.vehicle)
    log_evidence -= TOLERANCES * float(np.log(problem.exactness))
    magnitudes = zip(names, theta[problem.nuisances :], strict=True)
    known = all(is_gap(name, float(q), problem.vehicle.tolerance) for name, q in magnitudes)
    if not known or not np.isfinite(log_evidence):  # within tolerance, or a filter that diverged
        log_evidence = -np.inf
    mean_square = float(np.mean(e**2)) / problem.tempering
    return Fit(tuple(names), theta, at.cost, covariance, log_evidence, mean_square, at.iterations, problem.exactness)


def laplace_terms(
    hessian: np.ndarray,
    covariance: np.ndarray,
    theta: np.ndarray,
    mode: np.ndarray,
    names: Sequence[str],
    vehicle: VehicleParameters = REFERENCE,
) -> float:
    """What Laplace's approximation adds to the log posterior's peak.

    Nuisances are integrated out; the magnitudes are Gaussians around `mode` (where the quadratic has its peak), cut
    off at their bounds, one by one.
    """
    first = len(theta) - len(names)
    out = -0.5 * float(np.linalg.slogdet(hessian[:first, :first])[1])
    if not names:
        return out
    marginal = covariance[first:, first:]
    out += 0.5 * len(names) * float(np.log(2.0 * np.pi)) + 0.5 * float(np.linalg.slogdet(marginal)[1])
    for i, name in enumerate(names):
        low, high = bounds(name, vehicle)
        sigma, peak = float(np.sqrt(marginal[i, i])), float(mode[first + i])
        if theta[first + i] <= low or theta[first + i] >= high:
            # The peak lies outside: the cost at the bound already holds the quadratic's rise from the peak.
            distance = abs(peak - theta[first + i]) / sigma
            out += 0.5 * distance**2 + float(log_ndtr(-distance))
        else:
            inside = np.exp(log_ndtr((high - peak) / sigma)) - np.exp(log_ndtr((low - peak) / sigma))
            out += float(np.log(max(inside, 1e-300)))
        out += log_density(name, vehicle)
    return out
