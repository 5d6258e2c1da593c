"""The commands as typical actuators pass them on, (delta, tau) behind first-order lags: two states of the learnt model.

Road wheel and engine follow their commands with a lag that is as long as the model's step. A model of (x_k, u_k,
u_{k+1}) alone, as the paper's, cannot tell which part of an earlier command is still to come; that, and not the car's
parameters, was most of its error in a drift. The lags here are a typical car's: how the car at hand differs from it is
for the last layer to learn. No sensor is needed, for the commands are known.

A car whose lags are others, T in place of `LAG`, moves as a typical car does that is given the commands

    w = a + LAG / T (u - a),   a the commands u behind lags of T,

since a is then what w is behind a typical car's lags. So a network that knows typical cars alone serves any lags: it is
given (w, a) in place of (u, a) (`as_of_typical_car`). Which lags the car at hand has, its drives say (`lag_bank`).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_update

Numbers = NDArray[np.floating[Any]]
TIME_STEP = 0.1  # [s] of the model, of the plan's grid and of the training table
TYPICAL = (0.05, 0.10)  # [s] of steering and torque: the middle of the training population's
LAG = np.array(TYPICAL)
LAGGED = slice(6, 8)  # where the lagged commands stand in the learnt model's state


def lag_factors(dt: float | Numbers, lag: Numbers = LAG) -> tuple[Array, Array, Array]:
    """(c, c_now, c_next), each [..., 2], of lagged(t + dt) = c lagged(t) + c_now u(t) + c_next u(t + dt).

    Exact for commands that are linear over the step dt [s]; lag: of steering and torque [s].
    """
    ratio = np.asarray(dt, dtype=float)[..., None] / lag
    keep = np.exp(-ratio)
    by_next = 1.0 - (1.0 - keep) / ratio
    return keep, 1.0 - keep - by_next, by_next


def as_of_typical_car(lag: Numbers, dt: float) -> Array:
    """What a typical car's z [10] (`features`) is of that of a car with other lags, as a matrix [10, 10] times z.

    Args:
        lag: of steering and torque [s]; dt: the step [s].
    """
    share, rest = np.diag(LAG / lag), np.diag(1.0 - LAG / lag)
    keep, by_now, by_next = (np.diag(factor) for factor in lag_factors(dt, lag))
    matrix = np.eye(10)
    now, after, lagged = slice(4, 6), slice(6, 8), slice(8, 10)
    matrix[now, now], matrix[now, lagged] = share, rest
    matrix[after, after] = share + rest @ by_next
    matrix[after, now], matrix[after, lagged] = rest @ by_now, rest @ keep
    return matrix


def lagged_commands(t: Numbers, u: Numbers, lag: Numbers = LAG) -> Array:
    """Lagged commands [K, 2] of a log's commands u [K, 2] at times t [K] [s]; settled at the first."""
    keep, by_now, by_next = lag_factors(np.diff(t), lag)
    drive = by_now * u[:-1] + by_next * u[1:]
    out = np.empty(np.shape(u))
    out[0] = u[0]
    for k in range(len(drive)):
        out[k + 1] = keep[k] * out[k] + drive[k]
    return out


class CommandLag(LeafSystem):
    """Runs the lags along the commands in force.

    Input port: command [2]. Output port: lagged_command [2 K], (delta, tau) now behind each pair of lags.
    State in the Context, each `period`: time, command and lagged commands of the last tick. The lags start settled, and
    do so anew after a command that is not finite.
    """

    def __init__(self, period: float = 0.01, lag: Array = LAG) -> None:
        """Args: period: of the ticks [s]; lag: of steering and torque [2], or K of such pairs [K, 2] [s]."""
        LeafSystem.__init__(self)
        self._period = period
        self._factors = tuple(np.atleast_2d(factor) for factor in lag_factors(period, lag))
        size = self._factors[0].size
        self._command = self.DeclareVectorInputPort("command", 2)
        held = self.DeclareDiscreteState(np.full(3 + size, np.nan))
        declare_update(self, period, self._update)
        given = {self._command.ticket(), self.discrete_state_ticket(held), self.time_ticket()}
        declare_output(self, "lagged_command", size, lambda context: self._now(context)[3:], given)

    def _now(self, context: Context) -> Array:
        """(time, command, lagged commands) at this tick."""
        held, t = context.get_discrete_state_vector().value(), context.get_time()
        if t - held[0] < 0.5 * self._period:
            return held
        command = self._command.Eval(context)
        keep, by_now, by_next = self._factors
        if not np.isfinite(held).all():  # the first tick, or after a broken command
            return np.concatenate([[t], command, np.tile(command, len(keep))])
        lagged = keep * held[3:].reshape(-1, 2) + by_now * held[1:3] + by_next * command
        return np.concatenate([[t], command, lagged.ravel()])

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        discrete.set_value(self._now(context))
