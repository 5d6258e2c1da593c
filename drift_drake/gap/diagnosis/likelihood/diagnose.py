"""From runs of a car and the file of its simulator to where the gap is, which effect causes it, how far it shrinks."""

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.standard_output import Progress
from drift_drake.common.threads import one_blas_thread
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.likelihood.beliefs import beliefs_as_data
from drift_drake.gap.diagnosis.likelihood.isolability import isolability
from drift_drake.gap.diagnosis.likelihood.learned import learned
from drift_drake.gap.diagnosis.likelihood.search import search
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import Fit, no_effects, prior_precision
from drift_drake.gap.estimation.freeform import applied, misfit, responses, traced
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.prior import TWO_SIDED, Interval, bounds
from drift_drake.gap.estimation.problem import NUISANCES, TOLERANCES, ModelDiscrepancy, Problem, flat
from drift_drake.gap.estimation.reduction import (
    Reduction,
    errors_of,
    folds,
    held_out_thetas,
    reduction,
    with_folds,
    without_effects,
)
from drift_drake.gap.estimation.regression import (
    Equations,
    Regression,
    left_over,
    regress,
    solve_equations,
    summed_equations,
)
from drift_drake.gap.estimation.usable import MOST_SECONDS, admit, part_of, seen_effects
from drift_drake.gap.evidence.posterior import (
    UNKNOWN,
    PosteriorConstants,
    Ranked,
    hypothesis_name,
    implausibility,
    make_posterior,
    read_constants,
)
from drift_drake.gap.evidence.where import find_gap

MOST_REFUSED = 4  # causes that remove nothing
MOST_REFINED = 0.08  # share by which a noise level is corrected


@dataclasses.dataclass(frozen=True)
class Judged:
    """The hypotheses of a case, judged."""

    hypotheses: list[tuple[Fit, float]]  # with their evidence, the best first; without causes that remove nothing
    best: Fit
    posterior: Ranked[Fit]
    reduction: Reduction
    left: list[Regression]  # pulses and functions of state that the best hypothesis leaves
    calibration: PosteriorConstants

    @property
    def named(self) -> bool:
        """Whether the verdict names causes."""
        return self.posterior.verdict == "effect"

    @property
    def nothing(self) -> Fit:
        """The hypothesis without causes."""
        return next(fit for fit, _ in self.hypotheses if not fit.names)

    def intervals(self, vehicle: VehicleParameters) -> dict[str, Interval]:
        """Of the causes, or of the leading hypothesis's."""
        fit = self.posterior.leading
        return {name: magnitude_interval(fit, name, self.calibration, vehicle) for name in fit.names}

    def magnitudes(self, vehicle: VehicleParameters) -> dict[str, Interval]:
        """Of the causes that the verdict names."""
        return self.intervals(vehicle) if self.named else {}

    def warnings(self, problem: Problem) -> list[str]:
        """What to doubt of the magnitudes."""
        ends = at_ends(self.magnitudes(problem.vehicle), problem.vehicle)
        return [f"{name} is at the end of what is believed possible: doubt it" for name in ends]

    def as_data(self, problem: Problem, names: Sequence[str]) -> dict[str, Any]:
        """An answer's details; `names`: the effects that were considered."""
        fit, calibration = self.posterior.leading, self.calibration
        further: dict[str, Any] = {}
        if self.posterior.verdict == "none":
            further["detection"] = isolability(problem, self.nothing, names, small=True).limits(problem.vehicle)
        if self.posterior.verdict == UNKNOWN:
            causes = hypothesis_name(fit.names)
            fitted = self.intervals(problem.vehicle)
            further["nearest"] = nearest(problem, causes, fit, self.nothing, fitted)
        return {
            "reduction_by_state": self.reduction.by_state,
            "reduction_by_horizon": self.reduction.by_horizon,
            "mean_square_innovation": self.best.mean_square,
            "unexplained_nats": max(part.gain for part in self.left),
            "implausible_nats": implausibility(self.best, calibration),
            "free_form_removes": self.left[1].removed,
            "vehicle_file_exact": fit.exactness < 1.0,
            "leading_known": hypothesis_name(fit.names),
            "tempering": problem.tempering,
            "at_least": at_ends(self.magnitudes(problem.vehicle), problem.vehicle),
            **further,
            "beliefs": beliefs_as_data(problem, self.hypotheses, self.posterior.probabilities, names, calibration),
        }


