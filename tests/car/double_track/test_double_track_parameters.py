"""Parameters of a double-track car: checked, and its nearest single-track car."""

import pytest

from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters, TireParameters
from drift_drake.car.parameters import InvalidVehicleError

CAR = DoubleTrackParameters()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": -1.0}, r"mass \(m\) is -1; it must be positive, in kg"),
        ({"yaw_inertia": float("nan")}, r"yaw_inertia \(I_z\) is nan; give a finite number in kg m\^2"),
        ({"cg_height": -0.1}, "cg_height is -0.1; give zero or more"),
        ({"rolling_resistance": 120.0}, "rolling_resistance is 120; give a share of the weight, such as 0.012"),
        ({"torque_min": 500.0}, "must lie below torque_max"),
        ({"front_unsprung_mass": 1600.0}, "must weigh less than the car"),
        ({"wheel_inertia": 11.0}, "rear_axle_inertia .* holds both rear wheels; give at least twice"),
        ({"front_roll_stiffness": 1e3, "rear_roll_stiffness": 1e3}, "the car would fall over"),
    ],
)
def test_impossible_cars_are_refused(changes, message):
    with pytest.raises(InvalidVehicleError, match=message):
        CAR.replace(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shape": 2.2}, r"shape \(C\) is 2.2; give 1 to below 2"),
        ({"curvature": 1.5}, r"curvature \(E\) is 1.5; the Magic Formula takes 1 at most"),
        ({"load_sensitivity": 1.0}, "load_sensitivity .* give 0 to below 1"),
        ({"nominal_load": 0.0}, r"nominal_load \(F_z0\) is 0; it must be positive, in N"),
    ],
)
def test_impossible_tyres_are_refused(changes, message):
    with pytest.raises(InvalidVehicleError, match=message):
        TireParameters(**changes)


@pytest.mark.parametrize("car", CARS.values())
def test_the_nearest_single_track_car_shares_what_is_measured(car):
    single = car.single_track()
    for name in ("mass", "yaw_inertia", "front_axle_distance", "gear_ratio", "rear_axle_inertia", "torque_max"):
        assert getattr(single, name) == getattr(car, name)


def test_the_default_cars_nearest_one_is_of_the_default_single_track_cars_class():
    single, default = CAR.single_track(), CAR.single_track().__class__()
    for name in ("front_stiffness", "rear_stiffness", "friction"):
        assert getattr(single, name) == pytest.approx(getattr(default, name), rel=0.1)
