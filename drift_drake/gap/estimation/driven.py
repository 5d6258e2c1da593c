"""How runs were driven, and which parts of them an estimator uses, for pages."""

from collections.abc import Sequence

from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters
from drift_drake.gap.estimation.usable import stretches
from drift_drake.view.pages.driving import Driven, driven


def all_driven(runs: Sequence[Run], car: CarParameters) -> list[Driven]:
    """What is drawn of each run, of a car of that size."""
    used = stretches(runs, car.single_track(), not isinstance(car, SimulatorCar))
    return [driven(run, parts) for run, parts in zip(runs, used, strict=True)]
