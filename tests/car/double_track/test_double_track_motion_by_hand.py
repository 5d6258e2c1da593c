"""The double-track equations at a lively state, worked out anew from rigid bodies, forces at places and first lags."""

import numpy as np
import pytest

from drift_drake.car.double_track.motion import (
    LEAST_LOAD_SHARE,
    MIN_RELAXATION_SPEED,
    OwnStates,
    axle_loads,
    double_track_motion,
    road_wheel_angles,
    roll_arm_moment,
    wheel_forces,
    wheel_loads,
    wheel_motion,
)
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.double_track.tyres import tire_force
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.single_track.motion import MIN_SLIP_SPEED

R, V, BETA, OMEGA, DELTA, TAU = 0.7, 12.0, -0.35, 14.0, -0.2, 160.0
OWN = OwnStates(-0.15, 120.0, 1.6, 0.035, -0.2, 1.3, 6.0, -0.04, -0.05, -0.21, -0.18, 0.09, 0.14)
CAR = CARS["roadster"]
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


def places(car: DoubleTrackParameters) -> np.ndarray:
    """Of the wheels (front left, front right, rear left, rear right) from the centre of gravity [4, 2] [m]."""
    a, b, front, rear = car.front_axle_distance, car.rear_axle_distance, car.front_track / 2, car.rear_track / 2
    return np.array([[a, front], [a, -front], [-b, rear], [-b, -rear]])


def hub_velocities(car: DoubleTrackParameters, r: float, v: float, beta: float, roll_rate: float) -> np.ndarray:
    """[4, 2] of a rigid body; the whole mass's centre lies above the roll axis, which moves to its left under it."""
    centre = np.array([v * np.cos(beta), v * np.sin(beta) + roll_arm_moment(car.constants()) / car.mass * roll_rate, 0])
    return np.array([(centre + np.cross([0, 0, r], [*place, 0]))[:2] for place in places(car)])


def turned(angle: float) -> np.ndarray:
    """Rows: a wheel's directions ahead and to its left, in the body frame."""
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("speed", [V, -V, 0.3])
@pytest.mark.parametrize("car", CARS.values())
def test_slips_and_speeds_are_those_of_a_rigid_bodys_hubs(car: DoubleTrackParameters, speed: float) -> None:
    left, right, difference, roll_rate = -0.14, -0.16, 1.6, -0.2
    found = wheel_motion(R, speed, BETA, OMEGA, left, right, difference, roll_rate, car.constants())
    hubs = hub_velocities(car, R, speed, BETA, roll_rate)
    front = [turned(angle) @ hub for angle, hub in zip((left, right), hubs, strict=False)]
    rims = np.array([OMEGA - difference / 2, OMEGA + difference / 2])  # their mean and their difference
    wanted = (
        left, right, *(across / max(abs(ahead), MIN_SLIP_SPEED) for ahead, across in front),
        *(hubs[2:, 1] / rims), *((rims - hubs[2:, 0]) / rims), *(ahead for ahead, _ in front), *hubs[2:, 0],
    )  # fmt: skip
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)


def test_a_rim_that_hardly_turns_slips_by_the_floor_of_the_speed() -> None:
    found = wheel_motion(0.0, 3.0, 0.1, 0.2, 0.0, 0.0, 0.0, 0.0, CAR.constants())
    assert found.rear_left_drive_slip == pytest.approx((0.2 - 3.0 * np.cos(0.1)) / MIN_SLIP_SPEED)
    assert found.rear_right_slip == pytest.approx(3.0 * np.sin(0.1) / MIN_SLIP_SPEED)


def test_front_angles_differ_by_the_share_of_ackermanns_geometry() -> None:
    """To second order, by cot(outer) - cot(inner) = track / wheelbase, both by an angle that the force takes back."""
    car = CAR.replace(ackermann=1.0, steering_compliance=0.0)
    left, right = road_wheel_angles(0.01, 0.0, car.constants())
    wheelbase = car.front_axle_distance + car.rear_axle_distance
    assert 1.0 / np.tan(right) - 1.0 / np.tan(left) == pytest.approx(car.front_track / wheelbase, rel=1e-3)
    half = road_wheel_angles(0.01, 0.0, car.replace(ackermann=0.5).constants())
    assert half[0] - half[1] == pytest.approx(0.5 * (left - right))
    soft = road_wheel_angles(0.2, 4000.0, car.replace(ackermann=0.0, steering_compliance=2e-6).constants())
    assert soft == pytest.approx((0.192, 0.192))


