"""From logs of a car and a first guess of it to the calibrated car, with intervals and what the logs cannot tell.

Two criteria: the filter's likelihood, exact where its innovations are white, and robust prediction errors where they
are not (`by_prediction`). The logs choose.
"""

import dataclasses
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from drift_drake.car.double_track.nearest import nearest_double_track
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.catalogue import CATALOGUE, fitted
from drift_drake.car.equations import kind_of
from drift_drake.car.foreign.led_in import led_in
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.given_vehicle import Vehicle, label_of, vehicle_given
from drift_drake.car.log.cases import GivenLogs, Logs, logs_given
from drift_drake.car.log.table import InvalidLogError, Run, read_case, stated_noise
from drift_drake.car.parameters import CarParameters, InvalidVehicleError, VehicleParameters
from drift_drake.common.standard_output import Progress
from drift_drake.gap.estimation.effort import counted
from drift_drake.gap.estimation.unknowns import OWN
from drift_drake.gap.estimation.usable import admit, part_of, seen_effects
from drift_drake.gap.estimation.windows import stride_of, windowed
from drift_drake.gap.identification.by_likelihood import NO_PEAK, identify_by_likelihood, stretched
from drift_drake.gap.identification.by_prediction import PredictionFit, fit_by_prediction, held_out_windows
from drift_drake.gap.identification.calibration import Calibration, Identification
from drift_drake.gap.identification.driving import CIRCLES, ONE_RECORDING, SLIPPERY, STEPS, driving_of
from drift_drake.gap.identification.estimate import check_effect_names, whiteness
from drift_drake.gap.identification.options import EFFECTS, KNOWN, AskedKind, Criterion
from drift_drake.gap.identification.stated import Asked, held_still, kept_at_first_guess, stated_in_full
from drift_drake.gap.identification.validation import split
from drift_drake.gap.monitoring.baselines import learn_baseline

WHITE = 0.1  # tempering exponent of that fit, from which they are
# That a car may have in addition to those asked for, taken in where held-out prediction asks.
FURTHER = fitted("further")


def identify(
    logs: Logs | Sequence[str | Path], vehicle: Vehicle, *, known: Sequence[str] = KNOWN,
    effects: Sequence[str] = EFFECTS, criterion: Criterion = "auto", stated: Mapping[str, float] | None = None,
    case: str | None = None, car: AskedKind = "auto", force: bool = False, watching: bool = True,
    validation: Sequence[str] = (), progress: Progress | None = None,
) -> Identification:  # fmt: skip
    """Calibrates a car on logs: parameters, tolerances, lags, and what the logs cannot identify.

    Examples:
        >>> found = identify(["logs/monday", "logs/tuesday"], "start.yaml")  # doctest: +SKIP
        >>> write_vehicle("car.yaml", found.vehicle, found.effects)  # doctest: +SKIP

    Args:
        logs: path of a case folder, paths of several (one for each day), or runs of one car;
        vehicle: vehicle file's path, parameters, or (parameters, effects): the first guess; tolerances that a file
            states are believed, times two;
        known: parameters whose tolerance is believed as it is; effects: names of effects that may belong to the car;
        criterion: "likelihood" (exact where innovations are white), "prediction" (errors half a second ahead), or
            "auto", which lets the logs choose;
        stated: noise levels [SI, one standard deviation] by column that are known otherwise; case: name of it all;
        car: kind of car where prediction judges: "single-track", "double-track", or "auto", which takes a double-track
            one where that predicts held-out parts better, and keeps the single-track one with it (`single_track`);
        force: also on logs that are too gentle, and whatever a known parameter comes out as;
        watching: whether to learn a monitor's baseline (`watch`), where the logs can say;
        validation: runs (NAME, of several days DAY/NAME) or stretches of them (NAME:START-END [s] of column t) that
            nothing is fitted to, and that the car is judged by; without any, blocks of 1.5 s are held out for that;
        progress: called with a stage and the share done.

    Returns:
        The calibrated vehicle, its effects and the calibration with 95 % intervals (`calibration.parameters`).

    Raises:
        InvalidLogError: no run can be used, they are too gentle, a known parameter comes out far from what is known of
            it, prediction is asked for without the column beta, or a stretch for validation is of no run or too short;
        InvalidVehicleError: of the vehicle, or a name that is none;
        SimulatorError: a simulator of the user's fails.
    """
    first, days = vehicle_given(vehicle), days_given(logs, case)
    found = calibrate(days.runs, Asked(
        first.parameters, first.effects, days.case, tuple(known), tuple(effects), {**days.noise, **(stated or {})},
        criterion, first.tolerances, car, force, validation=tuple(validation),
    ), progress)  # fmt: skip
    if not watching:
        return found
    baseline = learn_baseline(split(days.runs, validation)[0], found.vehicle, found.effects, found.calibration.normal)
    return dataclasses.replace(found, calibration=dataclasses.replace(found.calibration, watching=baseline))


