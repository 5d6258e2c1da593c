"""What a double-track car has that a vehicle file says nothing of moves what it is named for."""

import numpy as np
import pytest

from drift_drake.car.double_track.constants import flattened
from drift_drake.car.double_track.deviations import DEVIATIONS, deviated, value_of
from drift_drake.car.double_track.nearest import nearest_double_track
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.unknowns import deviations_of

FIRST = nearest_double_track(VehicleParameters()).constants()


def test_the_unknowns_move_what_they_are_named_for() -> None:
    same = deviated(FIRST, {}, Effects())
    np.testing.assert_allclose(flattened(same), flattened(FIRST), rtol=1e-12)
    for name, one in DEVIATIONS.items():
        car = deviated(FIRST, {name: 0.5}, Effects())
        changed = {field for field in car._fields if getattr(car, field) != getattr(same, field)}
        expected = {"roll_stiffness": {"front_roll_stiffness", "rear_roll_stiffness"},
                    "front_roll_share": {"front_roll_stiffness", "rear_roll_stiffness"}}.get(name)  # fmt: skip
        assert changed == (expected or ({name} if name in car._fields else {"front_tire", "rear_tire"})), name
        before, after = value_of(name, FIRST), value_of(name, car)
        assert after == pytest.approx(before * np.exp(0.5 * one.deviation) if one.relative
                                      else before + 0.5 * one.deviation)  # fmt: skip


def test_bounds_hold_the_first_guess_and_make_a_car() -> None:
    car = nearest_double_track(VehicleParameters())
    for unknown in deviations_of(FIRST):
        assert (unknown.low <= 0.0 <= unknown.high, unknown.prior) == (True, 1.0)
        for end in (unknown.low, unknown.high):
            car.with_constants(deviated(FIRST, {unknown.name: end}, Effects()))


def test_wheels_are_never_heavier_than_the_axle_that_they_are_a_part_of() -> None:
    light = Effects(drivetrain_inertia_error=-0.7)
    car = deviated(FIRST, {"wheel_inertia": 4.0}, light)
    assert 2.0 * car.wheel_inertia < 0.3 * FIRST.rear_axle_inertia