def judge_hypotheses(
    problem: Problem, hypotheses: list[tuple[Fit, float]], count: int, calibration: PosteriorConstants,
    tell: Callable[[str, float], None],
) -> Judged:  # fmt: skip
    """Judges hypotheses, the best first, by their evidence, by what they leave, and on what they were not fitted to.

    Args:
        count: of the effects that were considered; tell: called with a stage's name and the share done.
    """
    best = hypotheses[0][0]
    refined = refine_noise(problem, best)
    tell("unknown forces", 0.82)
    left = [misfit(refined, best, kind) for kind in ("pulses", "functions")]
    gain = max(part.gain for part in left)
    posterior = make_posterior(hypotheses, gain, count, calibration)
    tell("reduction of the gap", 0.87)
    shrinks = _shrinks(problem, posterior, best)
    for _ in range(MOST_REFUSED):  # causes that remove nothing of what they were not fitted to are none
        if posterior.verdict != "effect" or shrinks.estimate > 0.0:
            break
        hypotheses = [(f, e) for f, e in hypotheses if f.names != posterior.leading.names]
        posterior = make_posterior(hypotheses, gain, count, calibration)
        shrinks = _shrinks(problem, posterior, best)
    return Judged(hypotheses, best, posterior, shrinks, left, calibration)


def _shrinks(problem: Problem, posterior: Ranked[Fit], best: Fit) -> Reduction:
    return reduction(problem, posterior.leading if posterior.verdict == "effect" else no_effects(problem), best)


def nearest(problem: Problem, name: str, fit: Fit, nothing: Fit, magnitudes: dict[str, Interval]) -> dict[str, Any]:
    """What an engineer is left with where no known cause explains the gap: the nearest one, and what free forces reach.

    For an answer's details; both are judged on blocks of the runs that they were not fitted to.

    `removes` is the hypothesis's share of the nominal car's squared innovations, `free_forces_remove` that of functions
    of the state relative to the car without effects.

    Args:
        name: of the hypothesis, "none" if no effect comes nearer than the car as it is; fit: of it; nothing: of the car
            without effects; magnitudes: of the hypothesis.
    """
    before = squares(problem, np.zeros(problem.nuisances), (), np.ones(problem.count, dtype=bool))
    known = sum(
        squares(problem, theta, fit.names, rows)
        for theta, rows in zip(held_out_thetas(problem, fit), folds(problem), strict=True)
    )
    return {
        "name": name,
        "magnitudes": {effect: dataclasses.asdict(m) for effect, m in magnitudes.items()},
        "removes": 1.0 - known / before,
        "free_forces_remove": 1.0 - free_squares(problem, nothing) / before,
    }


def squares(problem: Problem, theta: np.ndarray, names: tuple[str, ...], rows: np.ndarray) -> float:
    """Sum of the squared innovations of some measurements [count] under parameters."""
    e = flat(problem, filter_case(problem, theta, names).innovations)[rows]
    return float(e @ e)


def free_squares(problem: Problem, fit: Fit) -> float:
    """Squared innovations that functions of the state leave of a fit, each fold's under weights from the others."""
    prior, by_fold = prior_precision(problem, len(fit.theta)), list[Equations]()
    for run, measured in zip(problem.runs, responses(problem, fit, "functions"), strict=True):
        by_fold = with_folds(by_fold, run, measured, len(fit.theta))
    whole = summed_equations(by_fold)
    precision = 1.0 / regress(whole, fit.theta, prior).scales[whole.channel_of] ** 2
    left = 0.0
    for fold, held_out in enumerate(by_fold):
        others = summed_equations([part for i, part in enumerate(by_fold) if i != fold])
        found = solve_equations(others, others.gradient + prior * fit.theta, prior, precision)
        left += left_over(held_out, found.own, found.weights)
    return left


def refine_noise(problem: Problem, fit: Fit) -> Problem:
    """The problem with noise levels that the best hypothesis' innovations agree with, within a few percent."""
    gains = filter_case(problem, fit.theta, fit.names)
    innovations = np.concatenate([e[run.counted] for run, e in zip(problem.runs, gains.innovations, strict=True)])
    whitening = np.concatenate([w[run.counted] for run, w in zip(problem.runs, gains.whitening, strict=True)])
    used = np.all([run.used for run in problem.runs], axis=0)
    return traced(problem.replace(noise=refined_levels(problem.noise, used, innovations, whitening)))


