"""The double-track equations against independent derivations, symmetries and limits."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import brentq

from drift_drake.car.double_track.constants import changed_constants
from drift_drake.car.double_track.motion import (
    OwnStates,
    WheelForces,
    double_track_motion,
    ground_wrench,
    road_wheel_angles,
    roll_acceleration,
    roll_arm_moment,
    settled_states,
    sprung_mass,
    wheel_forces,
    wheel_loads,
)
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.effects.catalogue import CATALOGUE, OFF_THE_MOTION
from drift_drake.car.effects.magnitudes import NOT_ON_FOUR_WHEELS, Effects
from drift_drake.car.single_track.motion import motion
from experiments.benchmarks.rows import PERIOD, advance, row_states, start

CAR = DoubleTrackParameters()
NONE = Effects()


def own_states(z):
    return OwnStates(*z[5:-2])


def driven(car, v, delta, duration, effects=NONE, hold=True):
    """States [20] of a car that is steered in, its speed held by torque or left to itself."""
    p, rows = car.constants(), round(duration / PERIOD) + 1
    steering, torque = np.zeros(rows), np.zeros(rows)
    z, _ = start(np.array([0.0, v, 0.0, v]), (0.0, 0.0), p, effects)
    states = [z]
    for row in range(rows - 1):
        steering[row + 1] = delta * min(1.0, row * PERIOD)
        torque[row + 1] = 100.0 * (v - z[1]) if hold else 0.0
        z, _ = advance(z, row, steering, torque, p, effects)
        states.append(z)
    return np.array(states)


@pytest.mark.parametrize("car", CARS.values())
def test_steady_turn_has_the_understeer_that_stiffnesses_and_loads_give(car):
    """Linear range: delta = (L + K v^2) r / v, K = W_f/C_f - W_r/C_r + c_s W_f over gravity, from statics alone."""
    v, delta = 20.0, 0.004
    single = car.single_track()
    a, b = car.front_axle_distance, car.rear_axle_distance
    front, rear = car.mass * b / (a + b), car.mass * a / (a + b)
    gradient = front / single.front_stiffness - rear / single.rear_stiffness + car.steering_compliance * front
    z = driven(car, v, delta, 6.0)[-1]
    assert z[0] == pytest.approx(delta * z[1] / (a + b + gradient * z[1] ** 2), rel=0.01)
    assert z[2] == pytest.approx(z[0] * (b / z[1] - rear * z[1] / single.rear_stiffness), rel=0.03)


@pytest.mark.parametrize("car", CARS.values())
def test_wheel_loads_carry_the_weight_and_the_roll_moment(car):
    p = car.constants()
    a_x, a_y, g = 1.5, 4.0, car.gravity
    arm = roll_arm_moment(p)
    roll = arm * a_y / (p.front_roll_stiffness + p.rear_roll_stiffness - arm * g)  # steady
    left_front, right_front, left_rear, right_rear = wheel_loads(p, roll, 0.0, a_x, a_y)
    assert left_front + right_front + left_rear + right_rear == pytest.approx(car.mass * g, rel=1e-12)
    across = (right_front - left_front) * p.front_track / 2.0 + (right_rear - left_rear) * p.rear_track / 2.0
    assert across == pytest.approx(car.mass * a_y * car.cg_height + arm * g * roll, rel=1e-12)
    along = (left_rear + right_rear) * p.rear_axle_distance - (left_front + right_front) * p.front_axle_distance
    assert along == pytest.approx(car.mass * a_x * car.cg_height, rel=1e-12)


@pytest.mark.parametrize("car", CARS.values())
def test_a_car_rolls_as_far_as_its_springs_carry_the_moment_about_the_road(car):
    """Statics of the whole car: the side force at its height and the weight that the roll moves aside, on four wheels.

    The wheels' loads are those of the springs' deflection; where they balance those moments, nothing turns the body.
    """
    p, roll, g = car.constants(), 0.02, car.gravity
    unsprung = car.front_unsprung_mass + car.rear_unsprung_mass
    a, b = car.front_axle_distance, car.rear_axle_distance
    axis = (car.front_roll_center * b + car.rear_roll_center * a) / (a + b)
    arm = car.mass * car.cg_height - unsprung * car.wheel_radius - (car.mass - unsprung) * axis

    def out_of_balance(a_y):
        left_front, right_front, left_rear, right_rear = wheel_loads(p, roll, 0.0, 0.0, a_y)
        across = (right_front - left_front) * p.front_track / 2.0 + (right_rear - left_rear) * p.rear_track / 2.0
        return across - car.mass * a_y * car.cg_height - arm * g * roll

    a_y = brentq(out_of_balance, 0.1, 20.0, xtol=1e-12)
    still = OwnStates(*np.zeros(len(OwnStates._fields)))._replace(roll=roll)
    assert roll_acceleration(still, a_y, p) == pytest.approx(0.0, abs=1e-8)
    assert roll_acceleration(still, 1.2 * a_y, p) == pytest.approx(0.2 * arm * a_y / car.roll_inertia)
    damping = -car.roll_damping * 0.5 / car.roll_inertia
    assert roll_acceleration(still._replace(roll_rate=0.5), a_y, p) == pytest.approx(damping)


@pytest.mark.parametrize("car", CARS.values())
def test_settled_states_carry_their_own_roll_and_go_on_as_they_are(car):
    p, command = car.constants(), (0.03, 60.0)
    own = settled_states(0.3, 15.0, -0.02, 15.2, *command, p, NONE)
    _, rates = double_track_motion(0.3, 15.0, -0.02, 15.2, 0.0, own, *command, p, NONE)
    assert own.roll > 0.005
    assert rates.roll_rate == pytest.approx(0.0, abs=0.02)


def test_a_lifting_wheel_leaves_its_load_to_the_other():
    loads = wheel_loads(CAR.constants(), 0.4, 0.0, 0.0, 20.0)
    assert min(loads) > 0.0
    assert sum(loads) == pytest.approx(CAR.mass * CAR.gravity)


def test_loads_of_a_moving_car_go_on_carrying_its_weight():
    p = CAR.constants()
    for z in driven(CAR, 14.0, 0.12, 2.0)[::20]:
        own = own_states(z)
        loads = wheel_loads(p, own.roll, own.roll_rate, own.a_x, own.a_y)
        assert sum(loads) == pytest.approx(CAR.mass * CAR.gravity)


def mirrored(own):
    return OwnStates(
        -own.steering, own.torque, -own.rim_difference, -own.roll, -own.roll_rate, own.a_x, -own.a_y,
        -own.front_right_slip, -own.front_left_slip, -own.rear_right_slip, -own.rear_left_slip,
        own.rear_right_drive_slip, own.rear_left_drive_slip,
    )  # fmt: skip


def test_left_and_right_are_alike():
    p, q = CAR.constants(), Effects(road_grade=0.04, aero_drag=1.0, torque_lag=0.1, steering_lag=0.1)
    r, v, beta, omega_r, psi, delta, tau = 0.5, 13.0, -0.2, 14.5, 0.7, 0.15, 140.0
    own = OwnStates(0.12, 90.0, 0.6, 0.04, 0.1, 1.1, 5.0, -0.05, -0.06, -0.11, -0.12, 0.08, 0.12)
    m, rates = double_track_motion(r, v, beta, omega_r, psi, own, delta, tau, p, q)
    other, back = double_track_motion(-r, v, -beta, omega_r, -psi, mirrored(own), -delta, tau, p, q)
    assert (-other.r_dot, other.v_dot, -other.beta_dot, other.omega_r_dot, other.a_x, -other.a_y) == pytest.approx(m)
    assert mirrored(back) == pytest.approx(rates)


def energy(z, car):
    """[J] of the planar motion, the rear wheels, the roll and its springs."""
    p, own = car.constants(), own_states(z)
    r, v, _, omega_r = z[:4]
    spring = p.front_roll_stiffness + p.rear_roll_stiffness - roll_arm_moment(p) * p.gravity
    return 0.5 * (
        p.mass * v**2
        + p.yaw_inertia * r**2
        + p.rear_axle_inertia * (omega_r / p.wheel_radius) ** 2
        + 0.5 * p.wheel_inertia * (own.rim_difference / p.wheel_radius) ** 2
        + p.roll_inertia * own.roll_rate**2
        + spring * own.roll**2
    )


@pytest.mark.parametrize("car", CARS.values())
def test_a_coasting_car_loses_energy_all_along(car):
    states = driven(car, 18.0, 0.08, 5.0, hold=False)
    assert np.all(np.diff([energy(z, car) for z in states[::10]]) < 0.0)


def single_track_limit():
    """No height, hardly a track, tyres that are linear and alike in both directions: a single-track car."""

    def tire(stiffness):
        return dataclasses.replace(
            CAR.front_tire, lateral_stiffness=stiffness, longitudinal_stiffness=stiffness, lateral_friction=1e4,
            longitudinal_friction=1e4, load_sensitivity=0.0,
        )  # fmt: skip

    return CAR.replace(
        cg_height=0.0, front_roll_center=0.0, rear_roll_center=0.0, front_unsprung_mass=0.0, rear_unsprung_mass=0.0,
        front_track=1e-3, rear_track=1e-3, steering_compliance=0.0, aero_drag=0.0, rolling_resistance=0.0,
        front_tire=tire(9e4), rear_tire=tire(1.3e5),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("state", "command"),
    [((0.0, 12.0, 0.0, 12.0), (0.02, 0.0)), ((0.3, 15.0, -0.03, 15.4), (0.05, 120.0)),
     ((-0.4, 9.0, 0.05, 8.8), (-0.06, -30.0))],
)  # fmt: skip
def test_without_height_and_track_it_is_the_single_track_car_in_grip(state, command):
    car = single_track_limit()
    own = settled_states(*state, *command, car.constants(), NONE)
    m, rates = double_track_motion(*state, 0.0, own, *command, car.constants(), NONE)
    expected = motion(*state, *command, car.single_track().constants())
    np.testing.assert_allclose(m, expected, rtol=1e-3, atol=1e-3)
    assert rates.roll_rate == 0.0


def test_the_differential_is_open():
    """In a steady turn under power both rear tyres drive alike, whatever their loads, and their rims differ."""
    p = CAR.constants()
    own = own_states(driven(CAR, 13.0, 0.1, 6.0)[-1])
    forces = wheel_forces(own, p)
    loads = wheel_loads(p, own.roll, own.roll_rate, own.a_x, own.a_y)
    assert loads[3] > 1.5 * loads[2]
    assert forces.rear_left_x == pytest.approx(forces.rear_right_x, rel=1e-3)
    assert own.rim_difference > 0.0


def test_the_wrench_is_that_of_four_forces_at_four_places():
    p, left, right = CAR.constants(), 0.2, 0.17
    forces = WheelForces(3000.0, 4000.0, 500.0, 2500.0, 1500.0, 3500.0)

    def turned(angle, f_y):
        return np.array([-f_y * np.sin(angle), f_y * np.cos(angle)])

    a, b, front, rear = p.front_axle_distance, p.rear_axle_distance, p.front_track / 2.0, p.rear_track / 2.0
    places = [(a, front), (a, -front), (-b, rear), (-b, -rear)]
    acting = [turned(left, 3000.0), turned(right, 4000.0), np.array([500.0, 2500.0]), np.array([1500.0, 3500.0])]
    moment = sum(x * f[1] - y * f[0] for (x, y), f in zip(places, acting, strict=True))
    np.testing.assert_allclose(ground_wrench(forces, left, right, p), [*sum(acting), moment], rtol=1e-12)


def test_the_inner_front_wheel_turns_more_and_the_side_force_turns_both_back():
    p = CAR.constants()
    left, right = road_wheel_angles(0.3, 0.0, p)
    assert left > 0.3 > right
    assert np.tan(left) ** -1 - np.tan(right) ** -1 == pytest.approx(
        -CAR.ackermann * CAR.front_track / (CAR.front_axle_distance + CAR.rear_axle_distance), rel=0.15
    )
    assert road_wheel_angles(0.0, 5000.0, p) == pytest.approx((-0.005, -0.005), rel=0.01)


def test_the_centre_of_gravity_takes_its_loads_along():
    p, moved = CAR.constants(), changed_constants(CAR.constants(), Effects(cg_shift=0.1))
    before, after = (wheel_loads(c, 0.0, 0.0, 0.0, 0.0) for c in (p, moved))
    wheelbase = CAR.front_axle_distance + CAR.rear_axle_distance
    shift = CAR.mass * CAR.gravity * 0.1 / wheelbase
    assert after[2] + after[3] - before[2] - before[3] == pytest.approx(shift)


def test_added_mass_is_on_the_springs():
    p, heavy = CAR.constants(), changed_constants(CAR.constants(), Effects(mass_error=0.1))
    assert sprung_mass(heavy) - sprung_mass(p) == pytest.approx(0.1 * CAR.mass)


MOVING = tuple(name for name in Effects._fields if name not in OFF_THE_MOTION + NOT_ON_FOUR_WHEELS)


@pytest.mark.parametrize("name", MOVING)
def test_every_effect_on_the_motion_changes_it(name):
    states = [driven(CAR, 13.0, 0.1, 1.0, Effects(**{name: size}))[-1] for size in (0.0, 0.05)]
    assert np.max(np.abs(states[1][:4] - states[0][:4])) > 1e-6


@pytest.mark.parametrize("name", [name for name in OFF_THE_MOTION if CATALOGUE[name].stage == "sensor"])
def test_sensors_effects_leave_the_motion_alone(name):
    states = [driven(CAR, 13.0, 0.1, 0.2, Effects(**{name: size}))[-1] for size in (0.0, 0.05)]
    np.testing.assert_array_equal(*states)


def test_arrays_give_what_numbers_give():
    p = CAR.constants()
    own = OwnStates(*(np.full(3, value) for value in settled_states(0.3, 12.0, -0.05, 12.5, 0.1, 50.0, p, NONE)))
    v = np.array([10.0, 12.0, 15.0])
    m, rates = double_track_motion(0.3, v, -0.05, 12.5, 0.0, own, 0.1, 50.0, p, NONE)
    for i, speed in enumerate(v):
        one = OwnStates(*(value[i] for value in own))
        single, single_rates = double_track_motion(0.3, float(speed), -0.05, 12.5, 0.0, one, 0.1, 50.0, p, NONE)
        np.testing.assert_allclose([np.broadcast_to(value, 3)[i] for value in m], single, rtol=1e-12)
        np.testing.assert_allclose([np.broadcast_to(value, 3)[i] for value in rates], single_rates, rtol=1e-12)


def test_states_are_named():
    assert len(row_states(CAR.constants())) == 7 + len(OwnStates._fields) == len(driven(CAR, 10.0, 0.0, 0.1)[0])


def test_the_engines_power_limits_what_both_rear_wheels_and_the_differential_get():
    p, state = CAR.constants(), (0.6, 12.0, -0.5, 17.0)
    power = 60.0  # [kW]
    given = 1e3 * power * p.wheel_radius / (p.gear_ratio * state[3])
    own = settled_states(*state, -0.3, given, p, NONE)._replace(rim_difference=1.0)
    limited, rates = double_track_motion(*state, 0.2, own, -0.3, 5.0 * given, p, Effects(power_limit=power))
    whole, of_whole = double_track_motion(*state, 0.2, own, -0.3, given, p, NONE)
    np.testing.assert_allclose(limited, whole, rtol=1e-5)
    np.testing.assert_allclose(rates, of_whole, rtol=1e-5, atol=1e-9)
