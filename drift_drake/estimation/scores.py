"""What is normal for a car: scores of its prediction errors, direction by direction, and how they scatter.

A score is a window's error projected on what an effect would do to it. On the day of calibration the scores of blocks
of time show what the calibrated car lacks every day, in each direction, and how that scatters; what calibration left
unknown (a friction limit that no drive came near) widens the scatter wherever another day's drives depend on it. A
generalised method of moments with an empirical weight (Hansen 1982).

Recordings differ: batteries empty, tyres warm up, wind turns, a sensor is aligned anew, and equations that do not
follow the car ask for other parameters on a circle than in a slalom. Blocks of time within a recording do not show
that, whole recordings do: each is one draw (Liang and Zeger 1986). A few recordings show little of it: what is known to
vary from recording to recording (`Effect.varies`) is taken to, by less than a gap; and by how much recordings differ is
read off all that the logs show together, since a few recordings differ in few directions, and the next one will in
others.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from drift_drake.estimation.normal import Normal, capped_squares
from drift_drake.estimation.robust_fit import THREADS, robust_scales
from drift_drake.estimation.unknowns import added
from drift_drake.estimation.windows import HORIZONS, WindowedRun, errors, errors_of_all, regimes
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import Constants, VehicleParameters

BLOCK = 2.0  # [s]
CLIPPED = 4.0  # robust scales at which a window's error in a channel is clipped (Huber)
LARGEST = 20.0  # robust scales of a derivative
SHARE = 0.25  # of the practical range, that derivatives are taken over
RATE_LIMIT_SHARE = 0.5  # the same of a limit, which acts only where it is low
REGULAR = 1e-2  # of the errors' covariance
SHRUNK, SHRUNK_AT = 0.3, 24  # towards a diagonal covariance, with so many blocks
BETWEEN_DAYS = 8.0  # by how much scores scatter more between days than between blocks of one day (validation days)
COVERED = 0.98  # quantile of the calibration's windows, up to which a regime is known
GRACE = (1.0, 1.0, 1.5, 1.5)  # times it, by `windows.regimes`: a changed car slides more on the same drive
BEYOND = 0.15  # share beyond, at which a window counts half
MODEL_FORM = {"yaw_inertia_error": 0.08}
"""Standard deviation from manoeuvre to manoeuvre of what an effect of the equations is worth: where a body rolls and
tyres relax, the yaw inertia that predicts best depends on the drive (validation cars)."""
ALIKE = 4.0
"""Recordings that the belief that recordings differ alike in all that logs show is worth, beside those that were seen
(validation days and recordings)."""
RECORDING_SHARE = 0.5  # of the least gap: what an effect deviates by from recording to recording, two are a gap
CALIBRATED = 4.0  # by how much what calibration left unknown is wider than its own logs say (validation days)


def units(names: Sequence[str], vehicle: VehicleParameters) -> np.ndarray:
    """Magnitudes [n] that derivatives are taken over."""
    sizes = [max(abs(q) for q in CATALOGUE[name].range_for(vehicle)) for name in names]
    shares = [RATE_LIMIT_SHARE if name == "steering_rate_limit" else SHARE for name in names]
    return np.array(sizes) * np.array(shares)


def block_of(runs: Sequence[WindowedRun]) -> np.ndarray:
    """Block [windows of all runs] that each window's start lies in."""
    out: list[np.ndarray] = []
    first = 0
    for run in runs:
        out.append(first + (run.starts * run.period / BLOCK).astype(int))
        first = int(out[-1].max(initial=first - 1)) + 1
    return np.asarray(np.unique(np.concatenate(out), return_inverse=True)[1])


