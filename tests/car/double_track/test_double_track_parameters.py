"""Parameters of a double-track car: checked, and its nearest single-track car."""

import numpy as np
import pytest

from drift_drake.car.double_track.constants import changed_constants
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters, TireParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import InvalidVehicleError, Tolerance

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


@pytest.mark.parametrize("car", CARS.values())
def test_a_cars_numbers_go_together_as_those_of_passenger_cars_do(car):
    """Inertias, lean, damping and tyres against one another: what is known of cars of all sizes."""
    a, b, weight = car.front_axle_distance, car.rear_axle_distance, car.mass * car.gravity
    assert 0.8 < car.yaw_inertia / (car.mass * a * b) < 1.1  # the dynamic index
    assert 0.2 < car.roll_inertia / car.yaw_inertia < 0.26
    assert 1.5 < (a + b) / car.front_track < 1.9
    assert car.rear_track == pytest.approx(car.front_track, rel=0.02)
    assert 0.6 < 2.0 * car.cg_height / car.front_track < 0.75
    stiffness, tipping = car.front_roll_stiffness + car.rear_roll_stiffness, weight * car.cg_height
    assert 4.0 < np.degrees(tipping / (stiffness - tipping)) < 10.0  # of lean at one g
    assert 0.55 < car.front_roll_stiffness / stiffness < 0.7  # so that it understeers
    assert 0.25 < car.roll_damping / (2.0 * np.sqrt(car.roll_inertia * stiffness)) < 0.4
    assert 0.1 < (car.front_unsprung_mass + car.rear_unsprung_mass) / car.mass < 0.13
    assert car.rear_axle_inertia > 2.0 * car.wheel_inertia
    for tire, load in ((car.front_tire, weight * b), (car.rear_tire, weight * a)):
        static = 0.5 * load / (a + b)
        assert tire.nominal_load == pytest.approx(static, rel=0.1)
        assert 2.0 < tire.stiffest_load / static < 2.5
        assert 18.0 < tire.lateral_stiffness / static < 36.0
        assert 1.0 < tire.longitudinal_stiffness / tire.lateral_stiffness < 1.4
        assert 1.0 < tire.longitudinal_friction / tire.lateral_friction < 1.1
        assert tire.longitudinal_relaxation < 0.6 * tire.lateral_relaxation


def test_effects_change_each_number_that_they_are_of_and_no_other():
    p = CARS["rear_engined"].constants()
    changed = changed_constants(
        p, Effects(torque_gain_error=-0.2, aero_drag=0.3, rolling_resistance=0.01, tyre_relaxation=0.1)
    )
    wanted = p._replace(
        gear_ratio=0.8 * p.gear_ratio,
        aero_drag=p.aero_drag + 0.3,
        rolling_resistance=p.rolling_resistance + 0.01,
        front_tire=p.front_tire._replace(lateral_relaxation=p.front_tire.lateral_relaxation + 0.1),
        rear_tire=p.rear_tire._replace(lateral_relaxation=p.rear_tire.lateral_relaxation + 0.1),
    )
    np.testing.assert_allclose(np.hstack(changed), np.hstack(wanted), rtol=1e-12)


def test_axles_have_the_tyres_at_the_static_loads():
    """Pacejka's K = K_max sin(2 atan(F_z / F_zk)) and a friction linear in the load, of two tyres each."""
    car = CARS["rear_engined"]
    wheelbase = car.front_axle_distance + car.rear_axle_distance
    loads = [
        0.5 * car.mass * car.gravity * arm / wheelbase for arm in (car.rear_axle_distance, car.front_axle_distance)
    ]
    tires = [car.front_tire, car.rear_tire]
    stiffness = [2.0 * tire.lateral_stiffness * np.sin(2.0 * np.arctan(load / tire.stiffest_load))
                 for load, tire in zip(loads, tires, strict=True)]  # fmt: skip
    assert [car.front_stiffness, car.rear_stiffness] == pytest.approx(stiffness, rel=1e-12)
    friction = [tire.lateral_friction * (1.0 - tire.load_sensitivity * (load / tire.nominal_load - 1.0))
                for load, tire in zip(loads, tires, strict=True)]  # fmt: skip
    assert car.friction == pytest.approx(np.mean(friction), rel=1e-12)


def test_plain_data_and_constants_make_the_car_again():
    car = CARS["saloon"]
    assert car.with_constants(car.constants()) == car
    data = dict(car.to_dict()["double_track"])
    tires = {name: TireParameters(**data.pop(name)) for name in ("front_tire", "rear_tire")}
    assert DoubleTrackParameters(**data | tires | {"tolerance": Tolerance(**data["tolerance"])}) == car
