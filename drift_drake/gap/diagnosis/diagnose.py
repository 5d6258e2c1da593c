"""Logs and the car of their simulator to where it is wrong, and why: the function behind `drift-drake diagnose`.

Each case is diagnosed by the criterion that its car was calibrated by; many cases are spread over processes.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.given_vehicle import Vehicle, single_track_of, vehicle_given
from drift_drake.car.log.cases import Logs, case_folders, case_name, logs_given
from drift_drake.car.log.table import InvalidLogError, Run, read_case, stated_noise
from drift_drake.car.parameters import CarParameters
from drift_drake.common.errors import DriftDrakeError, InvalidOptionError
from drift_drake.common.executors import ExecutorConfig, run_jobs
from drift_drake.common.run_folder import plain
from drift_drake.common.standard_output import Progress
from drift_drake.common.worker_pool import WorkerLostError
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.answers.provenance import KEY, provenance
from drift_drake.gap.diagnosis.calibrated.diagnose_change import ChangeDiagnosis, diagnose_change
from drift_drake.gap.diagnosis.likelihood import diagnose as likelihood
from drift_drake.gap.diagnosis.likelihood.diagnose import Diagnosis
from drift_drake.gap.diagnosis.options import USUAL_ALARMS, check_options, check_trust
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.usable import MOST_SECONDS
from drift_drake.gap.identification.calibration import Calibration, CarTrust, Identification, read_trust, trust_of

GivenCalibration = str | Path | Calibration | Identification


def diagnose(
    logs: Logs, vehicle: Vehicle, calibration: GivenCalibration | None = None, *, case: str | None = None,
    catalogue: Sequence[str] = tuple(CATALOGUE), without: Sequence[str] = (), every: int = 1,
    process_scale: float = 1.0, noise_scale: float = 1.0, tempering: float = 1.0,
    false_alarms: float | None = None, most_seconds: float = MOST_SECONDS, workers: int = 2,
    progress: Progress | None = None,
) -> Diagnosis | ChangeDiagnosis:  # fmt: skip
    """Finds where a simulator is wrong, which effect it lacks, how large that is, and how far adding it helps.

    Examples:
        >>> found = diagnose("logs/monday", "car.yaml")  # doctest: +SKIP
        >>> print(found.answer.sentence())  # doctest: +SKIP

    Args:
        logs: path of a case folder or of a run's file, or runs of one car on one day;
        vehicle: vehicle file's path, parameters, or (parameters, effects): what the simulator believes of the car;
        calibration: what `identify` found of this car (its JSON's path, or the object), so that the baseline of the
            car is no gap; case: name in the answer; catalogue: names of the effects to consider;
        without: columns to leave out; every: 2 takes every second row of the logs;
        process_scale, noise_scale: factors on process and sensor noise [-]; tempering: the likelihood's exponent [-],
            in (0, 1]; these three are part of a calibration;
        false_alarms: relative to a calibration by prediction, how often a day without a change may be said to have a
            gap [-] (0.001 to 0.2; 0.05 if it is not given);
        most_seconds: of logs that are looked at [s]; a calibration by prediction has a limit of its own;
        workers: threads; progress: called with a stage and the share done.

    Returns:
        A diagnosis, whose `answer` has verdict, causes, magnitudes (in the catalogue's units) with 95 % intervals, and
        the share of the gap that they remove; `report` draws it.

    Raises:
        InvalidLogError: no run can be used, or a column cannot be left out; InvalidVehicleError: of vehicle or effects;
        InvalidCalibrationError: of the calibration; InvalidOptionError: another argument is out of range.
    """
    car = vehicle_given(vehicle)
    check_options(catalogue, without, every, most_seconds, workers)
    options: dict[str, Any] = {
        "own": car.effects, "catalogue": tuple(catalogue), "most_seconds": most_seconds, "progress": progress,
        **trust_options(calibration, process_scale, noise_scale, tempering, false_alarms, catalogue),
    }  # fmt: skip
    if isinstance(logs, str | Path):
        return answer_folder(logs, car.parameters, workers, without=tuple(without), every=every, **options)
    given = logs_given(logs, case)
    runs = [run.without(*without).thinned(every) for run in given.runs]
    return answer_runs(runs, car.parameters, given.case, workers, **options)


def trust_options(
    calibration: GivenCalibration | None,
    process_scale: float = 1.0,
    noise_scale: float = 1.0,
    tempering: float = 1.0,
    false_alarms: float | None = None,
    catalogue: Sequence[str] = (),
) -> dict[str, Any]:
    """How far to trust sensors and model, from the calibration or the factors: options of `answer_folder`.

    Raises:
        InvalidOptionError: both are given, or a factor is out of range;
        InvalidCalibrationError: the calibration cannot be used.
    """
    check_trust(calibration, process_scale, noise_scale, tempering, false_alarms)
    if calibration is not None:
        trust = trust_given(calibration, catalogue)
    else:
        trust = CarTrust(noise_scale, process_scale, tempering, None)
    if trust.normal is None and false_alarms is not None:
        raise InvalidOptionError(
            "--false-alarms is a rate relative to a --calibration by prediction; give one ('drift-drake identify "
            "--criterion prediction --json'), or leave the rate out"
        )
    by_prediction = {"false_alarms": false_alarms or USUAL_ALARMS}
    return {"normal": trust.normal} | (trust.options() if trust.normal is None else by_prediction)


def trust_given(calibration: GivenCalibration, catalogue: Sequence[str] = ()) -> CarTrust:
    """How far to trust sensors and model, of a calibration's JSON or object; `catalogue`: effects that it has to know.

    Raises:
        InvalidOptionError: it is neither; InvalidCalibrationError: the JSON cannot be used.
    """
    if isinstance(calibration, str | Path):
        trust = read_trust(calibration)
        trust.check_knows(catalogue, calibration)
        return trust
    found = calibration.calibration if isinstance(calibration, Identification) else calibration
    if not isinstance(found, Calibration):
        raise InvalidOptionError(
            f"calibration: {type(calibration).__name__} is none; give what 'identify' found, or its JSON's path"
        )
    trust = trust_of(plain(found))
    trust.check_knows(catalogue, "the calibration")
    return trust


def answer_folder(
    folder: str | Path,
    vehicle: CarParameters,
    workers: int = 2,
    normal: Normal | None = None,
    without: Sequence[str] = (),
    every: int = 1,
    **options: Any,
) -> Diagnosis | ChangeDiagnosis:
    """Diagnoses one case folder by the criterion that its car was calibrated by.

    Args:
        normal: of a car that was calibrated by prediction (`changed_day`); without: columns to leave out;
        every: rows of the logs that make one here; options: of `diagnose`.
    """
    folder = Path(folder)
    given = {"normal": normal, "without": without, "every": every, **options}
    found_from = {KEY: provenance(folder, vehicle, given)}
    runs = [run.without(*without).thinned(every) for run in read_case(folder)]
    if normal is None:
        options.setdefault("stated", stated_noise(folder))
    found = answer_runs(runs, vehicle, case_name(folder), workers, normal, **options)
    answer = dataclasses.replace(found.answer, details=found.answer.details | found_from)
    return dataclasses.replace(found, answer=answer)


def answer_runs(
    runs: Sequence[Run], vehicle: CarParameters, case: str, workers: int = 2, normal: Normal | None = None,
    **options: Any,
) -> Diagnosis | ChangeDiagnosis:  # fmt: skip
    """Diagnoses runs by the criterion that their car was calibrated by; arguments as those of `answer_folder`."""
    if normal is None:
        options.pop("false_alarms", None)
        return likelihood.diagnose(runs, single_track_of(vehicle), case=case, workers=workers, **options)
    kept = {key: options[key] for key in ("own", "progress", "catalogue", "false_alarms") if key in options}
    return diagnose_change(runs, vehicle, normal, case=case, workers=workers, **kept)


def _answered(vehicle: CarParameters, options: Mapping[str, Any], folder: Path) -> Answer:
    return answer_folder(folder, vehicle, workers=1, **options).answer


def diagnose_all(
    folder: str | Path,
    vehicle: CarParameters,
    run_on: ExecutorConfig,
    progress: Callable[[Answer], None] | None = None,
    refused: Callable[[DriftDrakeError], None] | None = None,
    only: Sequence[Path] | None = None,
    quiet: bool = True,
    **options: Any,
) -> list[Answer]:
    """Diagnoses a folder of cases, spread over processes or a cluster.

    A case whose logs cannot be used, or whose worker process was killed again and again, is reported to `refused` and
    left out; without `refused`, its error ends the work.

    Args:
        run_on: where; on a cluster its machines must see the logs.
        progress: called with each answer as it comes in.
        only: some of `case_folders`; quiet: without a progress bar; options: of `answer_folder`.
    """
    folders = list(case_folders(folder) if only is None else only)
    answers: dict[Path, Answer] = {}

    def finish(path: Path, answer: Answer) -> None:
        answers[path] = answer
        if progress is not None:
            progress(answer)

    def failed(path: Path, error: BaseException) -> None:
        if isinstance(error, WorkerLostError):
            error = WorkerLostError(f"{path}: {error}; run the command again, which goes on with what is not answered")
        if refused is None or not isinstance(error, InvalidLogError | WorkerLostError):
            raise error
        refused(error)

    run_jobs(run_on, partial(_answered, vehicle, options), folders, finish, "case", failed, quiet=quiet)
    return [answers[path] for path in folders if path in answers]
