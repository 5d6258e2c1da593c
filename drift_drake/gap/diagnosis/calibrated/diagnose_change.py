"""The change of a car from its baseline, calibrated by prediction: what has changed beyond that baseline's scatter.

The car need not follow the equations: `estimation.scores` knows from the day of calibration how its errors scatter in
each direction, and what that day's drives left unknown.
"""

import dataclasses
import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import kind_of
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import CarParameters, InvalidVehicleError
from drift_drake.common.standard_output import Progress
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.calibrated.changed_car import judged, left_in, reduction, stated, where
from drift_drake.gap.diagnosis.calibrated.gross_gap import judged_by_errors
from drift_drake.gap.diagnosis.calibrated.one_stretch import (
    USUAL,
    named_alone,
    odd_blocks,
    stretch_sentence,
    stretches_in_words,
    usual_blocks,
    without,
)
from drift_drake.gap.diagnosis.calibrated.posterior import (
    at_bound,
    change_beliefs,
    detection_limits,
    interval,
    not_excluded,
    tells_from_zero,
    unless_hidden,
)
from drift_drake.gap.estimation.effort import affordable, counted, remarks
from drift_drake.gap.estimation.noise_levels import changed
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prior import Interval
from drift_drake.gap.estimation.reduction import FOLDS, STATES, Reduction
from drift_drake.gap.estimation.scores import Day, make_day
from drift_drake.gap.estimation.unknowns import magnitudes
from drift_drake.gap.estimation.usable import admit, seen_effects
from drift_drake.gap.estimation.windows import count_of, rows_between_starts, thinned, windowed
from drift_drake.gap.evidence.alarms import FALSE_ALARMS, false_alarm_rate
from drift_drake.gap.evidence.constants import PRIORS, WORTH_A_PAIR
from drift_drake.gap.evidence.hypotheses import Hypothesis, as_change
from drift_drake.gap.evidence.posterior import NONE, UNKNOWN, PosteriorConstants, hypothesis_name
from drift_drake.gap.evidence.ranking import DayRanked, halfway, ranked
from drift_drake.gap.evidence.search import Search

LEAST_FAMILIAR = 0.2  # share of familiar driving below which the verdict is more and more `unknown`
GROSS = 5.0  # times its scale on the day of calibration that a channel's median error may be, whatever is added
MEDIAN_OF_NORMAL = 0.6745  # of the absolute value, in standard deviations
CERTAIN = 0.98  # probability of `unknown` then, and beyond the next
FARTHEST = 3.0  # times the usual squared distance of scores from normal, beyond which `none` is no answer (validation)
MOST_WINDOWS = 600  # of a day, evenly chosen
LEAST_IN_A_FOLD = 2  # blocks, below which a day is short: 16 s of windows
LEAST_TIME = 5.0  # [s] of windows in all, below which scores are too few to be judged
FAR = "errors far beyond the baseline's"  # the stage in which they are judged
FAR_BEYOND = (
    "errors are far beyond normal: causes are judged by the errors that they remove at the shortest horizon, and "
    "may be what the calibration could not see instead of a change since"
)
NEAR, NEAR_SHARE = 60.0, 0.3  # [nats] behind the best single, and share of what it explains, from where none is judged
SINGLES, PAIRS = 10, 3  # leading ones that are judged at the changed car


@dataclasses.dataclass(frozen=True)
class ChangeDiagnosis:
    """The answer, and what a report is drawn from."""

    answer: Answer
    search: Search
    ranked: DayRanked
    reduction: Reduction
    runs: Sequence[Run] = dataclasses.field(default=(), repr=False)  # as they were given


