"""How scores scatter from one recording of a car to the next where nothing has changed, from its calibration's logs.

A linear mixed model (Laird and Ware 1982). A stretch of driving with information I has the scores -I (d + e) + n: d is
what the car always deviates by, of which its baseline tells what its drives show; e is what the equations ask for
otherwise on one stretch than on another, small for sensors and actuators, larger for tyres and body; n is the scatter
of blocks of time, which hangs together within a stretch and grows with the slip of the driven tyres. So what both days
share cancels, and what the baseline did not show widens the scatter only where the other day's drives depend on it. The
scale of n is the car's own: recordings are left out of the baseline in turn and asked how far they lie from what the
others predict, together with what is known of other cars. How large e is differs from car to car by more than a few
recordings tell: a factor on it is integrated over (a scale mixture of normal distributions, Andrews and Mallows 1974).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prediction_constants import (
    FACTORS,
    HANGS,
    HARDER,
    KIND_PRIOR,
    KIND_VARIES,
    LEFT_OF_FITTED,
    LEFT_OF_OTHERS,
    MORE_SO,
    OFF_SHAPE,
    PARTIAL_PRIOR,
    PARTIAL_VARIES,
    SHRUNK,
    SLIGHT,
    TYRES_AND_BODY,
)
from drift_drake.gap.estimation.scores import (
    Day,
    block_information,
    block_scores,
    summed_over,
    window_scores,
)
from drift_drake.gap.estimation.windows import WindowedRun, regimes

TINY = 1e-9  # of the mean variance of scores, that a direction without any gets


class Stretches(NamedTuple):
    """Scores and information of stretches of driving, each within one recording."""

    scores: np.ndarray  # [K, m]
    information: np.ndarray  # [K, m, m]
    blocks: np.ndarray  # [K] of time
    harder: np.ndarray  # [K] times the variance of a baseline's blocks, by how much the tyres slip
    recording: np.ndarray  # [K] index

    def kept(self, which: np.ndarray) -> "Stretches":
        """Those of a mask [K]."""
        return Stretches(*(part[which] for part in self))


class Spread(NamedTuple):
    """How scores scatter: from block to block, and from stretch to stretch and recording to recording in units."""

    covariance: np.ndarray  # from block to block [m, m]
    information: np.ndarray  # diagonal of a block's information [m]
    ratio: float  # of that scatter to the one that the information tells of
    blocks: int  # that show it
    stretch: np.ndarray  # variances from stretch to stretch [m]
    recording: np.ndarray  # variances from recording to recording [m]

    def times(self, factor: float) -> "Spread":
        """The same of a car whose equations lack so many times as much from stretch to stretch."""
        return self._replace(stretch=factor**2 * self.stretch)

    def of_blocks(self, information: np.ndarray, blocks: np.ndarray | float) -> np.ndarray:
        """Covariances of stretches' scores that their blocks make [..., m, m].

        Args:
            information: of each stretch [..., m, m]; blocks: of time in each [...].
        """
        count = np.asarray(blocks)[..., None, None]
        own = np.diagonal(information, axis1=-2, axis2=-1) / count[..., 0]
        grown = np.sqrt(own / np.maximum(self.information, 1e-300 + 1e-6 * own))
        known = SHRUNK / (SHRUNK + self.blocks)
        seen = (1.0 - known) * self.covariance * (grown[..., :, None] * grown[..., None, :])
        seen += known * self.ratio * information / count
        out = count * (1.0 + HANGS * (count - 1.0)) * seen
        variance = np.diagonal(out, axis1=-2, axis2=-1)
        alone = OFF_SHAPE * variance + TINY * np.mean(variance, axis=-1, keepdims=True) + 1e-300
        return np.asarray(out + alone[..., None] * np.eye(len(self.information)))

    def of_each(self, some: Stretches, scale: float = 1.0) -> np.ndarray:
        """Covariances of stretches' scores, but for what varies from recording to recording [K, m, m]."""
        lacking = (some.information * self.stretch) @ some.information
        return lacking + scale * some.harder[:, None, None] * self.of_blocks(some.information, some.blocks)

    def of_stretches(self, some: Stretches, scale: float = 1.0) -> np.ndarray:
        """Covariance of the summed scores of stretches of one recording [m, m]; scale: of what their blocks make."""
        total = some.information.sum(axis=0)
        return np.asarray((total * self.recording) @ total + self.of_each(some, scale).sum(axis=0))


class Known(NamedTuple):
    """What is known of a car's deviations [m], as a normal distribution."""

    mean: np.ndarray  # [m]
    covariance: np.ndarray  # [m, m]


