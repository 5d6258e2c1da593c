"""Detection limits of logs from which nothing has been diagnosed yet."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.gap.diagnosis.calibrated.diagnose_change import search_of
from drift_drake.gap.diagnosis.calibrated.posterior import detection_limits
from drift_drake.gap.diagnosis.likelihood.isolability import isolability
from drift_drake.gap.estimation.fit import no_effects
from drift_drake.gap.estimation.freeform import applied
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.problem import make_problem
from drift_drake.gap.estimation.usable import part_of, seen_effects

Limits = dict[str, dict[str, Any]]  # by effect, as in an answer's `details.detection`


def limits_by_prediction(
    runs: Sequence[Run], vehicle: CarParameters, normal: Normal, own: Effects, case: str, workers: int
) -> tuple[Limits, list[str]]:
    """Of a car that was calibrated by prediction, relative to its baseline; and sentences on what is missing.

    Raises:
        InvalidLogError: a column is missing, or there is too little driving.
    """
    names, warnings = seen_effects(runs, normal.names)
    search = search_of(runs, vehicle, normal, own, names, case, workers)
    search.singles(lambda _share: None)
    limits = detection_limits(search, search.curves)
    return {name: dataclasses.asdict(limit) for name, limit in limits.items()}, warnings


def limits_by_filter(
    runs: Sequence[Run], vehicle: VehicleParameters, own: Effects, stated: Mapping[str, float],
    trust: Mapping[str, Any],
) -> tuple[Limits, list[str]]:  # fmt: skip
    """Relative to the vehicle file as it is, from the filter's innovations (`Isolability.limits`); of long logs a part.

    Args:
        stated: noise by column that an import stated; trust: options of `diagnose` from a calibration by likelihood.
    """
    runs, left_out = part_of(runs)
    names, warnings = seen_effects(runs, tuple(CATALOGUE))
    warnings += left_out
    options = {key: value for key, value in trust.items() if key != "discrepancy"}
    problem = make_problem(runs, vehicle, stated=stated, own=own, **options)
    if trust.get("discrepancy") is not None:
        problem, more = applied(problem, trust["discrepancy"])
        warnings += more
    return isolability(problem, no_effects(problem), names, small=True).limits(vehicle), warnings
