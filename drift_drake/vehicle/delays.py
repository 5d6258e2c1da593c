"""Pure delays of the commands: how late they reach the car, by the effects whose records say that they delay one.

A delay has no finite state and is none of the equations of motion: whoever hands a car its commands takes them from
so much earlier.
"""

from collections.abc import Callable
from typing import Any

from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.compilation import compiled
from drift_drake.vehicle.effect import Command
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.scalar import jitable

DELAYS = tuple(name for name, effect in CATALOGUE.items() if effect.delays)


def _sum_of_delays(command: Command) -> Callable[[Effects], Any]:
    total = jitable(lambda q: 0.0)  # noqa: ARG005
    for name in DELAYS:
        if CATALOGUE[name].delays == command:
            total = jitable(_with_delay(total, Effects._fields.index(name)))
    return total


def _with_delay(before: Any, index: int) -> Callable[[Effects], Any]:
    return lambda q: before(q) + q[index]


_steering_delay, _torque_delay = _sum_of_delays("delta_cmd"), _sum_of_delays("tau_cmd")


@jitable
def command_delays(q: Effects) -> tuple[Any, Any]:
    """How late the steering and the torque command reach the car [s], the sensors' latency aside."""
    return _steering_delay(q), _torque_delay(q)


@compiled
def _command_at(command: Any, place: Any, last: Any) -> Any:
    if place <= 0.0:
        return command[0]
    row = min(int(place), last)
    return command[row] + (place - row) * (command[min(row + 1, last)] - command[row])


@compiled
def commands_at(delta: Any, tau: Any, place: Any, last: Any, period: Any, q: Any) -> Any:
    """Both commands as they reach the car at a place [rows], from rows up to `last` with `period` [s] between them.

    Linear between rows; before the first row they were what they are there.
    """
    late_delta, late_tau = command_delays(q)
    return _command_at(delta, place - late_delta / period, last), _command_at(tau, place - late_tau / period, last)
