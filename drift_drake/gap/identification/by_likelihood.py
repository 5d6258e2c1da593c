"""A car calibrated by the likelihood of the diagnosis's filter: exact where innovations are white."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import Tolerance, VehicleParameters
from drift_drake.common.standard_output import Progress
from drift_drake.gap.estimation.fit import cost_of, parameter_limits
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.prior import TWO_SIDED, scale
from drift_drake.gap.estimation.problem import NUISANCES, Problem, car, flat
from drift_drake.gap.estimation.usable import seen_effects
from drift_drake.gap.identification import agreement
from drift_drake.gap.identification.calibration import Calibration, Identification, Parameter, directions, tied
from drift_drake.gap.identification.estimate import (
    FIRST_SHARE,
    KEEPS,
    PARAMETERS,
    Estimate,
    effect_ranges,
    estimate,
    first_magnitude,
    shown_effects,
    widened,
)
from drift_drake.gap.identification.held_out import (
    HeldOut,
    held_out_error,
    held_out_rows,
    judged_by,
    squares_of,
    without_fold,
)
from drift_drake.gap.identification.model_discrepancy import model_discrepancy, widening

R_OVER_Q = (1.0, 3.0, 10.0)  # that are tried in turn
STEP = 1e-3  # of a broad prior, for differences: coarser ones tell mass and forces apart, which only ratios tell
HARDLY = 1e-3  # of an effect's range
EASED = 0.1  # R/Q ratio of a filter that only finds the way
ALIKE = 1.02  # of the least half-second error on the fitted rows, up to which fits predict alike
LEAST_LONGEST = 2.5  # [s] of one run: rows that are held out and rows that are not, half a second ahead in both
ABSOLUTE = ("front_axle_distance", "steering_offset")  # tolerances with a unit; the others are relative
FIELD = {"torque": "gear_ratio"}  # the parameter that a deviation changes, where it has another name
STRETCHED = 3.0  # tolerances beyond which a known parameter that came out elsewhere is doubted

NO_PEAK = (
    "{case}: the likelihood has no peak, since the filter loses the car on these logs; name what is known of it "
    "(--known mass), give a first guess nearer to it, or choose --criterion prediction"
)


def identify_by_likelihood(
    runs: Sequence[Run], vehicle: VehicleParameters, effects: Effects, case: str, known: Sequence[str],
    names: Sequence[str], stated: Mapping[str, float] | None, tell: Progress, validation: Sequence[Run] = (),
) -> Identification:  # fmt: skip
    """Calibrates a car on usable runs; see `identify.identify`.

    validation: runs that it is judged by, in place of rows that are held out at first.

    Raises:
        InvalidLogError: no run is long enough for rows to be held out, or the likelihood has no peak.
    """
    longest = max(len(run) * run.period for run in runs)
    if longest < LEAST_LONGEST - 1e-6:
        raise InvalidLogError(
            f"{case}: no run is long enough for a part to be held out, {longest:.3g} s at most; calibrate on runs one "
            f"of which has {LEAST_LONGEST:g} s in a row"
        )
    given = [name for name in CATALOGUE if getattr(effects, name) != 0.0 and name != "steering_offset"]
    asked = list(dict.fromkeys([*given, *names]))
    chosen, warnings = seen_effects(runs, shown_effects(asked, runs))
    wide = widened(vehicle, known)
    problem = make_problem(runs, wide, stated=stated)
    problem = problem.replace(ranges=effect_ranges(chosen, vehicle, runs, effects), step=STEP)
    first = first_guess(problem, chosen, effects)
    best = least_r_over_q_fit(problem, chosen, (first, first_guess(problem, chosen, effects, HARDLY)), tell)
    tell("all rows", 0.8)
    found = estimate(problem, chosen, best.theta, best.trust.noise / best.trust.process)
    guess = guess_as_stated(problem, first, chosen, effects)
    if validation:
        judging = make_problem(validation, wide, stated=stated).replace(ranges=problem.ranges)
        held = judged_by(judging, problem, guess, (found.theta, found.names))
    else:
        held = held_out_rows(
            problem, squares_of(problem, *guess, held=True), squares_of(problem, best.theta, best.names, held=True)
        )
    tell("intervals", 0.95)
    asked_for = summarise(found, vehicle, effects, known)[0]
    dropped = [n for n in chosen if asked_for[n].low <= 0.0 <= asked_for[n].high]
    kept = refit_without(problem, found, dropped)
    while least := negligible(kept):
        kept, dropped = refit_without(problem, kept, least), [*dropped, *least]
    # Stated values, intervals, tolerances and the file are of one fit: the last.
    out = stated_in_full(kept, runs, vehicle, effects, case, known, dropped, held)
    c = dataclasses.replace(out.calibration, warnings=[*warnings, *out.calibration.warnings])
    tell("done", 1.0)
    return dataclasses.replace(out, calibration=c)


def stated_in_full(
    kept: Estimate, runs: Sequence[Run], vehicle: VehicleParameters, effects: Effects, case: str, known: Sequence[str],
    dropped: Sequence[str], held: HeldOut,
) -> Identification:  # fmt: skip
    """Parameters with intervals, the file and what a diagnosis needs, all of one fit.

    Args:
        dropped: effects that were left out of it; held: errors on parts that were not fitted.
    """
    parameters, correlation, covariance = summarise(kept, vehicle, effects, known)
    check_peak(case, covariance)
    tempering, discrepancy = model_discrepancy(kept)
    new_vehicle, new_effects = calibrated_vehicle(
        kept.problem, vehicle, kept.theta, kept.names, {name: p.deviation for name, p in parameters.items()}
    )
    # The file's tolerances are those of the estimate; what recordings differ by is stated with the parameters.
    at, factors = places(kept.problem, kept.names), [s.factor for s in scales(kept.problem, vehicle, kept.names)]
    widened_by = np.array([p.widened for p in parameters.values()])
    apart, recordings = agreement.by_likelihood(kept, [run.recording or run.name for run in runs], at, widened_by)
    parameters, disagreed = agreement.with_differences(parameters, apart, recordings, np.abs(factors))
    calibration = Calibration(
        case=case,
        parameters=parameters,
        correlation=correlation.tolist(),
        not_identified=directions(parameters, correlation),
        tied=tied(list(parameters), correlation),
        left_out=list(dropped),
        held_out=held,
        trust=kept.trust,
        tempering=tempering,
        discrepancy=discrepancy,
        seconds=0.0,
        warnings=[
            *end_warnings(kept, parameters), *stretched(parameters), *agreement.sentences(disagreed, {}),
        ],
        disagreed=disagreed,
    )  # fmt: skip
    return Identification(calibration, new_vehicle, new_effects, sum(len(run) for run in runs))


def check_peak(case: str, covariance: np.ndarray) -> None:
    """Raises InvalidLogError where the likelihood has no peak, so that nothing is known of the parameters."""
    if not np.isfinite(covariance).all():
        raise InvalidLogError(NO_PEAK.format(case=case))


def first_guess(problem: Problem, names: Sequence[str], effects: Effects, share: float = FIRST_SHARE) -> np.ndarray:
    """Theta of the vehicle file, its effects a share of their ranges into these where it has none."""
    magnitudes = [first_magnitude(name, effects, *problem.range_of(name), share) for name in names]
    theta = np.concatenate([np.zeros(problem.nuisances), magnitudes])
    offset = PARAMETERS.index("steering_offset")
    theta[offset] = effects.steering_offset / problem.tolerance[offset]
    return theta


def guess_as_stated(
    problem: Problem, first: np.ndarray, names: Sequence[str], effects: Effects
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Theta and effects of the vehicle file exactly as it is."""
    own = tuple(name for name in names if getattr(effects, name) != 0.0)
    magnitudes = [float(getattr(effects, name)) for name in own]
    return np.concatenate([first[: problem.nuisances], magnitudes]), own


