"""Drivers: the hold stabilises a drift, the scripts stay within the limits."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import linearize
from drift_drake.drive.mpc.plan import interpolate_knots
from drift_drake.drive.reference.equilibrium import drift_equilibrium
from experiments.benchmarks.drifters import (
    DITHER_STEERING,
    DITHER_TORQUE,
    HoldDriver,
    dither,
    hold_gain,
    manual_script,
    wander,
)

CAR = VehicleParameters()


def test_the_gain_stabilises_a_drift_that_is_unstable() -> None:
    drift = drift_equilibrium(CAR, 18.0, -0.6)
    x = np.array([drift.r, drift.v, drift.beta, drift.omega_r, 0.0, 0.0])
    _, a, b = linearize(x, np.array([drift.delta, drift.tau]), np.array(0.0), CAR.constants())
    a, b = a[:4, :4], b[:4]
    assert np.linalg.eigvals(a).real.max() > 0.1
    assert np.linalg.eigvals(a - b @ hold_gain(CAR, drift)).real.max() < -0.3


def test_hold_plans_are_continuous_and_within_limits() -> None:
    drift = drift_equilibrium(CAR, 18.0, -0.6)
    driver = HoldDriver(CAR, drift, np.zeros((2, 2)))
    context = driver.CreateDefaultContext()
    end = np.array(driver.initial_command())
    for k, beta in enumerate((-0.6, -0.9, 0.5)):
        context.SetTime(0.01 * k)
        driver.GetInputPort("measured_state").FixValue(context, [drift.r, drift.v, beta, drift.omega_r, 0.0, 0.0, 0.0])
        context.SetDiscreteState(driver.EvalUniquePeriodicDiscreteUpdate(context))
        plan = driver.GetOutputPort("plan").Eval(context)
        assert plan[0] == pytest.approx(0.01 * (k + 1))
        np.testing.assert_array_equal(plan[1:3], end)
        end = plan[3:].copy()
        assert abs(end[0]) <= CAR.steering_limit
        assert CAR.torque_min <= end[1] <= CAR.torque_max
    # Far too much sideslip to the other side: all the steering there is.
    assert abs(end[0]) == CAR.steering_limit


def test_knots_are_read_linearly_and_the_last_one_is_held() -> None:
    knots = np.array([[0.0, 10.0], [1.0, 20.0], [3.0, 0.0]])
    np.testing.assert_allclose(interpolate_knots(knots, 0.15), [2.0, 10.0])
    np.testing.assert_allclose(interpolate_knots(knots, 9.0), [3.0, 0.0])
    np.testing.assert_allclose(interpolate_knots(knots, -1.0), [0.0, 10.0])


def test_noise_has_the_stated_size() -> None:
    generator = np.random.default_rng(0)
    noise = dither(400.0, generator)
    np.testing.assert_allclose(noise.std(axis=0), [DITHER_STEERING, DITHER_TORQUE], rtol=0.05)
    slow = wander(400.0, generator, np.array([0.1, 20.0]), 0.5)
    np.testing.assert_allclose(slow[::5].std(axis=0), [0.1, 20.0], rtol=0.1)
    assert np.abs(np.diff(slow[:, 0])).max() < 0.2  # it takes five knots from one value to the next


def test_scripts_stay_within_the_limits() -> None:
    for seed in range(20):
        script = manual_script(CAR, 5.0, np.random.default_rng(seed))
        assert np.abs(script[:, 0]).max() <= CAR.steering_limit
        assert script[:, 1].min() >= CAR.torque_min
        assert script[:, 1].max() <= CAR.torque_max
