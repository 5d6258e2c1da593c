"""From runs of a car and the file of its simulator to where the gap is, which effect causes it, how far it shrinks."""

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from drift_drake.diagnosis.another_day.diagnose_day import DayDiagnosis, diagnose_day
from drift_drake.diagnosis.answers.answer import Answer
from drift_drake.diagnosis.answers.provenance import KEY, provenance
from drift_drake.diagnosis.likelihood.judging import judge
from drift_drake.diagnosis.likelihood.learned import learned
from drift_drake.diagnosis.likelihood.search import Found, search
from drift_drake.diagnosis.posterior import (
    Calibration,
    Posterior,
    read_calibration,
)
from drift_drake.diagnosis.where import locate
from drift_drake.errors import DriftDrakeError
from drift_drake.estimation.everyday import applied
from drift_drake.estimation.fit import Fit
from drift_drake.estimation.freeform import Regression, misfit
from drift_drake.estimation.horizons import HORIZONS, start_rows
from drift_drake.estimation.problem import Everyday, Problem, make_problem
from drift_drake.estimation.reduction import Reduction, errors_of, mean_squares, without_effects
from drift_drake.estimation.scores import Normal
from drift_drake.estimation.seen_effects import seen_effects
from drift_drake.estimation.usable import usable
from drift_drake.logs.cases import case_folders, case_name
from drift_drake.logs.screening.suspicions import suspicions
from drift_drake.logs.table import InvalidLogError, Run, read_case, stated_noise
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.workers import worker_processes

Progress = Callable[[str, float], None]
MOST_REFUSED = 4  # causes that remove nothing


class WorkerLostError(DriftDrakeError, RuntimeError):
    """A worker process was killed; the message names the case that it worked on."""


@dataclasses.dataclass(frozen=True)
class Diagnosis:
    """The answer, and what a report is drawn from."""

    answer: Answer
    problem: Problem
    found: Found
    posterior: Posterior
    fit: Fit  # of the causes; of the leading hypothesis where the verdict is none or unknown
    reduction: Reduction
    unexplained: Regression  # pulses that the best hypothesis leaves
    lacking: Regression  # pulses that the car without effects lacks


def diagnose(
    runs: Sequence[Run],
    vehicle: VehicleParameters,
    case: str = "case",
    workers: int = 2,
    progress: Progress | None = None,
    calibration: Calibration | None = None,
    catalogue: Sequence[str] = tuple(CATALOGUE),
    process_scale: float = 1.0,
    noise_scale: float = 1.0,
    stated: Mapping[str, float] | None = None,
    own: Effects = Effects(),  # noqa: B008 (immutable)
    row_weight: float = 1.0,
    everyday: Everyday | None = None,
) -> Diagnosis:
    """Diagnoses the runs of one case.

    Args:
        runs: of the same car on the same day; vehicle: what its simulator believes; workers: threads;
        progress: called with a stage's name and the share done; calibration: constants of the posterior;
        catalogue: names of the effects to consider; process_scale, noise_scale, stated,
        row_weight: see `make_problem`;
        own: effects that the vehicle file has already; what is found adds to them;
        everyday: misfit that is no gap, with a row weight of its own (`everyday.applied`).

    Raises:
        InvalidLogError: no run can be used.
    """
    began = time.perf_counter()
    tell = progress or (lambda _stage, _share: None)
    doubts = suspicions(runs, vehicle)
    runs, unusable = usable(runs, vehicle)
    names, unseen = seen_effects(runs, catalogue)
    problem = make_problem(runs, vehicle, process_scale, noise_scale, stated, own, row_weight)
    problem, misfits = (problem, []) if everyday is None else applied(problem, everyday)
    found = search(problem, names, workers, lambda stage, share: tell(stage, 0.8 * share))
    judged = judge(problem, found.hypotheses(), len(names), calibration or read_calibration(), tell)
    tell("where it is", 0.93)
    lacking = judged.left[0] if not judged.best.names else misfit(problem, judged.nothing)
    before, floor = without_effects(problem, None), errors_of(problem, judged.best.theta, judged.best.names)
    where = find_gap(problem, before, floor, lacking)
    tell("what the learnt model says", 0.97)
    details = judged.as_data(problem, names) | {
        "learned": dataclasses.asdict(learned(problem, before, floor)),
        "suspicions": [dataclasses.asdict(doubt) for doubt in doubts],
    }
    warnings = [*(doubt.sentence for doubt in doubts), *unusable, *unseen, *misfits, *judged.warnings(problem)]
    answer = judged.answer(problem, case, where, details, warnings, time.perf_counter() - began)
    tell("done", 1.0)
    return Diagnosis(answer, problem, found, judged.posterior, judged.posterior.fit, judged.reduction, judged.left[0],
                     lacking)  # fmt: skip


def find_gap(
    problem: Problem, before: Sequence[np.ndarray], floor: Sequence[np.ndarray], lacking: Regression
) -> dict[str, Any]:
    """The `where` of an answer: what the nominal car gets wrong (`before`) beyond the best fit (`floor`)."""
    excess = [b - f for b, f in zip(before, floor, strict=True)]
    rows = [start_rows(run) for run in problem.runs]
    where = dataclasses.asdict(locate(problem, excess, rows, lacking))
    means = zip(HORIZONS, mean_squares(np.concatenate(before)), strict=True)
    where["horizons"] = {f"{h:g} s": mean for h, mean in means if np.isfinite(mean)}
    return where


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
