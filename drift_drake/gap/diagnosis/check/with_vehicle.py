"""What logs are worth relative to a vehicle: what they would show, and whether a car can be calibrated on them.

What a calibration would leave open follows from the logs and the first guess alone: the car's errors are taken to first
order in all that is unknown of it, and the step that makes them least is taken. What it leaves shows the baseline
residuals, whether recordings agree, and which change a diagnosis could name.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE, shown_by
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import kind_of
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.given_vehicle import Vehicle, single_track_of, vehicle_given
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.common.errors import significant
from drift_drake.gap.diagnosis.calibrated.diagnose_change import search_of
from drift_drake.gap.diagnosis.calibrated.posterior import detection_limits
from drift_drake.gap.diagnosis.check.check import Checked
from drift_drake.gap.diagnosis.diagnose import GivenCalibration, trust_given
from drift_drake.gap.diagnosis.likelihood.isolability import isolability
from drift_drake.gap.estimation.baseline import left_of
from drift_drake.gap.estimation.effort import affordable
from drift_drake.gap.estimation.fit import no_effects
from drift_drake.gap.estimation.freeform import applied
from drift_drake.gap.estimation.learn_normal import learn_normal
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.robust_fit import robust_scales
from drift_drake.gap.estimation.scores import Day, between_recordings, huber_weights, make_day, units
from drift_drake.gap.estimation.unknowns import OWN
from drift_drake.gap.estimation.usable import admit, part_of, seen_effects
from drift_drake.gap.estimation.windows import stride_of, thinned, windowed
from drift_drake.gap.evidence.left_out import asked_in_turn
from drift_drake.gap.evidence.where import region_names, region_of
from drift_drake.gap.identification.by_prediction import EVIDENCE, LeftOpen, left_open, prior_of
from drift_drake.gap.identification.calibration import CarTrust
from drift_drake.gap.identification.driving import Driving, Missing, driving_of
from drift_drake.gap.identification.options import KNOWN
from drift_drake.gap.identification.outlook import TIMES, Outlook, never, outlook
from drift_drake.gap.identification.stated import EFFECT_OF, NEVER
from drift_drake.gap.logs.screening.screened import ScreenedLogs

WITHOUT_BETA = (
    "column beta is missing: a calibration goes by likelihood; whether recordings agree, and what a later log "
    "would show, can only be known with the sideslip logged"
)
MOST_WINDOWS = 600
ROUNDS = 3  # of a robust step's weights
Limits = dict[str, dict[str, Any]]  # by effect, as in an answer's `details.detection`
LEAST_COVERED = 0.5  # [s] in an operating region that counts as driven


def with_vehicle(
    checked: Checked, logs: ScreenedLogs, noise: Mapping[str, float], car: Vehicle,
    calibration: GivenCalibration | None, asked: bool, workers: int,
) -> Checked:  # fmt: skip
    """What can be said relative to a vehicle."""
    whole, own, tolerances, _ = vehicle_given(car)
    vehicle = whole.single_track()
    kept, doubts, warnings = admit(logs, whole)
    stated = {doubt.sentence for doubt in doubts if doubt.column is not None}  # by what is asked of the columns already
    warnings = [warning for warning in warnings if warning not in stated]
    names, grip = region_names(), vehicle.friction * vehicle.gravity
    seconds = np.zeros(len(names))
    for run in kept:
        beta = np.zeros(len(run)) if run.beta is None else run.beta
        np.add.at(seconds, region_of(run.v, run.r, beta, grip), run.period)
    regions = {name: float(s) for name, s in zip(names, seconds, strict=True) if s >= LEAST_COVERED}
    remarks = [*checked.remarks, *warnings]
    checked = dataclasses.replace(checked, remarks=list(dict.fromkeys(remarks)), regions=regions)
    if asked:
        return dataclasses.replace(checked, for_calibration=for_calibration(kept, whole, own, tolerances))
    unit = CarTrust(1.0, 1.0, 1.0, None)
    trust = unit if calibration is None else trust_given(calibration, tuple(CATALOGUE))
    detection: dict[str, dict[str, Any]] = {}
    if isinstance(whole, SimulatorCar) and trust.normal is None:  # without a calibration there is no limit
        more = [f"not judged, since the simulator cannot have it: {one}" for one in whole.simulator.left_out()]
    elif trust.normal is not None:
        detection, more = limits_by_prediction(kept, whole, trust.normal, own, checked.case, workers)
    else:
        detection, more = limits_by_filter(kept, single_track_of(whole), own, noise, trust.options())
    return dataclasses.replace(checked, remarks=list(dict.fromkeys([*remarks, *more])), detection=detection)


@dataclasses.dataclass(frozen=True)
class ForCalibration:
    """What is said of logs before a car is calibrated on them."""

    good_enough: bool
    refused: bool  # by `identify`, which is too little for any parameter
    driving: Driving
    missing: list[Missing]  # drives, the gravest first
    kept: list[str]  # parameters that would stay at their first guess
    disagreed: dict[str, str]  # parameters that recordings ask different values of, and which pulls each the most
    outlook: Outlook  # by effect the least magnitude of a change that would be seen, after `TIMES` as many recordings
    remarks: list[str]


def for_calibration(
    runs: Sequence[Run], vehicle: CarParameters, effects: Effects, stated: frozenset[str]
) -> ForCalibration:
    """Whether usable runs are good enough to calibrate a car on.

    Args:
        vehicle, effects: the first guess; stated: tolerances that its file states.
    """
    driving = driving_of(runs, vehicle.single_track())
    missing = driving.missing()
    disagreed, found, remarks = dict[str, str](), Outlook(), list[str]()
    if any(run.beta is None for run in runs):
        remarks = [WITHOUT_BETA]
    elif not driving.gentle:
        expected = forecast(runs, vehicle, effects, (*KNOWN, *driving.unseen), stated)
        disagreed = expected.left_open.disagreed
        found = expected.outlook | {
            EFFECT_OF[name]: NEVER for name in driving.unseen if EFFECT_OF[name] in expected.outlook
        }
        remarks = expected.left_open.sentences[driving.recordings == 1 :]  # that there is one is among what is missing
    return ForCalibration(
        not any(one.grave for one in missing), driving.gentle, driving, missing, list(driving.unseen), disagreed, found,
        remarks,
    )  # fmt: skip


def said(found: ForCalibration) -> list[str]:
    """What is said of it, a line each, to be wrapped where it begins with two spaces."""
    verdict = "good enough" if found.good_enough else "not good enough"
    refused = "; 'drift-drake identify' refuses them without --force" if found.refused else ""
    lines = [f"to calibrate a car on: {verdict}{refused}"]
    lines += [f"  - {one.sentence()}" for one in found.missing]
    if found.kept:
        lines.append(f"  - would stay at the first guess: {', '.join(found.kept)}")
    lines += [f"  - {remark}" for remark in found.remarks]
    named = {name: column for name, column in found.outlook.items() if name not in never(found.outlook)}
    if named:
        times = ", ".join(f"{n}" for n in TIMES)
        lines.append(f"a later log would show, from this magnitude on, after {times} times as many such recordings:")
        lines += [f"  {name} {limits(column)}{CATALOGUE[name].suffix}" for name, column in named.items()]
    unseen = never(found.outlook)
    if unseen:
        lines.append(f"no number of such recordings would show: {', '.join(unseen)}")
        lines += [f"  to see {', '.join(names)}: {words}" for words, names in shown_by(unseen)]
    return lines


def limits(column: Sequence[float | None]) -> str:
    """Magnitudes after more and more recordings."""
    return ", ".join("never" if q is None else significant(q, 2) for q in column)


class Forecast(NamedTuple):
    """Of a calibration by prediction."""

    left_open: LeftOpen
    outlook: Outlook


def forecast(
    runs: Sequence[Run], car: CarParameters, effects: Effects, known: Sequence[str], stated: frozenset[str]
) -> Forecast:
    """What a calibration by prediction on usable runs would leave open.

    Args:
        car, effects: the first guess; known: parameters that stay as they are; stated: tolerances that the vehicle
            file states.
    """
    vehicle, lacks = car.single_track(), kind_of(car.constants()).lacks
    seen, _ = seen_effects(runs, tuple(name for name in CATALOGUE if name not in lacks))
    windows = [windowed(run, run.filled, stride_of(vehicle)) for run in runs]
    steps = units(seen, vehicle)
    prior = np.array([prior_of(name, vehicle, stated | frozenset(known)) for name in seen]) / steps
    most = affordable(car.constants(), windows, MOST_WINDOWS)
    day = make_day(thinned(windows, most), car.constants(), effects, seen, steps)
    day = linearly_calibrated(day, prior)
    between = between_recordings(seen, vehicle) / steps
    own = [name for name in OWN if name in seen and CATALOGUE[name].tolerance not in known]
    left = left_of(prior, np.isin(seen, own))
    learnt = learn_normal(day, tuple(seen), steps, prior, between, left)
    return Forecast(
        left_open(day, learnt, own, asked_in_turn(learnt, vehicle)), outlook(day, learnt.normal, left, vehicle)
    )


def linearly_calibrated(day: Day, prior: np.ndarray) -> Day:
    """The day under the car that the errors ask for, to first order.

    Args:
        day: under the first guess; prior: standard deviations [n] of the effects, in their units.
    """
    e = day.errors
    for _ in range(ROUNDS):
        scales = robust_scales(e)
        weights = np.broadcast_to(huber_weights(e, scales), e.shape).reshape(len(e), -1)
        # Derivatives are in scales of the first guess.
        jacobian = day.jacobian[..., : len(prior)] * (robust_scales(day.errors) / scales).reshape(-1)[:, None]
        flat = (day.errors / scales).reshape(len(e), -1)
        information = np.einsum("wip,wi,wiq->pq", jacobian, weights, jacobian, optimize=True)
        gradient = np.einsum("wip,wi,wi->p", jacobian, weights, flat, optimize=True)
        step = -np.linalg.solve(np.diag(1.0 / prior**2) + EVIDENCE * information, EVIDENCE * gradient)
        e = ((flat + jacobian @ step) * scales.reshape(-1)).reshape(e.shape)
    ratio = (robust_scales(day.errors) / robust_scales(e)).reshape(-1)
    return dataclasses.replace(day, errors=e, jacobian=day.jacobian * ratio[:, None])


def limits_by_prediction(
    runs: Sequence[Run], vehicle: CarParameters, normal: Normal, own: Effects, case: str, workers: int
) -> tuple[Limits, list[str]]:
    """Of a car that was calibrated by prediction, relative to its baseline; and sentences on what is missing.

    Raises:
        InvalidLogError: a column is missing, or there is too little driving.
    """
    names, warnings = seen_effects(runs, normal.names)
    search = search_of(runs, vehicle, normal, own, names, case, workers)
    search.singles(lambda _share: None)
    limits = detection_limits(search, search.curves)
    return {name: dataclasses.asdict(limit) for name, limit in limits.items()}, warnings


def limits_by_filter(
    runs: Sequence[Run], vehicle: VehicleParameters, own: Effects, stated: Mapping[str, float],
    trust: Mapping[str, Any],
) -> tuple[Limits, list[str]]:  # fmt: skip
    """Relative to the vehicle file as it is, from the filter's innovations (`Isolability.limits`); of long logs a part.

    Args:
        stated: noise by column that an import stated; trust: options of `diagnose` from a calibration by likelihood.
    """
    runs, left_out = part_of(runs)
    names, warnings = seen_effects(runs, tuple(CATALOGUE))
    warnings += left_out
    options = {key: value for key, value in trust.items() if key != "discrepancy"}
    problem = make_problem(runs, vehicle, stated=stated, own=own, **options)
    if trust.get("discrepancy") is not None:
        problem, more = applied(problem, trust["discrepancy"])
        warnings += more
    return isolability(problem, no_effects(problem), names, small=True).limits(vehicle), warnings