def calibrate(runs: Sequence[Run], asked: Asked, progress: Progress | None = None) -> Identification:
    """Calibrates a car on runs of one or several days; raises as `identify`.

    Parameters that the drives cannot show stay at their first guess.
    """
    began = time.perf_counter()
    tell = progress or (lambda _stage, _share: None)
    case, known, given = asked.case, asked.known, runs
    check_effect_names(known, asked.names)
    vehicle, first = asked.vehicle, first_of_kind(asked.first, asked.kind)
    runs, kept = split(runs, asked.validation)
    runs, _, warnings = admit(runs, first)
    asked = dataclasses.replace(asked, judged=for_validation(kept, first))
    warnings += [
        f"effect {name}: calibrated anyway, as a parameter of the vehicle file" for name in asked.names if name in OWN
    ]
    driving = driving_of(runs, vehicle)
    if driving.gentle and not asked.force:
        raise InvalidLogError(driving.too_gentle(case))
    if isinstance(first, SimulatorCar):
        first, said = led_in(first)
        warnings += said
    found_unseen = tuple(name for name in driving.unseen if driving.gentle or name not in known)
    names, by_drives = tuple(name for name in asked.names if name not in OWN), asked.unseen is None
    asked = dataclasses.replace(asked, first=first, names=names, unseen=found_unseen if by_drives else asked.unseen)
    found = calibrated(runs, asked, tell)
    shows = driving.shows_friction_of(vehicle.friction, found.vehicle.single_track().friction)
    if by_drives and not shows and "friction" not in (*asked.kept, *known):
        asked = dataclasses.replace(asked, unseen=("friction", *asked.kept))
        found = calibrated(runs, asked, tell)
    if not asked.force:
        check_known(found.calibration)
    c = found.calibration
    lacking = [one.sentence() for one in driving.missing() if one.grave and one.why != ONE_RECORDING]
    warnings = [*warnings, *c.warnings, *lacking, *kept_sentences(asked)]
    c = dataclasses.replace(c, seconds=time.perf_counter() - began, driving=driving, warnings=warnings,
                            validation=asked.validation)  # fmt: skip
    tell("done", 1.0)
    return dataclasses.replace(found, calibration=c, first=(first, asked.effects), runs=given)


def for_validation(runs: Sequence[Run], first: CarParameters) -> tuple[Run, ...]:
    """Parts that can be used of runs that are kept for validation; raises InvalidLogError where they are too few."""
    try:
        return tuple(admit(runs, first).runs) if runs else ()
    except InvalidLogError as error:
        raise InvalidLogError(f"validation: {error}") from None


def first_of_kind(first: CarParameters, kind: AskedKind) -> CarParameters:
    """The first guess; of another car than a simulator the nearest single-track one, where that is asked for."""
    return first.single_track() if kind == "single-track" and not isinstance(first, SimulatorCar) else first


