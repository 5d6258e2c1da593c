"""A calibration's JSON as `diagnose` reads it."""

import json

import pytest

from drift_drake.cli import BAD_INPUT, main
from drift_drake.estimation.freeform import FORCE_CHANNELS
from drift_drake.identification.calibration import CarTrust, InvalidCalibrationError, read_trust
from drift_drake.run_folder import to_json
from drift_drake.vehicle.parameters import VehicleParameters


def test_what_identify_writes_can_be_read(identified, tmp_path):
    path = tmp_path / "car.json"
    path.write_text(to_json(identified.calibration))
    c = identified.calibration
    found = read_trust(path)
    assert (found.noise_scale, found.process_scale, found.row_weight) == (c.trust.noise, c.trust.process, c.row_weight)
    assert found.everyday == c.everyday


def test_forces_are_read_if_there_are_any(tmp_path):
    forces = {name: [1.0] for name in FORCE_CHANNELS}
    data = {"trust": {"noise": 2.0, "process": 0.5}, "row_weight": 0.1,
            "everyday": {"forces": forces, "offsets": {"r": 0.5}, "row_weight": 0.3}}  # fmt: skip
    path = tmp_path / "car.json"
    path.write_text(json.dumps(data))
    assert read_trust(path).everyday.row_weight == 0.3
    path.write_text(json.dumps(data | {"everyday": None}))
    assert read_trust(path) == CarTrust(2.0, 0.5, 0.1, None)


@pytest.mark.parametrize(("text", "says"), [("{", "not JSON"), ("{}", "no trust"), ("[]", "no trust"), (None, "read")])
def test_bad_calibrations_get_one_sentence(tmp_path, text, says):
    path = tmp_path / "car.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InvalidCalibrationError, match=says):
        read_trust(path)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--row-weight", "0"], "above 0, up to 1"),
        (["--row-weight", "1.5"], "above 0, up to 1"),
        (["--noise-scale", "-1"], "factors above 0"),
        (["--most-seconds", "5"], "give 12 or more"),
        (["--calibration", "nothing.json"], "nothing.json: cannot be read"),
        (["--calibration", "nothing.json", "--row-weight", "0.5"], "not both"),
    ],
)
def test_bad_trust_is_one_sentence(tmp_path, capsys, arguments, says):
    vehicle = tmp_path / "car.yaml"
    VehicleParameters().to_yaml(vehicle)
    assert main(["diagnose", str(tmp_path), "--vehicle", str(vehicle), *arguments]) == BAD_INPUT
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