def diagnose_change(
    runs: Sequence[Run], vehicle: CarParameters, normal: Normal,
    own: Effects = Effects(),
    case: str = "case", workers: int = 2, progress: Progress | None = None, constants: PosteriorConstants = PRIORS,
    catalogue: Sequence[str] = tuple(CATALOGUE), false_alarms: float = FALSE_ALARMS,
) -> ChangeDiagnosis:  # fmt: skip
    """Diagnoses the runs of one day.

    Args:
        runs: of the same car on the same day; vehicle, own: the calibrated car; normal: its baseline's residuals
            (`drift-drake identify --json`); workers: threads; progress: called with a stage's name and the share done;
        constants: of the posterior; catalogue: effects to consider; false_alarms: rate at which a day without an
            effect may be said to have a gap.

    Raises:
        InvalidLogError: no run can be used, a column is missing, or there is too little driving.
    """
    began = time.perf_counter()
    tell = progress or (lambda _stage, _share: None)
    used, doubts, warnings = admit(runs, vehicle)
    names, more = seen_effects(used, [name for name in normal.names if name in catalogue])
    tell("errors and their derivatives", 0.0)
    search = search_of(used, vehicle, normal, own, names, case, workers)
    noise = changed(normal.noise, search.day.runs)
    rate = false_alarm_rate(normal.left_out_none, false_alarms)
    how = constants, rate["judged_at"], noise.log_evidence
    with counted(tell, vehicle.constants()) as shown:
        none, others = hypotheses_of(search, shown)
    tell("reduction of the gap", 0.8)
    found, shrinks = ranked_hypotheses(search, none, others, *how)
    if found.verdict == UNKNOWN and not doubts and gross(search, none) > GROSS:
        found, shrinks = judged_by_errors(search, constants, lambda share: tell(FAR, 0.8 + 0.1 * share))
        warnings.append(FAR_BEYOND)
    (none, others, found, shrinks), whole, said = judged_rest(search, Decided(none, others, found, shrinks), how, tell)
    tell("detection limits", 0.9)
    limits = detection_limits(search, search.complete() if found.verdict == NONE else search.curves)
    found, shrinks = unless_hidden(found, shrinks, limits, none)
    h, named = found.leading, found.verdict == "effect"
    left = left_over_of(search, found, whole, none)
    warnings += [*said, *(unseen_sentence(name, q) for name, q in h.additional.items() if named)]
    warnings += [left_over_sentence(left)] if left else []
    warnings += [*noise.sentences(), *remarks(search.day.constants, len(search.day.errors), search.windows)]
    causes = {name: interval(h, i) for i, name in enumerate(h.names)}
    answer = Answer(
        case=case, verdict=found.verdict, causes=list(h.names) if named else [], posterior=found.probabilities,
        ambiguity=found.ambiguity, magnitudes=causes if named else {}, where=where(search, h, found.verdict == UNKNOWN),
        reduction=Interval(shrinks.estimate, shrinks.low, shrinks.high) if named else Interval(0.0, 0.0, 0.0),
        seconds=time.perf_counter() - began, tolerances={},
        details=details_of(search, found, shrinks, none, causes) | {
            "decision": found.decision,
            "false_alarm_rate": rate,
            "left_over": left,
            "suspicions": [dataclasses.asdict(doubt) for doubt in doubts],
            "detection": {name: dataclasses.asdict(limit) for name, limit in limits.items()},
            "beliefs": change_beliefs(search, found, [none, *others, h], limits, constants),
        },
        warnings=[*warnings, *more],
    )  # fmt: skip
    tell("done", 1.0)
    return ChangeDiagnosis(answer, search, found, shrinks, runs)


def left_over_of(search: Search, found: DayRanked, shrinks: Reduction, none: Hypothesis) -> dict[str, Any]:
    """What a named cause, or `unknown`, leaves over: share of the gap, signals, driving; empty where nothing is."""
    h = found.leading
    if not found.something_else and found.verdict != UNKNOWN:
        return {}
    signals, driving = left_in(search, h)
    rest = h.left_over or none.left_over
    return {
        "probability": found.something_else if found.verdict != UNKNOWN else found.probabilities[UNKNOWN],
        "share": 1.0 - max(shrinks.estimate, 0.0),
        "signals": signals,
        "driving": driving,
        "like": str(rest.like) if rest is not None else "",
    }


def left_over_sentence(left: Mapping[str, Any]) -> str:
    """Where something is left that no catalogued effect explains, in words."""
    most = sorted(left["signals"], key=lambda name: -left["signals"][name])[:2]
    signals = " and ".join(f"{name} ({100 * left['signals'][name]:.0f} %)" for name in most)
    driving = f", most of it at {left['driving'][0]}" if left["driving"] else ""
    like = f"; it acts like {left['like']}" if left["like"] else ""
    share = f"{100 * left['share']:.0f} % of the gap"
    return f"{share} is left that no catalogued effect explains, in {signals}{driving}{like}"


class Decided(NamedTuple):
    """Hypotheses of a search, and what was decided."""

    none: Hypothesis
    others: list[Hypothesis]
    found: DayRanked
    shrinks: Reduction


