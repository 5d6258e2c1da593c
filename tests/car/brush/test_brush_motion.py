"""The brush car's equations against figures by hand: tyre, loads, differential, axles that yield, forces and rates."""

import numpy as np
import pytest

from drift_drake.car import equations
from drift_drake.car.brush.equations import (
    KIND,
    BrushStates,
    brush_force,
    kinematic_slips,
    locking_torque,
    rates,
    settle,
    wheel_angles,
    wheel_loads,
)
from drift_drake.car.brush.parameters import DEVIATIONS, BrushParameters, changed_constants
from drift_drake.car.effects.magnitudes import Effects

CAR = BrushParameters()
P, NONE, OWN, SIZE, deviated = CAR.constants(), Effects(), KIND.own, KIND.size, KIND.deviated
STILL = BrushStates(*np.zeros(len(OWN)))


def rates_at(own: BrushStates = STILL, moving: tuple[float, ...] = (0.0, 12.0, 0.0, 12.0), command=(0.0, 0.0),
             effects: Effects = NONE, p=P, wrench=(0.0, 0.0, 0.0), psi: float = 0.0) -> dict[str, float]:  # fmt: skip
    """Rates by name under a state (r, v, beta, omega_r)."""
    out = np.zeros(SIZE)
    rates(np.array([*moving, psi, *own]), command, (p, effects, wrench), out)
    return dict(zip(("r", "v", "beta", "omega_r", "psi", *OWN), out, strict=True))


def test_a_tyre_grips_in_proportion_to_small_slips_and_slides_with_less_friction() -> None:
    p = P._replace(load_sensitivity=0.0)
    _, side = brush_force(0.0, 1e-4, 4000.0, 10.0, 0.85, 3.0, p)
    assert side == pytest.approx(-10.0 * 4000.0 * 1e-4, rel=1e-3)
    along, none = brush_force(-2.0, 0.0, 4000.0, 10.0, 0.85, 3.0, p)
    left = p.sliding_friction + (1.0 - p.sliding_friction) * np.exp(-6.0 / p.sliding_speed)
    assert along == pytest.approx(0.85 * 4000.0 * left)
    assert none == 0.0


def test_a_tyre_between_is_the_brush_models_cubic() -> None:
    """F = C s - (C s)^2 / (3 mu F_z) + (C s)^3 / (27 mu^2 F_z^2) where friction does not fall as the contact slides."""
    p = P._replace(load_sensitivity=0.0, sliding_friction=1.0)
    load, stiffness, friction, slip = 3500.0, 15.0, 0.9, 0.11
    q, peak = stiffness * load * slip, friction * load
    expected = q - q**2 / (3.0 * peak) + q**3 / (27.0 * peak**2)
    x, y = brush_force(slip * 0.6, -slip * 0.8, load, stiffness, friction, 12.0, p)
    assert (x, y) == (pytest.approx(-0.6 * expected), pytest.approx(0.8 * expected))


def test_friction_falls_with_the_load_to_a_floor() -> None:
    load = 2.0 * P.nominal_load
    slid = brush_force(0.0, 5.0, load, 15.0, 1.0, 1e3, P)[1]
    assert slid == pytest.approx(-(1.0 - P.load_sensitivity) * load * P.sliding_friction, rel=1e-6)
    heavy = 20.0 * P.nominal_load
    assert brush_force(0.0, 50.0, heavy, 15.0, 1.0, 1e3, P)[1] == pytest.approx(-0.3 * heavy * P.sliding_friction)


def test_a_differential_locks_no_more_than_it_can() -> None:
    assert locking_torque(0.0, 100.0, P) == P.lock_least
    assert locking_torque(1000.0, -100.0, P) == -(P.lock_least + 1000.0 * P.lock_share)
    assert locking_torque(1000.0, 0.1, P) == pytest.approx(0.1 * P.lock)


def test_loads_move_with_the_accelerations_and_keep_their_sum() -> None:
    weight, length = P.mass * P.gravity, P.front_axle_distance + P.rear_axle_distance
    loads = np.array(wheel_loads(2.0, 3.0, P))
    assert loads.sum() == pytest.approx(weight)
    assert loads[:2].sum() == pytest.approx((weight * P.rear_axle_distance - P.mass * P.cg_height * 2.0) / length)
    across = P.mass * 3.0 * P.cg_height / P.track
    assert loads[1] - loads[0] == pytest.approx(2.0 * P.front_roll_share * across)
    assert loads[3] - loads[2] == pytest.approx(2.0 * (1.0 - P.front_roll_share) * across)
    assert min(wheel_loads(0.0, 100.0, P)) == pytest.approx(1e-3 * weight)


def test_wheels_yield_to_their_axles_forces_and_the_roll() -> None:
    p = P._replace(rear_steer=-0.1)
    own = STILL._replace(a_y=4.0, front_slip=-0.02, rear_slip=0.5)
    front, rear = wheel_angles(0.1, own, p)
    assert front == pytest.approx(0.1 + p.front_compliance * p.front_cornering * -0.02 + 4.0 * p.roll_steer)
    assert rear == pytest.approx(-0.01 + p.rear_compliance)  # slides: no more than the static load's


