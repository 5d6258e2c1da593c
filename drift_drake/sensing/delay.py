"""Pure transport delay of a vector signal."""

import math
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

TIME_TOLERANCE = 1e-9  # [s] below which two times are the same


class TransportDelay(LeafSystem):
    """Output y(t) = u(t - delay), from rows of u that are stored each `period` and interpolated linearly.

    Exact for signals that are linear between the rows, and for every signal where t - delay is a row's time. Before
    the first row the signal is taken to have been what it was when the Simulator initialized the Context; until that
    is done the output is zero.

    Input ports: u. Output ports: y. The output depends on the input directly only if the delay is below `period`.

    Args:
        size: length of the signal.
        delay: [s], zero or more.
        period: time between rows [s].
        offset: time of the first row [s].

    Raises:
        ValueError: a negative delay, or a period that is not positive.
    """

    def __init__(self, size: int, delay: float, period: float = 0.01, offset: float = 0.0) -> None:
        LeafSystem.__init__(self)
        if not 0.0 <= delay < math.inf:
            raise ValueError(f"delay is {delay!r}; give it in seconds, zero or more")
        if not 0.0 < period < math.inf:
            raise ValueError(f"period is {period!r}; give it in seconds, above zero")
        self.delay, self.period = float(delay), float(period)
        self._shorter_than_period = self.delay < period - TIME_TOLERANCE
        self._u = self.DeclareVectorInputPort("u", size)
        prerequisites = {self.input_port_ticket(self._u.get_index())}
        if self.delay > 0.0:
            # A row each period back to t - delay, the one before it, and the one of the update still to come.
            self._shape = (math.ceil(self.delay / period) + 2, 1 + size)
            rows = np.zeros(self._shape)
            rows[:, 0] = -math.inf
            # One row is [time, u(time)]; the oldest comes first.
            rows_index = self.DeclareDiscreteState(rows.ravel())
            self.DeclareInitializationDiscreteUpdateEvent(self._fill)
            self.DeclarePeriodicDiscreteUpdateEvent(period, offset, self._store)
            past = {self.time_ticket(), self.discrete_state_ticket(rows_index)}
            prerequisites = past | prerequisites if self._shorter_than_period else past
        self.DeclareVectorOutputPort("y", size, self._calc_output, prerequisites_of_calc=prerequisites)

    def _rows(self, context: Context) -> Any:
        return context.get_discrete_state_vector().value().reshape(self._shape)

    def _fill(self, context: Context, discrete: DiscreteValues) -> None:
        rows = np.empty(self._shape)
        rows[:, 0] = -math.inf
        rows[-1, 0] = context.get_time()
        rows[:, 1:] = self._u.Eval(context)
        discrete.set_value(rows.ravel())

    def _store(self, context: Context, discrete: DiscreteValues) -> None:
        rows = self._rows(context)
        # A row at the time of the last one replaces it (the update at the time of the initialization).
        kept = rows[:-1] if context.get_time() - rows[-1, 0] < TIME_TOLERANCE else rows[1:]
        row = np.concatenate(([context.get_time()], self._u.Eval(context)))
        discrete.set_value(np.concatenate((kept.ravel(), row)))

    def _calc_output(self, context: Context, output: Any) -> None:
        if self.delay == 0.0:
            output.SetFromVector(self._u.Eval(context))
            return
        rows, at = self._rows(context), context.get_time() - self.delay
        after = int(np.searchsorted(rows[:, 0], at))
        if after == 0:
            raise RuntimeError(
                f"TransportDelay: the clock went backwards to {context.get_time():g} s; initialize again"
            )
        if after < len(rows):
            (t0, t1), (u0, u1) = rows[after - 1 : after + 1, 0], rows[after - 1 : after + 1, 1:]
        elif self._shorter_than_period and math.isfinite(rows[-1, 0]):
            (t0, t1), (u0, u1) = (rows[-1, 0], context.get_time()), (rows[-1, 1:], self._u.Eval(context))
        else:
            # Not initialized yet, or a time that is the last row's but for rounding.
            output.SetFromVector(rows[-1, 1:])
            return
        part = (at - t0) / (t1 - t0) if math.isfinite(t0) else 1.0
        output.SetFromVector(u0 + part * (u1 - u0) if part < 1.0 else u1)
