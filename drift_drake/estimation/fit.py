"""Joint Gauss-Newton over a hypothesis' magnitudes and the vehicle's tolerances, and its Laplace evidence."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.special import log_ndtr

from drift_drake.estimation.prior import bounds, is_gap, log_density, scale
from drift_drake.estimation.problem import (
    NUISANCES,
    START_MATTERS,
    TOLERANCES,
    Gains,
    Problem,
    counted,
    filter_case,
    flat,
    observe,
    observe_case,
)
from drift_drake.vehicle.catalogue import REFERENCE
from drift_drake.vehicle.parameters import VehicleParameters

MAGNITUDE_STEP = 2e-3  # of a magnitude's scale
LEAST_SHARE = 0.1  # of a constant of the vehicle file
CONVERGED = 0.05  # [nats] of predicted gain below which a fit has converged
LIMITER = NUISANCES.index("limiter_settling")
FLAT = 1e-6  # precision of a magnitude's prior, which keeps what the data do not show from being singular
MOST_AT_BOUNDS = 6  # parameters that a step may fix at their bounds, one after the other
STALE = 2.0  # [nats] of gain below which derivatives are not worth renewing


@dataclasses.dataclass(frozen=True)
class Fit:
    """A fitted hypothesis."""

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


def parameter_limits(problem: Problem, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of all parameters; of nuisances, that no constant of the car may fall below a tenth of its file's."""
    pairs = [problem.range_of(name) for name in names]
    low, high = np.full(problem.nuisances, -30.0), np.full(problem.nuisances, 30.0)
    with np.errstate(divide="ignore"):
        low[: len(NUISANCES)] = np.maximum(low[: len(NUISANCES)], (LEAST_SHARE - 1.0) / problem.tolerance)
    return np.concatenate([low, [a for a, _ in pairs]]), np.concatenate([high, [b for _, b in pairs]])


def cost_of(problem: Problem, gains: Gains, theta: np.ndarray) -> float:
    """Negative log posterior, up to constants, of parameters whose filter gave these innovations."""
    e = flat(problem, gains.innovations)
    prior = prior_precision(problem, len(theta))
    return 0.5 * float(e @ e) + 0.5 * gains.logdet + 0.5 * float(prior @ theta**2)


def sensitivity(
    problem: Problem, gains: Gains, theta: np.ndarray, names: Sequence[str], only: Sequence[int] | None = None
) -> np.ndarray:
    """Derivatives of the innovations [count, parameters] under frozen gains, by one-sided differences.

    Columns that are not in `only`, if given, are left zero, and so are those of the commands before the first row
    where no effect lets them matter.
    """
    base = observe_case(problem, gains, theta, names)
    out = np.zeros((len(base), len(theta)))
    _, high = parameter_limits(problem, names)
    first = problem.nuisances
    for column in [*range(len(NUISANCES)), *range(first, len(theta))]:
        if only is not None and column not in only:
            continue
        if column == LIMITER and "steering_rate_limit" not in names:
            continue
        step = problem.step if column < first else MAGNITUDE_STEP * problem.unit_of(names[column - first])
        step = step if theta[column] + step <= high[column] else -step
        moved = theta.copy()
        moved[column] += step
        out[:, column] = (observe_case(problem, gains, moved, names) - base) / step
    if only is None:
        _start_columns(problem, gains, theta, names, base, out)
    return out


def _start_columns(
    problem: Problem, gains: Gains, theta: np.ndarray, names: Sequence[str], base: np.ndarray, out: np.ndarray
) -> None:
    """Fills the columns of the commands before the first row; those of one run only move that run."""
    for kind, matters in enumerate(START_MATTERS):
        if not matters.intersection(names):
            continue
        row = 0
        for i, run in enumerate(problem.runs):
            column = len(NUISANCES) + 2 * i + kind
            moved = theta.copy()
            moved[column] += problem.step
            e = counted(problem, run, observe(problem, gains, moved, names, i)).ravel()
            out[row : row + len(e), column] = (e - base[row : row + len(e)]) / problem.step
            row += len(e)