def calibrated(runs: Sequence[Run], asked: Asked, tell: Progress) -> Identification:
    """The car by the criterion that is asked for, or that its logs choose; runs: parts that can be used."""
    lacks_beta = any(run.beta is None for run in (*runs, *asked.judged))
    criterion, warnings = asked.criterion, list[str]()
    double = asked.kind == "double-track" or not isinstance(asked.first, VehicleParameters)
    another = not isinstance(asked.first, VehicleParameters | DoubleTrackParameters)
    label = label_of(asked.first) if another else "double-track car"
    if another and asked.kind == "double-track":
        raise InvalidLogError(f"{asked.case}: the car is a {label}; leave out --car")
    if double and criterion == "likelihood":
        raise InvalidLogError(
            f"{asked.case}: a {label} is calibrated by prediction; choose --criterion prediction"
            f"{'' if isinstance(asked.first, SimulatorCar) else ', or --car single-track'}"
        )
    criterion = "prediction" if double else criterion
    if criterion == "prediction" and lacks_beta:
        raise InvalidLogError(
            f"{asked.case}: column beta is missing; prediction needs it, choose --criterion likelihood"
        )
    if criterion == "auto" and lacks_beta:
        criterion, warnings = "likelihood", ["column beta is missing: calibrated by likelihood"]
    found = single = None
    part, left_out = part_of(runs)  # the filter's derivatives are kept for every row
    if criterion != "likelihood":
        predicted = by_prediction(runs, asked, double, lambda stage, share: tell(stage, 0.5 * share))
        why = []
        if criterion == "auto":
            white = whiteness(part, predicted.vehicle.single_track(), predicted.effects, asked.stated)
            why = [white.sentence()]
            found = white_or_none(part, asked, tell) if white.may_be_white else None
        if found is None:
            better, rows = predicted, sum(len(run) for run in runs)
            if asked.kind == "auto" and not double and may_have_two_tracks(runs, asked.vehicle):
                better, sentence = of_better_kind(runs, asked, predicted, tell)
                why.append(sentence)
            found = stated_in_full(better, why, asked, rows)
            single = stated_in_full(predicted, why, asked, rows) if better is not predicted else None
    if found is None:
        found = by_likelihood(part, asked, tell)
    found = with_unseen(found, asked, single)
    c = found.calibration
    warnings += left_out if c.criterion == "likelihood" else []
    return dataclasses.replace(found, calibration=dataclasses.replace(c, warnings=[*warnings, *c.warnings]))


def with_unseen(found: Identification, asked: Asked, single: Identification | None = None) -> Identification:
    """A calibration whose unseen parameters stay as they were believed; single: the one to be kept with it."""
    found = kept_at_first_guess(found, asked.vehicle, asked.effects, asked.kept, asked.tolerances, asked.known)
    if single is None:
        return found
    single = with_unseen(single, asked)
    return dataclasses.replace(found, single_track=(single.vehicle.single_track(), single.effects))


def check_known(c: Calibration) -> None:
    """Raises InvalidLogError where a parameter that is known came out far from what is known of it."""
    off = stretched(c.parameters)
    if off:
        raise InvalidLogError(
            f"{c.case}: {off[0]}; nothing is calibrated: give it a tolerance in the vehicle file that it is known to, "
            f"or drive {STEPS}, and {CIRCLES} (--force writes it nevertheless)"
        )


def kept_sentences(asked: Asked) -> list[str]:
    """Which parameters stay at their first guess."""
    if not asked.kept:
        return []
    names = ", ".join(asked.kept)
    slippery = f" ({SLIPPERY})" if "friction" in asked.kept else ""
    return [f"{names}: kept at the first guess, and as uncertain as before: these drives do not show it{slippery}"]


def white_or_none(runs: Sequence[Run], asked: Asked, tell: Progress) -> Identification | None:
    """The car calibrated by likelihood if its innovations are then white; None if not, if the filter fails, or if no
    run is long enough for it."""
    try:
        found = by_likelihood(runs, asked, tell)
    except InvalidLogError:
        return None
    return found if found.calibration.tempering >= WHITE else None


def by_likelihood(runs: Sequence[Run], asked: Asked, tell: Progress) -> Identification:
    """The most likely car.

    Raises:
        InvalidLogError: no run is long enough, or the likelihood has no peak.
    """
    vehicle, known = held_still(asked.vehicle, asked.kept), (*asked.known, *asked.kept)
    try:
        return identify_by_likelihood(
            runs, vehicle, asked.effects, asked.case, known, asked.without_unseen(asked.names), asked.stated, tell,
            asked.judged,
        )  # fmt: skip
    except np.linalg.LinAlgError:
        raise InvalidLogError(NO_PEAK.format(case=asked.case)) from None


