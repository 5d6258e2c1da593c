"""Axle stiffnesses that follow the axle loads."""

import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import static_loads
from drift_drake.car.single_track.motion_with_effects import changed_constants
from drift_drake.gap.evidence.hypotheses import FOLLOWING, with_load

P = VehicleParameters().constants()


@pytest.mark.parametrize(("name", "magnitude"), [("mass_error", 0.15), ("cg_shift", 0.08), ("cg_shift", -0.05)])
def test_stiffness_over_load_stays(name, magnitude):
    assert name in FOLLOWING
    car = changed_constants(P, make_effects(with_load(name, magnitude, 1.0, P)))
    before, after = static_loads(P), static_loads(car)
    assert car.front_stiffness / after[0] == pytest.approx(P.front_stiffness / before[0])
    assert car.rear_stiffness / after[1] == pytest.approx(P.rear_stiffness / before[1])


def test_other_effects_bring_nothing_along():
    assert with_load("steering_lag", 0.1, 1.0, P) == {"steering_lag": 0.1}


@pytest.mark.parametrize("name", FOLLOWING)
def test_a_share_of_none_leaves_stiffnesses(name):
    effects = make_effects(with_load(name, 0.1, 0.0, P))
    assert (effects.front_stiffness_error, effects.rear_stiffness_error) == (0.0, 0.0)
