"""Scores of a car's prediction errors: each window's error projected on what an effect would do to it.

Scores of blocks of time show, direction by direction, what a calibrated car lacks and how that scatters
(`estimation.baseline` says how those of another recording scatter). Directions are the effects of the catalogue, and
some of them in part of the driving only (`gap.estimation.partial`).

Recordings differ: batteries empty, tyres warm up, wind turns, a sensor is aligned anew, and equations that do not
follow the car ask for other parameters on a circle than in a slalom. Blocks of time within a recording do not show
that, whole recordings do: each is one draw (Liang and Zeger 1986). A few recordings show little of it: what is known to
vary from recording to recording (`Effect.varies`) is taken to, by less than a gap; and by how much recordings differ is
read off all that the logs show together, since a few recordings differ in few directions, and the next one will in
others.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants, kind_of
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.effort import is_slow
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.partial import free_columns, partial_columns, standards
from drift_drake.gap.estimation.robust_fit import robust_scales
from drift_drake.gap.estimation.unknowns import added
from drift_drake.gap.estimation.windows import THREADS, WindowedRun, errors, errors_of_all, regimes

BLOCK = 2.0  # [s]
STRETCH = 12.0  # [s], about, of a run over which what the equations lack hangs together
CLIPPED = 4.0  # robust scales at which a window's error in a channel is clipped (Huber)
LARGEST = 20.0  # robust scales of a derivative
SHARE = 0.25  # of the practical range, that derivatives are taken over
GAINS = {"gyro_gain_error": 0, "speed_gain_error": 1, "wheel_radius_error": 3}  # of sensors, and their channels
RATE_LIMIT_SHARE = 0.5  # the same of a limit, which acts only where it is low
COVERED = 0.98  # quantile of the calibration's windows, up to which a regime is known
GRACE = (1.0, 1.0, 1.5, 1.5)  # times it, by `windows.regimes`: a changed car slides more on the same drive
BEYOND = 0.15  # share beyond, at which a window counts half
ALIKE = 4.0
"""Recordings that the belief that recordings differ alike in all that logs show is worth, relative to those that were
seen (validation days and recordings)."""
RECORDING_SHARE = 0.5  # of the least gap: what an effect deviates by from recording to recording, two are a gap


def units(names: Sequence[str], vehicle: VehicleParameters) -> np.ndarray:
    """Magnitudes [n] that derivatives are taken over."""
    sizes = [max(abs(q) for q in CATALOGUE[name].range_for(vehicle)) for name in names]
    shares = [RATE_LIMIT_SHARE if CATALOGUE[name].limit else SHARE for name in names]
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


class Predictions:
    """Errors of cars that have been asked for, by their effects; those of some windows of others are a part of them."""

    def __init__(self, of: "Predictions | None" = None, which: np.ndarray | None = None) -> None:
        self._found = dict[Effects, np.ndarray]()
        self._of, self._which = of, which

    def get(self, effects: Effects) -> np.ndarray | None:
        """Errors [windows, HORIZONS, channels], if they are known."""
        whole = self._of.get(effects) if self._of is not None and effects not in self._found else None
        return self._found.get(effects) if whole is None else whole[self._which]

    def keep(self, effects: Effects, e: np.ndarray) -> None:
        self._found[effects] = e


@dataclasses.dataclass(frozen=True)
class Day:
    """Runs of one day relative to the calibrated car: errors, their derivatives, and the blocks."""

    runs: Sequence[WindowedRun]
    constants: CarConstants
    own: Effects
    errors: np.ndarray  # of the calibrated car [windows, HORIZONS, channels]
    jacobian: np.ndarray  # in scales [windows, HORIZONS * channels, m]: of the effects, then `partial_effects`
    block: np.ndarray  # [windows]
    run: np.ndarray  # [windows] index of the run
    weights: np.ndarray  # [windows] below one where the car is driven harder than on the day of calibration
    standard: np.ndarray  # of the driving, on the day of calibration (`partial.standards`)
    kind_units: np.ndarray  # of the deviations of the car's kind, in their standard deviations [k]
    predictions: Predictions = dataclasses.field(default_factory=Predictions, repr=False)  # of a slow simulator

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
    def stretch(self) -> np.ndarray:
        """Index [windows] of the stretch of about `STRETCH` seconds, within one run, that each window is of."""
        at = np.concatenate([(run.starts - run.starts[:1]) * run.period for run in self.runs])
        lasts = [float(np.ptp(run.starts)) * run.period if len(run.starts) else 0.0 for run in self.runs]
        count = np.array([max(round(last / STRETCH), 1) for last in lasts])
        length = np.maximum(np.array(lasts) / count, 1e-9)[self.run]
        own = np.minimum((at / length).astype(int), count[self.run] - 1)
        first = np.concatenate([[0], np.cumsum(count)[:-1]])
        return np.asarray(np.unique(first[self.run] + own, return_inverse=True)[1])

    def kept(self, which: np.ndarray) -> "Day":
        """The day of some of its windows; which: [windows] (bool)."""
        starts = [run.starts[which[self.run == k]] for k, run in enumerate(self.runs)]
        runs = [dataclasses.replace(run, starts=np.ascontiguousarray(of_run))
                for run, of_run in zip(self.runs, starts, strict=True) if len(of_run)]  # fmt: skip
        parts = {name: getattr(self, name)[which] for name in ("errors", "jacobian", "weights")}
        block, run = (np.unique(index[which], return_inverse=True)[1] for index in (self.block, self.run))
        known = Predictions(self.predictions, which)
        return dataclasses.replace(self, runs=runs, block=block, run=run, predictions=known, **parts)

    def errors_with(self, effects: Mapping[str, float]) -> np.ndarray:
        """Errors [windows, HORIZONS, channels] once effects are added to the calibrated car."""
        return self.errors_with_each([effects])[0]

    def errors_with_each(self, some: Sequence[Mapping[str, float]], threads: int = THREADS) -> list[np.ndarray]:
        """The same of several cars; a slow simulator is asked for none twice."""
        cars = [added(self.own, effects) for effects in some]
        if not is_slow(self.constants):
            return errors_of_all(self.runs, [(self.constants, effects) for effects in cars], threads)
        unknown = [effects for effects in dict.fromkeys(cars) if self.predictions.get(effects) is None]
        got = errors_of_all(self.runs, [(self.constants, effects) for effects in unknown], threads) if unknown else []
        for effects, found in zip(unknown, got, strict=True):
            self.predictions.keep(effects, found)
        return [e for effects in cars if (e := self.predictions.get(effects)) is not None]


def make_day(
    runs: Sequence[WindowedRun], constants: CarConstants, own: Effects, names: Sequence[str], steps: np.ndarray,
    normal: Normal | None = None, threads: int = THREADS, of_kind: np.ndarray | None = None,
    kind_units: np.ndarray | float = 1.0,
) -> Day:  # fmt: skip
    """A day's errors under the calibrated car and their derivatives by the effects `names`, in units of `steps`, by
    their partial ones, and by the deviations of the car's kind, in units of their standard deviations.

    Args:
        normal: the car's baseline; None on the day of calibration, which shows it;
        of_kind: derivatives by the deviations, where they are known near enough; kind_units: their units in standard
            deviations, those of `normal` if there is one.
    """
    at = errors(runs, constants, own)
    scales = robust_scales(at) if normal is None else normal.scales
    kind = kind_of(constants)
    cars = [(constants, added(own, {name: float(step)})) for name, step in zip(names, steps, strict=True)]
    if of_kind is None:
        cars += [(kind.deviated(constants, {name: 1.0}, own), own) for name in kind.deviations]
    found = errors_of_all(runs, cars, threads)
    by_effects, by_kind = found[: len(names)], found[len(names) :]
    moved = [moved_by(e, at, *effect) for e, *effect in zip(by_effects, names, steps, strict=True)]
    jacobian = np.stack([scaled(one, scales) for one in moved], axis=-1)
    standard = standards(runs) if normal is None else normal.standard
    free = {name: scaled(column, scales) for name, column in free_columns(runs, constants, own, at).items()}
    sizes = np.broadcast_to(kind_units if normal is None else normal.kind_units, len(kind.deviations))
    more = [of_kind]
    if of_kind is None:
        more = [size * scaled(e - at, scales)[..., None] for size, e in zip(sizes, by_kind, strict=True)]
    jacobian = np.concatenate([jacobian, partial_columns(jacobian, names, runs, standard, free)[1], *more], axis=-1)
    run = np.repeat(np.arange(len(runs)), [len(run.starts) for run in runs])
    weights = np.ones(len(at)) if normal is None else familiarity(runs, normal.covered)
    return Day(runs, constants, own, at, jacobian, block_of(runs), run, weights, standard, sizes)


def to_first_order(day: Day, normal: Normal, effects: Mapping[str, float]) -> np.ndarray:
    """What effects of the calibration's move the errors by, to first order [windows, HORIZONS, channels]."""
    at = [normal.names.index(name) for name in effects]
    moved = day.jacobian[..., at] @ (np.array(list(effects.values())) / normal.units[at])
    return np.asarray(moved.reshape(day.errors.shape) * normal.scales)