def prior_precision(problem: Problem, count: int) -> np.ndarray:
    """Normal priors of the nuisances, all but flat ones of the magnitudes: precisions [count]."""
    out = np.full(count, FLAT)
    out[: problem.nuisances] = 1.0
    out[:TOLERANCES] = 1.0 / problem.exactness**2
    return out


def normal_step(
    problem: Problem, jacobian: np.ndarray, e: np.ndarray, theta: np.ndarray, names: Sequence[str], damping: float
) -> tuple[np.ndarray, float]:
    """Damped Gauss-Newton step within the bounds, and the gain [nats] that it promises."""
    prior = prior_precision(problem, len(theta))
    hessian = jacobian.T @ jacobian + np.diag(prior)
    gradient = jacobian.T @ e + prior * theta
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
    """A fit in progress: parameters, their filter, and derivatives that may lag behind by a small step."""

    theta: np.ndarray
    gains: Gains
    cost: float
    jacobian: np.ndarray
    iterations: int = 0


def minimise(
    problem: Problem,
    names: Sequence[str],
    theta: np.ndarray,
    iterations: int = 6,
    enough: float = CONVERGED,
    jacobian: np.ndarray | None = None,
) -> Linearised:
    """Levenberg-Marquardt from a start, re-linearised (gains and derivatives) as it moves.

    Args:
        enough: gain [nats] below which it stops; jacobian: derivatives near the start, if they are known.
    """
    theta = np.clip(theta, *parameter_limits(problem, names))
    gains = filter_case(problem, theta, names)
    jacobian = sensitivity(problem, gains, theta, names) if jacobian is None else jacobian
    at = Linearised(theta, gains, cost_of(problem, gains, theta), jacobian)
    damping = 1e-4
    for _ in range(iterations):
        at.iterations += 1
        e, drop, gain = flat(problem, at.gains.innovations), 0.0, 0.0
        for _ in range(6):
            step, gain = normal_step(problem, at.jacobian, e, at.theta, names, damping)
            if gain < enough:
                break
            trial = at.theta + step
            trial_gains = filter_case(problem, trial, names)
            trial_cost = cost_of(problem, trial_gains, trial)
            if np.isfinite(trial_cost) and trial_cost < at.cost:
                drop = at.cost - trial_cost
                at.theta, at.gains, at.cost = trial, trial_gains, trial_cost
                break
            damping = max(10.0 * damping, 1e-3)
        if drop < enough:
            break
        if drop > 0.5 * gain:
            damping *= 0.1
        if drop > max(STALE, enough):
            at.jacobian = sensitivity(problem, at.gains, at.theta, names)
    return at


def fit(problem: Problem, names: Sequence[str], theta: np.ndarray, iterations: int = 6) -> Fit:
    """The fit of a hypothesis from a start."""
    return conclude(problem, names, minimise(problem, names, theta, iterations))


def conclude(problem: Problem, names: Sequence[str], at: Linearised) -> Fit:
    """The fit's covariance and its Laplace evidence, magnitudes truncated to their bounds."""
    theta, jacobian, e = at.theta, at.jacobian, flat(problem, at.gains.innovations)
    prior = prior_precision(problem, len(theta))
    hessian = jacobian.T @ jacobian + np.diag(prior)
    unit = np.concatenate([np.ones(problem.nuisances), [scale(name, problem.vehicle) for name in names]])
    unit[:TOLERANCES] = problem.exactness
    covariance = np.linalg.inv(hessian * np.outer(unit, unit)) * np.outer(unit, unit)
    mode = theta - covariance @ (jacobian.T @ e + prior * theta)
    log_evidence = -at.cost + laplace_terms(hessian, covariance, theta, mode, names, problem.vehicle)
    log_evidence -= TOLERANCES * float(np.log(problem.exactness))
    magnitudes = zip(names, theta[problem.nuisances :], strict=True)
    known = all(is_gap(name, float(q), problem.vehicle.tolerance) for name, q in magnitudes)
    if not known or not np.isfinite(log_evidence):  # within tolerance, or a filter that diverged
        log_evidence = -np.inf
    mean_square = float(np.mean(e**2)) / problem.row_weight
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
