"""The car with effects as a one-step model: what an MPC that knows the true car believes (the oracle).

The effects' own states (lags, relaxation, heat, filtered accelerations) are states of the model. They are not measured;
`InternalStateObserver` runs them along the measured states and the commands.
"""

import copy
import math
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.catalogue import CATALOGUE, OFF_THE_MOTION, PARAMETRIC
from drift_drake.car.effects.magnitudes import (
    COUNT,
    INSTALLED_STATES,
    INTERNAL_COUNT,
    Effects,
    InternalStates,
)
from drift_drake.car.integrate import ramp, runge_kutta
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.scalar import fixed_tuple, jitable
from drift_drake.car.single_track.motion import path_rates
from drift_drake.car.single_track.motion_with_effects import (
    RATE_LIMIT_TIME,
    changed_constants,
    motion_with_effects,
    settled_internal_states,
)
from drift_drake.car.step_model import STEP, SUBSTEPS, NominalStepModel, StepModel, block_scale
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_update

INTERNAL_SCALE = np.array([0.3, 100.0, 0.3, 0.3, 1.0, 1.0, 5.0, 5.0] + [1.0] * len(INSTALLED_STATES))
STATE_SIZE = 6 + INTERNAL_COUNT
COMPLEX_STEP = 1e-30
DIFFERENCES = 1e-7 * block_scale(INTERNAL_SCALE)
STABLE = 2.5  # times its settling time, up to which a step of Runge-Kutta is stable (2.78 at the limit)
FASTEST = 30.0  # [m/s] at which slips still settle so
BEYOND = tuple(name for name, effect in CATALOGUE.items() if name in OFF_THE_MOTION or "psi" in effect.needs)

LAGGED = tuple(name for name, effect in CATALOGUE.items() if effect.delays == "delta_cmd")


def on_the_motion(effects: Effects) -> Effects:
    """What of effects is part of a one-step model."""
    return effects._replace(**dict.fromkeys(BEYOND, 0.0))


def planned_with(effects: Effects) -> Effects:
    """What of effects a controller can plan with: those on the motion, a delay of the steering taken for as long a lag.

    With a delay of 0.05 or 0.1 s the figure-8 is so held at 0.07 to 0.11 m; with half as long a lag one of three runs
    was lost, with none all (validation).
    """
    motion = on_the_motion(effects)
    late = sum(getattr(effects, name) for name in LAGGED)
    return motion._replace(steering_lag=motion.steering_lag + late)


class RememberingModel(Protocol):
    """What `InternalStateObserver` asks of a step model of n = 6 + m states."""

    internal_scale: Array

    def with_theta(self, theta: Array) -> Self:
        """The model of the car with other magnitudes of the effects."""

    def settled(self, state: Array, command: Array) -> Array:
        """The internal states [m] of a car that has been in (r, v, beta, omega_r) under (delta, tau) for long."""

    def run_on(self, x: Array, u: Array, u_next: Array, duration: float) -> Array:
        """The state [n] a duration [s] after x [n] on a straight path, the input going from u to u_next [2]."""

    def follows_at_once(self) -> NDArray[np.bool_]:
        """Which of the internal states [m] nothing lags or relaxes, so that it always is the settled one."""


