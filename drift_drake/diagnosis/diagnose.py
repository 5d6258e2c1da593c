"""From runs of a car and the file of its simulator to where the gap is, which effect causes it, how far it shrinks."""

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from drift_drake.diagnosis.another_day import DayDiagnosis, diagnose_day
from drift_drake.diagnosis.answer import Answer
from drift_drake.diagnosis.beliefs import beliefs_as_data
from drift_drake.diagnosis.learned import learned
from drift_drake.diagnosis.nearest import nearest
from drift_drake.diagnosis.posterior import (
    UNKNOWN,
    Calibration,
    Posterior,
    hypothesis_name,
    implausibility,
    make_posterior,
    read_calibration,
)
from drift_drake.diagnosis.provenance import KEY, provenance
from drift_drake.diagnosis.search import Found, search
from drift_drake.diagnosis.where import locate
from drift_drake.errors import DriftDrakeError
from drift_drake.estimation.everyday import applied, traced
from drift_drake.estimation.fit import Fit
from drift_drake.estimation.freeform import Regression, misfit
from drift_drake.estimation.horizons import HORIZONS, start_rows
from drift_drake.estimation.interval import Interval
from drift_drake.estimation.noise import refined_levels
from drift_drake.estimation.prior import bounds
from drift_drake.estimation.problem import NUISANCES, TOLERANCES, Everyday, Problem, filter_case, make_problem
from drift_drake.estimation.reduction import Reduction, errors_of, mean_squares, reduction, without_effects
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
    calibration = calibration or read_calibration()
    tell = progress or (lambda _stage, _share: None)
    doubts = suspicions(runs, vehicle)
    runs, warnings = usable(runs, vehicle)
    warnings = [doubt.sentence for doubt in doubts] + warnings
    names, more = seen_effects(runs, catalogue)
    warnings += more
    problem = make_problem(runs, vehicle, process_scale, noise_scale, stated, own, row_weight)
    if everyday is not None:
        problem, more = applied(problem, everyday)
        warnings += more
    found = search(problem, names, workers, lambda stage, share: tell(stage, 0.8 * share))
    hypotheses = found.hypotheses()
    refined = refine_noise(problem, hypotheses[0][0])
    tell("what is left", 0.82)
    best = hypotheses[0][0]
    left = [misfit(refined, best, kind) for kind in ("pulses", "functions")]
    posterior = make_posterior(hypotheses, max(part.gain for part in left), len(names), calibration)
    tell("how far it shrinks", 0.87)
    shrinks = reduction(problem, posterior.fit if posterior.verdict == "effect" else _empty(problem), best)
    for _ in range(MOST_REFUSED):  # causes that remove nothing of what they were not fitted to are none
        if posterior.verdict != "effect" or shrinks.estimate > 0.0:
            break
        hypotheses = [(f, e) for f, e in hypotheses if f.names != posterior.fit.names]
        posterior = make_posterior(hypotheses, max(part.gain for part in left), len(names), calibration)
        shrinks = reduction(problem, posterior.fit if posterior.verdict == "effect" else _empty(problem), best)
    fit, named = posterior.fit, posterior.verdict == "effect"
    tell("where it is", 0.93)
    nothing = next(f for f, _ in hypotheses if not f.names)
    lacking = left[0] if not best.names else misfit(problem, nothing)
    before, floor = without_effects(problem, None), errors_of(problem, best.theta, best.names)
    where = find_gap(problem, before, floor, lacking)
    tell("what the learnt model says", 0.97)
    learnt = learned(problem, before, floor)
    fitted = {name: magnitude_interval(fit, name, calibration, vehicle) for name in fit.names}
    magnitudes = fitted if named else {}
    ends = at_ends(magnitudes, vehicle)
    warnings += [f"{name} is at the end of what is believed possible: doubt it" for name in ends]
    beside = {}
    if posterior.verdict == UNKNOWN:
        beside["nearest"] = nearest(problem, hypothesis_name(fit.names), fit, nothing, fitted).as_data()
    answer = Answer(
        case=case,
        verdict=posterior.verdict,
        causes=list(posterior.causes),
        posterior=posterior.probabilities,
        ambiguity=posterior.ambiguity,
        magnitudes=magnitudes,
        where=where,
        reduction=Interval(shrinks.estimate, shrinks.low, shrinks.high),
        seconds=time.perf_counter() - began,
        tolerances=dict(zip(NUISANCES[:TOLERANCES], (float(n) for n in fit.theta[:TOLERANCES]), strict=True)),
        details={
            "reduction_by_state": shrinks.by_state,
            "reduction_by_horizon": shrinks.by_horizon,
            "mean_square_innovation": best.mean_square,
            "unexplained_nats": max(part.gain for part in left),
            "implausible_nats": implausibility(best, calibration),
            "free_form_removes": left[1].removed,
            "vehicle_file_exact": fit.exactness < 1.0,
            "leading_known": hypothesis_name(fit.names),
            "row_weight": problem.row_weight,
            "at_least": ends,
            **beside,
            "learned": dataclasses.asdict(learnt),
            "suspicions": [dataclasses.asdict(doubt) for doubt in doubts],
            "beliefs": beliefs_as_data(problem, hypotheses, posterior.probabilities, names, calibration),
        },
        warnings=warnings,
    )
    tell("done", 1.0)
    return Diagnosis(answer, problem, found, posterior, fit, shrinks, left[0], lacking)


def _empty(problem: Problem) -> Fit:
    """A fit of nothing, whose effects remove nothing."""
    count = problem.nuisances
    return Fit((), np.zeros(count), 0.0, np.eye(count), 0.0, 0.0, 0)


def refine_noise(problem: Problem, fit: Fit) -> Problem:
    """The problem with noise levels that the best hypothesis' innovations agree with, within a few percent."""
    gains = filter_case(problem, fit.theta, fit.names)
    innovations = np.concatenate([e[run.counted] for run, e in zip(problem.runs, gains.innovations, strict=True)])
    whitening = np.concatenate([w[run.counted] for run, w in zip(problem.runs, gains.whitening, strict=True)])
    used = np.all([run.used for run in problem.runs], axis=0)
    return traced(problem.replace(noise=refined_levels(problem.noise, used, innovations, whitening)))


def magnitude_interval(fit: Fit, name: str, calibration: Calibration, vehicle: VehicleParameters) -> Interval:
    """95 % interval of a magnitude, within its bounds."""
    q, sigma = fit.magnitudes[name], fit.deviations[name] * calibration.interval_factor
    low, high = bounds(name, vehicle)
    return Interval(q, max(q - 1.96 * sigma, low), min(q + 1.96 * sigma, high))


def at_ends(magnitudes: dict[str, Interval], vehicle: VehicleParameters) -> list[str]:
    """Effects whose magnitudes are at the ends of what is believed possible."""
    out = []
    for name, m in magnitudes.items():
        low, high = bounds(name, vehicle)
        if m.estimate <= low or m.estimate >= high:
            out.append(name)
    return out


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
