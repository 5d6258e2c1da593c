"""The car from above: where its parts are, and that steering turns the front wheels to the left."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.view.pictures.car_shape import CarShape, placed, turned

SHAPE = CarShape.of(VehicleParameters())


def area(outline: np.ndarray) -> float:
    """Signed: positive for counter-clockwise outlines."""
    x, y = outline.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def test_outlines_are_counter_clockwise_and_symmetric():
    for outline in (SHAPE.body(), SHAPE.cabin(), *SHAPE.wheels(0.3)):
        assert area(outline) > 0.0
    for outline in (SHAPE.body(), SHAPE.cabin()):
        np.testing.assert_allclose(np.sort(outline[:, 1]), np.sort(-outline[:, 1]))
    assert np.ptp(SHAPE.body()[:, 0]) == pytest.approx(SHAPE.length)


def test_axles_are_where_the_vehicle_has_them():
    centres = SHAPE.wheel_centres()
    np.testing.assert_allclose(centres[:, 0], [1.23, 1.23, -1.24, -1.24])
    np.testing.assert_allclose([wheel.mean(axis=0) for wheel in SHAPE.wheels(0.4)], centres, atol=1e-12)


def test_a_positive_steering_angle_turns_the_front_wheels_left_and_the_rear_ones_not():
    wheels = SHAPE.wheels(0.4)
    directions = [wheel[1] - wheel[0] for wheel in wheels]
    angles = [np.arctan2(*direction[::-1]) for direction in directions]
    np.testing.assert_allclose(angles, [0.4, 0.4, 0.0, 0.0], atol=1e-12)


def test_a_model_car_is_a_small_one_in_all_its_sizes():
    p = VehicleParameters()
    small = CarShape.of(
        p.replace(
            front_axle_distance=0.1 * p.front_axle_distance,
            rear_axle_distance=0.1 * p.rear_axle_distance,
            wheel_radius=0.1 * p.wheel_radius,
        )
    )
    for part in (CarShape.body, CarShape.cabin, CarShape.wheel_centres):
        np.testing.assert_allclose(part(small), 0.1 * part(SHAPE), rtol=1e-9)
    np.testing.assert_allclose(small.scaled(10.0).wheels(0.3), SHAPE.wheels(0.3), rtol=1e-9)


def test_placing_turns_counter_clockwise_then_moves():
    np.testing.assert_allclose(placed(np.array([[1.0, 0.0]]), 5.0, 6.0, np.pi / 2.0), [[5.0, 7.0]], atol=1e-12)
    np.testing.assert_allclose(turned(np.array([[0.0, 1.0]]), np.pi / 2.0), [[-1.0, 0.0]], atol=1e-12)
