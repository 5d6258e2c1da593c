"""An assessment of logs before anything is fitted to them: the function behind `drift-drake check`."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.given_vehicle import Vehicle, single_track_of, vehicle_given
from drift_drake.car.log.given import GivenLogs, Logs, logs_given
from drift_drake.common.errors import InvalidOptionError
from drift_drake.gap.logs.screening.consistency import consistency_of
from drift_drake.gap.logs.screening.repeated import without_repeated
from drift_drake.gap.logs.screening.screened import RunQuality, quality, screened

if TYPE_CHECKING:
    from drift_drake.gap.diagnosis.check.for_calibration import ForCalibration
    from drift_drake.gap.diagnosis.diagnose import GivenCalibration

LEAST_COVERED = 0.5  # [s] in an operating region that counts as driven


@dataclasses.dataclass(frozen=True)
class Checked:
    """What was found; detection: by effect, as in an answer (`details.detection`); regions: seconds driven in each;
    unchecked: columns of which no other one tells whether they are right; undecided: what else they cannot tell."""

    case: str
    runs: list[RunQuality]
    remarks: list[str]
    regions: dict[str, float] = dataclasses.field(default_factory=dict)
    detection: dict[str, dict[str, Any]] = dataclasses.field(default_factory=dict)
    unchecked: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()
    for_calibration: "ForCalibration | None" = None


def check(
    logs: Logs, vehicle: Vehicle | None = None, calibration: "GivenCalibration | None" = None, *,
    for_calibration: bool = False, workers: int = 2,
) -> Checked:  # fmt: skip
    """Assesses logs: rates, columns, noise, bad samples; with a vehicle, what contradicts it and which effects show.

    Examples:
        >>> found = check("logs/monday", "car.yaml")
        >>> least = found.detection["steering_lag"]["least"]  # [s] that these logs would show

    Args:
        logs: path of a case folder or of a run's file, or runs; vehicle: vehicle file's path, parameters, or
            (parameters, effects); calibration: what `identify` found of this car, or its JSON's path;
        for_calibration: whether to say if a car can be calibrated on these logs, the vehicle being a first guess, in
            place of what they would show; workers: threads.

    Returns:
        Quality by run, remarks, seconds driven by operating region [s], and by effect the least magnitude that would
        be named (in the catalogue's unit).

    Raises:
        InvalidLogError: no run can be used; InvalidVehicleError: of the vehicle; InvalidCalibrationError: of the
            calibration; InvalidOptionError: a calibration without a vehicle; SimulatorError: of a simulator.
    """
    if calibration is not None and vehicle is None:
        raise InvalidOptionError("--calibration is of a vehicle file; give --vehicle too")
    if for_calibration and (vehicle is None or calibration is not None):
        raise InvalidOptionError("--for-calibration is of a first guess; give --vehicle, and no --calibration")
    given = logs_given(logs)
    once, repeated = without_repeated(given.runs)
    clean, bad = screened(once)
    car = None if vehicle is None else vehicle_given(vehicle).parameters.single_track()
    agrees = consistency_of([one.run for one in clean], car)
    remarks = [*(doubt.sentence for doubt in agrees.doubts), *repeated, *bad]
    checked = Checked(given.case, quality(once, clean), remarks, unchecked=agrees.unchecked, undecided=agrees.undecided)
    return checked if vehicle is None else _with_vehicle(checked, given, vehicle, calibration, for_calibration, workers)


def _with_vehicle(
    checked: Checked, given: GivenLogs, car: Vehicle, calibration: "GivenCalibration | None", asked: bool, workers: int
) -> Checked:
    """What can be said relative to a vehicle."""
    # Slow to import, and of no use without a vehicle.
    from drift_drake.gap.diagnosis.check.limits import limits_by_filter, limits_by_prediction
    from drift_drake.gap.diagnosis.diagnose import trust_given
    from drift_drake.gap.estimation.usable import admit
    from drift_drake.gap.evidence.where import region_names, region_of
    from drift_drake.gap.identification.calibration import CarTrust

    whole, own, tolerances, _ = vehicle_given(car)
    vehicle = whole.single_track()
    kept, doubts, warnings = admit(given.runs, whole)
    stated = {doubt.sentence for doubt in doubts if doubt.column is not None}  # by what is asked of the columns already
    warnings = [warning for warning in warnings if warning not in stated]
    names, grip = region_names(), vehicle.friction * vehicle.gravity
    seconds = np.zeros(len(names))
    for run in kept:
        beta = np.zeros(len(run)) if run.beta is None else run.beta
        np.add.at(seconds, region_of(run.v, run.r, beta, grip), run.period)
    regions = {name: float(s) for name, s in zip(names, seconds, strict=True) if s >= LEAST_COVERED}
    remarks = [*checked.remarks, *warnings]
    checked = dataclasses.replace(checked, remarks=list(dict.fromkeys(remarks)), regions=regions)
    if asked:
        from drift_drake.gap.diagnosis.check.for_calibration import for_calibration

        return dataclasses.replace(checked, for_calibration=for_calibration(kept, whole, own, tolerances))
    unit = CarTrust(1.0, 1.0, 1.0, None)
    trust = unit if calibration is None else trust_given(calibration, tuple(CATALOGUE))
    detection: dict[str, dict[str, Any]] = {}
    if isinstance(whole, SimulatorCar) and trust.normal is None:  # without a calibration there is no limit
        more = [f"not judged, since the simulator cannot have it: {one}" for one in whole.simulator.left_out()]
    elif trust.normal is not None:
        detection, more = limits_by_prediction(kept, whole, trust.normal, own, checked.case, workers)
    else:
        detection, more = limits_by_filter(kept, single_track_of(whole), own, given.noise, trust.options())
    return dataclasses.replace(checked, remarks=list(dict.fromkeys([*remarks, *more])), detection=detection)