class InternalStateObserver(LeafSystem):
    """Runs a model's internal states along what is measured: they are stable, so that their initial error dies out.

    What no effect lags or relaxes follows the commands and the slips at once, so that an effect may begin at any time.

    Input ports: measured_state [7]; command [2], in force; theta (optional), magnitudes in place of the model's own.
    Output port: internal states [m] (`effects.InternalStates`, or `double_track.motion.OwnStates`).
    State in the Context, each `period`: the internal states, settled at the start, and the command of the last tick.
    """

    def __init__(self, model: RememberingModel, period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._model, self._period = model, period
        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        self._command = self.DeclareVectorInputPort("command", 2)
        self._theta = self.DeclareVectorInputPort("theta", COUNT)
        internal_count = model.internal_scale.size
        # Time, state, internal states and command of the last tick.
        held = self.DeclareDiscreteState(np.full(1 + 6 + internal_count + 2, np.nan))
        declare_update(self, period, self._update)
        inputs = {self.input_port_ticket(port.get_index()) for port in (self._measured, self._command, self._theta)}
        self.DeclareVectorOutputPort(
            "internal_states",
            internal_count,
            lambda context, output: output.SetFromVector(self._now(context)[7:-2]),
            prerequisites_of_calc={*inputs, self.discrete_state_ticket(held), self.time_ticket()},
        )

    def _now(self, context: Context) -> Array:
        """(time, measured state [6], internal states, command [2]) at this tick, run on from the last one."""
        held, t = context.get_discrete_state_vector().value(), context.get_time()
        if t - held[0] < 0.5 * self._period:
            return held
        measured, command = self._measured.Eval(context), self._command.Eval(context)
        model = self._model
        if self._theta.HasValue(context):
            model = model.with_theta(self._theta.Eval(context))
        if not np.isfinite(measured).all():  # no reading: go on from the last one
            measured = held[1:8]
        internal = model.settled(measured[:4], command)
        if not np.isnan(held[0]) and np.isfinite(held[7:-2]).all():
            later = model.run_on(held[1:-2], held[-2:], command, self._period)
            internal = np.where(model.follows_at_once(), internal, later[6:])
        return np.concatenate([[t], measured[:6], internal, command])

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        discrete.set_value(self._now(context))


def check_one_step(effects: Effects) -> None:
    """Raises a ValueError that names the effects that cannot be part of a one-step model."""
    beyond = [name for name in BEYOND if getattr(effects, name) != 0.0]
    if beyond:
        raise ValueError(f"{', '.join(beyond)} cannot be part of a one-step model; leave it out")


class EffectsStepModel(StepModel):
    """One step of the car with effects: RK4 with sub-steps under linear input.

    Its Jacobians are exact (complex step) or, for a controller, forward differences of 1e-7 of the states' sizes: good
    to a millionth, in less than half of the time.

    A transport delay is beyond it (a step knows the commands at its own ends only), as are a road's grade
    on a heading (the six states have none) and the sensors' effects.

    Args:
        parameters: the car without effects; effects: magnitudes; exact: Jacobians; dt: of a step [s].

    Raises:
        ValueError: such an effect.

    Examples:
        >>> believed = EffectsStepModel(car, make_effects({"aero_drag": 1.0}))
        >>> believed.step(x, u, u, np.zeros(1)).shape
        (1, 6)
    """

    def __init__(self, parameters: VehicleParameters, effects: Effects, exact: bool = True, dt: float = STEP) -> None:
        check_one_step(effects)
        self._exact, self.dt = exact, dt
        self.internal_scale = INTERNAL_SCALE
        self.constants, self.effects = parameters.constants(), effects
        self._substeps = max(SUBSTEPS, _stable_substeps(effects, self.dt))

    def of_car(self, constants: Constants, effects: Effects) -> "EffectsStepModel":
        """The same step of another car, by its constants, whose effects are of the same kind."""
        other = copy.copy(self)
        other.constants, other.effects = constants, effects
        other._substeps = max(self._substeps, _stable_substeps(effects, self.dt))
        return other

    def with_theta(self, theta: Array) -> "EffectsStepModel":
        """The same step of the car that has the effects' magnitudes `theta` [count of effects] in place of its own."""
        return self.of_car(self.constants, Effects(*(float(q) for q in theta)))

    def observer(self, period: float) -> LeafSystem:
        return InternalStateObserver(self, period)

    def settled(self, state: Array, command: Array) -> Array:
        """Internal states [m] of a car that has long been in a state [4] (r, v, beta, omega_r) under a command [2]."""
        return np.array(settled_internal_states(*state, *command, self.constants, self.effects), dtype=float)

    def run_on(self, x: Array, u: Array, u_next: Array, duration: float) -> Array:
        """The state [n] a duration [s] after x [n], straight on, the input going from u [2] to u_next [2]."""
        x_next = np.empty((1, STATE_SIZE))
        substeps = _stable_substeps(self.effects, duration)
        _steps(x[None].copy(), u[None].copy(), u_next[None].copy(), np.zeros(1), self.constants, self.effects, duration,
               substeps, x_next)  # fmt: skip
        return x_next[0]

    def follows_at_once(self) -> NDArray[np.bool_]:
        """Which of the internal states [m] nothing lags or relaxes."""
        q = self.effects
        relaxed, lagged = q.tyre_relaxation > 0.0, q.steering_lag + q.steering_rate_limit > 0.0
        installed = [getattr(q, name) == 0.0 for name in INSTALLED_STATES]
        return np.array([not lagged, q.torque_lag <= 0.0, not relaxed, not relaxed, *[False] * 4, *installed])

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        if self._parametric:
            return self.linearize(x, u, u_next, curvature)[0]
        x_next = np.empty(x.shape)
        car = (self.constants, self.effects, self.dt, self._substeps)
        _steps(*_contiguous(x, u, u_next, curvature), *car, x_next)
        return x_next

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        if self._parametric:
            return self._linearize_parametric(x, u, u_next, curvature)
        x_next, jacobian = np.empty(x.shape), np.empty((len(x), STATE_SIZE, STATE_SIZE + 4))
        car = (self.constants, self.effects, self.dt, self._substeps)
        jacobians = _jacobians if self._exact else _differences
        jacobians(*_contiguous(x, u, u_next, curvature), *car, x_next, jacobian)
        n = STATE_SIZE
        return x_next, jacobian[:, :, :n], jacobian[:, :, n : n + 2], jacobian[:, :, n + 2 :]

    @property
    def _parametric(self) -> bool:
        return not any(q for name, q in zip(Effects._fields, self.effects, strict=True) if name not in PARAMETRIC)

    def _linearize_parametric(
        self, x: Array, u: Array, u_next: Array, curvature: Array
    ) -> tuple[Array, Array, Array, Array]:
        """The same of a car with other constants and no more; internal states, which nothing depends on, are held."""
        car = NominalStepModel.of(changed_constants(self.constants, self.effects), self.dt)
        count, n = len(x), STATE_SIZE
        x_next, by_x = x.copy(), np.tile(np.eye(n), (count, 1, 1))
        by_u, by_u_next = np.zeros((count, n, 2)), np.zeros((count, n, 2))
        x_next[:, :6], by_x[:, :6, :6], by_u[:, :6], by_u_next[:, :6] = car.linearize(x[:, :6], u, u_next, curvature)
        return x_next, by_x, by_u, by_u_next


def _stable_substeps(effects: Effects, duration: float) -> int:
    """Steps of Runge-Kutta over a duration [s] that what settles fastest asks for: lags, slips, a limited wheel."""
    settling = (effects.steering_lag, effects.torque_lag, effects.tyre_relaxation / FASTEST)
    steps = [duration / (STABLE * time) for time in settling if time > 0.0]
    if effects.steering_rate_limit > 0.0:
        steps.append(duration / (2.0 * RATE_LIMIT_TIME))  # 2 ms: steps of at most 4 ms
    return math.ceil(max(steps, default=1.0))


def _contiguous(x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
    return (np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(u, dtype=float),
            np.ascontiguousarray(u_next, dtype=float), np.ascontiguousarray(curvature, dtype=float))  # fmt: skip


@jitable
def _rates(x: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the rates; car: the path's curvature [1/m], constants, effects."""
    curvature, p, q = car
    internal = InternalStates(*fixed_tuple(x[6:], INTERNAL_COUNT))
    m, d = motion_with_effects(x[0], x[1], x[2], x[3], 0.0, internal, command[0], command[1], p, q)
    e_dot, dphi_dot, _ = path_rates(x[0], x[1], m.beta_dot, x[4], x[5], curvature)
    out[0], out[1], out[2], out[3], out[4], out[5] = m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, e_dot, dphi_dot
    for i, rate in enumerate(d):
        out[6 + i] = rate


@jitable
def _rk4(x: Any, u: Any, u_next: Any, curvature: Any, p: Constants, q: Effects, dt: float, substeps: int,
         work: Any) -> None:  # fmt: skip
    """Advances x in place; work [3, STATE_SIZE] is scratch of x's type."""
    for sub in range(substeps):
        begin, middle = ramp(u, u_next, sub / substeps), ramp(u, u_next, (sub + 0.5) / substeps)
        end = ramp(u, u_next, (sub + 1.0) / substeps)
        runge_kutta(_rates, x, begin, middle, end, dt / substeps, (curvature, p, q), work[2], work[:2])


@compiled
def _steps(x: Array, u: Array, u_next: Array, curvature: Array, p: Constants, q: Effects, dt: float, substeps: int,
           x_next: Array) -> None:  # fmt: skip
    work = np.empty((3, STATE_SIZE))
    for n in range(x.shape[0]):
        x_next[n] = x[n]
        _rk4(x_next[n], u[n], u_next[n], curvature[n], p, q, dt, substeps, work)


@compiled
def _jacobians(x: Array, u: Array, u_next: Array, curvature: Array, p: Constants, q: Effects, dt: float,
               substeps: int, x_next: Array, jacobian: Array) -> None:  # fmt: skip
    n_x = STATE_SIZE
    z = np.empty(n_x + 4, dtype=np.complex128)
    work = np.empty((3, n_x), np.complex128)
    for n in range(x.shape[0]):
        for j in range(n_x + 4):
            for i in range(n_x):
                z[i] = x[n, i]
            for i in range(2):
                z[n_x + i], z[n_x + 2 + i] = u[n, i], u_next[n, i]
            z[j] += COMPLEX_STEP * 1j
            _rk4(z[:n_x], z[n_x : n_x + 2], z[n_x + 2 :], curvature[n], p, q, dt, substeps, work)
            for i in range(n_x):
                jacobian[n, i, j] = z[i].imag / COMPLEX_STEP
        for i in range(n_x):
            x_next[n, i] = z[i].real


@compiled
def _differences(x: Array, u: Array, u_next: Array, curvature: Array, p: Constants, q: Effects, dt: float,
                 substeps: int, x_next: Array, jacobian: Array) -> None:  # fmt: skip
    n_x = STATE_SIZE
    z, work = np.empty(n_x + 4), np.empty((3, n_x))
    for n in range(x.shape[0]):
        for j in range(-1, n_x + 4):
            z[:n_x], z[n_x : n_x + 2], z[n_x + 2 :] = x[n], u[n], u_next[n]
            if j >= 0:
                z[j] += DIFFERENCES[j]
            _rk4(z[:n_x], z[n_x : n_x + 2], z[n_x + 2 :], curvature[n], p, q, dt, substeps, work)
            if j < 0:
                x_next[n] = z[:n_x]
            else:
                jacobian[n, :, j] = (z[:n_x] - x_next[n]) / DIFFERENCES[j]