def test_each_tyre_has_its_own_slip_and_load_and_its_axles_rubber() -> None:
    car = CARS["saloon"]
    p = car.constants()
    loads = wheel_loads(p, OWN.roll, OWN.roll_rate, OWN.a_x, OWN.a_y)
    assert len({round(load) for load in loads}) == 4
    slips = [
        (0.0, OWN.front_left_slip),
        (0.0, OWN.front_right_slip),
        (OWN.rear_left_drive_slip, OWN.rear_left_slip),
        (OWN.rear_right_drive_slip, OWN.rear_right_slip),
    ]
    tires = [p.front_tire, p.front_tire, p.rear_tire, p.rear_tire]
    forces = [tire_force(*slip, load, tire) for slip, load, tire in zip(slips, loads, tires, strict=True)]
    assert wheel_forces(OWN, p) == pytest.approx((forces[0][1], forces[1][1], *forces[2], *forces[3]), rel=1e-12)


@pytest.mark.parametrize("car", CARS.values())
def test_loads_balance_the_weight_and_what_springs_dampers_and_roll_centres_carry(car: DoubleTrackParameters) -> None:
    p, roll, roll_rate, a_x, a_y = car.constants(), 0.02, 0.1, 1.5, 3.0
    loads, (_, left), unsprung = (
        np.array(wheel_loads(p, roll, roll_rate, a_x, a_y)),
        places(car).T,
        car.front_unsprung_mass + car.rear_unsprung_mass,
    )
    assert loads.sum() == pytest.approx(car.mass * car.gravity)
    assert -loads @ places(car)[:, 0] == pytest.approx(car.mass * a_x * car.cg_height)
    a, b = car.front_axle_distance, car.rear_axle_distance
    axis = car.front_roll_center + (car.rear_roll_center - car.front_roll_center) * a / (a + b)
    carried = (car.front_roll_stiffness + car.rear_roll_stiffness) * roll + car.roll_damping * roll_rate
    direct = (car.mass - unsprung) * axis + unsprung * car.wheel_radius
    assert -loads @ left == pytest.approx(carried + direct * a_y)
    # The sprung mass's height above the axis, of the whole's centre of gravity.
    sprung_height = (car.mass * car.cg_height - unsprung * car.wheel_radius) / (car.mass - unsprung)
    assert roll_arm_moment(p) == pytest.approx((car.mass - unsprung) * (sprung_height - axis))


def test_friction_of_the_drivetrain_slows_the_rim_and_a_rate_limit_the_steering() -> None:
    p = CAR.constants()
    moves = [double_track_motion(R, V, BETA, OMEGA, 0.3, OWN, DELTA, TAU, p, q)
             for q in (Effects(), Effects(drivetrain_friction=40.0), Effects(steering_rate_limit=0.4))]  # fmt: skip
    slower = moves[1][0].omega_r_dot - moves[0][0].omega_r_dot
    assert slower == pytest.approx(-40.0 / CAR.rear_axle_inertia * CAR.wheel_radius, rel=1e-3)
    assert moves[2][1].steering == pytest.approx(-0.4)  # from -0.15 on to -0.2, and the wheel is where it is
    at = double_track_motion(R, V, BETA, OMEGA, 0.3, OWN, OWN.steering, TAU, p, Effects())
    assert moves[2][0][:3] == pytest.approx(at[0][:3])


def test_an_axle_keeps_its_least_load() -> None:
    p = CAR.constants()
    weight = CAR.mass * CAR.gravity
    for a_x, place in ((1e3, 0), (-1e3, 1)):
        loads = axle_loads(p, a_x)
        assert loads[place] == pytest.approx(LEAST_LOAD_SHARE * weight)
        assert sum(loads) == pytest.approx(weight)


