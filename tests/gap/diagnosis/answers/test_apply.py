"""The corrected vehicle: what an answer found, added to the vehicle file's numbers by hand."""

import dataclasses

import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.answers.apply import corrected_vehicle
from drift_drake.gap.estimation.prior import Interval

CAR = VehicleParameters()
NOTHING = Interval(0.0, 0.0, 0.0)
NONE = Answer("monday", "none", [], {"none": 1.0}, ["none"], {}, {}, NOTHING, 1.0, {}, {}, [])
DRAG = dataclasses.replace(
    NONE, verdict="effect", causes=["aero_drag"], posterior={"aero_drag": 1.0},
    magnitudes={"aero_drag": Interval(1.5, 1.2, 1.8), "steering_lag": Interval(0.1, 0.0, 0.2)},
    details={"with": {"steering_offset": 0.01, "aero_drag": 0.25}},
)  # fmt: skip
OFF = {"mass": 2.0, "wheel_radius": -1.0, "front_axle_distance": 3.0, "torque": -0.5, "steering_offset": 1.5}
"""Tolerances that a car is off, in standard deviations of the vehicle file."""


def test_deviations_are_so_many_of_the_files_tolerances():
    vehicle, effects = corrected_vehicle(CAR, dataclasses.replace(NONE, tolerances=OFF))
    assert vehicle.mass == pytest.approx(1650.0 * 1.02)
    assert vehicle.wheel_radius == pytest.approx(0.337 * 0.998)
    assert vehicle.gear_ratio == pytest.approx(10.6 * 0.99)
    assert vehicle.front_stiffness == CAR.front_stiffness
    assert effects.steering_offset == pytest.approx(0.0015)  # [rad]


def test_a_centre_of_gravity_moves_between_axles_that_stay():
    vehicle, _ = corrected_vehicle(CAR, dataclasses.replace(NONE, tolerances={"front_axle_distance": 3.0}))
    assert vehicle.front_axle_distance == pytest.approx(1.23 + 0.03)
    wheelbase = vehicle.front_axle_distance + vehicle.rear_axle_distance
    assert wheelbase == pytest.approx(1.23 + 1.24, rel=1e-12)


def test_causes_and_what_comes_with_them_are_added_to_the_cars_own_effects():
    own = Effects(aero_drag=0.5, steering_lag=0.05)
    vehicle, effects = corrected_vehicle(CAR, dataclasses.replace(DRAG, tolerances=OFF), own=own)
    assert vehicle.mass == pytest.approx(1650.0 * 1.02)
    assert effects.aero_drag == pytest.approx(0.5 + 1.5 + 0.25)
    assert effects.steering_offset == pytest.approx(0.01 + 0.0015)
    assert effects.steering_lag == 0.05  # no cause


def test_tolerances_may_be_left_out_and_without_a_cause_nothing_comes_along():
    answer = dataclasses.replace(DRAG, tolerances=OFF)
    vehicle, effects = corrected_vehicle(CAR, answer, tolerances=False)
    assert vehicle == CAR
    assert effects == Effects(aero_drag=1.75, steering_offset=0.01)
    assert corrected_vehicle(CAR, dataclasses.replace(NONE, details=DRAG.details)) == (CAR, Effects())
