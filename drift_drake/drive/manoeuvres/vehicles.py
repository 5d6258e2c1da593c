"""The simulated vehicles xi that the drives are made with: the nominal car and several effects, drawn together.

Each effect of `TRAINING` is drawn for every vehicle from the distribution stated here, independently of the others;
held-out vehicles come from the same distributions under other seeds. `WIDE` stretches each of them and adds effects
that training never saw, `EXTREME` has single effects far beyond them: vehicles out of distribution. "nominal" is the
nominal car, without an effect: its actuators follow at once, which those of no training vehicle do.
"""

from typing import Literal, NamedTuple

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects, make_effects

Population = Literal["train", "validation", "held_out", "wide", "extreme", "nominal"]
POPULATIONS: tuple[Population, ...] = ("train", "validation", "held_out", "wide")


class Distribution(NamedTuple):
    """A normal distribution cut at `low` and `high`; a standard deviation of infinity makes it uniform."""

    mean: float
    deviation: float
    low: float
    high: float


def _normal(deviation: float, bound: float, mean: float = 0.0) -> Distribution:
    return Distribution(mean, deviation, mean - bound, mean + bound)


def _uniform(low: float, high: float) -> Distribution:
    return Distribution(0.5 * (low + high), float("inf"), low, high)


TRAINING: dict[str, Distribution] = {
    "friction_level": _normal(0.08, 0.16, mean=-0.04),
    "front_rear_friction_split": _normal(0.04, 0.08),
    "front_stiffness_error": _normal(0.15, 0.3),
    "rear_stiffness_error": _normal(0.15, 0.3),
    "tyre_relaxation": _uniform(0.15, 0.5),
    "sliding_friction_drop": _uniform(0.05, 0.15),
    "longitudinal_load_transfer": _uniform(0.3, 0.6),
    "lateral_load_transfer": _uniform(0.05, 0.12),
    "mass_error": _uniform(-0.05, 0.12),
    "yaw_inertia_error": _normal(0.1, 0.2),
    "steering_lag": _uniform(0.03, 0.07),
    "torque_lag": _uniform(0.05, 0.15),
    "torque_gain_error": _normal(0.07, 0.14),
    "aero_drag": _uniform(0.4, 1.0),
}

# Effects that training never saw, each in its catalogue's range.
_UNSEEN: dict[str, Distribution] = {
    "cg_shift": _uniform(-0.06, 0.06),
    "steering_offset": _uniform(-0.015, 0.015),
    "drivetrain_inertia_error": _uniform(-0.2, 0.4),
    "drivetrain_friction": _uniform(40.0, 150.0),
    "differential_yaw_moment": _uniform(40.0, 150.0),
}

WIDENING = 1.5  # of every distribution's spread about its mean


EXTREME: tuple[dict[str, float], ...] = (
    {"friction_level": -0.35},
    {"rear_stiffness_error": -0.4},
    {"steering_lag": 0.2},
    {"mass_error": 0.2},
)


def _widened(name: str, d: Distribution) -> Distribution:
    info = CATALOGUE[name]
    low, high = d.mean - WIDENING * (d.mean - d.low), d.mean + WIDENING * (d.high - d.mean)
    return Distribution(d.mean, WIDENING * d.deviation, max(low, info.low), min(high, info.high))


WIDE: dict[str, Distribution] = {name: _widened(name, d) for name, d in TRAINING.items()} | _UNSEEN


def draw_effects(population: Population, index: int, seed: int) -> Effects:
    """The effects of vehicle `index` of a population: the same for the same arguments, whatever else is drawn.

    Those of `EXTREME` come in turn, with nothing drawn; the nominal car has none.
    """
    if population == "nominal":
        return Effects()
    if population == "extreme":
        return make_effects(EXTREME[index % len(EXTREME)])
    generator = np.random.default_rng([seed, POPULATIONS.index(population), index])
    distributions = WIDE if population == "wide" else TRAINING
    return make_effects({name: _draw(d, generator) for name, d in distributions.items()})


def _draw(d: Distribution, generator: np.random.Generator) -> float:
    while True:
        value = generator.uniform(d.low, d.high) if np.isinf(d.deviation) else generator.normal(d.mean, d.deviation)
        if d.low <= value <= d.high:
            return float(value)
