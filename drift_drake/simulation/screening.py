"""Readings that no car can have given are kept from the controller, and counted."""

import enum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.simulation.sensors import MEASURED_STATE

Array = NDArray[np.float64]

# How fast a reading can change, by channel of the measured state, [unit/s]: some times what tyres can do, a collision
# aside. The path position is left out: on a closed path it may start anew.
FASTEST = np.array([80.0, 80.0, 30.0, 400.0, 80.0, 30.0, np.inf])
NOISE = np.array([0.1, 0.5, 0.1, 1.0, 0.3, 0.1, np.inf])  # a change of this size is none, whatever the time
LARGEST = np.array([20.0, 150.0, np.pi, 300.0, 1e3, np.inf, np.inf])  # no car's reading
FROZEN = 3  # equal readings in a row that pass; a car that moves repeats none
PATIENCE = 0.5  # [s] after which a reading is believed however far it is from the last one believed


class Reading(enum.IntEnum):
    """What a reading is."""

    GOOD = 0
    MISSING = 1  # not finite
    STOPPED = 2  # a speed of zero or less: none at which the controller's models hold
    JUMPED = 3  # further from the last good one than a car can have come, or no car's at all
    FROZEN = 4  # the same as the last ones


def judge(reading: Array, last: Array, elapsed: float, repeats: int) -> Reading:
    """What a measured state [7] is.

    Args:
        last: the last good one, NaN before the first; elapsed: time since [s]; repeats: readings equal to this one
            right before it.
    """
    if not np.isfinite(reading).all():
        return Reading.MISSING
    if reading[1] <= 0.0 or reading[3] <= 0.0:
        return Reading.STOPPED
    if (np.abs(reading) > LARGEST).any():
        return Reading.JUMPED
    if np.isfinite(last).all() and elapsed <= PATIENCE:
        limit = NOISE + FASTEST * elapsed
        if (np.abs(reading - last)[:-1] > limit[:-1]).any():
            return Reading.JUMPED
    return Reading.FROZEN if repeats >= FROZEN else Reading.GOOD


class Screen(LeafSystem):
    """Hands good readings on as they are, and NaN, which is no reading, in place of others.

    Input port: measured_state [7]. Output ports: screened_state [7]; reading [1], a `Reading`; counts [5] of each
    kind until now. State in the Context, each `period`: time and values of the last good reading, the last reading
    and how often it was repeated, the counts.
    """

    def __init__(self, period: float = 0.01) -> None:
        LeafSystem.__init__(self)
        size = len(MEASURED_STATE)
        self._measured = self.DeclareVectorInputPort("measured_state", size)
        self._good = self.DeclareDiscreteState(np.full(1 + size, np.nan))
        self._last = self.DeclareDiscreteState(np.full(1 + size, np.nan))  # [repeats, reading]
        self._counts = self.DeclareDiscreteState(np.zeros(len(Reading)))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclareVectorOutputPort("screened_state", size, self._calc_screened)
        self.DeclareVectorOutputPort(
            "reading", 1, lambda context, output: output.SetFromVector([self._judged(context)])
        )
        self.DeclareStateOutputPort("counts", self._counts)

    def _repeats(self, context: Context) -> float:
        last = context.get_discrete_state(self._last).value()
        same = np.array_equal(last[1:], self._measured.Eval(context))
        return float(last[0]) + 1.0 if same else 0.0

    def _judged(self, context: Context) -> Reading:
        good = context.get_discrete_state(self._good).value()
        elapsed = context.get_time() - good[0]
        return judge(self._measured.Eval(context), good[1:], elapsed, int(self._repeats(context)))

    def _calc_screened(self, context: Context, output: Any) -> None:
        x = self._measured.Eval(context)
        output.SetFromVector(x if self._judged(context) == Reading.GOOD else np.full_like(x, np.nan))

    def _calc_reading(self, context: Context, output: Any) -> None:
        output[0] = float(self._judged(context))

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        x, kind = self._measured.Eval(context), self._judged(context)
        discrete.get_mutable_vector(self._counts)[int(kind)] += 1.0
        discrete.set_value(self._last, np.concatenate([[self._repeats(context)], x]))
        if kind == Reading.GOOD:
            discrete.set_value(self._good, np.concatenate([[context.get_time()], x]))
