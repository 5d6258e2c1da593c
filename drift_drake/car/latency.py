"""A reading that is late, run on to the present by a car that is known, under the commands since (a predictor, as of
O. J. M. Smith, "Closer control of loops with dead time", 1957)."""

import math

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, DiscreteValues, LeafSystem, OutputPort

from drift_drake.car.internal_states import RememberingStepModel, followed
from drift_drake.car.path_plant import CurvedPath
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_update


class LatencyCompensation(LeafSystem):
    """Says where a car is now, from a reading of where it was.

    Input ports: measured_state [7] of a latency ago; command [2], in force.
    Output port: present_state [7]; not finite where the reading is not.
    State in the Context, each `period`: the commands of the latency; the last reading, the command that was in force
    then, and the car's internal states then, which settle at the start.

    Args:
        model: the car; latency: of the reading [s], above zero; path: that e and dphi are relative to; period: [s].
    """

    def __init__(self, model: RememberingStepModel, latency: float, path: CurvedPath, period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._model, self._path, self._period = model, path, period
        self._rows = max(math.ceil(latency / period - 1e-6), 1)
        self._first = latency - (self._rows - 1) * period  # [s] from the reading to the next tick
        internal_count = model.internal_scale.size
        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        self._command = self.DeclareVectorInputPort("command", 2)
        self._held = self.DeclareDiscreteState(np.full(2 * self._rows, np.nan))
        self._last = self.DeclareDiscreteState(np.full(7 + 2 + internal_count, np.nan))
        declare_update(self, period, self._update)
        given = {self._measured.ticket(), self._command.ticket(), self.all_state_ticket()}
        declare_output(self, "present_state", 7, self._present, given)

    def _commands(self, context: Context) -> Array:
        """Those at the reading and at each tick since [rows + 1, 2]."""
        now = self._command.Eval(context)
        held = context.get_discrete_state(self._held).value().reshape(-1, 2)
        commands = np.append(np.where(np.isfinite(held), held, now), [now], axis=0)
        commands[0] = commands[1] + self._first / self._period * (commands[0] - commands[1])
        return commands

    def _at_reading(self, context: Context, command: Array) -> Array:
        """(reading [7], command then [2], internal states then)."""
        reading = self._measured.Eval(context)
        if not np.isfinite(reading).all():
            return np.concatenate([reading, command, np.full(self._model.internal_scale.size, np.nan)])
        last = context.get_discrete_state(self._last).value()
        before = np.append(last[:6], last[9:])
        internal = followed(self._model, reading[:4], command, before, last[7:9], self._period)
        return np.concatenate([reading, command, internal])

    def _present(self, context: Context) -> Array:
        commands = self._commands(context)
        at_reading = self._at_reading(context, commands[0])
        x, s = np.append(at_reading[:6], at_reading[9:]), float(at_reading[6])
        if not np.isfinite(x).all():
            return np.full(7, np.nan)
        for k in range(self._rows):
            duration = self._first if k == 0 else self._period
            along = duration * x[1] * math.cos(x[5]) / (1.0 - float(self._path.curvature(s)) * x[4])
            x = self._model.run_on(x, commands[k], commands[k + 1], duration)
            x[5] -= along * float(self._path.curvature(s))
            s += along
        return np.append(x[:6], s)

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        commands = self._commands(context)
        held = context.get_discrete_state(self._held).value().reshape(-1, 2)
        discrete.set_value(self._held, np.append(held[1:], commands[-1:], axis=0).ravel())
        discrete.set_value(self._last, self._at_reading(context, commands[0]))


def at_present(
    builder: DiagramBuilder, measured_state: OutputPort, command: OutputPort, latency: float, model: object,
    path: CurvedPath, period: float,
) -> OutputPort:  # fmt: skip
    """The port of a measured state that is no longer late: the same port where it is not, or no car is known."""
    if latency <= 0.0 or not isinstance(model, RememberingStepModel):
        return measured_state
    ahead = builder.AddNamedSystem("latency_compensation", LatencyCompensation(model, latency, path, period))
    builder.Connect(measured_state, ahead.GetInputPort("measured_state"))
    builder.Connect(command, ahead.GetInputPort("command"))
    return ahead.get_output_port()
