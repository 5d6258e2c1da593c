"""The car that predicts best: robust output error over short windows, with bounds and priors.

Windows overlap and what the model lacks goes on for seconds, so that errors tell less than their number says: the
criterion is raised to a power, `evidence`, below one. Each window's error in each channel counts by a redescending
loss (Geman and McClure 1987): what no parameter can correct, a wheel that spins alone say, then moves none. The loss
starts wide and is narrowed, so that the first guess may be far off.
"""

import dataclasses
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from drift_drake.estimation.unknowns import DIFFERENCE, Unknown, added, magnitudes
from drift_drake.estimation.windows import HORIZONS, WindowedRun, errors
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import Constants

WIDTHS = (100.0, 30.0, 8.0)  # of the loss, in mean square errors over a window's robust scale, one after the other
ROUNDS, STEPS = 6, 6  # of scales, and Levenberg-Marquardt steps in each
ENOUGH = 0.02  # [nats] of a step that is not worth another
SETTLED = 0.05  # standard deviations that a round may move
MAD = 1.4826  # of a normal distribution's median absolute deviation
THREADS = 2


@dataclasses.dataclass(frozen=True)
class RobustFit:
    """A car fitted to windows."""

    names: tuple[str, ...]
    theta: np.ndarray  # [n] magnitudes
    errors: np.ndarray  # [windows, HORIZONS, channels]
    scales: np.ndarray  # [HORIZONS, channels] robust scales of the errors
    information: np.ndarray  # [n, n] of the magnitudes, at evidence one, without their priors


def robust_scales(e: np.ndarray) -> np.ndarray:
    """Robust standard deviation of errors [windows, HORIZONS, channels] over the windows."""
    return np.asarray(MAD * np.median(np.abs(e), axis=0) + 1e-9)


def loss(mean_squares: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """The redescending loss of mean squares, and the weight of each that its gradient gives."""
    share = width / (width + mean_squares)
    return share * mean_squares, share**2


@dataclasses.dataclass
class _At:
    """Where a fit stands."""

    theta: np.ndarray
    e: np.ndarray
    cost: float
    weights: np.ndarray  # [windows, channels]


def robust_fit(
    runs: Sequence[WindowedRun], constants: Constants, own: Effects, unknowns: Sequence[Unknown], evidence: float,
    theta: np.ndarray | None = None, widths: Sequence[float] = WIDTHS,
) -> RobustFit:  # fmt: skip
    """Fits unknowns, whose magnitudes add to the effects `own`, to all windows of the runs.

    Args:
        evidence: power, in (0, 1], that the criterion is raised to; theta: to start from, in place of the unknowns';
        widths: of the loss, the last of them where `theta` is near already.
    """
    names = [u.name for u in unknowns]
    prior = np.array([u.prior for u in unknowns])
    low, high = (np.array([getattr(u, end) for u in unknowns]) for end in ("low", "high"))
    steps = DIFFERENCE * np.array([u.unit for u in unknowns])
    theta = np.array([u.start for u in unknowns]) if theta is None else theta.copy()

    def predicted(at: np.ndarray) -> np.ndarray:
        return errors(runs, constants, added(own, magnitudes(names, at)))

    def judged(at: np.ndarray, scales: np.ndarray, width: float) -> _At:
        e = predicted(at)
        lost, weights = loss(np.mean((e / scales) ** 2, axis=1), width)
        return _At(at, e, 0.5 * evidence * HORIZONS * float(np.sum(lost)) + 0.5 * float(np.sum((at / prior) ** 2)),
                   weights)  # fmt: skip

    def derivatives(at: _At, pool: ThreadPoolExecutor) -> np.ndarray:
        """Of the errors [windows, HORIZONS, channels, n]."""
        signs = np.where(at.theta + steps <= high, 1.0, -1.0)
        moved = [at.theta + np.where(np.arange(len(steps)) == i, signs * steps, 0.0) for i in range(len(steps))]
        columns = [(e - at.e) / (sign * step)
                   for e, sign, step in zip(pool.map(predicted, moved), signs, steps, strict=True)]  # fmt: skip
        return np.stack(columns, axis=-1)

    information = np.eye(len(theta))
    scales = robust_scales(predicted(theta))
    with ThreadPoolExecutor(THREADS) as pool:
        for width in widths:
            for _ in range(ROUNDS):
                began, damping = theta, 1e-3
                scales = robust_scales(predicted(theta))
                at = judged(theta, scales, width)
                for _ in range(STEPS):
                    jacobian = derivatives(at, pool) / scales[..., None]
                    part = jacobian * np.sqrt(at.weights)[:, None, :, None]
                    part = part.reshape(-1, len(theta))
                    rest = (at.e / scales * np.sqrt(at.weights)[:, None, :]).ravel()
                    information = part.T @ part
                    hessian = evidence * information + np.diag(1.0 / prior**2)
                    gradient = evidence * part.T @ rest + at.theta / prior**2
                    better, damping = None, max(damping / 5.0, 1e-6)
                    while better is None and damping < 1e3:
                        moved = at.theta + bounded_step(hessian, gradient, at.theta, low, high, damping)
                        trial = judged(moved, scales, width)
                        better = trial if trial.cost < at.cost else None
                        damping *= 1.0 if better else 10.0
                    if better is None:
                        break
                    gained, at = at.cost - better.cost, better
                    if gained < ENOUGH:
                        break
                theta = at.theta
                deviations = np.sqrt(np.diag(np.linalg.inv(evidence * information + np.diag(1.0 / prior**2))))
                if np.all(np.abs(theta - began) < SETTLED * deviations):
                    break
    return RobustFit(tuple(names), theta, at.e, scales, information)


def bounded_step(
    hessian: np.ndarray, gradient: np.ndarray, theta: np.ndarray, low: np.ndarray, high: np.ndarray, damping: float
) -> np.ndarray:
    """Damped Newton step [n] within bounds; what would leave through a bound that it is at stays there."""
    free = np.ones(len(theta), dtype=bool)
    step = np.zeros(len(theta))
    for _ in range(len(theta)):
        step[:] = 0.0
        h = hessian[np.ix_(free, free)]
        step[free] = -np.linalg.solve(h + damping * np.diag(np.diag(h)), gradient[free])
        leaves = free & (((theta <= low) & (step < 0.0)) | ((theta >= high) & (step > 0.0)))
        if not np.any(leaves):
            break
        free &= ~leaves
    return np.clip(theta + step, low, high) - theta
