"""What systems declare: updates at a period and whenever they are forced, and outputs by a function of the Context."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pydrake.systems.framework import Context, DependencyTicket, LeafSystem, OutputPort

from drift_drake.common.arrays import Array

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


def declare_output(
    system: LeafSystem, name: str, size: int, value: Callable[[Context], Array | Sequence[float]],
    given: set[DependencyTicket] | None = None,
) -> OutputPort:  # fmt: skip
    """Declares a port whose numbers [size] a function of the Context gives.

    Args:
        given: what the numbers depend on; without, on all that the system has.
    """
    known = {} if given is None else {"prerequisites_of_calc": given}
    return system.DeclareVectorOutputPort(
        name, size, lambda context, output: output.SetFromVector(value(context)), **known
    )


def declare_parts(
    system: LeafSystem, parts: Mapping[str, slice], whole: Callable[[Context], Array], given: set[DependencyTicket]
) -> None:
    """`declare_output` of parts of what one function gives, by name."""

    def declare(name: str, part: slice) -> None:
        declare_output(system, name, part.stop - part.start, lambda context: whole(context)[part], given)

    for name, part in parts.items():
        declare(name, part)
