"""The first guess of a double-track car: its single-track car is the vehicle, whatever its size."""

import dataclasses

import pytest

from drift_drake.car.double_track.nearest import nearest_double_track
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.parameters import VehicleParameters

SMALL = VehicleParameters(
    mass=1.6, yaw_inertia=0.02, front_axle_distance=0.13, rear_axle_distance=0.13, wheel_radius=0.032,
    rear_axle_inertia=2e-4, gear_ratio=8.0, friction=0.8, front_stiffness=90.0, rear_stiffness=110.0,
    torque_min=-0.03, torque_max=0.08,
)  # fmt: skip
LORRY = VehicleParameters(
    mass=12e3, yaw_inertia=58e3, front_axle_distance=2.7, rear_axle_distance=1.6, wheel_radius=0.5,
    rear_axle_inertia=380.0, gear_ratio=19.0, friction=0.8, front_stiffness=2.8e5, rear_stiffness=6.4e5,
    torque_min=-250.0, torque_max=900.0,
)  # fmt: skip


@pytest.mark.parametrize("vehicle", [VehicleParameters(), SMALL, LORRY, *(car.single_track() for car in CARS.values())])
def test_its_single_track_car_is_the_vehicle(vehicle: VehicleParameters) -> None:
    again = nearest_double_track(vehicle).single_track()
    for field in dataclasses.fields(VehicleParameters):
        if field.name not in ("tyre", "tolerance"):
            assert getattr(again, field.name) == pytest.approx(getattr(vehicle, field.name)), field.name


def test_of_the_coupes_own_file_it_is_the_coupe() -> None:
    car, coupe = nearest_double_track(CARS["coupe"].single_track()), CARS["coupe"]
    for field in dataclasses.fields(DoubleTrackParameters):
        if field.name not in ("front_tire", "rear_tire", "aero_drag", "rolling_resistance"):
            assert getattr(car, field.name) == pytest.approx(getattr(coupe, field.name)), field.name
    assert car.aero_drag == car.rolling_resistance == 0.0
    assert car.front_tire.lateral_stiffness == pytest.approx(coupe.front_tire.lateral_stiffness)
    assert car.rear_tire.load_sensitivity == coupe.rear_tire.load_sensitivity


def test_a_car_of_half_the_length_rolls_as_far_at_the_same_acceleration() -> None:
    """Froude's scaling: mass by the cube, lengths by the factor; the roll angle under 1 g is the same."""
    big = VehicleParameters()
    half = big.replace(
        mass=big.mass / 8.0, yaw_inertia=big.yaw_inertia / 32.0, wheel_radius=big.wheel_radius / 2.0,
        rear_axle_inertia=big.rear_axle_inertia / 32.0, front_stiffness=big.front_stiffness / 8.0,
        front_axle_distance=big.front_axle_distance / 2.0, rear_axle_distance=big.rear_axle_distance / 2.0,
        rear_stiffness=big.rear_stiffness / 8.0,
    )  # fmt: skip
    gentle = [
        car.mass * car.cg_height * car.gravity / (car.front_roll_stiffness + car.rear_roll_stiffness)
        for car in (nearest_double_track(big), nearest_double_track(half))
    ]
    assert gentle[1] == pytest.approx(gentle[0])
