"""A car calibrated by how well it predicts, for logs whose innovations are not white: real tyres, smoothed sensors."""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants, kind_of
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.common.standard_output import Progress
from drift_drake.gap.estimation.baseline import left_of
from drift_drake.gap.estimation.effort import affordable, derivatives_of, remarks
from drift_drake.gap.estimation.learn_normal import Learnt, learn_normal
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prior import TWO_SIDED
from drift_drake.gap.estimation.reduction import STATES
from drift_drake.gap.estimation.robust_fit import WIDTHS, RobustFit, robust_fit
from drift_drake.gap.estimation.scores import Day, between_recordings, block_of, make_day, units
from drift_drake.gap.estimation.unknowns import FIELDS, Unknown, deviations_of, folded, magnitudes, unknown, with_found
from drift_drake.gap.estimation.windows import (
    HORIZONS,
    WindowedRun,
    count_of,
    errors,
    errors_of_all,
    forecast_error,
    thinned,
)
from drift_drake.gap.evidence.left_out import asked_in_turn
from drift_drake.gap.evidence.posterior import NONE
from drift_drake.gap.evidence.ranking import DayRanked
from drift_drake.gap.identification.agreement import agreement, odd_parts, sentences
from drift_drake.gap.identification.calibration import Parameter
from drift_drake.gap.identification.estimate import KEEPS
from drift_drake.gap.identification.held_out import HeldOut
from drift_drake.gap.identification.outlook import Outlook, outlook

EVIDENCE = 0.02  # power of the criterion: overlapping windows, misfit that goes on for seconds
MOST_WINDOWS, MOST_JUDGED = 450, 4000  # that a fit takes in, and that it is judged by, evenly chosen
MOST_LEARNT = 6000  # the same of the baseline: twenty minutes of a full-size car's logs
FOLDS, HELD_OUT = 4, 1.5  # one block [s] of so many is held out
LEAST_WINDOWS = 10  # on either side
RESAMPLES = 400
WIDER = 1.5  # intervals, than the scatter of blocks says: what the equations lack moves estimates too
ALONE = (
    "calibrated on one recording: by how much this car differs from one to the next is not known, but for what varies "
    "on any car (biases, grade, wind, rolling resistance); calibrate on several recordings, of different driving"
)


@dataclasses.dataclass(frozen=True)
class LeftOpen:
    """What a baseline leaves open of the parameters that were fitted."""

    deviations: np.ndarray  # [n] standard deviations
    stated: np.ndarray  # [n] the same with what the recordings differ by, where they disagree
    correlation: np.ndarray  # [n, n]
    disagreed: dict[str, str]  # parameters that recordings disagree about, and which pulls each the most
    sentences: list[str]


@dataclasses.dataclass(frozen=True)
class PredictionFit:
    """The calibrated car, and its baseline residual distribution."""

    unknowns: tuple[Unknown, ...]  # effects that were fitted
    of_kind: dict[str, Parameter]  # what a kind of car alone has
    fit: RobustFit
    vehicle: CarParameters  # with the deviations folded in
    effects: Effects
    normal: Normal
    left_open: LeftOpen
    held_out: HeldOut
    judged: Sequence[WindowedRun]  # the held-out windows
    without: tuple[CarConstants, Effects]  # the car that was fitted to the others
    left_out: tuple[str, ...]  # effects that were asked for and are none of this car's
    outlook: Outlook  # detection limits, and what more recordings would bring
    remarks: list[str]  # on a simulator of the user's


def is_held(run: WindowedRun, rows: np.ndarray) -> np.ndarray:
    """Whether rows lie in a block that is held out."""
    return np.asarray((rows * run.period / HELD_OUT).astype(int) % FOLDS == 1)


