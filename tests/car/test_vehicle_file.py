"""Vehicle files with effects: round trip and bad input."""

import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle


def test_round_trip(tmp_path):
    path = tmp_path / "vehicle.yaml"
    parameters, effects = VehicleParameters(mass=1500.0), Effects(steering_lag=0.08, aero_drag=1.2)
    write_vehicle(path, parameters, effects)
    assert read_vehicle(path) == (parameters, effects)


def test_a_file_without_effects_has_none(tmp_path):
    VehicleParameters().to_yaml(tmp_path / "vehicle.yaml")
    assert read_vehicle(tmp_path / "vehicle.yaml") == (VehicleParameters(), Effects())


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("effects: 3", "'effects' must hold"),
        ("effects: {warp: 1.0}", "unknown effect warp"),
        ("effects: {steering_lag: fast}", "effects.steering_lag is 'fast'"),
        ("tyre: [brush]", r"tyre is \['brush'\]; give one of brush"),
    ],
)
def test_bad_effects_get_one_sentence(tmp_path, line, says):
    path = tmp_path / "vehicle.yaml"
    VehicleParameters().to_yaml(path)
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(InvalidVehicleError, match=says) as caught:
        read_vehicle(path)
    assert str(path) in str(caught.value)


def test_an_unreadable_file_is_named(tmp_path):
    with pytest.raises(InvalidVehicleError, match="cannot be read"):
        read_vehicle(tmp_path / "nothing.yaml")
