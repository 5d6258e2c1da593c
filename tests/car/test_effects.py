"""The catalogue's effects as a whole: each is tested, none acts where it is zero."""

from pathlib import Path

import numpy as np
import pytest
from effect_cars import (
    COASTING,
    DRIFTING,
    SIDEWAYS,
    WHEELSPIN,
    at_rest_of,
    simulate,
)

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.on_path import PLANT_STATES
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.plant import VehiclePlant


def test_every_effect_has_its_test():
    assert tuple(CATALOGUE) == Effects._fields
    tests = "".join(path.read_text() for path in Path(__file__).parent.glob("test_effects_of_*.py"))
    assert [name for name in CATALOGUE if f"def test_{name}(" not in tests] == []


def test_names_that_are_not_in_the_catalogue():
    with pytest.raises(ValueError, match=r"unknown effect wind; the catalogue has friction_level, .*power_limit$"):
        make_effects({"wind": 1.0})


@pytest.mark.parametrize("coupling", [0.0, 0.7])
@pytest.mark.parametrize("state", [COASTING, WHEELSPIN, SIDEWAYS, DRIFTING])
def test_without_effects_it_is_the_nominal_car(state, coupling):
    car = VehicleParameters(front_coupling=coupling)
    bare, plant = VehiclePlant(car), VehiclePlant(car, make_effects({"mass_error": 0.1}))
    nominal = bare.EvalTimeDerivatives(at_rest_of(bare, state, (0.1, 120.0))).CopyToVector()
    context = at_rest_of(plant, state, (0.1, 120.0))
    context.get_mutable_numeric_parameter(1).SetFromVector(Effects())
    switched_off = plant.EvalTimeDerivatives(context).CopyToVector()[: len(PLANT_STATES)]
    np.testing.assert_allclose(switched_off, nominal[:], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_small_magnitude_changes_little(name):
    """No effect jumps as it is switched on; those of the sensors and the delay leave the motion alone."""
    nominal = simulate({}, COASTING, 1.0, (0.05, 100.0))[0][:10]
    tiny = simulate({name: 1e-3 * CATALOGUE[name].high}, COASTING, 1.0, (0.05, 100.0))[0][:10]
    if name in LIMITS:  # a tiny limit is a stuck steering, or no engine
        tiny = simulate({name: 1e4}, COASTING, 1.0, (0.05, 100.0))[0][:10]
    np.testing.assert_allclose(tiny, nominal, atol=0.02)
