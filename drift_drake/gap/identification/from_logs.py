"""Logs and a first guess of a car to the calibrated car: the function behind `drift-drake identify`."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

from drift_drake.car.given_vehicle import Vehicle, vehicle_given
from drift_drake.car.log.given import Logs, logs_given
from drift_drake.car.log.table import Run
from drift_drake.common.standard_output import Progress
from drift_drake.gap.identification.calibration import Identification
from drift_drake.gap.identification.identify import Days, read_days
from drift_drake.gap.identification.identify import identify as identify_runs
from drift_drake.gap.identification.options import EFFECTS, KNOWN, CarKind, Criterion
from drift_drake.gap.monitoring.baselines import learn_baseline


def identify(
    logs: Logs | Sequence[str | Path], vehicle: Vehicle, *, known: Sequence[str] = KNOWN,
    effects: Sequence[str] = EFFECTS, criterion: Criterion = "auto", stated: Mapping[str, float] | None = None,
    case: str | None = None, car: CarKind = "auto", force: bool = False, watching: bool = True,
    progress: Progress | None = None,
) -> Identification:  # fmt: skip
    """Calibrates a car on logs: parameters, tolerances, lags, and what the logs cannot identify.

    Examples:
        >>> found = identify(["logs/monday", "logs/tuesday"], "start.yaml")  # doctest: +SKIP
        >>> write_vehicle("car.yaml", found.vehicle, found.effects)  # doctest: +SKIP

    Args:
        logs: path of a case folder, paths of several (one for each day), or runs of one car;
        vehicle: vehicle file's path, parameters, or (parameters, effects): the first guess; tolerances that a file
            states are believed, times two;
        known: parameters whose tolerance is believed as it is; effects: names of effects that may belong to the car;
        criterion: "likelihood" (exact where innovations are white), "prediction" (errors half a second ahead), or
            "auto", which lets the logs choose;
        stated: noise levels [SI, one standard deviation] by column that are known otherwise; case: name of it all;
        car: kind of car where prediction judges: "single-track", "double-track", or "auto", which takes a double-track
            one where that predicts held-out parts better, and keeps the single-track one with it (`single_track`);
        force: also on logs that are too gentle; watching: whether to learn a monitor's baseline
            (`watch`), where the logs can say; progress: called with a stage and the share done.

    Returns:
        The calibrated vehicle, its effects and the calibration with 95 % intervals (`calibration.parameters`).

    Raises:
        InvalidLogError: no run can be used; InvalidVehicleError: of the vehicle, or a name that is none.
    """
    first, days = vehicle_given(vehicle), _days(logs, case)
    found = identify_runs(
        days.runs, first.parameters, first.effects, days.case, known, effects, {**days.stated, **(stated or {})},
        progress, criterion, first.tolerances, force, kind=car,
    )  # fmt: skip
    return _with_baseline(found, days.runs) if watching else found


def _days(logs: Logs | Sequence[str | Path], case: str | None) -> Days:
    if isinstance(logs, str | Path):
        logs = [logs]
    if isinstance(logs, Sequence) and logs and all(isinstance(path, str | Path) for path in logs):
        days = read_days([str(path) for path in logs])
        return days._replace(case=case or days.case)
    given = logs_given(logs, case)  # type: ignore[arg-type]
    return Days(given.runs, given.noise, given.case)


def _with_baseline(found: Identification, runs: Sequence[Run]) -> Identification:
    """A calibration with a monitor's baseline, where its logs can say."""
    watching = learn_baseline(runs, found.vehicle, found.effects, found.calibration.normal)
    return dataclasses.replace(found, calibration=dataclasses.replace(found.calibration, watching=watching))
