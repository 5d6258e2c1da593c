"""A double-track car in a file: read back as it was, and what is wrong with a file in one sentence."""

from pathlib import Path

import pytest
import yaml

from drift_drake.car.car_file import read_car
from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.given_vehicle import GivenVehicle, on_one_track, vehicle_given
from drift_drake.car.parameters import InvalidVehicleError
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle

EFFECTS = Effects(steering_lag=0.06, drivetrain_friction=40.0)


@pytest.mark.parametrize("name", CARS)
def test_it_is_read_back_to_the_bit(tmp_path: Path, name: str) -> None:
    car = CARS[name].replace(differential_preload=60.0, differential_share=0.3)
    path = tmp_path / "car.yaml"
    write_vehicle(path, car, EFFECTS)
    assert read_car(path) == (car, EFFECTS)
    write_vehicle(path, car)
    assert read_car(path) == (car, Effects())


def test_a_single_track_car_is_kept_with_it(tmp_path: Path) -> None:
    """What asks for one takes that, and the double-track car is the same with it and without."""
    path, kept = tmp_path / "car.yaml", (CARS["coupe"].single_track(), Effects(aero_drag=0.4))
    write_vehicle(path, CARS["coupe"], EFFECTS, kept)
    assert read_car(path) == (CARS["coupe"], EFFECTS)
    given = vehicle_given(path)
    assert on_one_track(given)[:2] == kept
    assert "double-track car: this uses the single-track car" in on_one_track(given).remark
    assert on_one_track(GivenVehicle(*kept)).remark == ""
    write_vehicle(path, CARS["coupe"], EFFECTS)
    with pytest.raises(InvalidVehicleError, match=r"car\.yaml: holds a double-track car, and no .*--car auto'"):
        on_one_track(vehicle_given(path), path)


def test_a_file_of_the_other_kind_is_said_so(tmp_path: Path) -> None:
    path = tmp_path / "car.yaml"
    write_vehicle(path, CARS["coupe"])
    with pytest.raises(InvalidVehicleError, match=r"car\.yaml: holds a double-track car, .* give a single-track"):
        read_vehicle(path)


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (("double_track", "mass"), "heavy", "double_track: mass (m) is 'heavy'; give a finite number in kg"),
        (("double_track", "mass"), None, "double_track: mass (m) is None; give a finite number in kg"),
        (("double_track", "weight"), 1.0, "double_track: unknown key 'weight'; known keys are ackermann, "),
        (("double_track", "front_tire", "shape"), 2.5, "front_tire.shape (C) is 2.5; give 1 to below 2"),
        (("double_track", "front_tire", "grip"), 1.0, "unknown key 'front_tire.grip'"),
        (("double_track", "rear_tire"), 3.0, "double_track: 'rear_tire' must hold 'name: value' lines"),
        (("double_track",), [1], "double_track: expected 'name: value' lines, found list"),
        (("colour",), 1.0, "unknown key 'colour'; known keys are double_track, effects, single_track"),
        (("effects", "lateral_load_transfer"), 0.1, "lateral_load_transfer cannot be put on a double-track car"),
        (("effects", "steering_lag"), -1.0, "effects.steering_lag is -1 s; no vehicle's is outside 0 to"),
        (("single_track",), {"mass": 1500.0}, "car.yaml: single_track: missing friction, "),
        (("double_track", "gravity"), 60.0, "gravity is 60; no vehicle's is outside 0.5 to 30"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, place: tuple[str, ...], value: object, said: str) -> None:
    path = tmp_path / "car.yaml"
    write_vehicle(path, CARS["coupe"], EFFECTS)
    data = yaml.safe_load(path.read_text())
    at = data
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InvalidVehicleError) as raised:
        read_car(path)
    assert str(path) in str(raised.value)
    assert said in str(raised.value)


def test_a_parameter_that_is_missing_is_named(tmp_path: Path) -> None:
    path = tmp_path / "car.yaml"
    write_vehicle(path, CARS["coupe"])
    path.write_text("".join(line for line in path.read_text().splitlines(True) if "cg_height" not in line))
    with pytest.raises(InvalidVehicleError, match=r"car\.yaml: double_track: missing cg_height; add a line"):
        read_car(path)


def test_a_tolerance_that_is_none_names_the_file(tmp_path: Path) -> None:
    path = tmp_path / "car.yaml"
    write_vehicle(path, CARS["coupe"])
    path.write_text(path.read_text().replace("    friction: 0.01", "    friction: -0.01"))
    with pytest.raises(InvalidVehicleError, match=r"car\.yaml: .*tolerance\.friction is -0\.01; give a standard"):
        read_car(path)


LENGTH, FORCE = "{} is {:g} m; no vehicle's of this wheelbase is", "{} is {:g}, .* times .*; no vehicle's is more"


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("front_track", 1580.0, LENGTH), ("rear_track", 0.002, LENGTH), ("rear_roll_center", 140.0, LENGTH),
        ("aero_drag", 450.0, FORCE), ("differential_preload", 5e5, FORCE), ("differential_share", 60.0, FORCE),
    ],
)  # fmt: skip
def test_a_length_or_a_force_of_no_vehicle_is_refused(tmp_path: Path, name: str, value: float, says: str) -> None:
    data = CARS["saloon"].to_dict()["double_track"] | {name: value}
    (tmp_path / "car.yaml").write_text(yaml.safe_dump({"double_track": data}))
    with pytest.raises(InvalidVehicleError, match=rf"car\.yaml: {says.format(name, value)}"):
        read_car(tmp_path / "car.yaml")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"load_time": 1e-9}, "load_time"),
        ({"wheel_inertia": 1e-4}, "wheel_inertia"),
        ({"roll_inertia": 1e-4}, "roll_damping"),
        ({"steering_compliance": 0.5}, "steering_compliance"),
        ({"rear_tire": {"lateral_relaxation": 1e-9}}, "rear_tire.lateral_relaxation"),
    ],
)
def test_a_car_that_no_integrator_can_follow_is_refused(tmp_path: Path, change: dict, named: str) -> None:
    data = CARS["saloon"].to_dict()["double_track"]
    for name, value in change.items():
        data[name] = data[name] | value if isinstance(value, dict) else value
    (tmp_path / "car.yaml").write_text(yaml.safe_dump({"double_track": data}))
    with pytest.raises(InvalidVehicleError, match=rf"car\.yaml: with this {named} the car settles in .* microseconds"):
        read_car(tmp_path / "car.yaml")