def least_r_over_q_fit(
    problem: Problem, names: Sequence[str], starts: tuple[np.ndarray, np.ndarray], tell: Progress
) -> Estimate:
    """The fit without the held-out rows, under the least R/Q ratio that predicts well half a second ahead.

    A filter of a low R/Q ratio judges a model by the next row, one of a high ratio by its own prediction of the next
    seconds. Where the model is right, both agree; where it is not, or the noise is not white, only the second is of
    use. Of those that predict alike, the lowest ratio is taken: a filter of a high one believes in its model, and its
    intervals hold the truth too seldom. The likelihood has several valleys, so that three ways lead there: from the
    first guess, from it by a filter that hears too well, whose likelihood has fewer valleys, and from effects that are
    hardly there (from a lag of 50 ms an axle's inertia may be taken for what is left of that lag). Of the ends that
    predict alike, the likeliest is gone on with.

    Args:
        starts: the first guess, and the one with effects that are hardly there.
    """
    kept, (first, hardly) = without_fold(problem), starts

    def error(at: Estimate) -> float:
        return float(np.sqrt(held_out_error(squares_of(problem, at.theta, at.names, held=False))))

    tell("fit 1", 0.0)
    direct = estimate(kept, names, first, R_OVER_Q[0])
    tell("fit 2", 0.2)
    eased = estimate(kept, names, estimate(kept, names, first, EASED).theta, R_OVER_Q[0])
    ways = (direct, eased, estimate(kept, names, hardly, R_OVER_Q[0]))
    off = [error(at) for at in ways]
    alike = [at for at, e in zip(ways, off, strict=True) if e <= ALIKE * min(off)]
    fits = [min(alike, key=lambda at: cost_of(at.problem, at.at.filtered, at.theta))]  # each under its own noise
    for number, r_over_q in enumerate(R_OVER_Q[1:], 3):
        tell(f"fit {number}", 0.15 * number)
        fits.append(estimate(kept, names, fits[-1].theta, r_over_q))
    errors = [error(at) for at in fits]
    return next(at for at, e in zip(fits, errors, strict=True) if e <= ALIKE * min(errors))