def test_slips_hold_backwards_and_at_a_standstill() -> None:
    forwards, backwards = kinematic_slips(0.2, 5.0, 0.3, 0.1, 0.0, P), kinematic_slips(0.2, -5.0, 0.3, 0.1, 0.0, P)
    a, b = P.front_axle_distance, P.rear_axle_distance
    assert forwards == (pytest.approx((0.3 + 0.2 * a) / 5.0 - 0.1), pytest.approx((0.3 - 0.2 * b) / 5.0))
    assert backwards == (pytest.approx((0.3 + 0.2 * a) / 5.0 + 0.1), pytest.approx((0.3 - 0.2 * b) / 5.0))
    assert np.isfinite(kinematic_slips(0.0, 0.0, 0.0, 0.3, 0.0, P)).all()


def test_a_car_that_rolls_straight_is_slowed_by_rolling_and_air_alone() -> None:
    found = rates_at()
    drag = P.rolling_resistance * P.gravity + P.aero_drag * 144.0 / P.mass
    assert found["v"] == pytest.approx(-drag, rel=1e-6)
    assert found["a_x"] == pytest.approx(-drag / P.pitch_time, rel=1e-6)
    assert found["omega_r"] == pytest.approx(0.0, abs=1e-6)
    assert found["r"] == found["beta"] == 0.0


def test_torque_turns_the_rims_and_their_difference_is_locked() -> None:
    found = rates_at(command=(0.0, 100.0))
    gain = P.wheel_radius / P.rear_axle_inertia
    assert found["omega_r"] == pytest.approx(gain * P.gear_ratio * 100.0, rel=1e-6)
    apart = rates_at(STILL._replace(rim_difference=0.001), p=P._replace(rear_cornering=1e-9))
    assert apart["rim_difference"] == pytest.approx(-2.0 * gain * P.lock * 0.001, rel=1e-4)


def test_each_rear_wheels_slip_pulls_on_its_own_side() -> None:
    """Sliding rims 2 m/s apart, no lateral slip: a yaw moment of half the track times the forces' difference."""
    moving = (0.0, 12.0, 0.0, 14.0)
    found = rates_at(STILL._replace(rim_difference=2.0), moving)
    load = 0.5 * P.mass * P.gravity * P.front_axle_distance / (P.front_axle_distance + P.rear_axle_distance)
    left, right = (brush_force(-slip / 12.0, 0.0, load, P.rear_cornering, P.friction, 12.0, P)[0] for slip in (1, 3))
    assert found["r"] == pytest.approx(0.5 * P.track * (right - left) / P.yaw_inertia)
    by_wheel = P.wheel_radius**2 / (0.5 * P.rear_axle_inertia)
    assert found["omega_r"] == pytest.approx(-0.5 * by_wheel * (left + right))
    locked = min(P.lock * 2.0, P.lock_least) * P.wheel_radius / (0.5 * P.rear_axle_inertia)
    assert found["rim_difference"] == pytest.approx(by_wheel * (left - right) - locked)


def test_a_slipping_front_axle_turns_the_car() -> None:
    p = P._replace(front_compliance=0.0, roll_steer=0.0, rolling_resistance=0.0, aero_drag=0.0)
    found = rates_at(STILL._replace(front_slip=-0.03), command=(0.2, 0.0), p=p)
    load = 0.5 * p.mass * p.gravity * p.rear_axle_distance / (p.front_axle_distance + p.rear_axle_distance)
    force = 2.0 * brush_force(0.0, -0.03, load, p.front_cornering, p.friction, 12.0, p)[1]
    assert found["r"] == pytest.approx(p.front_axle_distance * force * np.cos(0.2) / p.yaw_inertia)
    assert found["v"] == pytest.approx(-force * np.sin(0.2) / p.mass)
    assert found["beta"] == pytest.approx(force * np.cos(0.2) / p.mass / 12.0)
    assert found["front_slip"] == pytest.approx(12.0 / p.relaxation * (-0.2 + 0.03))


def test_motors_turn_the_car_as_steering_asks_for() -> None:
    p = P._replace(vectoring=3000.0, lock=0.0, lock_least=0.0, lock_share=0.0)
    length = p.front_axle_distance + p.rear_axle_distance
    wanted = 12.0 * 0.05 / length / (1.0 + 144.0 / (6.0 * p.gravity * length))
    found = rates_at(command=(0.05, 0.0), p=p)
    # Each motor's torque over the radius, half the track from the middle, makes half of the moment.
    force = 3000.0 * wanted / p.track
    gain = p.wheel_radius / (0.5 * p.rear_axle_inertia)
    assert found["rim_difference"] == pytest.approx(2.0 * gain * force * p.wheel_radius)
    assert found["omega_r"] == pytest.approx(0.0, abs=1e-6)


