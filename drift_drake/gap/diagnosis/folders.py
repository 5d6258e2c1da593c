"""Diagnoses of case folders, each by the criterion that its car was calibrated by; many of them over processes."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from drift_drake.car.given_vehicle import single_track_of
from drift_drake.car.log.cases import case_folders, case_name
from drift_drake.car.log.table import InvalidLogError, Run, read_case, stated_noise
from drift_drake.car.parameters import CarParameters
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.executors import ExecutorConfig, run_jobs
from drift_drake.common.worker_pool import WorkerLostError
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.answers.provenance import KEY, provenance
from drift_drake.gap.diagnosis.calibrated.diagnose_change import ChangeDiagnosis, diagnose_change
from drift_drake.gap.diagnosis.likelihood.diagnose import Diagnosis, diagnose
from drift_drake.gap.estimation.normal import Normal


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
        return diagnose(runs, single_track_of(vehicle), case=case, workers=workers, **options)
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
