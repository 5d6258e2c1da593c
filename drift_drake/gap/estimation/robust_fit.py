"""The car that predicts best: robust output error over short windows, with bounds and priors.

Windows overlap and what the model lacks goes on for seconds, so that errors tell less than their number says: the
criterion is raised to a power, `evidence`, below one. Each window's error in each channel counts by a redescending
loss (Geman and McClure 1987): what no parameter can correct, a wheel that spins alone say, then moves none. The loss
starts wide and is narrowed, so that the first guess may be far off.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from drift_drake.gap.estimation.simulated_windows import LARGEST_ERROR
from drift_drake.gap.estimation.unknowns import DIFFERENCE, Unknown, magnitudes
from drift_drake.gap.estimation.windows import HORIZONS

WIDTHS = (100.0, 30.0, 8.0)  # of the loss, in mean square errors over a window's robust scale, one after the other
ROUNDS, STEPS = 6, 6  # of scales, and Levenberg-Marquardt steps in each
ENOUGH = 0.02  # [nats] of a step that is not worth another
SETTLED = 0.05  # standard deviations that a round may move
MAD = 1.4826  # of a normal distribution's median absolute deviation

Predicted = Callable[[Sequence[Mapping[str, float]]], Sequence[np.ndarray]]


@dataclasses.dataclass(frozen=True)
class RobustFit:
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


def diverged(e: np.ndarray) -> np.ndarray:
    """Which windows [windows] have errors [windows, HORIZONS, channels] that are no errors, of a car that is lost."""
    return np.asarray(np.any(np.abs(e) >= LARGEST_ERROR, axis=(1, 2)))


def given_up(part: np.ndarray, at: "_At", scales: np.ndarray, width: float) -> np.ndarray:
    """What of the information [n, n] the loss takes back along the errors: it flattens where these are large.

    The loss's own second derivative, of which as much as leaves no direction curved downwards. Without it a few windows
    that hang on a parameter, beyond what the loss still follows, hold all steps short.

    Args:
        part: weighted derivatives [windows * HORIZONS * channels, n].
    """
    r = at.e / scales
    squares = np.sum(r**2, axis=1)
    mean = squares / r.shape[1]
    share = np.minimum(4.0 * mean / (width + mean), 1.0)
    along = np.einsum("whc,whcn->wcn", r, part.reshape(*r.shape, -1))
    along *= np.sqrt(share / np.maximum(squares, 1e-30))[..., None]
    along = along.reshape(-1, along.shape[-1])
    return np.asarray(along.T @ along)


@dataclasses.dataclass
class _At:
    """Where a fit stands."""

    theta: np.ndarray
    e: np.ndarray
    cost: float
    weights: np.ndarray  # [windows, channels]


@dataclasses.dataclass(frozen=True)
class Criterion:
    """What a fit minimises: losses of all windows' errors, raised to a power, and priors."""

    predicted: Predicted
    unknowns: Sequence[Unknown]
    evidence: float
    near: float = 0.0  # units of the unknowns, within which derivatives are used again
    difference: float = DIFFERENCE  # units of the unknowns, for derivatives
    known: list[tuple[np.ndarray, np.ndarray]] = dataclasses.field(default_factory=list)  # the last: where, and they

    @cached_property
    def prior(self) -> np.ndarray:
        return np.array([u.prior for u in self.unknowns])

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array([u.low for u in self.unknowns]), np.array([u.high for u in self.unknowns])

    def errors(self, *thetas: np.ndarray) -> Sequence[np.ndarray]:
        """Of the predictions of each [windows, HORIZONS, channels]."""
        return self.predicted([magnitudes([u.name for u in self.unknowns], theta) for theta in thetas])

    def hessian(self, information: np.ndarray) -> np.ndarray:
        return self.evidence * information + np.diag(1.0 / self.prior**2)

    def at(self, theta: np.ndarray, scales: np.ndarray, width: float) -> _At:
        (e,) = self.errors(theta)
        lost, weights = loss(np.mean((e / scales) ** 2, axis=1), width)
        cost = 0.5 * self.evidence * HORIZONS * float(np.sum(lost)) + 0.5 * float(np.sum((theta / self.prior) ** 2))
        return _At(theta, e, cost, weights)

    def derivatives(self, at: _At) -> np.ndarray:
        """Of the errors [windows, HORIZONS, channels, n], or those of a car that is near enough."""
        away = [np.abs(at.theta - where) / [u.unit for u in self.unknowns] for where, _ in self.known]
        if not away or np.max(away[0]) > self.near:
            self.known[:] = [(at.theta, self._derivatives(at))]
        return self.known[0][1]

    def _derivatives(self, at: _At) -> np.ndarray:
        steps = self.difference * np.array([u.unit for u in self.unknowns])
        signs = np.where(at.theta + steps <= self.bounds[1], 1.0, -1.0)
        moved = [at.theta + np.where(np.arange(len(steps)) == i, signs * steps, 0.0) for i in range(len(steps))]
        columns, lost = self.errors(*moved), diverged(at.e)
        for e, sign, step in zip(columns, signs, steps, strict=True):  # in place: logs may be long
            none = lost | diverged(e)  # from one that ends to one that does not is no derivative
            e -= at.e
            e /= sign * step
            e[none] = 0.0
        return np.stack(columns, axis=-1)

    def minimised(self, at: _At, scales: np.ndarray, width: float) -> tuple[_At, np.ndarray]:
        """The minimum for these scales by Levenberg-Marquardt steps, and the information [n, n] of the last."""
        damping, information = 1e-3, np.eye(len(at.theta))
        for _ in range(STEPS):
            jacobian = self.derivatives(at) / scales[..., None]
            part = jacobian * np.sqrt(at.weights)[:, None, :, None]
            part = part.reshape(-1, len(at.theta))
            rest = (at.e / scales * np.sqrt(at.weights)[:, None, :]).ravel()
            information = part.T @ part
            hessian = self.hessian(information - given_up(part, at, scales, width))
            gradient = self.evidence * part.T @ rest + at.theta / self.prior**2
            better, damping = None, max(damping / 5.0, 1e-6)
            while better is None and damping < 1e3:
                moved = at.theta + bounded_step(hessian, gradient, at.theta, *self.bounds, damping)
                if np.all(moved == at.theta):
                    break
                trial = self.at(moved, scales, width)
                better = trial if trial.cost < at.cost else None
                damping *= 1.0 if better else 10.0
            if better is None and np.any(at.theta != self.known[0][0]):
                self.known.clear()  # derivatives of a car near by led nowhere: once more with its own
                damping = 1e-3
                continue
            if better is None:
                break
            gained, at = at.cost - better.cost, better
            if gained < ENOUGH:
                break
        return at, information


