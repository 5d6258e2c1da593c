"""Unknown magnitudes: priors, bounds, starts; deviations folded into a vehicle file."""

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion_with_effects import (
    changed_constants,
    motion_with_effects,
    settled_internal_states,
)
from drift_drake.gap.estimation.unknowns import BROAD, CAUTION, OWN, added, folded, magnitudes, unknown

CAR = VehicleParameters()


def test_own_deviations_are_those_of_a_tolerance():
    assert OWN
    assert all(
        getattr(BROAD, CATALOGUE[name].tolerance) >= getattr(CAR.tolerance, CATALOGUE[name].tolerance) for name in OWN
    )


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_start_lies_within_bounds_and_bounds_hold_the_practical_range(name):
    u = unknown(name, CAR, frozenset())
    low, high = CATALOGUE[name].range_for(CAR)
    assert u.low <= u.start <= u.high
    assert u.high >= high
    assert u.low <= low
    assert u.unit > 0.0
    # No car has a negative mass, inertia or stiffness, or an axle behind its centre of gravity.
    car = changed_constants(CAR.constants(), make_effects({name: u.low}))
    assert min(car[:10]) > 0.0


def test_stated_tolerances_are_believed_with_caution():
    broad, stated = (unknown("mass_error", CAR, names) for names in (frozenset(), frozenset({"mass"})))
    assert broad.prior == BROAD.mass
    assert stated.prior == pytest.approx(CAUTION * CAR.tolerance.mass)


def test_an_unsigned_effect_starts_a_little_way_into_its_range():
    assert unknown("steering_lag", CAR, frozenset()).start > 0.0  # where it has a derivative


def test_added_magnitudes_add_up():
    both = added(make_effects({"mass_error": 0.1}), magnitudes(["mass_error", "aero_drag"], np.array([0.05, 0.4])))
    assert both == make_effects({"mass_error": 0.1 + 0.05, "aero_drag": 0.4})


def test_folded_is_the_same_car():
    effects = make_effects(dict.fromkeys(OWN, 0.04) | {"tyre_relaxation": 0.3, "aero_drag": 0.5})
    vehicle, rest = folded(CAR, effects)
    assert rest.tyre_relaxation == 0.3
    assert rest.steering_offset == 0.04  # no parameter of a file
    assert rest.mass_error == rest.cg_shift == 0.0
    assert vehicle.tolerance == CAR.tolerance
    state = (0.6, 14.0, -0.15, 15.0)
    cars = [(CAR.constants(), effects), (vehicle.constants(), rest)]
    internal_count = [settled_internal_states(*state, 0.05, 80.0, *car) for car in cars]
    np.testing.assert_allclose(internal_count[1], internal_count[0], rtol=1e-12, atol=1e-12)
    one, two = (
        motion_with_effects(*state, 0.3, m, 0.05, 80.0, *car) for m, car in zip(internal_count, cars, strict=True)
    )
    np.testing.assert_allclose(two[0], one[0], rtol=1e-12)
    np.testing.assert_allclose(two[1], one[1], rtol=1e-9, atol=1e-12)