def refined_levels(levels: np.ndarray, used: np.ndarray, innovations: np.ndarray, whitening: np.ndarray) -> np.ndarray:
    """Noise levels [9] corrected by a filter's innovations, by at most a share `MOST_REFINED`.

    The residual after the update and the one before it have the measurement noise's variance as covariance
    (Desroziers et al. 2005). Bounded, since a wrong model's innovations would make noise of the gap.

    Args:
        levels: standard deviations that the filter used [9]; used: channels that count [9].
        innovations: whitened [rows, 9]; whitening: the matrices that whitened them [rows, 9, 9].
    """
    before = np.linalg.solve(whitening, innovations[..., None])[..., 0]
    after = np.einsum("kji,kj->ki", whitening, innovations)  # of the noise's variance
    ratio = np.sqrt(np.clip(np.mean(before * after, axis=0), (1.0 - MOST_REFINED) ** 2, (1.0 + MOST_REFINED) ** 2))
    return np.where(used, levels * ratio, levels)


def magnitude_interval(fit: Fit, name: str, calibration: PosteriorConstants, vehicle: VehicleParameters) -> Interval:
    """95 % interval of a magnitude, within its bounds."""
    q, sigma = fit.magnitudes[name], fit.deviations[name] * calibration.interval_factor
    low, high = bounds(name, vehicle)
    return Interval(q, max(q - TWO_SIDED * sigma, low), min(q + TWO_SIDED * sigma, high))


def at_ends(magnitudes: dict[str, Interval], vehicle: VehicleParameters) -> list[str]:
    """Effects whose magnitudes are at the ends of what is believed possible."""
    out = []
    for name, m in magnitudes.items():
        low, high = bounds(name, vehicle)
        if m.estimate <= low or m.estimate >= high:
            out.append(name)
    return out


@dataclasses.dataclass(frozen=True)
class Diagnosis:
    """The answer, and what a report is drawn from."""

    answer: Answer
    problem: Problem
    found: list[tuple[Fit, float]]  # hypotheses with their log evidence, best first
    fit: Fit  # of the causes; of the leading hypothesis where the verdict is none or unknown
    reduction: Reduction
    runs: Sequence[Run] = dataclasses.field(default=(), repr=False)  # as they were given


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
    own: Effects = Effects(),
    tempering: float = 1.0,
    discrepancy: ModelDiscrepancy | None = None,
    most_seconds: float = MOST_SECONDS,
) -> Diagnosis:
    """Diagnoses the runs of one case.

    Args:
        runs: of the same car on the same day; vehicle: what its simulator believes; workers: threads;
        progress: called with a stage's name and the share done; calibration: constants of the posterior;
        catalogue: names of the effects to consider; process_scale, noise_scale, stated, tempering: see `make_problem`;
        own: effects that the vehicle file has already; what is found adds to them;
        discrepancy: model discrepancy, with a tempering exponent of its own (`freeform.applied`);
        most_seconds: of logs that are looked at; of longer ones pieces spread evenly over them (`part_of`).

    Raises:
        InvalidLogError: no run can be used.
    """
    began = time.perf_counter()
    tell = progress or (lambda _stage, _share: None)
    given = runs
    runs, doubts, doubted = admit(runs, vehicle)
    runs, left_out = part_of(runs, most_seconds)
    names, unseen = seen_effects(runs, catalogue)
    problem = make_problem(runs, vehicle, process_scale, noise_scale, stated, own, tempering)
    problem, misfits = (problem, []) if discrepancy is None else applied(problem, discrepancy)
    found = search(problem, names, workers, lambda stage, share: tell(stage, 0.8 * share))
    judged = judge_hypotheses(problem, found, len(names), calibration or read_constants(), tell)
    tell("location of the gap", 0.93)
    lacking = judged.left[0] if not judged.best.names else misfit(problem, judged.nothing)
    before, floor = without_effects(problem, None), errors_of(problem, judged.best.theta, judged.best.names)
    where = find_gap(problem, before, floor, lacking)
    tell("learnt model", 0.97)
    details = judged.as_data(problem, names) | {
        "learned": dataclasses.asdict(learned(problem, before, floor)),
        "suspicions": [dataclasses.asdict(doubt) for doubt in doubts],
    }
    warnings = [*doubted, *left_out, *unseen, *misfits]
    warnings += judged.warnings(problem)
    posterior, shrinks = judged.posterior, judged.reduction
    tolerances = posterior.leading.theta[:TOLERANCES].tolist()
    answer = Answer(
        case=case, verdict=posterior.verdict, causes=list(posterior.causes), posterior=posterior.probabilities,
        ambiguity=posterior.ambiguity, magnitudes=judged.magnitudes(vehicle), where=where,
        reduction=Interval(shrinks.estimate, shrinks.low, shrinks.high), seconds=time.perf_counter() - began,
        tolerances=dict(zip(NUISANCES[:TOLERANCES], tolerances, strict=True)), details=details, warnings=warnings,
    )  # fmt: skip
    tell("done", 1.0)
    return Diagnosis(answer, problem, found, posterior.leading, shrinks, given)
