"""Vehicle files: what is read back, and one clear sentence for everything that is wrong in one."""

import dataclasses
from pathlib import Path

import pytest
import yaml

from drift_drake.car.parameters import WORDS, Constants, InvalidVehicleError, Tolerance, VehicleParameters

SPEC_VEHICLE = Path(__file__).resolve().parents[3] / "shared" / "spec" / "vehicle.yaml"


def write(tmp_path, changes=None, drop=()):
    data = VehicleParameters().to_dict() | (changes or {})
    path = tmp_path / "car.yaml"
    path.write_text(yaml.safe_dump({key: value for key, value in data.items() if key not in drop}))
    return path


def message_of(call, *arguments, **keywords):
    with pytest.raises(InvalidVehicleError) as caught:
        call(*arguments, **keywords)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_defaults_are_the_specifications_vehicle():
    if not SPEC_VEHICLE.exists():
        pytest.skip(f"{SPEC_VEHICLE} is not here")
    assert VehicleParameters.from_yaml(SPEC_VEHICLE) == VehicleParameters()


def test_a_file_reads_back_to_the_same_parameters(tmp_path):
    car = VehicleParameters(mass=1234.5, torque_min=-70.0, tolerance=Tolerance(friction=0.05))
    car.to_yaml(tmp_path / "car.yaml")
    assert VehicleParameters.from_yaml(tmp_path / "car.yaml") == car
    assert VehicleParameters.from_dict(car.to_dict()) == car


def test_numbers_in_scientific_notation_without_a_sign_are_numbers(tmp_path):
    path = tmp_path / "car.yaml"
    VehicleParameters().to_yaml(path)
    path.write_text(path.read_text().replace("front_stiffness: 140000.0", "front_stiffness: 1.5e5"))
    assert VehicleParameters.from_yaml(path).front_stiffness == 1.5e5


def test_constants_are_the_fields_of_the_same_names():
    car = VehicleParameters(mass=1500, friction=0.9)
    constants = car.constants()
    assert constants == Constants(*(getattr(car, name) for name in Constants._fields[:-1]), 0.0)
    assert all(type(value) is float for value in constants)


def test_every_parameter_has_a_unit_and_a_symbol():
    for field in dataclasses.fields(VehicleParameters):
        if field.name not in WORDS:
            assert field.metadata["unit"]
            assert field.metadata["symbol"]


def test_a_changed_copy_is_validated():
    assert VehicleParameters().replace(friction=0.7).friction == 0.7
    assert "friction (mu) is -1" in message_of(VehicleParameters().replace, friction=-1.0)


def test_a_tyre_that_is_not_there():
    text = message_of(VehicleParameters, tyre="square")
    assert text == "tyre is 'square'; give one of brush, or install the package that has it"


def test_a_parameter_that_must_be_positive():
    text = message_of(VehicleParameters, mass=0.0)
    assert text == "mass (m) is 0; it must be positive, in kg"


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "heavy", None, True, [1.0]])
def test_a_parameter_that_is_no_finite_number(value):
    text = message_of(VehicleParameters, mass=value)
    assert text == f"mass (m) is {value!r}; give a finite number in kg"


def test_a_file_may_leave_the_coupling_of_the_front_axle_out(tmp_path):
    path = write(tmp_path, drop=("front_coupling",))
    assert VehicleParameters.from_yaml(path).front_coupling == 0.0
    assert "front_coupling is 2; give 0" in message_of(VehicleParameters, front_coupling=2)


def test_torque_limits_in_the_wrong_order():
    text = message_of(VehicleParameters, torque_min=500.0)
    assert text == "torque_min (500 N m) must lie below torque_max (450 N m)"


def test_a_steering_limit_in_degrees():
    text = message_of(VehicleParameters, steering_limit=38.0)
    assert text == "steering_limit is 38 rad; give it in radians, below pi/2"


@pytest.mark.parametrize("value", [-0.1, float("nan"), "small"])
def test_a_tolerance_that_is_no_standard_deviation(value):
    text = message_of(VehicleParameters, tolerance=Tolerance(mass=value))
    assert text == f"tolerance.mass is {value!r}; give a standard deviation, zero or more"


def test_a_tolerance_too_small_to_count_deviations_in():
    text = message_of(VehicleParameters, tolerance=Tolerance(mass=5e-324))
    assert text.startswith("tolerance.mass is 5e-324; give 0 for exactly known, or 1e-09 or more")
    assert VehicleParameters(tolerance=Tolerance(mass=0.0)).tolerance.mass == 0.0


def test_an_unknown_key_names_the_known_ones(tmp_path):
    text = message_of(VehicleParameters.from_yaml, write(tmp_path, {"weight": 1.0}))
    assert "car.yaml: unknown key 'weight'; known keys are" in text
    assert "mass" in text


def test_an_unknown_tolerance_names_the_known_ones(tmp_path):
    text = message_of(VehicleParameters.from_yaml, write(tmp_path, {"tolerance": {"masss": 0.1}}))
    assert "car.yaml: unknown key 'tolerance.masss'; known keys are" in text


def test_missing_keys_are_named_together(tmp_path):
    text = message_of(VehicleParameters.from_yaml, write(tmp_path, drop=("mass", "friction")))
    assert text.endswith("car.yaml: missing friction, mass; add a line for each")


def test_the_tolerance_may_be_left_out(tmp_path):
    assert VehicleParameters.from_yaml(write(tmp_path, drop=("tolerance",))) == VehicleParameters()


def test_a_tolerance_that_is_not_a_mapping(tmp_path):
    text = message_of(VehicleParameters.from_yaml, write(tmp_path, {"tolerance": 0.1}))
    assert text.endswith("car.yaml: 'tolerance' must hold 'name: standard deviation' lines")


def test_a_bad_value_is_reported_with_its_file(tmp_path):
    text = message_of(VehicleParameters.from_yaml, write(tmp_path, {"mass": "heavy"}))
    assert text.endswith("car.yaml: mass (m) is 'heavy'; give a finite number in kg")


def test_a_file_that_is_not_there(tmp_path):
    text = message_of(VehicleParameters.from_yaml, tmp_path / "none.yaml")
    assert text.endswith("none.yaml: cannot be read (No such file or directory); give the path of a vehicle file")


def test_a_file_that_is_not_yaml(tmp_path):
    path = tmp_path / "car.yaml"
    path.write_text("mass: 1\nfriction: [1\n")
    text = message_of(VehicleParameters.from_yaml, path)
    assert "car.yaml: not valid YAML at line" in text
    assert text.endswith("write one 'name: value' a line")


@pytest.mark.parametrize("content", ["", "just text", "- 1\n- 2\n"])
def test_a_file_that_holds_no_mapping(tmp_path, content):
    path = tmp_path / "car.yaml"
    path.write_text(content)
    assert "car.yaml: expected 'name: value' lines, found" in message_of(VehicleParameters.from_yaml, path)


def test_keys_that_are_not_text(tmp_path):
    path = tmp_path / "car.yaml"
    path.write_text("1: 2\n")
    assert "unknown key '1'" in message_of(VehicleParameters.from_yaml, path)


def test_a_file_that_is_not_text(tmp_path):
    path = tmp_path / "car.yaml"
    path.write_bytes(b"\xff\xfe\x00mass")
    assert "car.yaml: not a text file" in message_of(VehicleParameters.from_yaml, path)