def test_loads_follow_by_a_mode_of_roll_and_a_lag_of_pitch() -> None:
    own = STILL._replace(a_y=1.0, a_y_rate=2.0, a_x=1.0)
    found = rates_at(own, p=P._replace(roll_steer=0.0))
    assert found["a_y"] == 2.0
    expected = P.roll_frequency * (-P.roll_frequency - 2.0 * P.roll_damping * 2.0)
    assert found["a_y_rate"] == pytest.approx(expected, rel=1e-6)
    assert found["a_x"] == pytest.approx((found["v"] - 1.0) / P.pitch_time, rel=1e-6)


def test_forces_and_a_moment_act_on_the_body_and_a_grade_on_the_heading() -> None:
    plain, acted = rates_at(), rates_at(wrench=(1650.0, 3300.0, 4700.0))
    assert acted["v"] - plain["v"] == pytest.approx(1.0)
    assert acted["beta"] == pytest.approx(2.0 / 12.0)
    assert acted["r"] == pytest.approx(2.0)
    uphill = rates_at(effects=Effects(road_grade=0.05), psi=np.pi)  # -x is downhill
    assert uphill["v"] - plain["v"] == pytest.approx(P.gravity * np.sin(0.05))


def test_actuators_lag_where_they_do() -> None:
    own = STILL._replace(steering=0.1, torque=50.0)
    at_once = rates_at(own, command=(0.2, 100.0))
    assert at_once["steering"] == at_once["torque"] == 0.0
    lagging = rates_at(own, command=(0.2, 100.0), effects=Effects(steering_lag=0.1, torque_lag=0.2))
    assert lagging["steering"] == pytest.approx(1.0)
    assert lagging["torque"] == pytest.approx(250.0)


@pytest.mark.parametrize(
    ("effect", "fields"),
    [("mass_error", ("mass",)), ("yaw_inertia_error", ("yaw_inertia",)), ("friction_level", ("friction",)),
     ("front_stiffness_error", ("front_cornering",)), ("rear_stiffness_error", ("rear_cornering",)),
     ("torque_gain_error", ("gear_ratio",)), ("drivetrain_inertia_error", ("rear_axle_inertia",))],
)  # fmt: skip
def test_factors_change_their_numbers_alone(effect: str, fields: tuple[str, ...]) -> None:
    found = changed_constants(P, Effects(**{effect: 0.1}))
    assert {name for name in P._fields if getattr(found, name) != getattr(P, name)} == set(fields)
    assert all(getattr(found, name) == pytest.approx(1.1 * getattr(P, name)) for name in fields)


def test_sums_change_their_numbers_alone() -> None:
    found = changed_constants(P, Effects(cg_shift=0.1, aero_drag=0.5, rolling_resistance=0.01, tyre_relaxation=0.3))
    expected = P._replace(front_axle_distance=1.33, rear_axle_distance=1.14, aero_drag=0.9, rolling_resistance=0.022,
                          relaxation=0.5)  # fmt: skip
    np.testing.assert_allclose(found, expected)


def test_a_split_moves_friction_from_the_rear_axle_to_the_front() -> None:
    """Both axles sliding sideways."""
    own = STILL._replace(front_slip=5.0, rear_slip=5.0)
    plain, split = (rates_at(own, effects=Effects(front_rear_friction_split=q)) for q in (0.0, 0.1))
    p = P._replace(rolling_resistance=0.0, aero_drag=0.0)
    apart = p.front_axle_distance * p.rear_axle_distance / (p.front_axle_distance + p.rear_axle_distance)
    left = 1.0 - (1.0 - p.sliding_friction) * (1.0 - np.exp(-60.0 / p.sliding_speed))
    moment = -0.2 * p.friction * p.mass * p.gravity * apart * left  # (1.1 - 1) + (1 - 0.9), of a balanced car
    loads = (1.0 - P.load_sensitivity * (np.array(wheel_loads(0.0, 0.0, P)) / P.nominal_load - 1.0)).mean()
    assert split["r"] - plain["r"] == pytest.approx(moment * loads / P.yaw_inertia, rel=2e-3)


def test_settled_states_stand_still() -> None:
    """All but those of the rims and of the motion itself."""
    z, out = np.array([0.5, 12.0, -0.1, 12.3, 0.0, *np.zeros(len(OWN))]), np.zeros(SIZE)
    effects = Effects(steering_lag=0.05, torque_lag=0.1, mass_error=0.05, steering_offset=0.01, road_bank=0.05)
    settle(z, 0.05, 150.0, P, effects)
    rates(z, (0.05, 150.0), (P, effects, (0.0, 0.0, 0.0)), out)
    found = dict(zip(OWN, out[5:], strict=True))
    assert z[5] == 0.5 * P.track
    assert max(abs(found[name]) for name in OWN if name != "rim_difference") < 1e-3


def test_unknown_quantities_are_moved_by_their_deviations() -> None:
    car = deviated(P, {"cg_height": 2.0, "lock_share": -1.0}, NONE)
    assert car.cg_height == pytest.approx(P.cg_height * np.exp(0.3))
    assert car.lock_share == pytest.approx(P.lock_share - 0.2)
    assert deviated(P, {}, NONE) == P
    assert all(equations.kind_of(P).value_of(name, P) == getattr(P, name) for name in DEVIATIONS)