def split(
    runs: Sequence[WindowedRun], most: int = MOST_WINDOWS, most_judged: int = MOST_JUDGED,
    validation: Sequence[WindowedRun] = (),
) -> tuple[list[WindowedRun], list[WindowedRun]]:  # fmt: skip
    """Windows to fit, outside the held-out blocks, and windows to judge by: every row that starts in a block.

    validation: runs that are kept to judge by, in place of blocks.
    """
    if validation:
        every_row = [dataclasses.replace(run, starts=row_by_row(run)) for run in validation]
        return thinned(runs, most), thinned(every_row, most_judged)
    fitted, judged = [], []
    for some, run in zip(thinned(runs, most), runs, strict=True):
        starts, end = is_held(some, some.starts), is_held(some, some.starts + HORIZONS * some.stride_rows)
        fitted.append(dataclasses.replace(some, starts=some.starts[~starts & ~end]))
        judged.append(dataclasses.replace(run, starts=run.starts[is_held(run, run.starts)]))
    if min(count_of(part) for part in (fitted, judged)) < LEAST_WINDOWS:
        fitted, judged = thinned(runs, most), list(runs)  # too short to hold anything out
    return fitted, thinned([dataclasses.replace(run, starts=row_by_row(run)) for run in judged], most_judged)


def row_by_row(run: WindowedRun) -> np.ndarray:
    """Every row as a start, from each start to the next: sensors' noise is another one in each row."""
    if len(run.starts) < 2:
        return run.starts
    step = int(np.diff(run.starts).min())
    followed = run.starts[:-1][np.diff(run.starts) == step]
    return np.union1d(run.starts, (followed[:, None] + np.arange(step)).ravel())


