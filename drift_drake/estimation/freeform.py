"""What forces a hypothesis leaves unexplained: Bayesian linear regression in force space.

Two sets of regressors push the car beside a fitted hypothesis: pulses in time (any force, at any moment) and functions
of the state (what a correction could be learned from) with constant offsets of the sensors. Their weights have
closed-form evidence, with one prior scale per force channel, and one for the sensors, found by expectation
maximisation. The evidence that they gain measures what the hypothesis misses; their forces say where, and the state
functions are the ceiling of what a free-form model reaches.
"""

import dataclasses
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from drift_drake.estimation.filter_state import SIZE
from drift_drake.estimation.fit import prior_precision, sensitivity
from drift_drake.estimation.problem import Gains, Problem, car, counted, filter_case, flat, observe
from drift_drake.vehicle.bicycle import MIN_SLIP_SPEED
from drift_drake.vehicle.catalogue import REFERENCE, wheelbase

FORCE_CHANNELS = ("body longitudinal force", "body lateral force", "yaw moment", "axle torque")
SENSORS = len(FORCE_CHANNELS)  # index of the group of the sensors' offsets, behind the force channels
FORCE_UNIT = 100.0  # [N] or [N m] that weights are in, of the reference car; by weight and size of others
PULSE = 0.5  # [s] width of a pulse
MOST_PULSES = 40  # in one run
EM_STEPS = 30


class Fitted(Protocol):
    """A hypothesis that was fitted."""

    @property
    def names(self) -> tuple[str, ...]: ...

    @property
    def theta(self) -> np.ndarray: ...


@dataclasses.dataclass(frozen=True)
class Regression:
    """Posterior of the weights of one set of regressors."""

    gain: float  # [nats] of evidence over the hypothesis alone
    weights: np.ndarray  # run by run and channel by channel, in FORCE_UNIT
    channel_of: np.ndarray  # index of each weight's force channel (or SENSORS)
    scales: np.ndarray  # [channels, and the sensors] prior standard deviation of the weights
    removed: float  # share of the squared innovations that the regressors take away


def filtered_states(problem: Problem, gains: Gains, fit: Fitted) -> list[np.ndarray]:
    """Corrected states [rows, SIZE] of each run under a fit."""
    out = []
    for i, run in enumerate(problem.runs):
        states = np.empty((len(run.y), SIZE))
        observe(problem, gains, fit.theta, fit.names, i, states=states)
        out.append(states)
    return out


def state_functions(problem: Problem, fit: Fitted, states: np.ndarray, index: int) -> np.ndarray:
    """Functions of the state and the commands [rows, functions], each about one in size."""
    run = problem.runs[index]
    constants, _ = car(problem, fit.theta, fit.names)
    r, v, beta, omega_r, psi = (states[:, i] for i in range(5))
    u_x, u_y = v * np.cos(beta), v * np.sin(beta)
    rear_x = (omega_r - u_x) / np.maximum(omega_r, MIN_SLIP_SPEED)
    rear_y = (u_y - constants.rear_axle_distance * r) / np.maximum(omega_r, MIN_SLIP_SPEED)
    front_y = (u_y + constants.front_axle_distance * r) / np.maximum(u_x, MIN_SLIP_SPEED) - run.delta
    front_grip = 3.0 * constants.friction * constants.mass * constants.gravity / 2.0 / constants.front_stiffness
    rear_grip = 3.0 * constants.friction * constants.mass * constants.gravity / 2.0 / constants.rear_stiffness
    slip = np.hypot(rear_x, rear_y)
    rear_force = np.minimum(slip / rear_grip, 1.0) / np.maximum(slip, 1e-6)
    a_y = r * v / constants.gravity
    delta_rate = np.gradient(run.delta, run.period)
    reach = problem.vehicle.torque_max - problem.vehicle.torque_min
    columns = [
        np.ones(len(r)),
        v / 10.0,
        (v / 10.0) ** 2,
        r,
        a_y,
        a_y * np.abs(a_y),
        a_y**2,
        beta * 3.0,
        np.tanh(front_y / front_grip),
        front_y / front_grip * np.maximum(1.0 - np.abs(front_y) / front_grip, 0.0),
        rear_force * rear_y,
        rear_force * rear_x,
        rear_y / rear_grip,
        rear_x / rear_grip,
        run.delta * 5.0,
        delta_rate,
        run.tau / (0.2 * reach),
        np.tanh((run.tau - 0.04 * reach) / (0.02 * reach)),
        np.cos(psi),
        np.sin(psi),
    ]
    return np.stack(columns, axis=-1)


