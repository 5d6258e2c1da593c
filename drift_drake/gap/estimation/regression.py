"""Evidence of free forces besides a fitted hypothesis: Bayesian linear regression, its normal equations run by run.

The weights of one run's pulses move no other run's innovations: they meet the hypothesis' own parameters alone and are
eliminated run by run (a Schur complement), so that the work and what is kept grow with the length of the logs.
"""

import dataclasses
from collections.abc import Iterable, Sequence
from functools import reduce

import numpy as np

SENSORS = 4  # index of the group of the sensors' offsets, behind the force channels
EM_STEPS = 30


@dataclasses.dataclass(frozen=True)
class Responses:
    """What one run's innovations that count do as a fit's own parameters and the regressors' weights move."""

    weights: np.ndarray  # derivatives [count, weights]
    channel_of: np.ndarray  # index of each weight's force channel (or SENSORS)
    own: np.ndarray  # derivatives [count, columns]
    columns: np.ndarray  # own parameters that these are by
    residual: np.ndarray  # the innovations [count]

    def rows(self, kept: np.ndarray) -> "Responses":
        """Those of some of the measurements [count] bool."""
        return dataclasses.replace(self, weights=self.weights[kept], own=self.own[kept], residual=self.residual[kept])


@dataclasses.dataclass(frozen=True)
class Weights:
    """The part of the normal equations that weights of their own are in."""

    hessian: np.ndarray  # [weights, weights], without the prior
    cross: np.ndarray  # by the weights and the own parameters in `columns` [weights, columns]
    columns: np.ndarray
    gradient: np.ndarray  # [weights]
    channel_of: np.ndarray  # [weights]


@dataclasses.dataclass(frozen=True)
class Equations:
    """Normal equations of a hypothesis' own parameters and the weights of regressors, without any prior."""

    own: np.ndarray  # [parameters, parameters]
    gradient: np.ndarray  # by the own parameters
    weights: Sequence[Weights]  # run by run; one where they are shared by the runs
    squares: float  # of the innovations

    @property
    def channel_of(self) -> np.ndarray:
        """Index of each weight's force channel (or SENSORS)."""
        return np.concatenate([part.channel_of for part in self.weights])


@dataclasses.dataclass(frozen=True)
class Regression:
    """Posterior of the weights of one set of regressors."""

    gain: float  # [nats] of evidence over the hypothesis alone
    weights: np.ndarray  # run by run and channel by channel, in FORCE_UNIT
    channel_of: np.ndarray  # index of each weight's force channel (or SENSORS)
    scales: np.ndarray  # [channels, and the sensors] prior standard deviation of the weights
    removed: float  # share of the squared innovations that the regressors take away


def equations(runs: Iterable[Responses], parameters: int, shared: bool) -> Equations:
    """Normal equations of a hypothesis with so many own parameters.

    Args:
        shared: whether the runs' weights are the same ones.
    """
    own, gradient, squares = np.zeros((parameters, parameters)), np.zeros(parameters), 0.0
    weights: list[Weights] = []
    for run in runs:
        d, j, columns, e = run.weights, run.own, run.columns, run.residual
        own[np.ix_(columns, columns)] += j.T @ j
        gradient[columns] += j.T @ e
        squares += float(e @ e)
        cross = d.T @ j
        if shared:
            wide, everything = np.zeros((len(cross), parameters)), np.arange(parameters)
            wide[:, columns] = cross
            cross, columns = wide, everything
        part = Weights(d.T @ d, cross, columns, d.T @ e, run.channel_of)
        weights = [_sum(weights[0], part)] if shared and weights else [*weights, part]
    return Equations(own, gradient, weights, squares)


def _sum(a: Weights, b: Weights) -> Weights:
    """Of shared weights in two runs."""
    return Weights(a.hessian + b.hessian, a.cross + b.cross, a.columns, a.gradient + b.gradient, a.channel_of)


def joined_equations(parts: Sequence[Equations]) -> Equations:
    """Equations of all parts of the measurements, each with weights of its own."""
    own, gradient = sum(part.own for part in parts), sum(part.gradient for part in parts)
    weights = [some for part in parts for some in part.weights]
    return Equations(np.asarray(own), np.asarray(gradient), weights, sum(part.squares for part in parts))


def summed_equations(parts: Sequence[Equations]) -> Equations:
    """Equations of all parts of the measurements, which share their weights."""
    of = joined_equations(parts)
    return dataclasses.replace(of, weights=[reduce(_sum, of.weights)])


