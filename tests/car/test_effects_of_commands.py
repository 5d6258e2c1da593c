"""The physical meaning of effects between command and wheel, seen through Drake plants."""

import math

import numpy as np
import pytest
from effect_cars import (
    COASTING,
    HEAVY,
    P,
    acceleration_of,
    driven_car,
    rates_of,
    simulate,
)

from drift_drake.car.effects.delays import stamped
from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import InvalidVehicleError
from drift_drake.car.single_track.motion_with_effects import RATE_LIMIT_TIME
from drift_drake.drive.loop.car import Car


@pytest.mark.parametrize("t", [0.05, 0.1, 0.3])
def test_steering_lag(t):
    """After a step of the command the road wheels, and the side force with them, follow as 1 - exp(-t / q)."""
    q, delta = 0.1, 0.02
    view, _, a_y = simulate({"steering_lag": q}, COASTING, t, (delta, 0.0), HEAVY, settled=(0.0, 0.0))
    reached = delta * (1.0 - math.exp(-t / q))
    assert view.steering == pytest.approx(reached, rel=1e-6)
    assert a_y == pytest.approx(acceleration_of({}, COASTING, (reached, 0.0), HEAVY)[1], rel=1e-4)


@pytest.mark.parametrize("q", [0.02, 0.033, 0.15])
def test_steering_delay(q):
    """From steady coasting, everything happens later by exactly q."""
    steering = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.4, 0.06, 0.0), (0.9, -0.03, 0.0), (2.0, 0.0, 0.0)]
    prompt = driven_car({}, steering, 1.4)["state"]
    late = driven_car({"steering_delay": q}, steering, 1.4)["state"]
    shift = round(q / 0.001)
    np.testing.assert_allclose(late[:4, shift:], prompt[:4, :-shift], atol=1e-6)
    assert np.abs(late[:4] - prompt[:4]).max() > 0.01


def test_steering_delay_leaves_the_torque_alone():
    driving = [(0.0, 0.0, 0.0), (0.3, 0.0, 200.0), (2.0, 0.0, 100.0)]
    prompt, late = (driven_car(effects, driving, 0.8)["state"] for effects in ({}, {"steering_delay": 0.1}))
    np.testing.assert_allclose(late, prompt, atol=1e-9)


def test_steering_rate_limit():
    """After a large step the road wheels turn at the rate q, then they stand where the command is."""
    q = 0.5
    effects = {"steering_rate_limit": q}
    for t in (0.1, 0.3, 0.5):
        view, _, _ = simulate(effects, COASTING, t, (0.3, 0.0), HEAVY, settled=(0.0, 0.0))
        assert view.steering == pytest.approx(q * t, rel=1e-6)
        view, _, _ = simulate(effects, COASTING, t, (-0.3, 0.0), HEAVY, settled=(0.0, 0.0))
        assert view.steering == pytest.approx(-q * t, rel=1e-6)
    view, _, _ = simulate(effects, COASTING, 0.6 + 10.0 * RATE_LIMIT_TIME, (0.3, 0.0), HEAVY, settled=(0.0, 0.0))
    assert view.steering == pytest.approx(0.3, abs=1e-4)


def test_steering_rate_limit_with_a_lag():
    """Both together: the lag's rate, held within the limit."""
    effects = {"steering_rate_limit": 0.5, "steering_lag": 0.1}
    assert rates_of(effects, COASTING, (0.3, 0.0), internal={"steering": 0.0}).steering == pytest.approx(0.5)
    assert rates_of(effects, COASTING, (0.3, 0.0), internal={"steering": 0.29}).steering == pytest.approx(0.1)


@pytest.mark.parametrize("q", [-0.03, 0.03])
def test_steering_offset(q):
    """The car drives as a straight one whose steering is turned by q."""
    crooked, _, _ = simulate({"steering_offset": q}, COASTING, 1.0, (0.01, 50.0))
    straight, _, _ = simulate({}, COASTING, 1.0, (0.01 + q, 50.0))
    np.testing.assert_allclose(crooked[:10], straight[:10], atol=1e-6)


