"""The physical inputs of the feature network against the equations of motion, and their Jacobian."""

import numpy as np
import pytest

from drift_drake.model.features import INPUT_COUNT, INPUT_OFFSET, INPUT_SCALE
from drift_drake.model.physical_inputs import PHYSICAL_COUNT, PHYSICAL_SCALE, physical_inputs
from drift_drake.vehicle.bicycle import motion
from drift_drake.vehicle.parameters import VehicleParameters

VEHICLE = VehicleParameters()
NOMINAL = VEHICLE.constants()


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    z = INPUT_OFFSET + INPUT_SCALE * np.random.default_rng(4).normal(size=(60, INPUT_COUNT))
    z[:, [1, 3]] = np.abs(z[:, [1, 3]]) + 2.0
    return z


def test_forces_are_those_that_move_the_nominal_car(points: np.ndarray) -> None:
    for z in points:
        _, front, *_, rear_x, rear_y, _, next_front = physical_inputs(z, NOMINAL)[0]
        for share, delta in ((front, z[4]), (next_front, z[6])):
            moved = motion(*z[:4], delta, z[5], NOMINAL)
            a, b = NOMINAL.front_axle_distance, NOMINAL.rear_axle_distance
            load_front, load_rear = (NOMINAL.mass * NOMINAL.gravity * d / (a + b) for d in (b, a))
            f_yf, f_xr, f_yr = NOMINAL.friction * np.array([load_front * share, load_rear * rear_x, load_rear * rear_y])
            lateral = f_yf * np.cos(delta)
            np.testing.assert_allclose(moved.a_x * NOMINAL.mass, f_xr - f_yf * np.sin(delta), rtol=1e-9, atol=1e-6)
            np.testing.assert_allclose(moved.a_y * NOMINAL.mass, f_yr + lateral, rtol=1e-9, atol=1e-6)
            np.testing.assert_allclose(moved.r_dot * NOMINAL.yaw_inertia, a * lateral - b * f_yr, rtol=1e-9, atol=1e-6)


def test_inputs_stay_within_one_and_change_side_with_the_mirrored_car(points: np.ndarray) -> None:
    values, _ = physical_inputs(points, NOMINAL)
    assert np.max(np.abs(values)) <= 1.0 + 1e-12
    mirror = np.array([-1, 1, -1, 1, -1, 1, -1, 1])
    sides = np.array([-1, -1, 1, -1, 1, -1, -1, -1])  # only what points along the car stays
    np.testing.assert_allclose(physical_inputs(points * mirror, NOMINAL)[0], values * sides, rtol=0, atol=1e-12)


def test_jacobian_equals_finite_differences(points: np.ndarray) -> None:
    _, jacobian = physical_inputs(points.reshape(6, 10, INPUT_COUNT), NOMINAL)
    assert jacobian.shape == (6, 10, PHYSICAL_COUNT, INPUT_COUNT)
    assert PHYSICAL_SCALE.shape == (PHYSICAL_COUNT,)
    for j in range(INPUT_COUNT):
        step = np.zeros(INPUT_COUNT)
        step[j] = 1e-6 * INPUT_SCALE[j]
        difference = physical_inputs(points + step, NOMINAL)[0] - physical_inputs(points - step, NOMINAL)[0]
        numeric = difference / (2.0 * step[j])
        np.testing.assert_allclose(jacobian.reshape(60, PHYSICAL_COUNT, -1)[..., j], numeric, rtol=1e-5, atol=1e-6)