def huber_weights(e: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Weights [windows, 1, channels] that clip a window's error in a channel."""
    size = np.sqrt(np.mean((e / scales) ** 2, axis=1, keepdims=True))
    return np.asarray(np.minimum(1.0, CLIPPED / np.maximum(size, 1e-9)))


def flat_scores(e: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Clipped errors in robust scales [windows, HORIZONS * channels]."""
    return np.asarray((e / scales * huber_weights(e, scales)).reshape(len(e), -1))


@dataclasses.dataclass(frozen=True)
class Day:
    """Runs of one day beside the calibrated car: errors, their derivatives, and the blocks."""

    runs: Sequence[WindowedRun]
    constants: Constants
    own: Effects
    errors: np.ndarray  # of the calibrated car [windows, HORIZONS, channels]
    jacobian: np.ndarray  # in scales [windows, HORIZONS * channels, n]
    block: np.ndarray  # [windows]
    run: np.ndarray  # [windows] index of the run
    weights: np.ndarray  # [windows] below one where the car is driven harder than on the day of calibration

    @property
    def ahead(self) -> list[str]:
        """The horizons in words."""
        return [f"{h:g} s" for h in self.runs[0].horizons]

    @property
    def blocks(self) -> int:
        return int(self.block.max()) + 1

    @property
    def recordings(self) -> np.ndarray:
        """Index [runs] of the recording that each run is a part of."""
        return np.unique([run.recording for run in self.runs], return_inverse=True)[1]

    @property
    def recording_count(self) -> float:
        """How many recordings of equal length the windows are worth."""
        windows = np.bincount(self.recordings[self.run]).astype(float)
        return float(windows.sum() ** 2 / np.sum(windows**2))

    def errors_with(self, effects: Mapping[str, float], horizons: int = HORIZONS) -> np.ndarray:
        """Errors [windows, horizons, channels] once effects are added to the calibrated car."""
        return errors(self.runs, self.constants, added(self.own, effects), horizons)


def make_day(
    runs: Sequence[WindowedRun], constants: Constants, own: Effects, names: Sequence[str], steps: np.ndarray,
    normal: Normal | None = None, threads: int = THREADS,
) -> Day:  # fmt: skip
    """A day's errors under the calibrated car and their derivatives by the effects `names`, in units of `steps`.

    Args:
        normal: what is normal for the car; None on the day of calibration, which shows it.
    """
    at = errors(runs, constants, own)
    scales = robust_scales(at) if normal is None else normal.scales
    cars = [added(own, {name: float(step)}) for name, step in zip(names, steps, strict=True)]
    with ThreadPoolExecutor(threads) as pool:
        moved = errors_of_all(runs, constants, cars, pool)
    columns = [np.clip((e - at) / scales, -LARGEST, LARGEST).reshape(len(at), -1) for e in moved]
    run = np.repeat(np.arange(len(runs)), [len(run.starts) for run in runs])
    weights = np.ones(len(at)) if normal is None else familiarity(runs, normal.covered)
    return Day(runs, constants, own, at, np.stack(columns, axis=-1), block_of(runs), run, weights)


def drive_coverage(runs: Sequence[WindowedRun]) -> np.ndarray:
    """How hard the car was driven [4] (`windows.regimes`)."""
    return np.asarray(np.quantile(np.concatenate([regimes(run) for run in runs]), COVERED, axis=0) * np.array(GRACE))


def familiarity(runs: Sequence[WindowedRun], covered: np.ndarray) -> np.ndarray:
    """Weights [windows] that fall where a window is driven harder than `covered`: there the car is not known."""
    beyond = np.concatenate([regimes(run) for run in runs]) / np.maximum(covered, 1e-9) - 1.0
    return np.asarray(1.0 / (1.0 + (np.maximum(beyond.max(axis=1), 0.0) / BEYOND) ** 2))


def block_scores(day: Day, e: np.ndarray, scales: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """Scores [blocks, n] of errors e."""
    weighted = day.weights[:, None] * flat_scores(e, scales)
    score = np.einsum("wip,wi->wp", day.jacobian, weighted @ precision, optimize=True)
    out = np.zeros((day.blocks, score.shape[1]))
    np.add.at(out, day.block, score)
    return out


def block_information(day: Day, scales: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """Sum over the blocks of the information [n, n] that clipped errors hold."""
    weights = np.broadcast_to(huber_weights(day.errors, scales), day.errors.shape).reshape(len(day.errors), -1)
    half = np.sqrt(weights * day.weights[:, None])[..., None] * day.jacobian
    return np.asarray(np.einsum("wip,ij,wjq->pq", half, precision, half, optimize=True))


def between_recordings(names: Sequence[str], vehicle: VehicleParameters) -> np.ndarray:
    """Standard deviations [n] of effects from one recording to the next, whatever a calibration's recordings show."""
    return np.array([RECORDING_SHARE * CATALOGUE[n].least_for(vehicle) if CATALOGUE[n].varies else 0.0 for n in names])


def pulls(scores: np.ndarray, blocks: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """By how much each recording pulls the estimate away from that of the others, to first order [K, n].

    Args:
        scores: derivatives of half the squared errors of each recording, at the estimate [K, n]; blocks: of time in
            each [K]; covariance: inverse of the second derivatives of all, prior and all [n, n].
    """
    # What all recordings share is no difference between them: the estimate leaves it, whichever is left out.
    beyond = scores - np.outer(blocks / blocks.sum(), scores.sum(axis=0))
    return np.asarray(-beyond @ covariance)


def spread(pulled: np.ndarray) -> np.ndarray:
    """Covariance [n, n] of what single recordings ask for, from what each pulls the estimate by [K, n].

    Of an estimate from all K it is the K-th part. Zero of one recording, which shows none.
    """
    count = len(pulled)
    return np.asarray(count**2 / max(count - 1, 1) * pulled.T @ pulled)


def shrunk(seen: np.ndarray, alone: np.ndarray, information: np.ndarray, count: int, chance: float = 0.0) -> np.ndarray:
    """Covariance [n, n] from recording to recording, towards one that is alike in all directions that the logs show.

    In units of what the logs leave open: as many times that as has been seen over all directions, beyond chance (Ledoit
    and Wolf 2004, with that metric in place of the identity).

    Args:
        seen: of the recordings (`spread`) [n, n]; alone: covariance of the estimate, prior and logs [n, n];
        information: of the logs [n, n], without the prior; count: of the recordings; chance: how many times that would
            be seen of recordings that do not differ.
    """
    shown = alone @ information
    size = max(float(np.trace(np.linalg.solve(alone, seen)) / np.trace(shown)) - chance, 0.0)
    share = ALIKE / (ALIKE + count - 1.0)
    return np.asarray((1.0 - share) * seen + share * size * shown @ alone)


class Learnt(NamedTuple):
    """What a day of calibration shows of its car."""

    normal: Normal
    pulled: np.ndarray  # by how much each recording pulls the effects, in units [recordings, n]
    between: np.ndarray  # covariance of the effects over all recordings from that, in units [n, n]


def learn_normal(day: Day, names: Sequence[str], steps: np.ndarray, prior: np.ndarray, everyday: np.ndarray) -> Learnt:
    """What is normal, from the day of calibration.

    Args:
        day: the logs that the car was calibrated on, under the calibrated car; steps: units of the effects `names`;
        prior: standard deviations [n] of the effects, in their units, before those logs; everyday: the same of what
            they differ by from one recording to the next at least (`between_recordings`).
    """
    scales = robust_scales(day.errors)
    f = flat_scores(day.errors, scales)
    precision = np.linalg.inv(np.cov(f.T) + REGULAR * np.eye(f.shape[1]))
    score = block_scores(day, day.errors, scales, precision)
    information = block_information(day, scales, precision)
    scatter = np.maximum(np.cov(score.T), 0.0) * np.eye(len(names)) if len(score) < 3 else np.cov(score.T)
    scatter = scatter + 1e-12 * np.trace(scatter) * np.eye(len(names))
    deviation = np.sqrt(np.diag(scatter))
    shrink = min(SHRUNK * SHRUNK_AT / len(score), 0.9)
    correlation = (1.0 - shrink) * scatter / np.outer(deviation, deviation) + shrink * np.eye(len(names))
    covariance = correlation * np.outer(deviation, deviation)
    seen = np.diag(information) > 0.0
    ratio = float(np.mean(np.diag(covariance)[seen] * len(score) / np.diag(information)[seen]))
    temper = max(ratio, 1.0) * CALIBRATED
    alone = np.linalg.inv(np.diag(1.0 / prior**2) + information / temper)
    by_recording, blocks = scores_by_recording(day, score)
    pulled = pulls(by_recording / temper, blocks, alone)
    model_form = np.diag((np.array([MODEL_FORM.get(name, 0.0) for name in names]) / steps) ** 2)
    seen_apart = spread(pulled)
    # Blocks' scatter alone pulls recordings apart by a share of what is left open that is their number over CALIBRATED.
    chance = len(pulled) / CALIBRATED
    recording = shrunk(seen_apart, alone, information / temper, len(pulled), chance) + np.diag(everyday**2)
    unknown = alone + model_form + recording / len(pulled)
    run_of_block = np.array([day.run[day.block == k][0] for k in range(len(score))])
    modes = np.array([score[run_of_block == k].mean(axis=0) for k in np.unique(run_of_block)])
    offset = np.median(day.errors, axis=0)
    level = capped_squares((day.errors - offset) / scales).mean(axis=0)
    normal = Normal(
        names=tuple(names), stride=day.runs[0].stride, units=steps, scales=scales, precision=precision,
        blocks=len(score), mean=score.mean(axis=0), covariance=covariance, modes=modes,
        information=np.diag(information) / len(score), covered=drive_coverage(day.runs), unknown=unknown,
        recording=recording, offset=offset, level=level,
    )  # fmt: skip
    return Learnt(normal, pulled, seen_apart / len(pulled))


def scores_by_recording(day: Day, score: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scores summed over each recording [K, n], and its number of blocks [K]; score: of the blocks [blocks, n]."""
    of_block = np.zeros(day.blocks, dtype=int)
    of_block[day.block] = day.recordings[day.run]
    out = np.zeros((int(of_block.max()) + 1, score.shape[1]))
    np.add.at(out, of_block, score)
    return out, np.bincount(of_block)


@dataclasses.dataclass(frozen=True)
class Scatter:
    """How a day's summed scores scatter if nothing has changed, and their mean."""

    mean: np.ndarray  # [n]
    covariance: np.ndarray  # [n, n]
    inverse: np.ndarray  # of the covariance [n, n]

    def weight(self, apart: float = 0.0) -> np.ndarray:
        """The inverse covariance [n, n] once each score scatters by a further share `apart` of its variance, alone."""
        if apart == 0.0:
            return self.inverse
        return np.asarray(np.linalg.inv(self.covariance + apart * np.diag(np.diag(self.covariance))))


def scatter_of(day: Day, normal: Normal) -> Scatter:
    """The normal scatter of this day's scores: of blocks, of what calibration left unknown, of each new recording."""
    parts = [
        block_information(dataclasses.replace(day, weights=day.weights * (day.recordings[day.run] == k)),
                          normal.scales, normal.precision)
        for k in range(int(day.recordings.max()) + 1)
    ]  # fmt: skip
    information = np.sum(parts, axis=0)
    per_block = np.diag(information) / day.blocks
    grown = np.sqrt(per_block / np.maximum(normal.information, 1e-300 + 1e-6 * per_block))
    covariance = BETWEEN_DAYS * day.blocks * normal.covariance * np.outer(grown, grown)
    covariance = covariance + information @ normal.unknown @ information
    covariance = covariance + np.sum([part @ normal.recording @ part for part in parts], axis=0)
    mixed = day.blocks / len(normal.modes) * normal.modes
    covariance = covariance + mixed.T @ mixed
    covariance += 1e-9 * np.diag(np.diag(covariance)) + 1e-12 * np.eye(len(per_block))
    return Scatter(normal.mean * day.blocks, covariance, np.linalg.inv(covariance))


def summed(day: Day, normal: Normal, e: np.ndarray, kept: np.ndarray | None = None) -> np.ndarray:
    """Scores [n] of errors e summed over the day's blocks, or over those that are `kept` [blocks] (bool)."""
    score = block_scores(day, e, normal.scales, normal.precision)
    return np.asarray(score.sum(axis=0) if kept is None else score[kept].sum(axis=0))