def judged_rest(
    search: Search, judged_all: Decided, how: tuple[PosteriorConstants, float, float | None], tell: Progress
) -> tuple[Decided, Reduction, list[str]]:
    """What a log holds without the few seconds that hold most of a gap, if a cause explains that.

    Args:
        judged_all: with those seconds; how: options of `ranked_hypotheses`.

    Returns:
        The hypotheses and what they decide; the share of the whole gap that this removes; warnings.
    """
    found = judged_all.found
    if found.verdict != UNKNOWN and not found.something_else:
        return judged_all, judged_all.shrinks, []
    usual = usual_blocks(search)
    odd = usual if np.any(usual) else odd_blocks(search, found.leading)
    if not np.any(odd):
        return judged_all, judged_all.shrinks, []
    rest = without(search, odd)
    none, others = hypotheses_of(rest, lambda _stage, share: tell("without a few seconds", share))
    again, removed = ranked_hypotheses(rest, none, others, *how)
    where_odd, as_usual = stretches_in_words(search, odd), bool(np.any(usual))
    stands = named_alone(again) or (as_usual and found.verdict == UNKNOWN and again.verdict == NONE)
    said = [USUAL.format(where_odd) if as_usual and stands else stretch_sentence(where_odd, again)]
    if not stands:
        return judged_all, judged_all.shrinks, said
    if not as_usual:
        besides = max(found.something_else, found.probabilities[UNKNOWN])
        again = dataclasses.replace(again, something_else=besides)
    return Decided(none, others, again, removed), reduction(search, again.leading, again.leading), said


def hypotheses_of(search: Search, tell: Progress) -> tuple[Hypothesis, list[Hypothesis]]:
    """The car as it was calibrated; leading changes, judged at the changed car, and singles that are not excluded."""
    none = search.none()
    singles = search.singles(lambda share: tell("single effects", 0.1 + 0.3 * share))
    unshown = not_excluded(search, singles)
    least = min(h.nats for h in (none, *singles))
    near = least + max(NEAR, NEAR_SHARE * (none.nats - least))
    closest = search.closest() if none.nats > 0.5 * WORTH_A_PAIR * none.scores else []
    found = judged(search, candidates([h for h in singles if h.nats <= near], closest))
    leading = list({h.names: h for h in reversed(found)}.values())[::-1]  # each effect from its best start
    tell("single effects", 0.5)
    if min(h.nats for h in (none, *leading)) <= 0.5 * WORTH_A_PAIR * none.scores:
        return none, [*leading, *unshown]
    first = [h.names for h in leading]
    singles = [*leading, *(h for h in singles if h.names not in first)]
    pairs = search.pairs(singles, lambda share: tell("pairs of effects", 0.5 + 0.2 * share))
    pairs = judged(search, [as_change(h) for h in pairs if tells_from_zero(h)][:PAIRS])
    return none, [*leading, *(h for h in pairs if tells_from_zero(h)), *unshown]


