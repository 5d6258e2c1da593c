"""A vehicle as functions are given it."""

from pathlib import Path

import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.given_vehicle import effects_given, vehicle_given
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle

CAR, LAG = VehicleParameters(), Effects(steering_lag=0.05)


def test_a_file_and_what_it_holds_are_the_same_vehicle(tmp_path: Path) -> None:
    path = tmp_path / "car.yaml"
    write_vehicle(path, CAR, LAG)
    for vehicle in (path, str(path), (CAR, LAG), (CAR, {"steering_lag": 0.05})):
        assert vehicle_given(vehicle)[:2] == (CAR, LAG)
    assert vehicle_given(CAR)[:2] == (CAR, Effects())
    assert "mass" in vehicle_given(path).tolerances
    assert effects_given(None) == Effects()


@pytest.mark.parametrize("vehicle", [None, 3, (CAR,), (LAG, CAR)])
def test_what_is_no_vehicle_is_said(vehicle: object) -> None:
    with pytest.raises(InvalidVehicleError, match="VehicleParameters, DoubleTrackParameters, or both"):
        vehicle_given(vehicle)  # type: ignore[arg-type]