def slipping_of(day: Day) -> np.ndarray:
    """How much the tyres slip along the wheels in each window [windows], as a logarithm."""
    return slipping_in(day.runs)


def slipping_in(runs: Sequence[WindowedRun]) -> np.ndarray:
    """The same of the windows of runs."""
    return np.asarray(np.log(SLIGHT + np.concatenate([regimes(run)[:, -1] for run in runs])))


def stretches_of(day: Day, scales: np.ndarray, precision: np.ndarray, slipping: float) -> Stretches:
    """A day's stretches, under the car that it is judged by; slipping: mean of `slipping_of` its baseline's windows."""
    slips = slipping_of(day) - slipping
    stretch = day.stretch
    each = [stretch == k for k in range(int(stretch.max()) + 1)]
    return Stretches(
        summed_over(window_scores(day, day.errors, scales, precision), stretch),
        np.array([block_information(day, scales, precision, windows) for windows in each]),
        np.array([float(len(np.unique(day.block[windows]))) for windows in each]),
        np.array([np.exp(HARDER * np.mean(slips[windows])) for windows in each]),
        np.array([day.recordings[day.run[windows][0]] for windows in each]),
    )


def known_from(stretches: Stretches, model: Spread, prior: np.ndarray) -> Known:
    """What stretches tell of a car's deviations; prior: standard deviations [m] before them."""
    return known_without(stretches, model, prior, [np.zeros(len(stretches.blocks), dtype=bool)])[0]