def robust_fit(
    predicted: Predicted, unknowns: Sequence[Unknown], evidence: float, theta: np.ndarray | None = None,
    widths: Sequence[float] = WIDTHS, near: float = 0.0, difference: float = DIFFERENCE,
) -> RobustFit:  # fmt: skip
    """Fits unknowns to all windows.

    Args:
        predicted: errors [windows, HORIZONS, channels] of each of some cars, with these magnitudes of the unknowns;
        evidence: power, in (0, 1], that the criterion is raised to; theta: to start from, in place of the unknowns';
        widths: of the loss, the last of them where `theta` is near already;
        near: units of the unknowns, within which derivatives are used again, where a prediction is costly;
        difference: units of the unknowns that derivatives are taken over.
    """
    criterion = Criterion(predicted, unknowns, evidence, near, difference)
    theta = np.array([u.start for u in unknowns]) if theta is None else theta.copy()
    information = np.eye(len(theta))
    for width in widths:
        for _ in range(ROUNDS):
            began = theta
            scales = robust_scales(criterion.errors(theta)[0])
            at, information = criterion.minimised(criterion.at(theta, scales, width), scales, width)
            theta = at.theta
            deviations = np.sqrt(np.diag(np.linalg.inv(criterion.hessian(information))))
            if np.all(np.abs(theta - began) < SETTLED * deviations):
                break
    return RobustFit(tuple(u.name for u in unknowns), theta, at.e, scales, information)


def bounded_step(
    hessian: np.ndarray, gradient: np.ndarray, theta: np.ndarray, low: np.ndarray, high: np.ndarray, damping: float
) -> np.ndarray:
    """Damped Newton step [n] within bounds; what would leave through a bound that it is at stays there, and so does
    what nothing depends on (a limit that no drive reaches, without a prior)."""
    free = np.diag(hessian) > 0.0
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
