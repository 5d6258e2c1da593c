"""The baseline of a monitored car, of either kind: of windows where it was calibrated by prediction, else of a bank."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.given_vehicle import GivenVehicle, single_track_of
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.common.plain_files import read_json
from drift_drake.gap.estimation.normal import Normal, normal_from_data
from drift_drake.gap.monitoring.baseline_scores import (
    BaselineScores,
    calibrated_monitor,
    check_like,
    learn_baseline_scores,
    scores_from_data,
)
from drift_drake.gap.monitoring.events import InvalidBaselineScoresError, Watcher
from drift_drake.gap.monitoring.evidence import FALSE_ALARMS, alarm_at
from drift_drake.gap.monitoring.windowed.baseline import (
    WindowBaseline,
    learn_window_baseline,
    window_baseline_of,
    window_monitor,
)

REMEDY = "write it with 'drift-drake identify --json'"


class OfPrediction(NamedTuple):
    """Of a car that was calibrated by prediction."""

    windows: WindowBaseline
    normal: Normal


Baseline = BaselineScores | OfPrediction


def learn_baseline(
    runs: Sequence[Run], vehicle: CarParameters, own: Effects, normal: Normal | None
) -> dict[str, Any] | None:
    """What a calibration keeps for a monitor, as plain data; None where its logs, or its kind of car, give none.

    Args:
        normal: its baseline's residuals, of a car calibrated by prediction.
    """
    try:
        if normal is not None and not isinstance(vehicle, SimulatorCar):
            return learn_window_baseline(runs, vehicle, own, normal).as_data()
        return learn_baseline_scores(runs, vehicle, own).as_data() if isinstance(vehicle, VehicleParameters) else None
    except (InvalidLogError, ValueError):  # no torque commands, or too little driving
        return None


def calibrated_watcher(
    baseline: Baseline, run: Run, given: GivenVehicle, false_alarms: float = FALSE_ALARMS
) -> Watcher:
    """The monitor of a calibrated car for a log of the same columns and rate; false_alarms: that are allowed [1/h].

    Raises:
        InvalidLogError: the log lacks a column of the calibration's logs, or has another rate;
        InvalidBaselineScoresError: the vehicle is not the one that was calibrated.
    """
    if isinstance(baseline, OfPrediction):
        check_like(run, baseline.windows.columns, baseline.windows.period)
        if isinstance(given.parameters, SimulatorCar):
            raise InvalidBaselineScoresError(
                "the vehicle is a simulator of yours, too slow to be watched with; give the file of a car of ours that "
                "'drift-drake identify' wrote"
            )
        return window_monitor(baseline.windows, baseline.normal, given.parameters, given.effects, false_alarms)
    car = single_track_of(given.parameters)
    return calibrated_monitor(baseline, run, car, given.effects, alarm_at(false_alarms))


def baseline_given(calibration: Any) -> Baseline:
    """The baseline of what `identify` found, or of its JSON's path.

    Raises:
        InvalidBaselineScoresError: unreadable, not JSON, without any, or not what `identify` writes.
    """
    if isinstance(calibration, str | Path):
        return baseline_of(read_json(calibration, InvalidBaselineScoresError, REMEDY), calibration)
    found = getattr(calibration, "calibration", calibration)  # of an identification
    normal = getattr(found, "normal", None)
    data = {"watching": getattr(found, "watching", None), "normal": normal and normal.as_data()}
    return baseline_of(data, "the calibration")


def baseline_of(data: Any, path: str | Path) -> Baseline:
    """The same from the JSON's content; `path`: what is named in errors."""
    found = data.get("watching") if isinstance(data, dict) else None
    if found is None:
        raise InvalidBaselineScoresError(
            f"{path}: has no normal scores to watch with: the logs it was made of had no torque commands, or less than "
            f"8 s, or an older version wrote it; {REMEDY}, of logs with the column tau_cmd"
        )
    try:
        if data.get("normal"):
            return OfPrediction(window_baseline_of(found), normal_from_data(data["normal"]))
        return scores_from_data(found)
    except (KeyError, TypeError, AttributeError):
        raise InvalidBaselineScoresError(f"{path}: 'watching' is not what 'identify' writes; {REMEDY}") from None
    except ValueError as error:
        raise InvalidBaselineScoresError(f"{path}: watching: {error}; {REMEDY}") from None
