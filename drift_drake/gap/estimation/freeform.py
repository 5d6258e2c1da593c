"""What forces a hypothesis leaves unexplained: Bayesian linear regression in force space.

Two sets of regressors force the car of a fitted hypothesis: pulses in time (any force, at any moment) and functions
of the state (what a correction could be learned from) with constant offsets of the sensors. Their weights have
closed-form evidence, with one prior scale per force channel, and one for the sensors, found by expectation
maximisation. The evidence that they gain measures what the hypothesis misses; their forces say where, and the state
functions are the ceiling of what a free-form model reaches.
"""

import dataclasses
from collections.abc import Iterator
from typing import Protocol

import numpy as np

from drift_drake.car.effects.catalogue import REFERENCE, wheelbase
from drift_drake.car.lanes import LANES
from drift_drake.car.single_track.motion import MIN_SLIP_SPEED
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import no_effects, prior_precision, run_sensitivity
from drift_drake.gap.estimation.observed import NO_STATE, filtered_states, observe_each
from drift_drake.gap.estimation.problem import (
    Gains,
    ModelDiscrepancy,
    Problem,
    car,
    counted,
    first_row,
    flat,
    run_commands,
)
from drift_drake.gap.estimation.regression import SENSORS, Regression, Responses, equations, regress
from drift_drake.gap.estimation.variants import Variant

FUNCTIONS = 20  # of the state, and the commands (`state_functions`)
FORCE_CHANNELS = ("body longitudinal force", "body lateral force", "yaw moment", "axle torque")
FORCE_UNIT = 100.0  # [N] or [N m] that weights are in, of the reference car; by weight and size of others
PULSE = 0.5  # [s] width of a pulse
MOST_PULSES = 40  # in one run
TOGETHER = LANES // len(FORCE_CHANNELS)  # shapes, in all channels
COARSE = 10.0  # factor on the process noise's deviation with which hypotheses are screened and predictions start
STEP = 1e-3  # of the forces, for their linear trace: where the logs do not feel one, its weight may be anything


class Fitted(Protocol):
    """A hypothesis that was fitted."""

    @property
    def names(self) -> tuple[str, ...]: ...

    @property
    def theta(self) -> np.ndarray: ...


def state_functions(problem: Problem, fit: Fitted, states: np.ndarray, index: int) -> np.ndarray:
    """Functions of the state and the commands [rows, functions], each about one in size."""
    run = problem.runs[index]
    constants, _ = car(problem, fit.theta, fit.names)
    r, v, beta, omega_r, psi = (states[:, i] for i in range(5))
    u_x, u_y = v * np.cos(beta), v * np.sin(beta)
    rear_x = (omega_r - u_x) / np.maximum(np.abs(omega_r), MIN_SLIP_SPEED)
    rear_y = (u_y - constants.rear_axle_distance * r) / np.maximum(np.abs(omega_r), MIN_SLIP_SPEED)
    front_y = (u_y + constants.front_axle_distance * r) / np.maximum(np.abs(u_x), MIN_SLIP_SPEED) - run.delta
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


def forced(
    problem: Problem, gains: Gains, fit: Fitted, index: int, states: np.ndarray, shapes: np.ndarray
) -> np.ndarray:
    """Derivatives of one run's innovations that count by the weights of shapes in time [rows, shapes] in each channel.

    Where a shape has not begun nothing has changed: each rollout starts from there, from the fit's corrected states
    [rows, SIZE]. The columns [count, channels * shapes] are those of the first channel, then of the next.
    """
    run, units, base = problem.runs[index], force_units(problem), gains.innovations[index]
    out = np.empty((counted(problem, run, base).size, len(FORCE_CHANNELS), shapes.shape[1]))
    commands = run_commands(problem, index, fit.theta, car(problem, fit.theta, fit.names)[1])
    unforced = Variant(fit.theta, fit.names, commands=commands)
    for first in range(0, shapes.shape[1], TOGETHER):
        some, variants = shapes[:, first : first + TOGETHER], list[Variant]()
        for channel in range(3):
            wrenches = np.zeros((some.shape[1], len(base), 3))
            wrenches[:, :, channel] = units[channel] * some.T
            variants += [unforced._replace(wrench=wrench) for wrench in wrenches]
        for torque in units[3] / problem.nominal.gear_ratio * some.T:
            variants.append(unforced._replace(extra_torque=torque))
        since = int(np.argmax(some.any(axis=1))) - 1
        since, known = (since, states[since]) if since > first_row(run, fit.names) else (0, NO_STATE)
        e = observe_each(problem, gains, index, variants, since, known)
        change = np.zeros((*base.shape, len(variants)))
        change[since + 1 :] = np.moveaxis(e[:, 1:] - base[since + 1 :], 0, -1)
        out[:, :, first : first + TOGETHER] = counted(problem, run, change).reshape(
            -1, len(FORCE_CHANNELS), some.shape[1]
        )
    return out.reshape(len(out), -1)


