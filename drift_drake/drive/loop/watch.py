"""What watches the car in a closed loop: a part that is plugged in, and says what follows from what it sees."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from pydrake.systems.framework import DiagramBuilder, OutputPort

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import StepModel
from drift_drake.drive.reference.trajectory import Reference


class LoopPorts(NamedTuple):
    """What a watch is given of the loop."""

    measured_state: OutputPort  # as the screen leaves it
    command: OutputPort  # in force
    log_row: OutputPort  # `car.sensors.LOG_ROW`
    plan: OutputPort  # the controller's
    reading: OutputPort | None  # kind of it (`drive.screening.screen.ReadingKind`), where readings are screened


class Watched(NamedTuple):
    """What the loop goes on with."""

    measured_state: OutputPort  # for the controller
    plan: OutputPort  # for the actuator
    logged: dict[str, tuple[OutputPort, Sequence[str]]]  # ports and their columns of a run's table, by logger
    effects: OutputPort | None = None  # for the controller's model
    trusted: OutputPort | None = None  # for an adapter that forgets
    pace: float | None = None  # [m/s] at the slowest; None where the reference's speeds stay


class LoopWatch(Protocol):
    """See `gap.monitoring.in_loop.GapWatch`."""

    @property
    def effects_size(self) -> int:
        """Of the effects that it gives the controller's model; 0 for none."""

    def watching(
        self, builder: DiagramBuilder, ports: LoopPorts, model: StepModel | None, parameters: VehicleParameters,
        reference: Reference, steps: int, period: float,
    ) -> Watched:  # fmt: skip
        """Adds its systems to a loop whose controller believes `model`, and plans `steps`, each `period` [s]."""
