"""The populations of simulated vehicles."""

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.drawn import USUAL
from drift_drake.car.effects.magnitudes import Effects, make_effects
from experiments.benchmarks.vehicles import EXTREME, OUT_OF_DISTRIBUTION, POPULATIONS, draw_effects


def test_vehicles_are_reproducible_and_differ() -> None:
    drawn = {(p, i, seed): draw_effects(p, i, seed) for p in POPULATIONS for i in range(3) for seed in (0, 1)}
    assert len(set(drawn.values())) == len(drawn)
    assert draw_effects("held_out", 2, 1) == drawn["held_out", 2, 1]


def test_magnitudes_lie_in_their_distributions_and_in_the_catalogue() -> None:
    for population, stated in (("train", USUAL), ("wide", OUT_OF_DISTRIBUTION)):
        effects = [draw_effects(population, i, 0) for i in range(300)]
        for name in CATALOGUE:
            values = np.array([getattr(q, name) for q in effects])
            if name not in stated:
                assert (values == 0.0).all(), name
                continue
            d = stated[name]
            assert CATALOGUE[name].low <= d.low < d.high <= CATALOGUE[name].high, name
            assert ((values >= d.low) & (values <= d.high)).all(), name
            np.testing.assert_allclose(values.mean(), 0.5 * (d.low + d.high), atol=0.12 * (d.high - d.low))
            assert values.std() > 0.15 * (d.high - d.low), name


def test_the_population_out_of_distribution_is_wider_and_has_effects_that_training_lacks() -> None:
    assert set(USUAL) < set(OUT_OF_DISTRIBUTION)
    wider = [
        name
        for name, d in USUAL.items()
        if OUT_OF_DISTRIBUTION[name].high - OUT_OF_DISTRIBUTION[name].low > d.high - d.low
    ]
    assert set(wider) == set(USUAL)


def test_extreme_vehicles_have_one_effect_each_in_turn() -> None:
    assert draw_effects("nominal", 3, 1) == Effects()
    assert draw_effects("extreme", 0, 0) == make_effects({"friction_level": -0.35})
    assert draw_effects("extreme", 2, 5) == draw_effects("extreme", 2 + len(EXTREME), 0)