def force_units(problem: Problem) -> np.ndarray:
    """Units of the force channels' weights [4], of a car of this weight and size [N], [N m]."""
    vehicle = problem.vehicle
    weight = vehicle.mass / REFERENCE.mass
    by_size = [1.0, 1.0, wheelbase(vehicle) / wheelbase(REFERENCE), vehicle.wheel_radius / REFERENCE.wheel_radius]
    return FORCE_UNIT * weight * np.array(by_size)


def pulses(rows: int, period: float) -> np.ndarray:
    """Triangles in time, next to each other [rows, pulses]; wider than `PULSE` in a long run."""
    t = np.arange(rows) * period
    width = max(PULSE, t[-1] / MOST_PULSES)
    centres = np.arange(0.0, t[-1] + width, width)
    return np.maximum(1.0 - np.abs(t[:, None] - centres) / width, 0.0)


def pushed(problem: Problem, gains: Gains, fit: Fitted, index: int, base: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Derivatives [rows, 9, channels, shapes] of innovations by the weights of shapes in time [rows, shapes]."""
    out = np.empty((*base.shape, len(FORCE_CHANNELS), shapes.shape[1]))
    units = force_units(problem)
    for channel in range(len(FORCE_CHANNELS)):
        for k in range(shapes.shape[1]):
            push = np.zeros((len(base), 3))
            torque = None
            if channel < 3:
                push[:, channel] = units[channel] * shapes[:, k]
            else:
                torque = units[channel] / problem.nominal.gear_ratio * shapes[:, k]
            e = observe(problem, gains, fit.theta, fit.names, index, push=push, extra_torque=torque)
            out[:, :, channel, k] = e - base
    return out


def offset_responses(problem: Problem, gains: Gains, fit: Fitted, index: int, base: np.ndarray) -> np.ndarray:
    """Derivatives [rows, 9, channels in use] of innovations by constant offsets of the sensors, in noise levels."""
    run = problem.runs[index]
    out = []
    for channel in np.flatnonzero(run.used):
        y = run.y.copy()
        y[:, channel] += problem.noise[channel]
        moved = problem.replace(runs=[*problem.runs[:index], dataclasses.replace(run, y=y), *problem.runs[index + 1 :]])
        out.append(observe(moved, gains, fit.theta, fit.names, index) - base)
    return np.stack(out, axis=-1)


@dataclasses.dataclass(frozen=True)
class Responses:
    """What one run's innovations that count do as a fit's own parameters and the regressors' weights move."""

    weights: np.ndarray  # derivatives [count, weights]
    own: np.ndarray  # derivatives [count, own parameters]
    residual: np.ndarray  # the innovations [count]

    def rows(self, kept: np.ndarray) -> "Responses":
        """Those of some of the measurements [count] bool."""
        return Responses(self.weights[kept], self.own[kept], self.residual[kept])


@dataclasses.dataclass(frozen=True)
class Equations:
    """Normal equations of a hypothesis' own parameters and, behind them, the weights of regressors."""

    hessian: np.ndarray  # without the priors
    gradient: np.ndarray  # with that of the own parameters' prior
    own: int  # parameters ahead of the weights
    channel_of: np.ndarray  # index of each weight's force channel (or SENSORS)
    squares: float  # of the innovations


def responses(problem: Problem, fit: Fitted, kind: str) -> tuple[list[Responses], np.ndarray]:
    """Each run's responses, and the channel of each weight.

    Args:
        kind: "pulses" (weights of their own in each run) or "functions" (of the state, shared by the runs).
    """
    gains = filter_case(problem, fit.theta, fit.names)
    states = filtered_states(problem, gains, fit)
    jacobian = sensitivity(problem, gains, fit.theta, fit.names)
    residual = flat(problem, gains.innovations)
    out, row = [], 0
    channel_of = np.zeros(0, dtype=int)
    for i, run in enumerate(problem.runs):
        base = gains.innovations[i]
        shapes = pulses(len(base), run.period) if kind == "pulses" else state_functions(problem, fit, states[i], i)
        d = counted(problem, run, pushed(problem, gains, fit, i, base, shapes))
        d = d.reshape(-1, len(FORCE_CHANNELS) * shapes.shape[1])
        groups = np.repeat(np.arange(len(FORCE_CHANNELS)), shapes.shape[1])
        if kind == "functions":
            offsets = counted(problem, run, offset_responses(problem, gains, fit, i, base))
            d = np.hstack([d, offsets.reshape(len(d), -1)])
            groups = np.concatenate([groups, np.full(offsets.shape[-1], SENSORS)])
        out.append(Responses(d, jacobian[row : row + len(d)], residual[row : row + len(d)]))
        row += len(d)
        channel_of = groups if kind == "functions" else np.concatenate([channel_of, groups])
    return out, channel_of


def equations(problem: Problem, fit: Fitted, runs: Sequence[Responses], channel_of: np.ndarray) -> Equations:
    """Normal equations of [own parameters, weights]; weights are shared by the runs if each has all of them."""
    own, total = len(fit.theta), len(channel_of)
    hessian, gradient = np.zeros((own + total, own + total)), np.zeros(own + total)
    at = own
    for run in runs:
        d, j, e = run.weights, run.own, run.residual
        to = slice(own, own + total) if d.shape[1] == total else slice(at, at + d.shape[1])
        hessian[:own, :own] += j.T @ j
        cross = j.T @ d
        hessian[:own, to] += cross
        hessian[to, :own] += cross.T
        hessian[to, to] += d.T @ d
        gradient[:own] += j.T @ e
        gradient[to] += d.T @ e
        at += d.shape[1]
    gradient[:own] += prior_precision(problem, own) * fit.theta
    residual = np.concatenate([run.residual for run in runs])
    return Equations(hessian, gradient, own, channel_of, float(residual @ residual))


def regress(problem: Problem, fit: Fitted, of: Equations) -> Regression:
    """Evidence of the weights with one prior scale a channel, found by expectation maximisation."""
    hessian, gradient, own, channel_of, squares = of.hessian, of.gradient, of.own, of.channel_of, of.squares
    prior = prior_precision(problem, len(fit.theta))
    without = _log_evidence(hessian[:own, :own] + np.diag(prior), gradient[:own], np.zeros(0))
    groups = SENSORS + 1
    scales = np.full(groups, 1.0)
    best = Regression(-np.inf, np.zeros(0), channel_of, scales, 0.0)
    for _ in range(EM_STEPS):
        precision = np.concatenate([prior, 1.0 / scales[channel_of] ** 2])
        matrix = hessian + np.diag(precision)
        covariance = np.linalg.inv(matrix)
        mean = -covariance @ gradient
        gain = _log_evidence(matrix, gradient, precision[own:]) - without
        if gain > best.gain:
            step = mean.copy()
            left = squares + 2.0 * float((gradient[:own] - prior * fit.theta) @ step[:own])
            left += 2.0 * float(gradient[own:] @ step[own:]) + float(step @ hessian @ step)
            best = Regression(gain, mean[own:], channel_of, scales.copy(), 1.0 - left / squares)
        spread = mean[own:] ** 2 + np.diag(covariance)[own:]
        new = np.array([np.sqrt(np.mean(spread[channel_of == c])) if c in channel_of else 1.0 for c in range(groups)])
        # Expectation maximisation is slow towards zero; a step and a half is still stable.
        scales = np.clip(scales * (new / scales) ** 1.5, 1e-4, 1e3)
    return best


def _log_evidence(matrix: np.ndarray, gradient: np.ndarray, precision: np.ndarray) -> float:
    """Log evidence up to the constant that all sets of regressors share."""
    factor = np.linalg.cholesky(matrix)
    half = np.linalg.solve(factor, gradient)
    return 0.5 * float(half @ half) - float(np.sum(np.log(np.diag(factor)))) + 0.5 * float(np.sum(np.log(precision)))


def misfit(problem: Problem, fit: Fitted, kind: str = "pulses") -> Regression:
    """What a fit leaves unexplained, by regressors of that kind (`regress`)."""
    return regress(problem, fit, equations(problem, fit, *responses(problem, fit, kind)))
