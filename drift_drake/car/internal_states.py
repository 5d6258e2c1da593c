"""Step models of cars with states of their own, which nothing measures: an observer runs them along the drive.

A car's own states (lags, relaxation, heat, filtered accelerations) are states of its model, behind the six measured
ones. They are stable, so that `InternalStateObserver` needs the measured states and the commands alone.
"""

import copy
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.car.effects.catalogue import CATALOGUE, HEADED, OFF_THE_MOTION
from drift_drake.car.effects.magnitudes import COUNT, Effects
from drift_drake.car.step_model import StepModel
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_update

BEYOND = OFF_THE_MOTION
IDENTIFIED_RATE_SHARE = 0.9  # of an identified limit of the rate that is planned with
LAGGED = tuple(name for name, effect in CATALOGUE.items() if effect.delays == "delta_cmd")


def on_the_motion(effects: Effects) -> Effects:
    """What of effects is part of a one-step model."""
    return effects._replace(**dict.fromkeys(BEYOND, 0.0))


def planned_with(effects: Effects) -> Effects:
    """What of effects a controller can plan with: those on the motion, a delay of the steering taken for as long a lag,
    a limit of its rate for a little less.

    With a delay of 0.05 or 0.1 s the figure-8 is so held at 0.07 to 0.11 m; with half as long a lag one of three runs
    was lost, with none all (validation). A limit of 0.6 rad/s that is taken for 2 to 5 % more than it is costs the
    figure-8 up to 1.5 m; for 5 to 20 % less, nothing (0.06 to 0.09 m, four cars).
    """
    motion = on_the_motion(effects)
    late = sum(getattr(effects, name) for name in LAGGED)
    limit = IDENTIFIED_RATE_SHARE * motion.steering_rate_limit
    return motion._replace(steering_lag=motion.steering_lag + late, steering_rate_limit=limit)


def check_one_step(effects: Effects) -> None:
    """Raises a ValueError that names the effects that cannot be part of a one-step model."""
    beyond = [name for name in BEYOND if getattr(effects, name) != 0.0]
    if beyond:
        raise ValueError(f"{', '.join(beyond)} cannot be part of a one-step model; leave it out")


def check_states(x: Array, model: StepModel) -> None:
    """Raises a ValueError where states [N, n] are without a model's own, which compiled code would read beyond."""
    own = model.internal_scale.size
    if x.shape[1:] != (6 + own,):
        raise ValueError(
            f"states have the shape {x.shape}; give {6 + own} columns: the six, then the model's own {own} (`settled`)"
        )


@runtime_checkable
class RememberingStepModel(StepModel, Protocol):
    """A step model of n = 6 + m states: a car of `effects`, whose further states an observer follows."""

    effects: Effects
    """Their magnitudes."""
    heading: Array = np.zeros(1)
    """Of the path at each stage [N] [rad] (`along`)."""

    def with_effects(self, effects: Effects) -> Self:
        """The same step of the car that has these effects in place of its own."""

    def settled(self, state: Array, command: Array) -> Array:
        """Internal states [m] of a car that has long been in a state [4] (r, v, beta, omega_r) under a command [2]."""

    def run_on(self, x: Array, u: Array, u_next: Array, duration: float) -> Array:
        """The state [n] a duration [s] after x [n], straight on, the input going from u [2] to u_next [2]."""

    def follows_at_once(self) -> NDArray[np.bool_]:
        """Which of the internal states [m] nothing lags or relaxes, so that each always is the settled one."""

    @property
    def headed(self) -> bool:
        return any(getattr(self.effects, name) != 0.0 for name in HEADED)

    def along(self, heading: Array) -> Self:
        other = copy.copy(self)
        other.heading = heading
        return other

    def on_paths(self, curvature: Array) -> Array:
        """Curvature [1/m] and heading [rad] of the path at stages [N, 2], or at these over and over again."""
        return np.stack([curvature, np.resize(self.heading, len(curvature))], axis=1)

    def unheaded(self) -> Effects:
        """The effects without those that depend on the heading, where that is not known."""
        return self.effects._replace(**dict.fromkeys(HEADED, 0.0))

    def with_theta(self, theta: Array) -> Self:
        """`with_effects` of magnitudes [count of effects]."""
        return self.with_effects(Effects(*(float(q) for q in theta)))

    def observer(self, period: float) -> LeafSystem:
        return InternalStateObserver(self, period)


def followed(
    model: RememberingStepModel, state: Array, command: Array, before: Array, command_before: Array, period: float
) -> Array:
    """Internal states [m] under a command [2] in a measured state [4], run on from (x [n], command [2]) a period ago.

    Settled where nothing is known of then. What no effect lags or relaxes follows the commands and the slips at once,
    so that an effect may begin at any time.
    """
    settled = model.settled(state, command)
    if not (np.isfinite(before).all() and np.isfinite(command_before).all()):
        return settled
    later = model.run_on(before, command_before, command, period)
    return np.where(model.follows_at_once(), settled, later[6:])


class InternalStateObserver(LeafSystem):
    """Runs a model's internal states along what is measured: they are stable, so that their initial error dies out.

    Input ports: measured_state [7]; command [2], in force; theta (optional), magnitudes in place of the model's own.
    Output port: internal states [m] (`effects.InternalStates`, or `double_track.motion.OwnStates`).
    State in the Context, each `period`: the internal states, settled at the start, and the command of the last tick.
    """

    def __init__(self, model: "RememberingStepModel", period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._model, self._period = model, period
        self._made = np.empty(0), model  # scratch: the last theta's model
        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        self._command = self.DeclareVectorInputPort("command", 2)
        self._theta = self.DeclareVectorInputPort("theta", COUNT)
        internal_count = model.internal_scale.size
        # Time, state, internal states and command of the last tick.
        held = self.DeclareDiscreteState(np.full(1 + 6 + internal_count + 2, np.nan))
        declare_update(self, period, self._update)
        inputs = {self.input_port_ticket(port.get_index()) for port in (self._measured, self._command, self._theta)}
        given = {*inputs, self.discrete_state_ticket(held), self.time_ticket()}
        declare_output(self, "internal_states", internal_count, lambda context: self._now(context)[7:-2], given)

    def _now(self, context: Context) -> Array:
        """(time, measured state [6], internal states, command [2]) at this tick, run on from the last one."""
        held, t = context.get_discrete_state_vector().value(), context.get_time()
        if t - held[0] < 0.5 * self._period:
            return held
        measured, command = self._measured.Eval(context), self._command.Eval(context)
        model = self._model
        if self._theta.HasValue(context):
            theta = self._theta.Eval(context)
            if not np.array_equal(theta, self._made[0]):
                self._made = np.array(theta), model.with_theta(theta)
            model = self._made[1]
        if not np.isfinite(measured).all():  # no reading: go on from the last one
            measured = held[1:8]
        internal = followed(model, measured[:4], command, held[1:-2], held[-2:], self._period)
        return np.concatenate([[t], measured[:6], internal, command])

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        discrete.set_value(self._now(context))
