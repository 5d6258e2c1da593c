"""The physical inputs of the feature network against the equations of motion, and their Jacobian."""

import numpy as np
import pytest

from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.single_track.motion import motion
from drift_drake.drive.learnt.command_lag import LAG, lag_factors
from drift_drake.drive.learnt.features import INPUT_COUNT, INPUT_OFFSET, INPUT_SCALE
from drift_drake.drive.learnt.physical_inputs import PHYSICAL_COUNT, PHYSICAL_SCALE, with_physical_inputs

VEHICLE = VehicleParameters()
NOMINAL = VEHICLE.constants()


def physical_inputs(z: np.ndarray, nominal: Constants, dt: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    inputs, jacobian = with_physical_inputs(z, nominal, dt)
    return inputs[..., INPUT_COUNT:], jacobian


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    z = INPUT_OFFSET + INPUT_SCALE * np.random.default_rng(4).normal(size=(60, INPUT_COUNT))
    z[:, [1, 3]] = np.abs(z[:, [1, 3]]) + 2.0
    return z


def test_forces_are_those_that_move_the_nominal_car(points: np.ndarray) -> None:
    keep, by_now, by_next = (factor[0] for factor in lag_factors(0.1))
    for z in points:
        delta_at_end = by_now * z[4] + by_next * z[6] + keep * z[8]
        _, front, *_, rear_x, rear_y, _, next_front = physical_inputs(z, NOMINAL)[0]
        for share, delta in ((front, z[8]), (next_front, delta_at_end)):
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
    mirror = np.array([-1, 1, -1, 1, -1, 1, -1, 1, -1, 1])
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


def test_the_lagged_steering_and_not_the_command_moves_the_front_at_the_steps_start(points: np.ndarray) -> None:
    values, jacobian = physical_inputs(points, NOMINAL)
    commanded, lagged = points.copy(), points.copy()
    commanded[:, [4, 6]] += [0.05, -0.02]
    lagged[:, 8] += 0.05
    np.testing.assert_array_equal(physical_inputs(commanded, NOMINAL)[0][:, :6], values[:, :6])
    np.testing.assert_array_equal(jacobian[:, :6, [4, 6]], 0.0)
    moved = physical_inputs(lagged, NOMINAL)[0]
    front_slips = np.abs(moved - values)[:, [0, 6]]
    assert (front_slips > 0.0).all()
    assert (np.median(front_slips, axis=0) > [0.02, 0.002]).all()
    np.testing.assert_array_equal(moved[:, 2:6], values[:, 2:6])  # the rear's do not know of steering
    np.testing.assert_array_equal(jacobian[..., [5, 7, 9]], 0.0)  # nor any of torque, which a lagged one does not tell


def test_held_steering_is_where_the_lag_ends(points: np.ndarray) -> None:
    """Settled lags under held commands: the front is the same at both ends; over many lags it is the command's."""
    held = points.copy()
    held[:, [6, 8]] = held[:, [4]]
    values, _ = physical_inputs(held, NOMINAL)
    np.testing.assert_allclose(values[:, 6:], values[:, :2], rtol=0, atol=1e-12)
    late = points.copy()
    late[:, 6] = late[:, 4]
    far, _ = physical_inputs(late, NOMINAL, dt=40.0 * LAG[0])
    np.testing.assert_allclose(far[:, 6:], values[:, :2], rtol=0, atol=1e-9)
