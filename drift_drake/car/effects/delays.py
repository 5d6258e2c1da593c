"""Times of the commands: how late they reach the car, by the effects whose records say that they delay or hasten one.

A delay has no finite state and is none of the equations of motion: whoever hands a car its commands takes them from
so much earlier. A command that acts before the log says so is no car's but a wrong clock's: a log can be looked ahead
in, a car that is driven now cannot (`check_causal`), and a simulated log is stamped wrongly afterwards (`stamped`).
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.joined import Function, over, plus
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.effects.record import Command
from drift_drake.car.parameters import InvalidVehicleError
from drift_drake.car.scalar import jitable
from drift_drake.common.arrays import Array

ROUNDING = 1e-9  # [s]

DELAYS = tuple(name for name, effect in CATALOGUE.items() if effect.delays)
LATE = tuple(name for name, effect in CATALOGUE.items() if effect.late)
HASTENERS = tuple(name for name, effect in CATALOGUE.items() if effect.hastens)


def _delay_of(command: Command) -> Function:
    records = enumerate(CATALOGUE.values())
    later = {
        place: effect.delays == command for place, effect in records if command in (effect.delays, *effect.hastens)
    }
    late = over([place for place in later if later[place]], 0.0, plus)
    early = over([place for place in later if not later[place]], 0.0, plus)
    return jitable(lambda q: late(q) - early(q))


_steering_delay, _torque_delay = _delay_of("delta_cmd"), _delay_of("tau_cmd")


@jitable
def command_delays(q: Effects) -> tuple[Any, Any]:
    """How late the steering and the torque command reach the car [s], the sensors' latency aside.

    Below zero where they act before the log says so.
    """
    return _steering_delay(q), _torque_delay(q)


def sensor_delay(q: Effects) -> float:
    """How late readings are [s]."""
    return float(sum(getattr(q, name) for name in LATE))


def check_causal(q: Effects, source: str, late: float = 0.0) -> None:
    """Raises an InvalidVehicleError, which names `source`, where commands would act before they are given.

    Args:
        late: [s] that what follows from commands comes later by.
    """
    early = -min(command_delays(q)) - late
    if early > ROUNDING:
        names = ", ".join(name for name in HASTENERS if getattr(q, name) > 0.0)
        raise InvalidVehicleError(
            f"{source}: with {names} commands would act {early:g} s before they are given, which only a log that was "
            "stamped late can show; leave it out here, and take it off the commands' times in the logs"
        )


def on_time(q: Effects) -> Effects:
    """The effects with the commands' clock right: what a car has, and not its log."""
    return q._replace(**dict.fromkeys(HASTENERS, 0.0))


def stamped(columns: Mapping[Command, Array], q: Effects, period: float) -> tuple[dict[Command, Array], int]:
    """Columns of commands [rows], `period` [s] apart, as a log with a wrong clock has them, and how many rows it has.

    What was commanded at t is logged at t + q; before the first row commands were what they are there. A clock that is
    early logs nothing for the last rows.
    """
    moved = {name: _moved(values, -_clock(q, name), period) for name, values in columns.items()}
    kept = min(len(v) - math.ceil(max(-_clock(q, name), 0.0) / period - ROUNDING) for name, v in columns.items())
    return {name: values[:kept] for name, values in moved.items()}, kept


def as_commanded(columns: Mapping[Command, Array], q: Effects, period: float) -> dict[Command, Array]:
    """`stamped` the other way: a log's commands [rows] when they were given; after its last row they are held."""
    return {name: _moved(values, _clock(q, name), period) for name, values in columns.items()}


def _clock(q: Effects, command: Command) -> float:
    return float(sum(getattr(q, name) for name in HASTENERS if command in CATALOGUE[name].hastens))


def _moved(values: Array, ahead: float, period: float) -> Array:
    t = period * np.arange(len(values))
    return np.asarray(np.interp(t + ahead, t, values)) if ahead != 0.0 else values