def summarise(
    found: Estimate, vehicle: VehicleParameters, effects: Effects, known: Sequence[str]
) -> tuple[dict[str, Parameter], np.ndarray, np.ndarray]:
    """Parameters with intervals, their correlation and their covariance in their own units."""
    table = scales(found.problem, vehicle, found.names)
    at = places(found.problem, found.names)
    white = found.covariance
    wider = widening(found.problem.runs, found.at.jacobian, flat(found.problem, found.at.filtered.innovations), white)
    factor = np.array([s.factor for s in table])
    deviation = np.sqrt(np.diag(white))[at] * wider[at] * np.abs(factor)
    spread = np.sqrt(np.diag(white))[at]
    correlation = white[np.ix_(at, at)] / np.maximum(np.outer(spread, spread), 1e-300)
    parameters = {}
    for i, s in enumerate(table):
        own = i >= len(PARAMETERS)
        low, high = found.problem.range_of(s.name) if own else (-np.inf, np.inf)
        prior = float((high - low) / np.sqrt(12.0) if own else abs(s.factor))
        value = s.origin + s.factor * float(found.theta[at[i]])
        sigma = float(min(deviation[i], prior))
        kind = "effect" if own else ("known" if PARAMETERS[i] in known or prior == 0.0 else "free")
        start = float(getattr(effects, s.name)) if s.name in CATALOGUE else s.origin
        parameters[s.name] = Parameter(
            s.unit, start, value, max(value - TWO_SIDED * sigma, low), min(value + TWO_SIDED * sigma, high), sigma,
            prior, float(wider[at[i]]), kind,
        )  # fmt: skip
    sigmas = np.array([p.deviation for p in parameters.values()])
    return parameters, correlation, correlation * np.outer(sigmas, sigmas)


@dataclasses.dataclass(frozen=True)
class Scale:
    """An unknown's value is `origin + factor * theta`, in `unit`."""

    name: str
    origin: float
    factor: float
    unit: str


