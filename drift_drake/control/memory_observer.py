"""What follows the states that a model has beyond the measured ones: the model itself, run along the measurements."""

from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.arrays import Array
from drift_drake.vehicle.effects import COUNT


class RememberingModel(Protocol):
    """What `MemoryObserver` asks of a step model of n = 6 + m states."""

    memory_scale: Array

    def with_theta(self, theta: Array) -> Self:
        """The model of the car with other magnitudes of the effects."""

    def settled(self, state: Array, command: Array) -> Array:
        """The memory [m] of a car that has been in (r, v, beta, omega_r) under (delta, tau) for long."""

    def run_on(self, x: Array, u: Array, u_next: Array, duration: float) -> Array:
        """The state [n] a duration [s] after x [n] on a straight path, the input going from u to u_next [2]."""

    def follows_at_once(self) -> NDArray[np.bool_]:
        """Which of the memory [m] nothing lags or relaxes, so that it always is the settled one."""


class MemoryObserver(LeafSystem):
    """Runs a model's memory along what is measured: its states are stable, so that their initial error dies out.

    What no effect lags or relaxes follows the commands and the slips at once, so that an effect may begin at any time.

    Input ports: measured_state [7]; command [2], in force; theta (optional), magnitudes in place of the model's own.
    Output port: memory [m] (`effects.Memory`, or `double_track.motion.OwnStates`).
    State in the Context, each `period`: the memory and the command of the last tick; the memory starts settled.
    """

    def __init__(self, model: RememberingModel, period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._model, self._period = model, period
        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        self._command = self.DeclareVectorInputPort("command", 2)
        self._theta = self.DeclareVectorInputPort("theta", COUNT)
        memories = model.memory_scale.size
        # Time, state, memory and command of the last tick.
        held = self.DeclareDiscreteState(np.full(1 + 6 + memories + 2, np.nan))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        inputs = {self.input_port_ticket(port.get_index()) for port in (self._measured, self._command, self._theta)}
        self.DeclareVectorOutputPort(
            "memory",
            memories,
            lambda context, output: output.SetFromVector(self._now(context)[7:-2]),
            prerequisites_of_calc={*inputs, self.discrete_state_ticket(held), self.time_ticket()},
        )

    def _now(self, context: Context) -> Array:
        """(time, measured state [6], memory, command [2]) at this tick, the memory run on from the last one."""
        held, t = context.get_discrete_state_vector().value(), context.get_time()
        if t - held[0] < 0.5 * self._period:
            return held
        measured, command = self._measured.Eval(context), self._command.Eval(context)
        model = self._model
        if self._theta.HasValue(context):
            model = model.with_theta(self._theta.Eval(context))
        if not np.isfinite(measured).all():  # no reading: go on from the last one
            measured = held[1:8]
        memory = model.settled(measured[:4], command)
        if not np.isnan(held[0]) and np.isfinite(held[7:-2]).all():
            later = model.run_on(held[1:-2], held[-2:], command, self._period)
            memory = np.where(model.follows_at_once(), memory, later[6:])
        return np.concatenate([[t], measured[:6], memory, command])

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        discrete.set_value(self._now(context))
