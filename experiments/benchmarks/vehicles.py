"""The simulated vehicles xi that the drives are made with: the nominal car and several effects, drawn together.

Each effect of `car.effects.drawn` is drawn for every vehicle from the distribution in its record, independently of the
others; held-out vehicles come from the same distributions under other seeds. `OUT_OF_DISTRIBUTION` stretches each of
them and adds effects that training never saw, `EXTREME` has single effects far beyond them: vehicles out of
distribution.
"nominal" is the nominal car, without an effect: its actuators follow at once, which those of no training vehicle do.
"""

from typing import Literal

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.drawn import USUAL, drawn_effects
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.effects.record import Distribution

Population = Literal["train", "validation", "held_out", "wide", "extreme", "nominal"]
POPULATIONS: tuple[Population, ...] = ("train", "validation", "held_out", "wide")


_UNSEEN = {
    name: effect.drawn_out_of_distribution for name, effect in CATALOGUE.items() if effect.drawn_out_of_distribution
}

STRETCHED = 1.5  # of every distribution's spread about its mean

EXTREME: tuple[dict[str, float], ...] = (
    {"friction_level": -0.35},
    {"rear_stiffness_error": -0.4},
    {"steering_lag": 0.2},
    {"mass_error": 0.2},
)


def _out_of_distribution(name: str, d: Distribution) -> Distribution:
    info = CATALOGUE[name]
    low, high = d.mean - STRETCHED * (d.mean - d.low), d.mean + STRETCHED * (d.high - d.mean)
    return Distribution(d.mean, STRETCHED * d.deviation, max(low, info.low), min(high, info.high))


OUT_OF_DISTRIBUTION: dict[str, Distribution] = {
    name: _out_of_distribution(name, d) for name, d in USUAL.items()
} | _UNSEEN


def draw_effects(population: Population, index: int, seed: int) -> Effects:
    """The effects of vehicle `index` of a population: the same for the same arguments, whatever else is drawn.

    Those of `EXTREME` come in turn, with nothing drawn; the nominal car has none.
    """
    if population == "nominal":
        return Effects()
    if population == "extreme":
        return make_effects(EXTREME[index % len(EXTREME)])
    generator = np.random.default_rng([seed, POPULATIONS.index(population), index])
    return drawn_effects(generator, OUT_OF_DISTRIBUTION if population == "wide" else USUAL)
