"""A car calibrated by how well it predicts, for logs whose innovations are not white: real tyres, smoothed sensors."""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.common.standard_output import Progress
from drift_drake.gap.estimation.baseline import Learnt, learn_normal, left_of
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.reduction import STATES
from drift_drake.gap.estimation.robust_fit import WIDTHS, RobustFit, robust_fit
from drift_drake.gap.estimation.scores import Day, between_recordings, block_of, make_day, units
from drift_drake.gap.estimation.unknowns import FIELDS, OWN, Unknown, added, folded, magnitudes, unknown
from drift_drake.gap.estimation.windows import HORIZONS, WindowedRun, errors, forecast_error, thinned
from drift_drake.gap.evidence.left_out import asked_in_turn
from drift_drake.gap.evidence.posterior import NONE
from drift_drake.gap.evidence.ranking import DayRanked
from drift_drake.gap.identification.agreement import agreement, odd_parts, sentences
from drift_drake.gap.identification.estimate import KEEPS
from drift_drake.gap.identification.held_out import HeldOut
from drift_drake.gap.identification.outlook import Outlook, outlook

EVIDENCE = 0.02  # power of the criterion: overlapping windows, misfit that goes on for seconds
MOST_WINDOWS, MOST_JUDGED = 450, 4000  # that a fit takes in, and that it is judged by, evenly chosen
MOST_LEARNT = 6000  # the same of what is normal: twenty minutes of a full-size car's logs
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
    """The calibrated car, and what is normal for it."""

    unknowns: tuple[Unknown, ...]  # that were fitted
    fit: RobustFit
    vehicle: VehicleParameters  # with the deviations folded in
    effects: Effects
    normal: Normal
    left_open: LeftOpen
    held_out: HeldOut
    left_out: tuple[str, ...]  # effects that were asked for and are none of this car's
    outlook: Outlook  # detection limits, and what more recordings would bring


def is_held(run: WindowedRun, rows: np.ndarray) -> np.ndarray:
    """Whether rows lie in a block that is held out."""
    return np.asarray((rows * run.period / HELD_OUT).astype(int) % FOLDS == 1)


def split(runs: Sequence[WindowedRun]) -> tuple[list[WindowedRun], list[WindowedRun]]:
    """Windows to fit, outside the held-out blocks, and windows to judge by: every row that starts in a block."""
    fitted, judged = [], []
    for some, run in zip(thinned(runs, MOST_WINDOWS), runs, strict=True):
        starts, end = is_held(some, some.starts), is_held(some, some.starts + HORIZONS * some.stride_rows)
        fitted.append(dataclasses.replace(some, starts=some.starts[~starts & ~end]))
        judged.append(dataclasses.replace(run, starts=run.starts[is_held(run, run.starts)]))
    if min(sum(len(run.starts) for run in part) for part in (fitted, judged)) < LEAST_WINDOWS:
        fitted, judged = thinned(runs, MOST_WINDOWS), list(runs)  # too short to hold anything out
    return fitted, thinned([dataclasses.replace(run, starts=row_by_row(run)) for run in judged], MOST_JUDGED)


def row_by_row(run: WindowedRun) -> np.ndarray:
    """Every row as a start, from each start to the next: sensors' noise is another one in each row."""
    if len(run.starts) < 2:
        return run.starts
    step = int(np.diff(run.starts).min())
    followed = run.starts[:-1][np.diff(run.starts) == step]
    return np.union1d(run.starts, (followed[:, None] + np.arange(step)).ravel())


