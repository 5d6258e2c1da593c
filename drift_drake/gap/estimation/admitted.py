"""What an estimator is given of runs: usable parts, and doubts of units, signs and clocks."""

from collections.abc import Sequence
from typing import NamedTuple

from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.usable import usable_parts
from drift_drake.gap.logs.screening.repeated import without_repeated
from drift_drake.gap.logs.screening.screened import screened
from drift_drake.gap.logs.screening.suspicions import Suspicion, suspicions_of


class Admitted(NamedTuple):
    """What an estimator is given of runs."""

    runs: list[Run]  # the parts that it can use
    doubts: list[Suspicion]  # units, signs and clocks that seem wrong
    warnings: list[str]  # of the doubts, of bad samples and of what is left out


def admit(runs: Sequence[Run], vehicle: VehicleParameters) -> Admitted:
    """`usable` parts and `suspicions` of runs that are screened once; a run that is there twice counts once.

    Raises:
        InvalidLogError: too little is left.
    """
    runs, repeated = without_repeated(runs)
    clean, found = screened(runs)
    doubts = suspicions_of(clean, vehicle)
    kept, left_out = usable_parts(runs, clean, vehicle)
    return Admitted(kept, doubts, [*(doubt.sentence for doubt in doubts), *repeated, *found, *left_out])
