"""The commands as typical actuators pass them on, (delta, tau) behind first-order lags: two states of the learnt model.

Road wheel and engine follow their commands with a lag that is as long as the model's step. A model of (x_k, u_k,
u_{k+1}) alone, as the paper's, cannot tell which part of an earlier command is still to come; that, and not the car's
parameters, was most of its error in a drift. The lags here are a typical car's: how the car at hand differs from it is
for the last layer to learn. No sensor is needed, for the commands are known.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

Array = NDArray[np.floating[Any]]

LAG = np.array([0.05, 0.10])  # [s] of steering and torque: the middle of the training population's
LAGGED = slice(6, 8)  # where the lagged commands stand in the learnt model's state


def lag_factors(dt: float | Array) -> tuple[Array, Array, Array]:
    """(c, c_now, c_next), each [..., 2], of lagged(t + dt) = c lagged(t) + c_now u(t) + c_next u(t + dt).

    Exact for commands that are linear over the step dt [s].
    """
    ratio = np.asarray(dt)[..., None] / LAG
    keep = np.exp(-ratio)
    by_next = 1.0 - (1.0 - keep) / ratio
    return keep, 1.0 - keep - by_next, by_next


def lagged_commands(t: Array, u: Array) -> Array:
    """Lagged commands [K, 2] of a log's commands u [K, 2] at times t [K] [s]; settled at the first."""
    keep, by_now, by_next = lag_factors(np.diff(t))
    drive = by_now * u[:-1] + by_next * u[1:]
    out = np.empty(np.shape(u))
    out[0] = u[0]
    for k in range(len(drive)):
        out[k + 1] = keep[k] * out[k] + drive[k]
    return out


class CommandLag(LeafSystem):
    """Runs the lags along the commands in force.

    Input port: command [2]. Output port: lagged_command [2], (delta, tau) now.
    State in the Context, each `period`: time, lagged commands and command of the last tick. The lags start settled, and
    do so anew after a command that is not finite.
    """

    def __init__(self, period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._period = period
        self._factors = lag_factors(period)
        self._command = self.DeclareVectorInputPort("command", 2)
        held = self.DeclareDiscreteState(np.full(5, np.nan))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclareVectorOutputPort(
            "lagged_command",
            2,
            self._calc_lagged,
            prerequisites_of_calc={self._command.ticket(), self.discrete_state_ticket(held), self.time_ticket()},
        )

    def _now(self, context: Context) -> Array:
        """(time, lagged commands, command) at this tick."""
        held, t = context.get_discrete_state_vector().value(), context.get_time()
        if t - held[0] < 0.5 * self._period:
            return held
        command = self._command.Eval(context)
        if not np.isfinite(held).all():  # the first tick, or after a broken command
            return np.concatenate([[t], command, command])
        keep, by_now, by_next = self._factors
        return np.concatenate([[t], keep * held[1:3] + by_now * held[3:] + by_next * command, command])

    def _calc_lagged(self, context: Context, output: Any) -> None:
        output.SetFromVector(self._now(context)[1:3])

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        discrete.set_value(self._now(context))
