"""Vehicles from 1.6 kg to 40 t are taken; absurd ones are refused by name."""

from pathlib import Path

import pytest

from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.effects import make_effects
from drift_drake.vehicle.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.vehicle.vehicle_file import check_effects, check_plausible, effect_range, read_vehicle

P = VehicleParameters()
LORRY = VehicleParameters(
    mass=4e4, yaw_inertia=4e5, front_axle_distance=3.5, rear_axle_distance=2.5, wheel_radius=0.52,
    rear_axle_inertia=400.0, gear_ratio=30.0, friction=0.7, front_stiffness=1.5e6, rear_stiffness=3e6,
    torque_min=-2000.0, torque_max=2600.0,
)  # fmt: skip


def test_small_cars_cars_and_lorries_are_taken() -> None:
    for file in sorted((Path(__file__).parents[2] / "experiments" / "vehicles").glob("*.yaml")):
        read_vehicle(file)
    for vehicle in (P, LORRY):
        check_plausible(vehicle)
        for name, info in CATALOGUE.items():
            for magnitude in info.range_for(vehicle):
                check_effects(make_effects({name: magnitude}), vehicle)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mass", 1e300),
        ("mass", 1e-3),
        ("rear_axle_inertia", 1e-9),
        ("yaw_inertia", 1e9),
        ("front_stiffness", 1.0),
        ("rear_stiffness", 1e12),
        ("torque_max", 1e30),
        ("wheel_radius", 337.0),
        ("gravity", 1e-6),
    ],
)
def test_an_absurd_parameter_is_named(name: str, value: float) -> None:
    with pytest.raises(InvalidVehicleError, match="vehicle: "):
        check_plausible(P.replace(**{name: value}))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("friction_level", -5.0),
        ("mass_error", -2.0),
        ("steering_lag", -0.1),
        ("aero_drag", 1e6),
        ("cg_shift", 1.3),
        ("tyre_relaxation", 1e-9),
        ("drivetrain_inertia_error", -0.99),
        ("gyro_bias", float("nan")),
    ],
)
def test_an_absurd_effect_is_named(name: str, value: float) -> None:
    with pytest.raises(InvalidVehicleError, match=f"effects.{name} is "):
        check_effects(make_effects({name: value}), P)


def test_ranges_follow_the_vehicle_s_size() -> None:
    small = P.replace(mass=1.6, wheel_radius=0.03)
    assert effect_range("drivetrain_friction", small)[1] < 1.0
    assert effect_range("drivetrain_friction", LORRY)[1] > effect_range("drivetrain_friction", P)[1]


@pytest.mark.parametrize("text", [".nan", "1e400", "true", "[1]", "1e5"])
def test_effects_in_a_file_are_numbers_in_range(tmp_path: Path, text: str) -> None:
    path = tmp_path / "car.yaml"
    P.to_yaml(path)
    path.write_text(path.read_text() + f"effects: {{aero_drag: {text}}}\n")
    with pytest.raises(InvalidVehicleError, match=r"effects\.aero_drag is"):
        read_vehicle(path)