def moved_by(e: np.ndarray, at: np.ndarray, name: str, magnitude: float) -> np.ndarray:
    """What an effect moves errors by, [..., HORIZONS, channels] with and without it, without the noise of readings.

    A sensor's gain moves a reading by a share of it, and so by a share of its noise, of which the error holds the same:
    where little else is left, as behind a lead-in, scores would be off by it. The predicted reading takes its place.
    """
    moved = np.asarray(e - at)
    if name in GAINS:
        moved[..., GAINS[name]] += magnitude * at[..., GAINS[name]]
    return moved


def scaled(moved: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """What errors move by, in scales [windows, HORIZONS * channels], clipped."""
    return np.clip(moved / scales, -LARGEST, LARGEST).reshape(len(moved), -1)


def drive_coverage(runs: Sequence[WindowedRun]) -> np.ndarray:
    """How hard the car was driven [4] (`windows.regimes`)."""
    return np.asarray(np.quantile(np.concatenate([regimes(run) for run in runs]), COVERED, axis=0) * np.array(GRACE))


def familiarity(runs: Sequence[WindowedRun], covered: np.ndarray) -> np.ndarray:
    """Weights [windows] that fall where a window is driven harder than `covered`: there the car is not known."""
    beyond = np.concatenate([regimes(run) for run in runs]) / np.maximum(covered, 1e-9) - 1.0
    return np.asarray(1.0 / (1.0 + (np.maximum(beyond.max(axis=1), 0.0) / BEYOND) ** 2))


def window_scores(day: Day, e: np.ndarray, scales: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """Scores [windows, m] of errors e."""
    weighted = day.weights[:, None] * flat_scores(e, scales)
    return np.asarray(np.einsum("wip,wi->wp", day.jacobian, weighted @ precision, optimize=True))


def block_scores(day: Day, e: np.ndarray, scales: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """Scores [blocks, m] of errors e."""
    return summed_over(window_scores(day, e, scales, precision), day.block)


def summed_over(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Sums [groups, m] of values [windows, m] over groups [windows]."""
    out = np.zeros((int(group.max()) + 1, values.shape[1]))
    np.add.at(out, group, values)
    return out


def block_information(
    day: Day, scales: np.ndarray, precision: np.ndarray, kept: np.ndarray | None = None
) -> np.ndarray:
    """Sum over the blocks of the information [m, m] that clipped errors hold; kept: windows [windows] (bool) of it."""
    rows = np.arange(len(day.errors)) if kept is None else np.flatnonzero(kept)
    weights = np.broadcast_to(huber_weights(day.errors[rows], scales), day.errors[rows].shape).reshape(len(rows), -1)
    half = np.sqrt(weights * day.weights[rows, None])[..., None] * day.jacobian[rows]
    size = half.shape[-1]
    weighted = np.tensordot(half, precision, axes=(1, 0)).transpose(0, 2, 1).reshape(-1, size)
    return np.asarray(half.reshape(-1, size).T @ weighted)


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


def scores_by_recording(day: Day, score: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scores summed over each recording [K, n], and its number of blocks [K]; score: of the blocks [blocks, n]."""
    of_block = np.zeros(day.blocks, dtype=int)
    of_block[day.block] = day.recordings[day.run]
    out = np.zeros((int(of_block.max()) + 1, score.shape[1]))
    np.add.at(out, of_block, score)
    return out, np.bincount(of_block)


def summed(day: Day, normal: Normal, e: np.ndarray, kept: np.ndarray | None = None) -> np.ndarray:
    """Scores [m] of errors e summed over the day's blocks, or over those that are `kept` [blocks] (bool)."""
    score = block_scores(day, e, normal.scales, normal.precision)
    return np.asarray(score.sum(axis=0) if kept is None else score[kept].sum(axis=0))