def may_have_two_tracks(runs: Sequence[Run], vehicle: VehicleParameters) -> bool:
    """Whether a double-track car is asked for unasked: its rear wheels' speeds need torque, and it drives no front
    wheel."""
    return vehicle.front_coupling == 0.0 and all(run.tau_cmd is not None and run.omega_r is not None for run in runs)


def of_better_kind(
    runs: Sequence[Run], asked: Asked, single: PredictionFit, tell: Progress
) -> tuple[PredictionFit, str]:
    """A double-track car where it predicts held-out parts better than the single-track one.

    Not only beyond chance: every car has two tracks, and noise hides on held-out parts what a day of other manoeuvres
    shows.
    """

    def progress(stage: str, share: float) -> None:
        tell(f"{stage}, double-track car", 0.5 + 0.5 * share)

    try:
        double = by_prediction(runs, asked, True, progress)
    except (InvalidVehicleError, np.linalg.LinAlgError) as error:
        return single, f"a single-track car: a double-track one cannot be identified on these logs ({error})"
    apart = held_out_windows(single.judged, single.without, double.without)
    ratio = f"{apart.ratio:.2f} (95 %: {apart.low:.2f} to {apart.high:.2f}) times the single-track car's"
    said = f"on held-out parts the errors of a double-track car are {ratio}"
    return (double, f"a double-track car: {said}") if apart.ratio < 1.0 else (single, f"a single-track car: {said}")


def by_prediction(runs: Sequence[Run], asked: Asked, double: bool, tell: Progress) -> PredictionFit:
    """The car that predicts best; parameters that are known, or that the drives cannot show, stay as they are.

    double: a double-track car.
    """
    first = asked.first
    if double and isinstance(first, VehicleParameters):
        if first.front_coupling:
            raise InvalidVehicleError(
                f"{asked.case}: a double-track car drives its rear wheels alone, and front_coupling is "
                f"{first.front_coupling:g}; calibrate it with --car single-track"
            )
        first = nearest_double_track(first)
    lacks = kind_of(first.constants()).lacks
    held = {name for name, info in CATALOGUE.items() if info.tolerance in (*asked.known, *asked.kept)}
    seen, _ = seen_effects(runs, tuple(name for name in CATALOGUE if name not in lacks))
    own = [name for name in OWN if name not in held and name in seen]
    if not own:
        raise InvalidLogError(
            f"{asked.case}: nothing is left to be calibrated: every parameter is known (--known) or not shown by these "
            f"drives; drive {CIRCLES}"
        )
    further = asked.without_unseen(list(dict.fromkeys([*asked.names, *FURTHER])))
    candidates = [name for name in further if name in seen and name not in OWN]
    stated = asked.tolerances | frozenset(asked.known)
    windows, judged = (
        [windowed(run, run.filled, stride_of(asked.vehicle)) for run in some] for some in (runs, asked.judged)
    )
    with counted(tell, first.constants()) as shown:
        return fit_by_prediction(windows, first, asked.effects, own, candidates, stated, seen, shown, judged)


def days_given(logs: Logs | Sequence[str | Path], case: str | None) -> GivenLogs:
    """Runs of paths, one for each day, or runs as they are; `case`: what they are called."""
    if isinstance(logs, str | Path):
        logs = [logs]
    if isinstance(logs, Sequence) and logs and all(isinstance(path, str | Path) for path in logs):
        days = read_days([str(path) for path in logs])
        return days._replace(case=case or days.case)
    return logs_given(logs, case)  # type: ignore[arg-type]


def read_days(folders: Sequence[str | Path]) -> GivenLogs:
    """Reads case folders (`log.table.read_case`); runs of several days have their folder's name before their own."""
    runs, noise = [], dict[str, list[float]]()
    for folder in folders:
        day = read_case(folder)
        prefix = f"{Path(folder).resolve().name}/" if len(folders) > 1 else ""
        runs += [dataclasses.replace(run, name=prefix + run.name) for run in day]
        for name, level in stated_noise(folder).items():
            noise.setdefault(name, []).append(level)
    stated = {name: float(np.median(levels)) for name, levels in noise.items()}
    return GivenLogs(runs, "+".join(Path(folder).resolve().name for folder in folders), stated)
