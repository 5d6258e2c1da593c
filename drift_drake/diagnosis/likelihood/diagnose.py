"""From runs of a car and the file of its simulator to where the gap is, which effect causes it, how far it shrinks."""

import dataclasses
import time
from collections.abc import Mapping, Sequence

from drift_drake.diagnosis.answers.answer import Answer
from drift_drake.diagnosis.likelihood.judging import judge_hypotheses
from drift_drake.diagnosis.likelihood.learned import learned
from drift_drake.diagnosis.likelihood.search import search
from drift_drake.diagnosis.shared.posterior import PosteriorConstants, Ranked, read_constants
from drift_drake.diagnosis.shared.where import find_gap
from drift_drake.estimation.fit import Fit
from drift_drake.estimation.freeform import applied, misfit
from drift_drake.estimation.problem import Everyday, Problem, make_problem
from drift_drake.estimation.reduction import Reduction, errors_of, without_effects
from drift_drake.estimation.regression import Regression
from drift_drake.estimation.usable import MOST_SECONDS, part_of, seen_effects, usable
from drift_drake.logs.screening.suspicions import suspicions
from drift_drake.logs.table import Run
from drift_drake.standard_output import Progress
from drift_drake.threads import one_blas_thread
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters


@dataclasses.dataclass(frozen=True)
class Diagnosis:
    """The answer, and what a report is drawn from."""

    answer: Answer
    problem: Problem
    found: list[tuple[Fit, float]]  # hypotheses with their log evidence, best first
    posterior: Ranked[Fit]
    fit: Fit  # of the causes; of the leading hypothesis where the verdict is none or unknown
    reduction: Reduction
    unexplained: Regression  # pulses that the best hypothesis leaves
    lacking: Regression  # pulses that the car without effects lacks


@one_blas_thread()
def diagnose(
    runs: Sequence[Run],
    vehicle: VehicleParameters,
    case: str = "case",
    workers: int = 2,
    progress: Progress | None = None,
    calibration: PosteriorConstants | None = None,
    catalogue: Sequence[str] = tuple(CATALOGUE),
    process_scale: float = 1.0,
    noise_scale: float = 1.0,
    stated: Mapping[str, float] | None = None,
    own: Effects = Effects(),  # noqa: B008 (immutable)
    row_weight: float = 1.0,
    everyday: Everyday | None = None,
    most_seconds: float = MOST_SECONDS,
) -> Diagnosis:
    """Diagnoses the runs of one case.

    Args:
        runs: of the same car on the same day; vehicle: what its simulator believes; workers: threads;
        progress: called with a stage's name and the share done; calibration: constants of the posterior;
        catalogue: names of the effects to consider; process_scale, noise_scale, stated, row_weight: see `make_problem`;
        own: effects that the vehicle file has already; what is found adds to them;
        everyday: misfit that is no gap, with a row weight of its own (`freeform.applied`);
        most_seconds: of logs that are looked at; of longer ones pieces spread evenly over them (`part_of`).

    Raises:
        InvalidLogError: no run can be used.
    """
    began = time.perf_counter()
    tell = progress or (lambda _stage, _share: None)
    doubts = suspicions(runs, vehicle)
    runs, unusable = usable(runs, vehicle)
    runs, left_out = part_of(runs, most_seconds)
    names, unseen = seen_effects(runs, catalogue)
    problem = make_problem(runs, vehicle, process_scale, noise_scale, stated, own, row_weight)
    problem, misfits = (problem, []) if everyday is None else applied(problem, everyday)
    found = search(problem, names, workers, lambda stage, share: tell(stage, 0.8 * share))
    judged = judge_hypotheses(problem, found, len(names), calibration or read_constants(), tell)
    tell("where it is", 0.93)
    lacking = judged.left[0] if not judged.best.names else misfit(problem, judged.nothing)
    before, floor = without_effects(problem, None), errors_of(problem, judged.best.theta, judged.best.names)
    where = find_gap(problem, before, floor, lacking)
    tell("what the learnt model says", 0.97)
    details = judged.as_data(problem, names) | {
        "learned": dataclasses.asdict(learned(problem, before, floor)),
        "suspicions": [dataclasses.asdict(doubt) for doubt in doubts],
    }
    warnings = [*(doubt.sentence for doubt in doubts), *unusable, *left_out, *unseen, *misfits]
    warnings += judged.warnings(problem)
    answer = judged.answer(problem, case, where, details, warnings, time.perf_counter() - began)
    tell("done", 1.0)
    posterior = judged.posterior
    return Diagnosis(answer, problem, found, posterior, posterior.leading, judged.reduction, judged.left[0], lacking)
