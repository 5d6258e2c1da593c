"""Discrete updates of systems: at their period under a Simulator, and whenever they are forced."""

from collections.abc import Callable
from typing import Any

from pydrake.systems.framework import LeafSystem

Update = Callable[..., Any]


def declare_update(system: LeafSystem, period: float, update: Update, offset: float = 0.0) -> None:
    """Declares a discrete update for a Simulator and for a loop, or a test, without one.

    Drake makes an update that is declared as periodic alone at its times only: `CalcForcedDiscreteVariableUpdate` and
    `ExecuteForcedEvents` would leave the state as it was.

    Args:
        period, offset: of the update's times [s]; update: from a Context into `DiscreteValues`.
    """
    system.DeclarePeriodicDiscreteUpdateEvent(period, offset, update)
    system.DeclareForcedDiscreteUpdateEvent(update)