def candidates(likely: Sequence[Hypothesis], closest: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Singles to judge at the changed car: likely ones and those that leave the least errors, if they are not zero."""
    out = [h for h in likely if tells_from_zero(h)][:SINGLES]
    more = [h for h in closest if not any(h.names == o.names and h.magnitudes == o.magnitudes for o in out)]
    return [*out, *(h for h in more if tells_from_zero(h))]


def details_of(
    search: Search, found: DayRanked, shrinks: Reduction, none: Hypothesis, causes: dict[str, Interval]
) -> dict[str, Any]:
    """An answer's details; `none`: the car as it was calibrated, `causes`: of the leading hypothesis."""
    h, named, day = found.leading, found.verdict == "effect", search.day
    nearest = {
        "hypothesis": hypothesis_name(h.names),
        "magnitudes": {name: dataclasses.asdict(m) for name, m in causes.items()},
        "removes": shrinks.estimate,
        "free_forces_remove": None,
    }
    medians = np.median(np.abs(day.errors), axis=0)[:, : len(STATES)]  # at each horizon, in the states' units
    return {
        "criterion": "prediction",
        "familiar": float(np.mean(day.weights)),
        "reduction_by_state": shrinks.by_state if named else {},
        "reduction_by_horizon": shrinks.by_horizon if named else {},
        "nats_from_normal": {"none": none.nats, hypothesis_name(h.names): h.nats},
        "leading_known": hypothesis_name(h.names),
        "at_least": at_bound(h, search.ranges) if named else [],
        "with": brought_along(h, day) if named else {},
        "errors": dict(zip(day.ahead, medians.tolist(), strict=True)),
        "nearest": nearest if found.verdict == UNKNOWN else {},
    }


def search_of(
    runs: Sequence[Run], vehicle: CarParameters, normal: Normal, own: Effects, names: Sequence[str], case: str,
    workers: int,
) -> Search:  # fmt: skip
    """The search for causes in usable runs of one day, among the effects of these names.

    Raises:
        InvalidLogError: a column is missing, or there is too little driving;
        InvalidVehicleError: the car is of another kind than the one that was calibrated.
    """
    if tuple(kind_of(vehicle.constants()).deviations) != normal.of_kind:
        raise InvalidVehicleError(
            f"{case}: the calibration is of another kind of car (single-track, double-track, brush, a simulator) than "
            "the vehicle file; give the file that 'drift-drake identify' wrote with it (--out)"
        )
    if any(run.beta is None for run in runs):
        raise InvalidLogError(
            f"{case}: column beta is missing; a car that was calibrated by prediction is diagnosed from logs with it"
        )
    windows = [windowed(run, run.filled, normal.stride) for run in runs]
    covered = sum(len(run.starts) * rows_between_starts(normal.stride, run.period) * run.period for run in windows)
    if covered < LEAST_TIME:
        raise InvalidLogError(
            f"{case}: {covered:.1f} s of driving can be used, {LEAST_TIME:g} s are the least; log longer drives"
        )
    asked = thinned(windows, affordable(vehicle.constants(), windows, MOST_WINDOWS))
    day = make_day(asked, vehicle.constants(), own, normal.names, normal.units, normal, workers)
    search = Search(day, normal, vehicle.single_track(), names, workers)
    search.windows = count_of(thinned(windows, MOST_WINDOWS))
    return search


def ranked_hypotheses(
    search: Search, none: Hypothesis, others: Sequence[Hypothesis], constants: PosteriorConstants,
    false_alarms: float = FALSE_ALARMS, noise: float | None = None,
) -> tuple[DayRanked, Reduction]:  # fmt: skip
    """Probabilities, led by a cause that differs from zero and removes errors on held-out blocks (or `halfway`)."""
    kept, every = [none, *others], None
    # Nothing can be judged where too little of the driving is known from the calibration.
    doubt = max(1.0 - float(np.mean(search.day.weights)) / LEAST_FAMILIAR, 0.0)
    counts = len(search.ranges), constants, doubt, false_alarms
    while True:
        found = ranked(kept, *counts, noise, search.normal.factors)
        leading = stated(search, found.leading)
        shrinks = reduction(search, leading, leading)
        if not leading.names or (tells_from_zero(found.leading) and shrinks.estimate > 0.0):
            break
        every = every or found
        kept = [h for h in kept if h is not found.leading]
    if every is not None and found.verdict == "effect" and search.day.blocks < LEAST_IN_A_FOLD * FOLDS:
        found = halfway(found, every)
    if gross(search, leading) > GROSS or (found.verdict == NONE and none.nats > FARTHEST * 0.5 * none.scores):
        found = ranked(kept, *counts[:2], max(doubt, CERTAIN), false_alarms, noise, search.normal.factors)
    return dataclasses.replace(found, leading=leading), shrinks


def unseen_sentence(name: str, q: float) -> str:
    """That the day asks for more of the car's build than its calibration knows."""
    return (
        f"these logs also ask for {name} of {q:.2g}{CATALOGUE[name].suffix}, which belongs to the car's build: the "
        "baseline did not show it; calibrate on such drives too"
    )


def brought_along(h: Hypothesis, day: Day) -> dict[str, float]:
    """What a hypothesis adds to the car in addition to its causes' magnitudes: stiffnesses that follow the loads."""
    own = magnitudes(h.names, h.magnitudes)
    return {name: value - own.get(name, 0.0) for name, value in h.effects(day).items() if value != own.get(name)}


def gross(search: Search, h: Hypothesis) -> float:
    """The largest median error of a channel at the longest horizon under a hypothesis, in deviations that are normal.

    Clipped scores cannot tell how far off a car is that is wrong throughout: a column in another unit, say. Normal is
    the scale on the day of calibration with what another recording differs by.
    """
    day, normal = search.day, search.normal
    of_effects = day.jacobian.reshape(*day.errors.shape, -1)[:, -1, :, : len(normal.names)]
    apart = np.sqrt(np.diag(normal.recording)) * of_effects
    e = day.errors_with(h.effects(day))[:, -1] / normal.scales[-1]
    deviations = np.abs(e) / np.sqrt(1.0 + np.sum(apart**2, axis=-1))
    return float(np.max(np.median(deviations, axis=0)) / MEDIAN_OF_NORMAL)
