"""Hypotheses of a change from a baseline: effects with their most likely magnitudes, and what loads bring along."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.equations import CarConstants, kind_of
from drift_drake.gap.estimation.baseline import Scatter
from drift_drake.gap.estimation.prior import Range
from drift_drake.gap.estimation.scores import Day
from drift_drake.gap.evidence.left_over import LeftOver

FADES = 0.2  # of the practical range, over which a prior falls off beyond it
BUILD = 0.5  # `daily` below which an effect is of the car's build
FOLLOWING = tuple(name for name, effect in CATALOGUE.items() if effect.moves_loads)
LOADED = frozenset(("front_stiffness_error", "rear_stiffness_error"))  # what a real tyre does then


@dataclasses.dataclass(frozen=True)
class Hypothesis:
    """One change with its most likely magnitudes."""

    names: tuple[str, ...]
    magnitudes: np.ndarray  # [k]
    covariance: np.ndarray  # [k, k]
    nats: float  # half the squared distance of its scores from normal
    log_evidence: float
    follows_load: float = 0.0  # share by which axle stiffnesses follow the loads (`with_load`)
    additional: Mapping[str, float] = dataclasses.field(
        default_factory=dict
    )  # of the car's build, unseen by calibration
    scores: int = 0  # that judge it
    by_factor: np.ndarray | float = 0.0  # [K] log evidence at each of the factors, less that at the main one
    among: np.ndarray | float | None = None  # [K] relative to other causes', whose shapes are not exact either
    left_over: LeftOver | None = None  # what it leaves over; None where it was not judged at the changed car

    def effects(self, day: Day, magnitudes: np.ndarray | None = None) -> dict[str, float]:
        """What is added to the calibrated car, with other magnitudes [k] if they are given."""
        q = self.magnitudes if magnitudes is None else magnitudes
        return added_up(effects_of(self.names, q, self.follows_load, day), self.additional)


def added_up(one: Mapping[str, float], other: Mapping[str, float]) -> dict[str, float]:
    """The sum of two sets of effects by name."""
    return {name: one.get(name, 0.0) + other.get(name, 0.0) for name in {**one, **other}}


def as_change(h: Hypothesis) -> Hypothesis:
    """A pair with one effect of the car's build as the other alone: a car's build does not change by the day.

    That effect stays in addition, as something that calibration has not seen.
    """
    built = [name for name in h.names if CATALOGUE[name].daily < BUILD]
    if len(h.names) != 2 or len(built) != 1:
        return h
    at = 1 - h.names.index(built[0])
    return dataclasses.replace(
        h, names=(h.names[at],), magnitudes=h.magnitudes[[at]], covariance=h.covariance[[at]][:, [at]],
        additional={built[0]: float(h.magnitudes[1 - at])},
    )  # fmt: skip


def effects_of(names: Sequence[str], magnitudes: np.ndarray, follows_load: float, day: Day) -> dict[str, float]:
    """Effects by name; those that the loads bring along are added."""
    out: dict[str, float] = {}
    for name, magnitude in zip(names, magnitudes, strict=True):
        parts = with_load(name, float(magnitude), follows_load, day.constants)
        out = added_up(out, {key: value for key, value in parts.items() if value != 0.0 or key == name})
    return out


def with_load(name: str, magnitude: float, share: float, constants: CarConstants) -> dict[str, float]:
    """Effects of a magnitude whose axle stiffnesses follow a share of what the static loads change by.

    In the catalogue what moves loads leaves the stiffnesses as they are. A real tyre's follows its load, which is
    another signature of the same cause.

    Args:
        constants: of the calibrated car, whose axle distances a shift of its centre of gravity changes.
    """
    if name not in FOLLOWING or not LOADED.isdisjoint(kind_of(constants).lacks):
        return {name: magnitude}
    distances = -float(constants.rear_axle_distance), float(constants.front_axle_distance)
    front, rear = distances if CATALOGUE[name].unit == "m" else (1.0, 1.0)
    return {
        name: magnitude,
        "front_stiffness_error": share * magnitude / front,
        "rear_stiffness_error": share * magnitude / rear,
    }


def concluded(
    names: tuple[str, ...], q: np.ndarray, covariance: np.ndarray, nats: float, ranges: Sequence[Range],
    follows: float,
) -> Hypothesis:  # fmt: skip
    """A fitted hypothesis with its Laplace evidence under flat priors over the ranges."""
    widths = np.array([r.width for r in ranges])
    sign, logdet = np.linalg.slogdet(covariance)
    occam = 0.5 * len(q) * np.log(2.0 * np.pi) + 0.5 * (logdet if sign > 0.0 else 0.0) - float(np.sum(np.log(widths)))
    fades = float(np.sum([unusual(x, r) for x, r in zip(q, ranges, strict=True)]))
    return Hypothesis(names, q, covariance, nats, -nats - fades + min(float(occam), 0.0), follows)


def unusual(q: np.ndarray | float, r: Range) -> np.ndarray:
    """By how much a magnitude's log prior falls off beyond what is usual, heavy-tailed."""
    below = r.usual[0] - q if r.low < 0.0 else 0.0
    beyond = np.maximum(np.maximum(q - r.usual[1], below), 0.0) / (FADES * r.usual[1])
    return np.asarray(2.0 * np.log1p(0.5 * np.square(beyond)))


def integrated(q: np.ndarray, scores: np.ndarray, r: Range, scatter: Scatter) -> np.ndarray:
    """Log evidence of one effect at each of the factors [K], integrated over the magnitudes that would be a gap.

    Args:
        q: magnitudes, ascending [k]; scores: with them, less their normal mean [k, m].
    """
    log_density = np.where(r.allows(q), scatter.log_densities(scores) - unusual(q, r) - np.log(r.width), -np.inf)
    top = np.max(log_density, axis=1)
    return np.asarray(top + np.log(np.trapezoid(np.exp(log_density - top[:, None]), q, axis=1)))
