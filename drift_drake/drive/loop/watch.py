"""What watches the car in a closed loop: a part that is plugged in, and says what follows from what it sees."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from pydrake.systems.framework import DiagramBuilder, OutputPort

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import StepModel
from drift_drake.drive.reference.trajectory import Reference


class LoopPorts(NamedTuple):
    """What a watch is given of the loop."""

    measured_state: OutputPort  # as the controller has it
    command: OutputPort  # in force
    log_row: OutputPort  # `car.sensors.LOG_ROW`
    reading: OutputPort | None  # kind of it (`drive.screening.screen.ReadingKind`), where readings are screened


class Watched(NamedTuple):
    """What it gives the loop."""

    measured_state: OutputPort  # for the controller
    logged: dict[str, tuple[OutputPort, Sequence[str]]]  # ports and their columns of a run's table, by logger
    effects: OutputPort | None = None  # for the controller's model
    trusted: OutputPort | None = None  # for an adapter that forgets


class Paced(NamedTuple):
    """A plan as the loop is to follow it."""

    plan: OutputPort
    pace: float | None = None  # [m/s] at the slowest; None where the reference's speeds stay
    logged: dict[str, tuple[OutputPort, Sequence[str]]] = {}  # noqa: RUF012 (never written to)


class LoopWatch(Protocol):
    """See `gap.monitoring.in_loop.GapWatch`."""

    @property
    def effects_size(self) -> int:
        """Of the effects that it gives the controller's model; 0 for none."""

    def watching(self, builder: DiagramBuilder, ports: LoopPorts, model: StepModel | None) -> Watched:
        """Adds its systems to a loop whose controller believes `model`."""

    def pacing(
        self, builder: DiagramBuilder, ports: LoopPorts, plan: OutputPort, parameters: VehicleParameters,
        reference: Reference, steps: int, period: float,
    ) -> Paced:  # fmt: skip
        """Adds what stands between the controller's plans (of `steps`, each `period` [s]) and the actuator."""