def by_hand(
    car: DoubleTrackParameters, q: Effects, wrench: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """(rates of r, v, beta, omega_r and the acceleration, rates of the own states) by Newton, Euler and first lags."""
    p, f = car.constants(), wheel_forces(OWN, car.constants())
    angles = road_wheel_angles(OWN.steering + q.steering_offset, f.front_left + f.front_right, p)
    acting = np.array([turned(angles[0]).T @ [0, f.front_left], turned(angles[1]).T @ [0, f.front_right],
                       [f.rear_left_x, f.rear_left_y], [f.rear_right_x, f.rear_right_y]])  # fmt: skip
    weight = car.mass * car.gravity
    ground = acting.sum(axis=0) - [car.rolling_resistance * weight, 0.0]
    velocity = V * np.array([np.cos(BETA), np.sin(BETA)])
    a_x, a_y = (ground - car.aero_drag * V * velocity + wrench[:2]) / car.mass
    moment = np.cross(np.pad(places(car), ((0, 0), (0, 1))), np.pad(acting, ((0, 0), (0, 1))))[:, 2].sum() + wrench[2]
    # The acceleration of the velocity's components, u' - r w and w' + r u, in polar coordinates.
    rates = [a_x + R * velocity[1], a_y - R * velocity[0]]
    v_dot = velocity @ rates / V
    beta_dot = (velocity[0] * rates[1] - velocity[1] * rates[0]) / V**2
    pull, radius = f.rear_left_x + f.rear_right_x, car.wheel_radius
    spin = (car.gear_ratio * OWN.torque - pull * radius) / car.rear_axle_inertia * radius
    axle = [moment / car.yaw_inertia, v_dot, beta_dot, spin, a_x, a_y]

    w = wheel_motion(R, V, BETA, OMEGA, *angles, OWN.rim_difference, OWN.roll_rate, p)._asdict()
    front, rear, drive = (
        [car.front_tire.lateral_relaxation] * 2,
        [car.rear_tire.lateral_relaxation] * 2,
        [car.rear_tire.longitudinal_relaxation] * 2,
    )
    speeds = [abs(w[f"{wheel}_speed"]) for wheel in (*WHEELS, *WHEELS[2:])]
    slips = [*(f"{wheel}_slip" for wheel in WHEELS), *(f"{wheel}_drive_slip" for wheel in WHEELS[2:])]
    relaxing = [
        speed / length * (w[slip] - getattr(OWN, slip))
        for speed, length, slip in zip(speeds, front + rear + drive, slips, strict=True)
    ]
    # Each rear wheel turns about its own axis; equal torques of an open differential leave their difference alone.
    difference = (f.rear_left_x - f.rear_right_x) * radius / car.wheel_inertia * radius
    arm, spring = roll_arm_moment(p), car.front_roll_stiffness + car.rear_roll_stiffness
    tipping = arm * (ground[1] / car.mass + car.gravity * OWN.roll) - spring * OWN.roll
    rolling = (tipping - car.roll_damping * OWN.roll_rate) / car.roll_inertia
    loading = (ground / car.mass - [OWN.a_x, OWN.a_y]) / car.load_time
    lags = (DELTA - OWN.steering) / q.steering_lag, (TAU - OWN.torque) / q.torque_lag
    return np.array(axle), np.array([*lags, difference, OWN.roll_rate, rolling, *loading, *relaxing])


@pytest.mark.parametrize("wrench", [(0.0, 0.0, 0.0), (400.0, -900.0, 1300.0)])
@pytest.mark.parametrize("car", CARS.values())
def test_all_rates_are_those_worked_out_by_hand(car: DoubleTrackParameters, wrench: tuple[float, float, float]) -> None:
    q = Effects(steering_lag=0.08, torque_lag=0.15, steering_offset=0.02)
    found = double_track_motion(R, V, BETA, OMEGA, 0.3, OWN, DELTA, TAU, car.constants(), q, *wrench)
    for some, wanted in zip(found, by_hand(car, q, wrench), strict=True):
        np.testing.assert_allclose(some, wanted, rtol=1e-10, atol=1e-10)


def test_slips_of_a_car_that_hardly_moves_still_fade() -> None:
    p, length = CAR.constants(), CAR.rear_tire.lateral_relaxation
    own = OwnStates(*np.zeros(len(OwnStates._fields)))._replace(rear_left_slip=0.1)
    _, rates = double_track_motion(0.0, 0.0, 0.0, 0.0, 0.0, own, 0.0, 0.0, p, Effects())
    assert rates.rear_left_slip == pytest.approx(-0.1 * MIN_RELAXATION_SPEED / length)


def test_commands_act_at_once_without_lags() -> None:
    p = CAR.constants()
    moves = [double_track_motion(R, V, BETA, OMEGA, 0.3, own, DELTA, TAU, p, Effects())
             for own in (OWN, OWN._replace(steering=0.4, torque=-20.0))]  # fmt: skip
    assert moves[0] == moves[1]
    assert (moves[0][1].steering, moves[0][1].torque) == (0.0, 0.0)