@pytest.mark.parametrize("q", [-0.3, 0.3])
def test_steering_ratio_error(q):
    """The car drives as one whose steering is turned (1 + q) times as far; an offset is not multiplied."""
    wrong, _, _ = simulate({"steering_ratio_error": q, "steering_offset": 0.01}, COASTING, 1.0, (0.03, 50.0))
    right, _, _ = simulate({}, COASTING, 1.0, (0.03 * (1.0 + q) + 0.01, 50.0))
    np.testing.assert_allclose(wrong[:10], right[:10], atol=1e-6)


def test_steering_ratio_error_comes_before_lag_and_limit():
    """What lags and is limited is the road wheel that the command asks for: (1 + q) times the command."""
    for slow in ({"steering_lag": 0.1}, {"steering_rate_limit": 0.5}):
        wrong = rates_of({"steering_ratio_error": 0.2, **slow}, COASTING, (0.05, 0.0), internal={"steering": 0.02})
        right = rates_of(slow, COASTING, (0.06, 0.0), internal={"steering": 0.02})
        assert wrong.steering == pytest.approx(right.steering, rel=1e-12)
    settled, _, _ = simulate({"steering_ratio_error": 0.2, "steering_lag": 0.1}, COASTING, 0.01, (0.05, 0.0))
    assert settled.steering == pytest.approx(0.06, rel=1e-9)


def test_command_clock_error():
    """An early clock: from steady coasting, what either command does comes later by exactly -q."""
    driving = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.4, 0.06, 150.0), (0.9, -0.03, 0.0), (2.0, 0.0, 0.0)]
    prompt = driven_car({}, driving, 1.2)["state"]
    late = driven_car({"command_clock_error": -0.05}, driving, 1.2)["state"]
    np.testing.assert_allclose(late[:4, 50:], prompt[:4, :-50], atol=1e-6)
    with pytest.raises(InvalidVehicleError, match=r"the car: with command_clock_error commands would act 0\.03 s"):
        Car(P, make_effects({"command_clock_error": 0.03}))


@pytest.mark.parametrize("q", [-0.04, 0.0, 0.025])
def test_a_log_with_a_wrong_clock_holds_at_t_plus_q_what_was_commanded_at_t(q):
    t = 0.01 * np.arange(100)
    delta, tau = np.sin(4.0 * t), 100.0 * np.cos(3.0 * t)
    logged, rows = stamped({"delta_cmd": delta, "tau_cmd": tau}, make_effects({"command_clock_error": q}), 0.01)
    assert rows == 100 + min(round(q / 0.01), 0)
    inside = (t > 0.0) & (t + q >= 0.0) & (t + q <= t[rows - 1])
    for name, true in (("delta_cmd", delta), ("tau_cmd", tau)):
        assert len(logged[name]) == rows
        read = np.interp((t + q)[inside], t[:rows], logged[name])
        np.testing.assert_allclose(read, true[inside], atol=1e-3 * np.ptp(true))


@pytest.mark.parametrize("t", [0.1, 0.2, 0.6])
def test_torque_lag(t):
    """After a step of the command the engine's torque follows as 1 - exp(-t / q)."""
    q = 0.2
    plant_view, _, _ = simulate({"torque_lag": q}, COASTING, t, (0.0, 100.0), settled=(0.0, 0.0))
    reached = 100.0 * (1.0 - math.exp(-t / q))
    assert plant_view.torque == pytest.approx(reached, rel=1e-6)
    rates = rates_of({"torque_lag": q}, COASTING, (0.0, 100.0), internal={"torque": reached})
    assert rates.omega_r == pytest.approx(rates_of({}, COASTING, (0.0, reached)).omega_r, rel=1e-12)
