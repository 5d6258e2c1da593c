"""An assessment of logs before anything is fitted to them: the function behind `drift-drake check`."""

import dataclasses
from typing import TYPE_CHECKING, Any

from drift_drake.car.given_vehicle import Vehicle, vehicle_given
from drift_drake.car.log.cases import Logs, logs_given
from drift_drake.common.errors import InvalidOptionError
from drift_drake.gap.logs.screening.consistency import consistency_of
from drift_drake.gap.logs.screening.screened import RunQuality, quality, screened_logs

if TYPE_CHECKING:
    from drift_drake.gap.diagnosis.check.with_vehicle import ForCalibration
    from drift_drake.gap.diagnosis.diagnose import GivenCalibration


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
    once, clean, said = screened = screened_logs(given.runs)
    car = None if vehicle is None else vehicle_given(vehicle).parameters.single_track()
    agrees = consistency_of([one.run for one in clean], car)
    remarks = [*(doubt.sentence for doubt in agrees.doubts), *said]
    checked = Checked(given.case, quality(once, clean), remarks, unchecked=agrees.unchecked, undecided=agrees.undecided)
    if vehicle is None:
        return checked
    from drift_drake.gap.diagnosis.check.with_vehicle import with_vehicle  # slow to import

    return with_vehicle(checked, screened, given.noise, vehicle, calibration, for_calibration, workers)
