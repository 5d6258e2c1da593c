"""Cars as they differ from each other: effects drawn from the catalogue's distributions, each independently."""

from collections.abc import Mapping

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.effects.record import Distribution

USUAL: dict[str, Distribution] = {name: effect.drawn for name, effect in CATALOGUE.items() if effect.drawn}
"""What each car has, as those do that the learnt models are trained on."""


def drawn_effects(generator: np.random.Generator, distributions: Mapping[str, Distribution] = USUAL) -> Effects:
    """One car's effects."""
    return make_effects({name: _draw(d, generator) for name, d in distributions.items()})


def _draw(d: Distribution, generator: np.random.Generator) -> float:
    while True:
        value = generator.uniform(d.low, d.high) if np.isinf(d.deviation) else generator.normal(d.mean, d.deviation)
        if d.low <= value <= d.high:
            return float(value)
