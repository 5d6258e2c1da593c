"""The physical meaning of effects on masses, drive and resistances, seen through Drake plants."""

import math

import numpy as np
import pytest
from effect_cars import (
    COASTING,
    DRIFTING,
    ROLLING_MASS,
    WHEELBASE,
    WHEELSPIN,
    P,
    acceleration_of,
    rates_of,
    simulate,
)


@pytest.mark.parametrize("q", [-0.12, 0.2])
def test_mass_error(q):
    """A force on the body accelerates it by F / (m (1 + q))."""
    a_x, _ = acceleration_of({"mass_error": q}, COASTING, wrench=(1000.0, 0.0, 0.0))
    assert a_x == pytest.approx(1000.0 / (P.mass * (1.0 + q)), rel=1e-9)


@pytest.mark.parametrize("q", [-0.3, 0.4])
def test_yaw_inertia_error(q):
    """A moment on the body turns it by M / (I_z (1 + q))."""
    r_dot = rates_of({"yaw_inertia_error": q}, COASTING, wrench=(0.0, 0.0, 500.0)).r
    assert r_dot == pytest.approx(500.0 / (P.yaw_inertia * (1.0 + q)), rel=1e-9)


@pytest.mark.parametrize("q", [-0.12, 0.12])
def test_cg_shift(q):
    """The centre of gravity moves back: the rear axle carries more, and the front axle's lever grows."""
    a_x, _ = acceleration_of({"cg_shift": q}, WHEELSPIN)
    assert a_x == pytest.approx(P.gravity * (P.front_axle_distance + q) / WHEELBASE, rel=1e-9)
    r_dot = rates_of({"cg_shift": q}, COASTING, (1e-6, 0.0)).r
    lever = P.front_axle_distance + q
    assert r_dot == pytest.approx(lever * P.front_stiffness * 1e-6 / P.yaw_inertia, rel=1e-3)


@pytest.mark.parametrize("q", [-0.3, 0.2])
def test_torque_gain_error(q):
    """The car accelerates as if the torque were (1 + q) times what was commanded."""
    weak, _, _ = simulate({"torque_gain_error": q}, COASTING, 1.0, (0.02, 100.0))
    nominal, _, _ = simulate({}, COASTING, 1.0, (0.02, 100.0 * (1.0 + q)))
    np.testing.assert_allclose(weak[:10], nominal[:10], atol=1e-6)


@pytest.mark.parametrize("q", [-0.4, 0.8])
def test_drivetrain_inertia_error(q):
    """The freely rolling axle spins up by G tau / (I_w (1 + q))."""
    rim = rates_of({"drivetrain_inertia_error": q}, COASTING, (0.0, 100.0)).omega_r
    expected = P.gear_ratio * 100.0 / (P.rear_axle_inertia * (1.0 + q)) * P.wheel_radius
    assert rim == pytest.approx(expected, rel=1e-9)


def test_drivetrain_friction():
    """Coasting, the car and its wheels slow down together by q / R_w over their mass."""
    q = 200.0
    view, _, _ = simulate({"drivetrain_friction": q}, COASTING, 2.0)
    assert 12.0 - view.v == pytest.approx(2.0 * q / P.wheel_radius / ROLLING_MASS, rel=0.01)


@pytest.mark.parametrize(("omega_r", "torque"), [(17.5, 400.0), (-17.5, -400.0)])
def test_power_limit(omega_r, torque):
    """Far above its limit the engine gives the torque that makes this power at the axle; below, all; it brakes as ever.

    Forwards as in reverse.
    """
    state, forwards = (0.0, 0.9 * omega_r, 0.0, omega_r, 0.0, 0.0), math.copysign(1.0, omega_r)
    asked = torque * P.gear_ratio * omega_r / P.wheel_radius * 1e-3  # [kW]
    for share, least in ((0.25, 1e-12), (0.8, 1e-4), (1.0, 0.022)):
        q = share * asked
        limited, given = rates_of({"power_limit": q}, state, (0.0, torque)).omega_r, share * torque
        full = rates_of({}, state, (0.0, given)).omega_r
        drive = P.gear_ratio * abs(given) / P.rear_axle_inertia * P.wheel_radius  # of the rate, by this torque alone
        assert 0.0 <= (full - limited) * forwards <= least * drive
    whole, loose = rates_of({}, state, (0.0, torque)), rates_of({"power_limit": 3.0 * asked}, state, (0.0, torque))
    assert loose.omega_r == pytest.approx(whole.omega_r, rel=1e-4)
    for braking in (-0.1 * torque, 0.0):
        limited = rates_of({"power_limit": 0.1 * asked}, state, (0.0, braking)).omega_r
        assert limited == rates_of({}, state, (0.0, braking)).omega_r


