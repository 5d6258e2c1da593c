"""The corrected vehicle: what an answer found, added to the vehicle file's numbers by hand."""

import dataclasses

import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.gap.diagnosis.answers.answer import Answer, InvalidAnswerError
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


def test_deviations_of_a_single_track_file_are_not_put_on_a_double_track_car():
    off, coupe = dataclasses.replace(DRAG, tolerances=OFF), CARS["coupe"]
    with pytest.raises(InvalidAnswerError, match=r"monday was diagnosed with a single-track .* or --no-tolerances"):
        corrected_vehicle(coupe, off)
    vehicle, effects = corrected_vehicle(coupe, off, tolerances=False)
    assert vehicle == coupe
    assert effects.aero_drag == 1.75
    assert corrected_vehicle(coupe, dataclasses.replace(DRAG, tolerances={"mass": 0.0}))[0] == coupe


def test_an_effect_that_a_double_track_car_cannot_have_is_not_put_on_one():
    loads = dataclasses.replace(DRAG, causes=["lateral_load_transfer"], details={},
                                magnitudes={"lateral_load_transfer": Interval(0.2, 0.1, 0.3)})  # fmt: skip
    with pytest.raises(InvalidVehicleError, match="lateral_load_transfer cannot be put on a double-track car"):
        corrected_vehicle(CARS["coupe"], loads)
