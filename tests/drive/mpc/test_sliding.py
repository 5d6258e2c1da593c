"""A car that slides on its lane stops in its slide: sides, ways and when not."""

import numpy as np
import pytest

from drift_drake.car.log.driving import slowest
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.mpc.sliding import SlidingStop
from drift_drake.drive.mpc.stopping import FASTEST
from drift_drake.drive.reference.path import Path
from drift_drake.drive.reference.trajectory import figure_8

CAR = VehicleParameters()
REFERENCE = figure_8(CAR)
DRIFT, COMMAND = np.append(REFERENCE.state(0.0), 0.0), np.array(REFERENCE.input(0.0))
MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
STEP = 0.01  # [s]


def lane(_: float) -> tuple[np.ndarray, np.ndarray]:
    return np.array(-3.0), np.array(3.0)


def circle(radius: float) -> Path:
    return Path([0.0, 200.0], [1.0 / radius, 1.0 / radius])


def stop(radius: float = 18.0) -> SlidingStop:
    return SlidingStop(CAR, circle(radius), lane, FASTEST)


def test_it_has_no_side() -> None:
    left, right = stop().command(DRIFT, COMMAND), stop(-18.0).command(MIRROR * DRIFT, COMMAND * [-1.0, 1.0])
    assert left is not None
    assert right is not None
    np.testing.assert_array_equal(left, right * [-1.0, 1.0])
    assert left[0] == CAR.steering_limit  # into the bend to the left


@pytest.mark.parametrize("changes", [
    {2: -0.02, 0: 0.6, 3: 12.0},  # it grips
    {4: -2.9, 5: -0.5},  # it is about to leave the lane
    {2: -1.0},  # it has nearly spun
    {1: np.nan},
])  # fmt: skip
def test_other_cars_are_left_to_the_law(changes: dict[int, float]) -> None:
    x = DRIFT.copy()
    for index, value in changes.items():
        x[index] = value
    assert stop().command(x, COMMAND) is None


def test_the_way_lies_between_those_of_all_tyres_braking_and_of_the_engines_drag() -> None:
    model, path = NominalStepModel(CAR, STEP, 4), circle(18.0)
    x, u = DRIFT.copy(), COMMAND.copy()
    wanted = stop().command(x, u)
    assert wanted is not None
    while x[1] > slowest(CAR):
        after = u + np.clip(wanted - u, -FASTEST * STEP, FASTEST * STEP)
        curvature = path.curvature(x[6])
        along = x[1] * np.cos(x[5]) / (1.0 - curvature * x[4])
        x[:6] = model.step(x[None, :6], u[None], after[None], np.array([curvature]))[0]
        x[6] += STEP * along
        u = after
        assert abs(x[4]) < 3.0
    shed = 0.5 * (DRIFT[1] ** 2 - slowest(CAR) ** 2)
    drag = -CAR.torque_min * CAR.gear_ratio / CAR.wheel_radius / CAR.mass
    assert shed / (CAR.friction * CAR.gravity) < x[6] < shed / drag