def left_over(of: Equations, own: np.ndarray, weights: Sequence[np.ndarray]) -> float:
    """Squared innovations after a step of the own parameters and of the weights, those of `of.weights` one by one."""
    out = of.squares + 2.0 * float(of.gradient @ own) + float(own @ of.own @ own)
    for part, w in zip(of.weights, weights, strict=True):
        out += 2.0 * float(part.gradient @ w) + float(w @ part.hessian @ w)
        out += 2.0 * float(w @ part.cross @ own[part.columns])
    return out


@dataclasses.dataclass(frozen=True)
class Solution:
    """The mode under one prior, and what goes with it."""

    own: np.ndarray  # step of the own parameters
    weights: list[np.ndarray]
    variance: np.ndarray  # of the weights
    log_evidence: float  # up to the constant that all sets of regressors share


def solve_equations(of: Equations, gradient: np.ndarray, prior: np.ndarray, precision: np.ndarray) -> Solution:
    """The mode of all parameters.

    Args:
        gradient: by the own parameters, with that of their prior; prior: their precisions; precision: of the weights.
    """
    schur, left, evidence = of.own + np.diag(prior), gradient.copy(), 0.5 * float(np.sum(np.log(precision)))
    parts = []
    of_part = np.split(precision, np.cumsum([len(part.gradient) for part in of.weights])[:-1])
    for part, own_precision in zip(of.weights, of_part, strict=True):
        matrix = part.hessian + np.diag(own_precision)
        inverse = np.linalg.inv(matrix)
        by_own, alone = inverse @ part.cross, inverse @ part.gradient
        schur[np.ix_(part.columns, part.columns)] -= part.cross.T @ by_own
        left[part.columns] -= part.cross.T @ alone
        evidence += 0.5 * float(part.gradient @ alone) - _half_log_determinant(matrix)
        parts.append((part, by_own, alone, np.diag(inverse)))
    schur = _definite(schur, prior)
    covariance = np.linalg.inv(schur)
    own = -covariance @ left
    evidence += -0.5 * float(left @ own) - _half_log_determinant(schur)
    weights = [-alone - by_own @ own[part.columns] for part, by_own, alone, _ in parts]
    variance = [
        diagonal + np.sum((by_own @ covariance[np.ix_(part.columns, part.columns)]) * by_own, axis=1)
        for part, by_own, _, diagonal in parts
    ]
    return Solution(own, weights, np.concatenate(variance), evidence)


def _definite(matrix: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """An information matrix, raised to the prior's precisions where rounding has left it below: it is their sum."""
    if np.linalg.eigvalsh(matrix)[0] > 0.0:
        return matrix
    root = np.sqrt(np.outer(prior, prior))
    values, vectors = np.linalg.eigh(matrix / root)
    return np.asarray(root * ((vectors * np.maximum(values, 1.0)) @ vectors.T))


def _half_log_determinant(matrix: np.ndarray) -> float:
    return float(np.sum(np.log(np.diag(np.linalg.cholesky(matrix)))))


def regress(of: Equations, theta: np.ndarray, prior: np.ndarray) -> Regression:
    """Evidence of the weights with one prior scale a channel, found by expectation maximisation.

    Args:
        theta: the hypothesis' own parameters; prior: the precisions of their prior around zero.
    """
    gradient, channel_of, groups = of.gradient + prior * theta, of.channel_of, SENSORS + 1
    alone = of.own + np.diag(prior)
    without = 0.5 * float(gradient @ np.linalg.solve(alone, gradient)) - _half_log_determinant(alone)
    scales = np.full(groups, 1.0)
    best = Regression(-np.inf, np.zeros(0), channel_of, scales, 0.0)
    for _ in range(EM_STEPS):
        found = solve_equations(of, gradient, prior, 1.0 / scales[channel_of] ** 2)
        gain, weights = found.log_evidence - without, np.concatenate(found.weights)
        if gain > best.gain:
            left = left_over(of, found.own, found.weights)
            best = Regression(gain, weights, channel_of, scales.copy(), 1.0 - left / of.squares)
        spread = weights**2 + found.variance
        new = np.array([np.sqrt(np.mean(spread[channel_of == c])) if c in channel_of else 1.0 for c in range(groups)])
        # Expectation maximisation is slow towards zero; a step and a half is still stable.
        scales = np.clip(scales * (new / scales) ** 1.5, 1e-4, 1e3)
    return best