def offset_responses(problem: Problem, gains: Gains, fit: Fitted, index: int, base: np.ndarray) -> np.ndarray:
    """The same [count, channels in use] by constant offsets of the sensors, in noise levels."""
    run = problem.runs[index]
    offsets = np.diag(problem.noise)[run.used]
    variants = [Variant(fit.theta, fit.names, y=run.y + offset) for offset in offsets]
    e = observe_each(problem, gains, index, variants) - base
    return counted(problem, run, np.moveaxis(e, 0, -1)).reshape(-1, len(variants))


def responses(problem: Problem, fit: Fitted, kind: str) -> Iterator[Responses]:
    """Each run's responses, one run after the other.

    Args:
        kind: "pulses" (weights of their own in each run) or "functions" (of the state, shared by the runs).
    """
    gains = filter_case(problem, fit.theta, fit.names)
    for i, run in enumerate(problem.runs):
        base = gains.innovations[i]
        states = filtered_states(problem, gains, fit.theta, fit.names, i)
        shapes = pulses(len(base), run.period) if kind == "pulses" else state_functions(problem, fit, states, i)
        d = forced(problem, gains, fit, i, states, shapes)
        channel_of = np.repeat(np.arange(len(FORCE_CHANNELS)), shapes.shape[1])
        if kind == "functions":
            offsets = offset_responses(problem, gains, fit, i, base)
            d = np.hstack([d, offsets])
            channel_of = np.concatenate([channel_of, np.full(offsets.shape[1], SENSORS)])
        own, columns = run_sensitivity(problem, gains, fit.theta, fit.names, i)
        yield Responses(d, channel_of, own, columns, counted(problem, run, base).ravel())


def misfit(problem: Problem, fit: Fitted, kind: str = "pulses") -> Regression:
    """What a fit leaves unexplained, by regressors of that kind (`regression.regress`)."""
    prior = prior_precision(problem, len(fit.theta))
    return regress(
        equations(responses(problem, fit, kind), len(fit.theta), shared=kind == "functions"), fit.theta, prior
    )


def applied(problem: Problem, discrepancy: ModelDiscrepancy) -> tuple[Problem, list[str]]:
    """The problem with a discrepancy's forces and the tempering exponent with them, and warnings.

    As it is, where they bring the car no nearer to these logs: functions of the state say nothing of states that the
    calibration never saw.
    """
    taken_out = traced(problem.replace(discrepancy=discrepancy, tempering=discrepancy.tempering))
    before, after = (nominal_mean_square(p) for p in (problem, taken_out))
    if after < before:
        return taken_out, []
    return problem, [
        f"the forces of the calibration's model discrepancy do not carry over to these logs (mean square innovation "
        f"{after:.3g} with them, {before:.3g} without): they are left out, and the likelihood tempering exponent is "
        f"{problem.tempering:.2g}"
    ]


def nominal_mean_square(problem: Problem) -> float:
    """Mean square innovation of the car as it is."""
    e = flat(problem, filter_case(problem, np.zeros(problem.nuisances), ()).innovations)
    return float(np.mean(e**2)) / problem.tempering


def traced(problem: Problem) -> Problem:
    """The problem with the trace that its discrepancy's forces leave in the innovations of the car as it is.

    To first order, they then are those of a car with these forces. The trace depends on the filter: whoever changes
    noise or process noise traces again. A problem without a discrepancy is left as it is.
    """
    discrepancy = problem.discrepancy
    if discrepancy is None:
        return problem
    bare = [dataclasses.replace(run, trace=None) for run in problem.runs]
    problem = problem.replace(runs=bare)
    nominal = no_effects(problem)
    gains = filter_case(problem, nominal.theta, nominal.names)
    weights = np.array([discrepancy.forces[channel] for channel in FORCE_CHANNELS])
    traces = []
    for i, run in enumerate(bare):
        states = filtered_states(problem, gains, nominal.theta, nominal.names, i)
        functions = state_functions(problem, nominal, states, i)
        forces = STEP * force_units(problem) * (functions @ weights.T)
        y = run.y.copy()
        for name, offset in discrepancy.offsets.items():
            channel = CHANNELS.index(name)
            y[:, channel] += STEP * offset * problem.noise[channel] * run.used[channel]
        torque = forces[:, 3] / problem.nominal.gear_ratio
        variant = Variant(nominal.theta, nominal.names, forces[:, :3].copy(), torque, y)
        traces.append((observe_each(problem, gains, i, [variant])[0] - gains.innovations[i]) / STEP)
    runs = [dataclasses.replace(run, trace=trace) for run, trace in zip(bare, traces, strict=True)]
    return problem.replace(runs=runs)


def with_more_process_noise(problem: Problem) -> Problem:
    """The same problem with more process noise: innovations then depend less on the past."""
    return traced(problem.replace(process=problem.process * COARSE**2))