def fit_by_prediction(
    runs: Sequence[WindowedRun], vehicle: VehicleParameters, effects: Effects, own: Sequence[str],
    candidates: Sequence[str], stated: frozenset[str], seen: Sequence[str], progress: Progress,
) -> PredictionFit:  # fmt: skip
    """Calibrates a car on windows.

    Args:
        vehicle, effects: the first guess; own: deviations of its parameters that are unknown (`unknowns.OWN`);
        candidates: further effects, taken in together where held-out windows ask for them; stated: tolerances that
            the vehicle file states; seen: effects that the columns can show.
    """
    constants = vehicle.constants()
    base = [unknown(name, vehicle, stated) for name in own]
    more = [unknown(name, vehicle, stated) for name in candidates]
    fitted, judged = split(runs)

    def fitted_to(
        some: Sequence[WindowedRun], unknowns: Sequence[Unknown], start: np.ndarray | None = None
    ) -> RobustFit:
        widths = WIDTHS if start is None else WIDTHS[1:]
        predicted = partial(predicted_with, some, constants, effects)
        return robust_fit(predicted, unknowns, EVIDENCE, start, widths)

    def furthest(fit: RobustFit) -> float:
        return forecast_error(errors(judged, constants, added(effects, magnitudes(fit.names, fit.theta))))

    progress("the car alone", 0.0)
    alone = fitted_to(fitted, base)
    progress("with further effects", 0.2)
    start = np.concatenate([alone.theta, [u.start for u in more]])
    full = fitted_to(fitted, [*base, *more], start)
    asked_for = furthest(full) < furthest(alone)
    chosen, best = ([*base, *more], full) if asked_for else (base, alone)
    held_out = held_out_windows(judged, vehicle, effects, added(effects, magnitudes(best.names, best.theta)))
    progress("all windows", 0.5)
    fit = fitted_to(thinned(runs, MOST_WINDOWS), chosen, best.theta)
    kept = [u for u, q in zip(chosen, fit.theta, strict=True) if u.name in OWN or abs(q) > KEEPS * u.unit]
    if len(kept) < len(chosen):
        at = [fit.names.index(u.name) for u in kept]
        fit = fitted_to(thinned(runs, MOST_WINDOWS), kept, fit.theta[at])
    progress("baseline residuals", 0.85)
    car, rest = folded(vehicle, added(effects, magnitudes(fit.names, fit.theta)))
    steps = units(seen, vehicle)
    prior = np.array([prior_of(name, vehicle, stated) for name in seen]) / steps
    day = make_day(thinned(runs, MOST_LEARNT), car.constants(), rest, seen, steps)
    everyday = between_recordings(seen, vehicle) / steps
    left = left_of(prior, np.isin(seen, fit.names))
    learnt = learn_normal(day, tuple(seen), steps, prior, everyday, left)
    found = asked_in_turn(learnt, car)
    none = np.array([one.probabilities[NONE] for one in found])
    learnt = learnt._replace(normal=dataclasses.replace(learnt.normal, left_out_none=none))
    return PredictionFit(
        tuple(kept), fit, car, rest, learnt.normal, left_open(day, learnt, [u.name for u in kept], found), held_out,
        tuple(name for name in candidates if name not in fit.names), outlook(day, learnt.normal, left, vehicle),
    )  # fmt: skip


def left_open(day: Day, learnt: Learnt, names: Sequence[str], asked: Sequence[DayRanked]) -> LeftOpen:
    """What a baseline leaves open of the effects `names` that were fitted.

    Args:
        day: the baseline under the calibrated car; learnt: what it shows of it;
        asked: what each recording says, left out.
    """
    normal = learnt.normal
    at = [normal.names.index(name) for name in names]
    scale = normal.units[at]
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
    runs: Sequence[WindowedRun], constants: Constants, effects: Effects, found: Mapping[str, float]
) -> np.ndarray:
    """Prediction errors of a car whose effects have further magnitudes."""
    return errors(runs, constants, added(effects, found))


def prior_of(name: str, vehicle: VehicleParameters, stated: frozenset[str]) -> float:
    """Standard deviation of what any effect may be on the day of calibration, before its logs.

    A sensor's bias or a road's slope belongs to no car: it is as on any recording. A latency or a gain may be this
    car's every day, where that day's drives did not show it.
    """
    info = CATALOGUE[name]
    bias = info.varies and (info.stage == "sensor" or info.of_road)
    return float(between_recordings([name], vehicle)[0]) if bias else unknown(name, vehicle, stated).prior


def held_out_windows(
    judged: Sequence[WindowedRun], vehicle: VehicleParameters, before: Effects, after: Effects
) -> HeldOut:
    """Median absolute errors on held-out windows of the first guess and of the calibrated car, in the states' units.

    The ratio is the states' geometric mean at the longest horizon, its interval from resampled blocks of 2 s.
    """
    shown = [i for i in range(len(STATES)) if all(run.used[i] for run in judged)]
    one, two = (np.abs(errors(judged, vehicle.constants(), car))[..., shown] for car in (before, after))

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