def fit_by_prediction(
    runs: Sequence[WindowedRun], first: CarParameters, effects: Effects, own: Sequence[str],
    candidates: Sequence[str], stated: frozenset[str], seen: Sequence[str], progress: Progress,
    validation: Sequence[WindowedRun] = (),
) -> PredictionFit:  # fmt: skip
    """Calibrates a car on windows.

    Args:
        first, effects: the first guess; own: deviations of its parameters that are unknown (`unknowns.OWN`);
        candidates: further effects, taken in together where held-out windows ask for them; stated: tolerances that
            the vehicle file states; seen: effects that the columns can show; validation: held out, in place of blocks.

    Raises:
        InvalidVehicleError: what predicts best is no car.
    """
    constants, vehicle = first.constants(), first.single_track()
    base = [*(unknown(name, vehicle, stated) for name in own), *deviations_of(constants)]
    more = [unknown(name, vehicle, stated) for name in candidates]
    most = affordable(constants, runs, MOST_WINDOWS)
    fitted, judged = split(runs, most, MOST_JUDGED * most // MOST_WINDOWS, validation)

    def fitted_to(
        some: Sequence[WindowedRun], unknowns: Sequence[Unknown], start: np.ndarray | None = None
    ) -> RobustFit:
        widths = WIDTHS if start is None else WIDTHS[1:]
        predicted = partial(predicted_with, some, constants, effects)
        return robust_fit(predicted, unknowns, EVIDENCE, start, widths, *derivatives_of(constants))

    def furthest(fit: RobustFit) -> float:
        return forecast_error(predicted_with(judged, constants, effects, [magnitudes(fit.names, fit.theta)])[0])

    progress("the car alone", 0.0)
    alone = fitted_to(fitted, base)
    progress("with further effects", 0.2)
    full = fitted_to(fitted, [*base, *more], np.concatenate([alone.theta, [u.start for u in more]]))
    chosen, best = ([*base, *more], full) if furthest(full) < furthest(alone) else (base, alone)
    found = with_found(constants, effects, magnitudes(best.names, best.theta))
    held_out = held_out_windows(judged, (constants, effects), found)
    progress("all windows", 0.5)
    fit = fitted_to(thinned(runs, most), chosen, best.theta)
    kept = [u for u, q in zip(chosen, fit.theta, strict=True) if u in base or abs(q) > KEEPS * u.unit]
    if len(kept) < len(chosen):
        fit = fitted_to(thinned(runs, most), kept, fit.theta[[fit.names.index(u.name) for u in kept]])
    progress("baseline residuals", 0.85)
    now, among = with_found(constants, effects, magnitudes(fit.names, fit.theta))
    car, rest = folded(first.with_constants(now), among)
    steps = units(seen, vehicle)
    prior = np.array([prior_of(name, vehicle, stated) for name in seen]) / steps
    windows = thinned(runs, MOST_LEARNT * most // MOST_WINDOWS)
    day = make_day(windows, car.constants(), rest, seen, steps, kind_units=sizes_of(constants, fit))
    left = left_of(prior, np.isin(seen, fit.names))
    learnt = learn_normal(day, tuple(seen), steps, prior, between_recordings(seen, vehicle) / steps, left)
    learnt, asked = with_left_out(learnt, car.single_track())
    of_effects = tuple(u for u in kept if u.name in CATALOGUE)
    return PredictionFit(
        of_effects, of_kind(constants, fit, kept), fit, car, rest, learnt.normal,
        left_open(day, learnt, [u.name for u in of_effects], asked, less_known(fit, kept)), held_out, judged, found,
        tuple(name for name in candidates if name not in fit.names), outlook(day, learnt.normal, left, vehicle),
        remarks(constants, count_of(thinned(runs, most)), count_of(thinned(runs, MOST_WINDOWS))),
    )  # fmt: skip


def information_of(fit: RobustFit, unknowns: Sequence[Unknown]) -> np.ndarray:
    """Of all that was fitted [n, n], priors and logs."""
    return np.asarray(EVIDENCE * fit.information + np.diag([1.0 / u.prior**2 for u in unknowns]))


def less_known(fit: RobustFit, unknowns: Sequence[Unknown]) -> np.ndarray:
    """By how much the effects' standard deviations grow [n] since what the car's kind alone has is not known either."""
    information = information_of(fit, unknowns)
    at = [i for i, u in enumerate(unknowns) if u.name in CATALOGUE]
    alone, together = np.linalg.inv(information[np.ix_(at, at)]), np.linalg.inv(information)[np.ix_(at, at)]
    return np.asarray(np.sqrt(np.diag(together) / np.diag(alone)))


def with_left_out(learnt: Learnt, vehicle: VehicleParameters) -> tuple[Learnt, list[DayRanked]]:
    """The baseline with the probabilities that recordings left out in turn have no gap, and what each says."""
    asked = asked_in_turn(learnt, vehicle)
    none = np.array([one.probabilities[NONE] for one in asked])
    return learnt._replace(normal=dataclasses.replace(learnt.normal, left_out_none=none)), asked


def sizes_of(first: CarConstants, fit: RobustFit) -> np.ndarray:
    """Units [k] of the deviations of a car's kind, in their standard deviations.

    What came out far from what is usual makes up for something that the equations lack, and that other driving asks
    for less.
    """
    by = magnitudes(fit.names, fit.theta)
    return np.array([max(1.0, abs(by[name])) for name in kind_of(first).deviations])


def left_open(
    day: Day, learnt: Learnt, names: Sequence[str], asked: Sequence[DayRanked], wider: np.ndarray | float = 1.0
) -> LeftOpen:
    """What a baseline leaves open of the effects `names` that were fitted.

    Args:
        day: the baseline under the calibrated car; learnt: what it shows of it;
        asked: what each recording says, left out; wider: factors [n] of their standard deviations (`less_known`).
    """
    normal = learnt.normal
    at = [normal.names.index(name) for name in names]
    scale = normal.units[at] * wider
    covariance = normal.unknown[np.ix_(at, at)] * np.outer(scale, scale)
    deviations = WIDER * np.sqrt(np.diag(covariance))
    recordings = sorted({run.recording for run in day.runs})
    left = np.diag(normal.unknown)[at] - np.diag(normal.recording)[at] / len(recordings)
    found = agreement(learnt.pulled[:, at], left)
    apart = scale * np.sqrt(WIDER**2 * left + found.apart)
    furthest = zip((FIELDS.get(name, name) for name in names), found.disagreed, found.furthest, strict=True)
    disagreed = {name: recordings[k] for name, differs, k in furthest if differs}
    return LeftOpen(
        deviations, np.where(found.disagreed, np.maximum(deviations, apart), deviations),
        covariance * WIDER**2 / np.outer(deviations, deviations), disagreed,
        differences(len(recordings), disagreed, odd_parts(day, asked)),
    )  # fmt: skip


def predicted_with(
    runs: Sequence[WindowedRun], constants: CarConstants, effects: Effects, found: Sequence[Mapping[str, float]]
) -> list[np.ndarray]:
    """Prediction errors of a first guess with each of some magnitudes of what was unknown (`unknowns.with_found`)."""
    return errors_of_all(runs, [with_found(constants, effects, one) for one in found])


def of_kind(first: CarConstants, fit: RobustFit, kept: Sequence[Unknown]) -> dict[str, Parameter]:
    """What a kind of car alone has, with intervals from the fit's information."""
    kind = kind_of(first)
    covariance = np.linalg.inv(information_of(fit, kept))
    out = {}
    for name, deviation in kind.deviations.items():
        at, start = fit.names.index(name), kind.value_of(name, first)
        by, spread = float(fit.theta[at]), min(float(np.sqrt(covariance[at, at])), 1.0)
        low, value, high, further = (deviation.moved(start, by + share * spread)
                                     for share in (-TWO_SIDED, 0.0, TWO_SIDED, 1.0))  # fmt: skip
        size = (further - value) / spread
        state = "free" if size > 0.0 else "known"  # a relative deviation of what the car has not
        out[name] = Parameter(deviation.unit, start, value, low, high, size * spread, size, 1.0, state)
    return out


def prior_of(name: str, vehicle: VehicleParameters, stated: frozenset[str]) -> float:
    """Standard deviation of what any effect may be on the day of calibration, before its logs.

    A sensor's bias or a road's slope belongs to no car: it is as on any recording. A latency or a gain may be this
    car's every day, where that day's drives did not show it.
    """
    info = CATALOGUE[name]
    bias = info.varies and (info.stage == "sensor" or info.of_road)
    return float(between_recordings([name], vehicle)[0]) if bias else unknown(name, vehicle, stated).prior


def held_out_windows(
    judged: Sequence[WindowedRun], before: tuple[CarConstants, Effects], after: tuple[CarConstants, Effects]
) -> HeldOut:
    """Median absolute errors on held-out windows of the first guess and of the calibrated car, in the states' units.

    The ratio is the states' geometric mean at the longest horizon, its interval from resampled blocks of 2 s.
    """
    shown = [i for i in range(len(STATES)) if all(run.used[i] for run in judged)]
    one, two = (np.abs(errors(judged, *car))[..., shown] for car in (before, after))

    def ratios(rows: np.ndarray) -> np.ndarray:
        medians = [np.median(part[rows, -1], axis=0) + 1e-12 for part in (one, two)]
        return np.asarray(medians[1] / medians[0])

    blocks = [np.flatnonzero(block == k) for block in [block_of(judged)] for k in range(int(block.max()) + 1)]
    rng = np.random.default_rng(0)
    draws = np.array([ratios(np.concatenate([blocks[k] for k in rng.integers(0, len(blocks), len(blocks))]))
                      for _ in range(RESAMPLES)])  # fmt: skip
    low, high = np.quantile(np.exp(np.mean(np.log(draws), axis=1)), [0.025, 0.975])
    by_state = [(float(a), float(b)) for a, b in np.quantile(draws, [0.025, 0.975], axis=0).T]
    first, then = ([[float(q) for q in row] for row in np.median(part, axis=0)] for part in (one, two))
    ratio = float(np.exp(np.mean(np.log(ratios(np.arange(len(one)))))))
    return HeldOut(
        judged[0].horizons, tuple(STATES[i] for i in shown), first, then, ratio, float(low), float(high), by_state
    )


def differences(recordings: int, disagreed: Mapping[str, str], odd: Mapping[str, str]) -> list[str]:
    """Sentences on recordings that disagree, or that there is one only.

    Args:
        disagreed: by parameter the recording that pulls it the most; odd: `odd_parts`.
    """
    return [*([ALONE] if recordings == 1 else []), *sentences(disagreed, odd)]
