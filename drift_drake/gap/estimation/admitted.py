"""What an estimator is given of runs: usable parts, and doubts of units, signs and clocks."""

from collections.abc import Sequence
from typing import NamedTuple

from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters
from drift_drake.gap.estimation.usable import usable_parts
from drift_drake.gap.logs.screening.repeated import without_repeated
from drift_drake.gap.logs.screening.screened import screened
from drift_drake.gap.logs.screening.suspicions import Suspicion, suspicions_of


class Admitted(NamedTuple):
    """What an estimator is given of runs."""

    runs: list[Run]  # the parts that it can use
    doubts: list[Suspicion]  # units, signs and clocks that seem wrong
    warnings: list[str]  # of the doubts, of bad samples and of what is left out


def admit(runs: Sequence[Run], car: CarParameters) -> Admitted:
    """`usable` parts and `suspicions` of runs that are screened once; a run that is there twice counts once.

    Parts that reverse are for cars of this package alone: what a simulator of the user's does with a negative speed is
    its own affair.

    Raises:
        InvalidLogError: too little is left.
    """
    vehicle = car.single_track()
    runs, repeated = without_repeated(runs)
    clean, found = screened(runs)
    doubts = suspicions_of(clean, vehicle)
    kept, left_out = usable_parts(runs, clean, vehicle, not isinstance(car, SimulatorCar))
    return Admitted(kept, doubts, [*(doubt.sentence for doubt in doubts), *repeated, *found, *left_out])