def test_aero_drag():
    """Coasting, 1/v grows by q / m each second; in a drift the force opposes the course, not the body."""
    q = 2.0
    view, _, _ = simulate({"aero_drag": q}, COASTING, 3.0)
    assert 1.0 / view.v - 1.0 / 12.0 == pytest.approx(3.0 * q / ROLLING_MASS, rel=0.01)
    dragged, free = rates_of({"aero_drag": q}, DRIFTING), rates_of({}, DRIFTING)
    assert dragged.v - free.v == pytest.approx(-q * 12.7**2 / P.mass, rel=1e-9)
    assert dragged.beta == pytest.approx(free.beta, rel=1e-12)


def test_rolling_resistance():
    """The body is held back by q g, whatever its sideslip."""
    q = 0.04
    for state in (COASTING, DRIFTING):
        held, free = acceleration_of({"rolling_resistance": q}, state), acceleration_of({}, state)
        np.testing.assert_allclose(held - free, [-q * P.gravity, 0.0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("psi", [0.0, 1.0, math.pi, -2.0])
def test_road_grade(psi):
    """A coasting car loses g sin(q) along the fixed x axis, wherever it heads."""
    q = 0.05
    uphill, flat = (acceleration_of(effects, DRIFTING, pose=(0.0, 0.0, psi)) for effects in ({"road_grade": q}, {}))
    body = uphill - flat
    along_x = math.cos(psi) * body[0] - math.sin(psi) * body[1]
    along_y = math.sin(psi) * body[0] + math.cos(psi) * body[1]
    assert along_x == pytest.approx(-P.gravity * math.sin(q), rel=1e-9)
    assert along_y == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("psi", [0.0, 2.0])
@pytest.mark.parametrize("state", [COASTING, DRIFTING])
def test_road_bank(state, psi):
    """The car is pulled to its right by g sin(q), whatever its heading and sideslip; no moment turns it."""
    q = 0.12
    banked, flat = (acceleration_of(effects, state, pose=(0.0, 0.0, psi)) for effects in ({"road_bank": q}, {}))
    np.testing.assert_allclose(banked - flat, [0.0, -P.gravity * math.sin(q)], rtol=1e-12, atol=1e-12)
    turned, free = rates_of({"road_bank": q}, state), rates_of({}, state)
    assert turned.r == pytest.approx(free.r, rel=1e-12)
    # In numpy: gravity's part along and across the course.
    v, beta, pull = state[1], state[2], -P.gravity * math.sin(q)
    assert turned.v - free.v == pytest.approx(pull * math.sin(beta), abs=1e-12)
    assert turned.beta - free.beta == pytest.approx(pull * math.cos(beta) / v, rel=1e-12)


def test_road_grade_slows_a_coasting_car():
    view, _, _ = simulate({"road_grade": 0.05}, COASTING, 2.0)
    assert 12.0 - view.v == pytest.approx(2.0 * P.gravity * math.sin(0.05) * P.mass / ROLLING_MASS, rel=0.01)


def test_differential_yaw_moment():
    """A moment -q r v resists turning."""
    q = 200.0
    locked, free = rates_of({"differential_yaw_moment": q}, DRIFTING), rates_of({}, DRIFTING)
    assert locked.r - free.r == pytest.approx(-q * 0.7 * 12.7 / P.yaw_inertia, rel=1e-9)
    assert locked.v == free.v