def scales(problem: Problem, vehicle: VehicleParameters, names: Sequence[str]) -> list[Scale]:
    """How the vehicle's own parameters and the effects `names` follow from theta, in the order of `places`."""
    out = []
    fields = {field.name: field.metadata for field in dataclasses.fields(VehicleParameters)}
    for name in PARAMETERS:
        tolerance = float(problem.tolerance[NUISANCES.index(name)])
        if name == "steering_offset":
            out.append(Scale(name, 0.0, tolerance, "rad"))
            continue
        field = FIELD.get(name, name)
        value = float(getattr(vehicle, field))
        out.append(Scale(field, value, tolerance * (1.0 if name in ABSOLUTE else value), fields[field]["unit"]))
    return out + [Scale(name, 0.0, 1.0, CATALOGUE[name].unit) for name in names]


def places(problem: Problem, names: Sequence[str]) -> np.ndarray:
    """Indices in theta of the vehicle's own parameters and of the effects `names`."""
    return np.concatenate([np.arange(len(PARAMETERS)), problem.nuisances + np.arange(len(names))])


def calibrated_vehicle(
    problem: Problem, vehicle: VehicleParameters, theta: np.ndarray, names: Sequence[str], deviations: dict[str, float]
) -> tuple[VehicleParameters, Effects]:
    """The vehicle and effects at theta, with posterior standard deviations (in units of `scales`) for tolerances."""
    constants, effects = car(problem, theta, names)
    fixed = ("gravity", "front_coupling", "tyre")
    changes = {name: value for name, value in constants._asdict().items() if name not in fixed}
    if problem.rim_fed:
        changes["rear_axle_inertia"] = vehicle.rear_axle_inertia
    tolerances = {}
    for name in PARAMETERS:
        field = FIELD.get(name, name)
        tolerances[name] = deviations[field] / (1.0 if name in ABSOLUTE else changes[field])
    tolerance: Tolerance = dataclasses.replace(vehicle.tolerance, **tolerances)
    kept = {name: float(getattr(effects, name)) for name in {*names, "steering_offset"}}
    return vehicle.replace(**changes, tolerance=tolerance), make_effects(kept)


def negligible(found: Estimate) -> list[str]:
    """Effects that came out at the least of their range, above zero, or as next to nothing of the range."""
    low, first = parameter_limits(found.problem, found.names)[0], found.problem.nuisances
    return [
        name
        for i, name in enumerate(found.names, first)
        if 0.0 < low[i] >= found.theta[i] or abs(found.theta[i]) < KEEPS * scale(name, found.problem.vehicle)
    ]


def refit_without(problem: Problem, found: Estimate, dropped: Sequence[str]) -> Estimate:
    """The fit with effects that are nothing of this car's taken out, so that the others make up for them."""
    if not dropped:
        return found
    kept = [name for name in found.names if name not in dropped]
    first = problem.nuisances
    magnitudes = [found.theta[first + found.names.index(name)] for name in kept]
    theta = np.concatenate([found.theta[:first], magnitudes])
    return estimate(problem, kept, theta, found.trust.noise / found.trust.process)


def end_warnings(found: Estimate, parameters: Mapping[str, Parameter]) -> list[str]:
    """Warnings of unknowns at the ends of what is believed possible, zero aside."""
    low, high = parameter_limits(found.problem, found.names)
    at = places(found.problem, found.names)
    return [
        f"{name} is at the end of what is believed possible ({parameters[name].estimate:.3g}): doubt it, or change its "
        "first guess"
        for name, i in zip(parameters, at, strict=True)
        if (found.theta[i] <= low[i] and low[i] != 0.0) or found.theta[i] >= high[i]
    ]


def stretched(parameters: Mapping[str, Parameter]) -> list[str]:
    """Warnings of parameters that came out far from what the vehicle file holds to be known."""
    return [
        f"{name}, known to {p.prior:.3g} {p.unit}, came out {abs(p.estimate - p.start) / p.prior:.0f} tolerances off: "
        "it makes up for something that the model lacks, or its tolerance is too small"
        for name, p in parameters.items()
        if p.kind == "known" and abs(p.estimate - p.start) > STRETCHED * p.prior
    ]
