"""The physical meaning of effects on the sensors, seen through Drake plants."""

import numpy as np
import pytest
from effect_cars import (
    driven_car,
)

from drift_drake.car.sensors import LOG_ROW, MEASURED_STATE

SLALOM = [(0.0, 0.0, 50.0), (0.2, 0.08, 150.0), (0.6, -0.08, 0.0), (1.0, 0.05, 100.0)]


def sensed(effects):
    """(measured - true) signals at the sampling times of a slalom, by name, and the true motion."""
    logs = driven_car(effects, SLALOM, 0.8)
    every = slice(0, None, 10)
    state, row = logs["measured_state"][:, every], logs["log_row"][:, every]
    truth = np.concatenate([logs["state"], logs["path_position"]])[:, every]
    pose, acceleration = logs["pose"][:, every], logs["acceleration"][:, every]
    row_truth = np.concatenate([pose, logs["state"][:4, every], acceleration])
    by_state = dict(zip(MEASURED_STATE, state - truth, strict=True))
    by_row = dict(zip(LOG_ROW[1:], row[1:] - row_truth, strict=True))
    return by_state, by_row, truth


def check_bias(effect, biased):
    by_state, by_row, truth = sensed({effect: 0.03})
    np.testing.assert_array_equal(truth, sensed({})[2])
    for errors in (by_state, by_row):
        for name, error in errors.items():
            np.testing.assert_allclose(error, 0.03 if name in biased else 0.0, atol=1e-12, err_msg=name)


def test_gyro_bias():
    check_bias("gyro_bias", {"r"})


def test_sideslip_bias():
    """The course that a car measures is its heading plus its sideslip, so it is biased too."""
    check_bias("sideslip_bias", {"beta", "dphi"})


def test_wheel_radius_error():
    by_state, by_row, truth = sensed({"wheel_radius_error": -0.04})
    np.testing.assert_array_equal(truth, sensed({})[2])
    for errors in (by_state, by_row):
        for name, error in errors.items():
            expected = -0.04 * truth[3] if name == "omega_r" else 0.0 * truth[3]
            np.testing.assert_allclose(error, expected, atol=1e-12, err_msg=name)


def check_gain(effect, channel, place):
    by_state, by_row, truth = sensed({effect: 0.06})
    np.testing.assert_array_equal(truth, sensed({})[2])
    for errors in (by_state, by_row):
        for name, error in errors.items():
            expected = 0.06 * truth[place] if name == channel else 0.0 * truth[place]
            np.testing.assert_allclose(error, expected, atol=1e-12, err_msg=name)


def test_gyro_gain_error():
    check_gain("gyro_gain_error", "r", 0)


def test_speed_gain_error():
    """The rim's speed, the place and the accelerations stay right."""
    check_gain("speed_gain_error", "v", 1)


@pytest.mark.parametrize("q", [0.02, 0.037, 0.12])
def test_sensor_latency(q):
    """Every measured column at a sampling time is what was true q before; before the start, it stood still."""
    logs = driven_car({"sensor_latency": q}, SLALOM, 0.8)
    np.testing.assert_allclose(logs["state"], driven_car({}, SLALOM, 0.8)["state"], atol=1e-7)
    shift = round(q / 0.001)
    sampled = np.arange(0, logs["log_row"].shape[1], 10)
    came_from = np.maximum(sampled - shift, 0)
    truth = np.concatenate([logs["pose"], logs["state"][:4], logs["acceleration"]])[:, came_from]
    np.testing.assert_allclose(logs["log_row"][1:, sampled], truth, atol=1e-6)
    np.testing.assert_allclose(logs["log_row"][0, sampled], 0.001 * sampled, atol=1e-12)
    state = np.concatenate([logs["state"], logs["path_position"]])[:, came_from]
    np.testing.assert_allclose(logs["measured_state"][:, sampled], state, atol=1e-6)