def known_without(
    stretches: Stretches, model: Spread, prior: np.ndarray, left_out: Sequence[np.ndarray]
) -> list[Known]:
    """The same without the stretches of each mask [K]; of a recording that has none of them it is computed once."""
    each, out = model.of_each(stretches), []
    recordings = [np.flatnonzero(stretches.recording == k) for k in np.unique(stretches.recording)]
    parts = [(stretches.information[k], stretches.scores[k], each[k]) for k in recordings]

    def shown(part: tuple[np.ndarray, ...], kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Precision and pull that a recording adds."""
        information, scores, covariance = (np.tensordot(kept.astype(float), one, 1) for one in part)
        covariance = (information * model.recording) @ information + covariance
        solved = np.linalg.solve(covariance, np.column_stack([information, scores]))
        return information @ solved[:, :-1], -information @ solved[:, -1]

    whole = [shown(part, np.ones(len(part[0]))) for part in parts]
    for mask in left_out:
        precision, pull = np.diag(1.0 / prior**2), np.zeros(len(prior))
        for k, part, of_all in zip(recordings, parts, whole, strict=True):
            if not mask[k].all():
                more = shown(part, ~mask[k]) if mask[k].any() else of_all
                precision, pull = precision + more[0], pull + more[1]
        covariance = np.linalg.inv(0.5 * (precision + precision.T))
        out.append(Known(covariance @ pull, covariance))
    return out


@dataclass(frozen=True)
class Scatter:
    """How a day's summed scores scatter if nothing has changed, and their mean."""

    mean: np.ndarray  # [m]
    covariances: np.ndarray  # at each of the factors on what equations lack from stretch to stretch [K, m, m]
    information: np.ndarray  # of the day: what a unit of each effect takes off the scores [m, m]
    main: int = 0  # index of the factor that was the most probable before the day

    @property
    def covariance(self) -> np.ndarray:
        """At the main factor [m, m]."""
        return np.asarray(self.covariances[self.main])

    @property
    def inverse(self) -> np.ndarray:
        """Of that covariance [m, m]."""
        return np.asarray(self.inverses[self.main])

    @cached_property
    def inverses(self) -> np.ndarray:
        """Of all covariances [K, m, m]."""
        return np.linalg.inv(self.covariances)

    @cached_property
    def sizes(self) -> np.ndarray:
        """Half the logarithm of each determinant less that of the main one [K]."""
        halves = 0.5 * np.linalg.slogdet(self.covariances)[1]
        return np.asarray(halves - halves[self.main])

    def log_densities(self, scores: np.ndarray) -> np.ndarray:
        """Of scores less their mean [m] or [n, m] at each of the factors [K] or [K, n], but for a constant."""
        squared = np.sum((scores @ self.inverses) * scores, axis=-1)
        return np.asarray(-0.5 * squared - self.sizes.reshape(-1, *[1] * (scores.ndim - 1)))

    def apart(self, share: float) -> "Scatter":
        """The same once each score scatters by a further share of its variance, alone."""
        alone = np.eye(len(self.mean)) * np.diagonal(self.covariances, axis1=1, axis2=2)[:, :, None]
        return replace(self, covariances=self.covariances + share * alone) if share else self


def predicted(stretches: Stretches, known: Known, models: Sequence[Spread], scale: float = 1.0,
              main: int = 0) -> Scatter:  # fmt: skip
    """How the summed scores of stretches scatter, of a car of which something is known.

    Args:
        models: at each factor; main: index of the most probable one;
        scale: of what blocks scatter by and of what is not known of the car. What equations lack from stretch to
            stretch and what varies from recording to recording is known of other cars: recordings of the same kinds of
            driving would show too little of it.
    """
    total = stretches.information.sum(axis=0)
    parts = [stretches.kept(stretches.recording == k) for k in np.unique(stretches.recording)]
    covariances = np.array([sum(model.of_stretches(part, scale) for part in parts) for model in models])
    covariances += scale * total @ known.covariance @ total
    return Scatter(-total @ known.mean, 0.5 * (covariances + np.swapaxes(covariances, 1, 2)), total, main)


def scatter_of(day: Day, normal: Normal) -> Scatter:
    """How this day's scores scatter if the car is the one of its baseline."""
    stretches = stretches_of(day, normal.scales, normal.precision, normal.slipping)
    model = spread_of(normal, normal.names, normal.least_deviations, len(normal.of_kind))
    known, models = Known(normal.expected, normal.left_open), [model.times(factor) for factor in FACTORS]
    return predicted(stretches, known, models, normal.scale, normal.main)


def spread_of(shown: "Seen | Normal", names: tuple[str, ...], least_deviations: np.ndarray, of_kind: int = 0) -> Spread:
    """How scores scatter, by what a baseline shows of the effects `names` and what varies by itself, in units [n].

    of_kind: scores of deviations of the car's kind, the last.
    """
    scores = len(shown.information)
    recording = np.concatenate([least_deviations, np.zeros(scores - len(names))]) ** 2
    return Spread(shown.covariance, shown.information, shown.ratio, shown.blocks,
                  variances_of_stretches(names, scores, of_kind), recording)  # fmt: skip


def variances_of_stretches(names: tuple[str, ...], scores: int, of_kind: int = 0) -> np.ndarray:
    """Variances [m], in units, of what effects, partial effects and deviations of the car's kind are worth from one
    stretch to the next."""
    kinds = [CATALOGUE[name] for name in names]
    own = [MORE_SO if one.rolls else TYRES_AND_BODY if one.of_tyres_or_body else 0.0 for one in kinds]
    return np.array(own + [PARTIAL_VARIES] * (scores - len(names) - of_kind) + [KIND_VARIES] * of_kind) ** 2


def left_of(prior: np.ndarray, fitted: np.ndarray) -> np.ndarray:
    """Standard deviations [n] of what a calibrated car may deviate by, before its scores are looked at.

    Args:
        prior: of the effects before calibration [n]; fitted: which of them were [n] (bool).
    """
    return np.asarray(np.where(fitted, LEFT_OF_FITTED, LEFT_OF_OTHERS) * prior)


def with_partial(left: np.ndarray, scores: int, of_kind: int = 0) -> np.ndarray:
    """The same of effects [n], their partial effects and deviations of the car's kind [m]."""
    partial = np.full(scores - len(left) - of_kind, PARTIAL_PRIOR)
    return np.concatenate([left, partial, np.full(of_kind, KIND_PRIOR)])


class Seen(NamedTuple):
    """What a baseline shows, before anything is believed of cars."""

    stretches: Stretches
    covariance: np.ndarray  # from block to block, as hard as it is driven on the whole [m, m]
    information: np.ndarray  # diagonal of a block's information [m]
    ratio: float  # of that scatter to the one that the information tells of
    blocks: int
    slipping: float  # mean of `slipping_of`
    score: np.ndarray  # of the blocks [blocks, m]


def seen_of(day: Day, scales: np.ndarray, precision: np.ndarray) -> Seen:
    """What a day of calibration shows, under the calibrated car."""
    slipping = float(np.mean(slipping_of(day)))
    stretches = stretches_of(day, scales, precision, slipping)
    score, stretch = block_scores(day, day.errors, scales, precision), np.zeros(day.blocks, dtype=int)
    stretch[day.block] = day.stretch
    scatter = np.atleast_2d(np.cov((score / np.sqrt(stretches.harder[stretch])[:, None]).T))
    if len(score) <= 2:
        scatter = np.maximum(scatter, 0.0) * np.eye(score.shape[1])
    diagonal = np.diag(stretches.information.sum(axis=0))
    shown = diagonal > TINY * diagonal.max()
    ratio = max(float(np.median(np.diag(scatter)[shown] * len(score) / diagonal[shown])), TINY)
    return Seen(stretches, scatter, diagonal / len(score), ratio, len(score), slipping, score)
