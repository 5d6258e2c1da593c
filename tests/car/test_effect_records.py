"""Records of the package's own effects: their physics against formulas, and what other layers ask of them."""

import numpy as np
import pytest

from drift_drake.car.double_track.constants import changed_constants as changed_double_track
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects import changed
from drift_drake.car.effects.catalogue import CATALOGUE, OWN, PARAMETRIC, fitted, shown_by
from drift_drake.car.effects.delays import sensor_delay
from drift_drake.car.effects.magnitudes import (
    Effects,
    InternalStates,
    depends_on_heading,
    make_effects,
    measured,
    reading_gains,
    unbiased,
    with_double_track_forces,
    with_forces,
)
from drift_drake.car.parameters import Tolerance, VehicleParameters
from drift_drake.car.sensor_errors import SENSORS
from drift_drake.car.single_track.motion_with_effects import changed_constants

CAR = VehicleParameters().constants()
START = np.array([1.0, 2.0, 3.0])  # wrench of the tyres
STATES = np.random.default_rng(5).uniform([-1.0, 2.0, -0.8, 2.0, -3.0], [1.0, 30.0, 0.8, 40.0, 3.0], (40, 5))


def drawn(seed: int) -> Effects:
    chance = np.random.default_rng(seed)
    return make_effects({name: chance.uniform(effect.low, effect.high) for name, effect in OWN.items()})


