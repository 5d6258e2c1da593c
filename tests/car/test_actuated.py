"""What actuators make of commands: exact lag, delay, rate limit."""

import numpy as np
import pytest

from drift_drake.car.actuated import STAGES, actuated, delayed, first_order_lag, without_actuators
from drift_drake.car.effects.magnitudes import Effects

PERIOD = 0.01
STEP = PERIOD / STAGES


def test_lag_follows_a_ramp_late_by_its_time_constant():
    ramp = np.arange(400) * STEP
    out = first_order_lag(ramp, 0.0, STEP, 0.05)
    t = ramp
    np.testing.assert_allclose(out, t - 0.05 * (1.0 - np.exp(-t / 0.05)), atol=1e-12)


def test_delay_is_exact_for_what_is_linear_between_rows():
    command = np.cumsum(np.random.default_rng(0).standard_normal(50))
    out = delayed(command, -3.0, PERIOD, 0.034)
    t = np.arange(len(out)) * STEP - 0.034
    inside = t >= 0.0
    np.testing.assert_allclose(out[inside], np.interp(t[inside], np.arange(50) * PERIOD, command), atol=1e-9)
    assert np.all(out[~inside] == -3.0)


def test_rate_limit_holds_and_latency_delays_both():
    step_command = np.where(np.arange(100) < 20, 0.0, 0.3)
    limited, _ = actuated(step_command, step_command, (0.0, 0.0), PERIOD, Effects(steering_rate_limit=0.5))
    assert np.max(np.diff(limited)) / STEP == pytest.approx(0.5, rel=1e-6)
    late = actuated(step_command, step_command, (0.0, 0.0), PERIOD, Effects(sensor_latency=0.05))
    plain = actuated(step_command, step_command, (0.0, 0.0), PERIOD, Effects())
    for one, other in zip(late, plain, strict=True):
        np.testing.assert_allclose(one[5 * STAGES :], other[: -5 * STAGES], atol=1e-9)


def test_effects_without_actuators_keep_the_rest():
    left = without_actuators(Effects(steering_lag=0.1, sensor_latency=0.1, aero_drag=1.0))
    assert left == Effects(aero_drag=1.0)
