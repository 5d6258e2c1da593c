"""Diagnoses of case folders, each by the criterion that its car was calibrated by; many of them over processes."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, as_completed
from pathlib import Path
from typing import Any

from drift_drake.diagnosis.another_day.diagnose_day import DayDiagnosis, diagnose_day
from drift_drake.diagnosis.answers.answer import Answer
from drift_drake.diagnosis.answers.provenance import KEY, provenance
from drift_drake.diagnosis.likelihood.diagnose import Diagnosis, diagnose
from drift_drake.errors import DriftDrakeError
from drift_drake.estimation.normal import Normal
from drift_drake.logs.cases import case_folders, case_name
from drift_drake.logs.table import InvalidLogError, read_case, stated_noise
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.workers import worker_processes


class WorkerLostError(DriftDrakeError, RuntimeError):
    """A worker process was killed; the message names the case that it worked on."""


def answer_folder(
    folder: str | Path,
    vehicle: VehicleParameters,
    workers: int = 2,
    normal: Normal | None = None,
    without: Sequence[str] = (),
    every: int = 1,
    **options: Any,
) -> Diagnosis | DayDiagnosis:
    """Diagnoses one case folder by the criterion that its car was calibrated by.

    Args:
        normal: of a car that was calibrated by prediction (`another_day`); without: columns to leave out;
        every: rows of the logs that make one here; options: of `diagnose`.
    """
    folder = Path(folder)
    given = {"normal": normal, "without": without, "every": every, **options}
    found_from = {KEY: provenance(folder, vehicle, given)}
    runs = [run.without(*without).thinned(every) for run in read_case(folder)]
    case = case_name(folder)
    found: Diagnosis | DayDiagnosis
    if normal is not None:
        kept = {key: options[key] for key in ("own", "progress", "catalogue") if key in options}
        found = diagnose_day(runs, vehicle, normal, case=case, workers=workers, **kept)
    else:
        options.setdefault("stated", stated_noise(folder))
        found = diagnose(runs, vehicle, case=case, workers=workers, **options)
    answer = dataclasses.replace(found.answer, details=found.answer.details | found_from)
    return dataclasses.replace(found, answer=answer)


def _answer_folder(folder: Path, vehicle: VehicleParameters, options: Mapping[str, Any]) -> Answer:
    return answer_folder(folder, vehicle, workers=1, **options).answer


def diagnose_all(
    folder: str | Path,
    vehicle: VehicleParameters,
    executor: Executor | None = None,
    progress: Callable[[Answer], None] | None = None,
    refused: Callable[[InvalidLogError], None] | None = None,
    only: Sequence[Path] | None = None,
    **options: Any,
) -> list[Answer]:
    """Diagnoses a folder of cases, spread over the executor (processes of this machine if none is given).

    A case whose logs cannot be used is told to `refused` and left out; without `refused`, its error ends the work.
    `only` picks some of `case_folders`; `options` go to `diagnose`.

    Raises:
        WorkerLostError: a worker process was killed.
    """
    folders = list(case_folders(folder) if only is None else only)
    if not folders:
        return []
    if executor is None:
        with worker_processes() as own:
            return diagnose_all(folder, vehicle, own, progress, refused, folders, **options)
    jobs = {executor.submit(_answer_folder, path, vehicle, options): path for path in folders}
    answers = {}
    for job in as_completed(jobs):
        try:
            answer = job.result()
        except InvalidLogError as error:
            if refused is None:
                raise
            refused(error)
            continue
        except BrokenExecutor:
            raise WorkerLostError(
                f"{jobs[job]}: its worker process was killed, perhaps for want of memory; run the command again, which "
                "goes on with what is not answered yet"
            ) from None
        answers[jobs[job]] = answer
        if progress is not None:
            progress(answer)
    return [answers[path] for path in folders if path in answers]