@pytest.mark.parametrize("seed", range(3))
def test_further_forces_are_those_of_air_road_and_rear_axle(seed):
    q, weight = drawn(seed), CAR.mass * CAR.gravity
    for r, v, beta, omega_r, psi in STATES:
        slope = np.array([-weight * np.sin(q.road_grade) * np.cos(psi),
                          weight * (np.sin(q.road_grade) * np.sin(psi) - np.sin(q.road_bank)), 0.0])  # fmt: skip
        drag = -q.aero_drag * v**2 * np.array([np.cos(beta), np.sin(beta), 0.0])
        rest = np.array([-q.rolling_resistance * weight, 0.0, -q.differential_yaw_moment * r * v])
        found = with_forces(r, v, beta, omega_r, psi, CAR, q, InternalStates(), tuple(START))
        np.testing.assert_allclose(found, START + slope + drag + rest, rtol=1e-13, atol=1e-11)
        # The others are parameters of a double-track car, or nothing there.
        found = with_double_track_forces(r, v, beta, omega_r, psi, CAR, q, InternalStates(), tuple(START))
        np.testing.assert_allclose(found, START + slope, rtol=1e-13, atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_readings_have_gains_and_biases_and_lose_them(seed):
    q = drawn(seed)
    for r, v, beta, omega_r, _ in STATES:
        y = measured(r, v, beta, omega_r, q)
        gains = 1.0 + q.gyro_gain_error, 1.0 + q.speed_gain_error, 1.0, 1.0 + q.wheel_radius_error
        assert reading_gains(q) == gains
        formula = np.multiply(gains, (r, v, beta, omega_r)) + np.array([q.gyro_bias, 0.0, q.sideslip_bias, 0.0])
        np.testing.assert_allclose(y, formula, rtol=1e-15, atol=1e-15)
        np.testing.assert_allclose(unbiased(*y, q), (r, v, beta, omega_r), rtol=1e-13)
    assert sensor_delay(q) == q.sensor_latency


def test_without_effects_nothing_is_there():
    still = Effects()
    assert not any(still)
    for r, v, beta, omega_r, psi in STATES:
        assert not any(with_forces(r, v, beta, omega_r, psi, CAR, still, InternalStates(), (0.0, 0.0, 0.0)))
        assert measured(r, v, beta, omega_r, still) == (r, v, beta, omega_r)


def test_only_a_grade_makes_the_motion_depend_on_the_heading():
    headed = [name for name, effect in OWN.items() if depends_on_heading(make_effects({name: effect.high}))]
    assert headed == ["road_grade"]


def test_a_deviation_is_found_by_its_tolerance():
    assert {name for name, effect in OWN.items() if effect.tolerance} - {"steering_offset"} == PARAMETRIC
    assert all(hasattr(Tolerance(), str(OWN[name].tolerance)) for name in PARAMETRIC)
    for tolerance, name in (
        ("mass", "mass_error"),
        ("friction", "friction_level"),
        ("front_axle_distance", "cg_shift"),
        ("torque", "torque_gain_error"),
    ):
        assert [one for one, effect in OWN.items() if effect.tolerance == tolerance] == [name]
    changing = {name for name in OWN if changed_constants(CAR, make_effects({name: 0.1})) != CAR}
    assert changing == PARAMETRIC


@pytest.mark.parametrize("seed", range(3))
def test_parameters_change_alike_on_both_cars(seed):
    q, p, two = drawn(seed), CAR, DoubleTrackParameters().constants()
    for car, found in ((p, changed_constants(p, q)), (two, changed_double_track(two, q))):
        assert found.mass == car.mass * (1.0 + q.mass_error)
        assert found.yaw_inertia == car.yaw_inertia * (1.0 + q.yaw_inertia_error)
        assert found.front_axle_distance == car.front_axle_distance + q.cg_shift
        assert found.rear_axle_distance == car.rear_axle_distance - q.cg_shift
        assert found.rear_axle_inertia == car.rear_axle_inertia * (1.0 + q.drivetrain_inertia_error)
        assert found.gear_ratio == car.gear_ratio * (1.0 + q.torque_gain_error)
    single, double = changed_constants(p, q), changed_double_track(two, q)
    assert single.friction == p.friction * (1.0 + q.friction_level)
    sides = ("front", q.front_stiffness_error, 1.0), ("rear", q.rear_stiffness_error, -1.0)
    for axle, stiffer, sign in sides:
        split, tire, before = 1.0 + sign * q.front_rear_friction_split, f"{axle}_tire", f"{axle}_stiffness"
        assert getattr(single, before) == getattr(p, before) * (1.0 + stiffer)
        own, now = getattr(two, tire), getattr(double, tire)
        friction = (1.0 + q.friction_level) * split
        np.testing.assert_allclose(
            (now.lateral_stiffness, now.longitudinal_stiffness, now.lateral_friction, now.longitudinal_friction),
            (own.lateral_stiffness * (1.0 + stiffer), own.longitudinal_stiffness * (1.0 + stiffer),
             own.lateral_friction * friction, own.longitudinal_friction * friction), rtol=1e-15)  # fmt: skip
        assert getattr(changed, f"{axle}_friction")(1.0, q) == friction


def test_a_vector_of_magnitudes_keeps_its_order():
    """New effects come behind: vectors from before stay what they are."""
    names = list(Effects._fields)
    assert names[: len(OWN)] == list(OWN)
    assert names[:2] == ["friction_level", "front_rear_friction_split"]
    assert names[28:35] == ["steering_ratio_error", "gyro_gain_error", "speed_gain_error", "road_bank",
                            "command_clock_error", "longitudinal_stiffness_error", "power_limit"]  # fmt: skip


def test_other_layers_find_by_the_records_what_they_look_for():
    assert set(fitted("alone")) == {"steering_delay", "tyre_thermal_fade", "steering_rate_limit", "sensor_latency",
                                    "gyro_bias", "sideslip_bias", "power_limit"}  # fmt: skip
    assert set(fitted("drives")) - set(fitted("further")) == {
        "rolling_resistance", "drivetrain_friction", "differential_yaw_moment"
    }  # fmt: skip
    assert {name for name, effect in OWN.items() if effect.watched} == {
        "friction_level", "steering_ratio_error", "torque_gain_error", "steering_lag", "torque_lag", "steering_offset",
        "gyro_bias", "sideslip_bias",
    }  # fmt: skip
    assert set(fitted("further")) == {
        "steering_lag", "torque_lag", "aero_drag", "front_rear_friction_split", "longitudinal_load_transfer",
        "lateral_load_transfer", "tyre_relaxation", "sliding_friction_drop", "longitudinal_stiffness_error",
    }  # fmt: skip
    assert set(SENSORS) == {name for name, effect in CATALOGUE.items() if effect.stage == "sensor"} - {"sensor_latency"}
    ((words, names),) = shown_by(["gyro_bias"])
    assert (words, names) == (OWN["gyro_bias"].shown_by, ["gyro_bias"])
