"""A calibration's JSON as `diagnose` reads it."""

import json

import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.cli.main import BAD_INPUT, main
from drift_drake.common.run_folder import to_json
from drift_drake.gap.estimation.freeform import FORCE_CHANNELS, FUNCTIONS
from drift_drake.gap.identification.calibration import CarTrust, InvalidCalibrationError, read_trust


def test_what_identify_writes_can_be_read(identified, tmp_path):
    path = tmp_path / "car.json"
    path.write_text(to_json(identified.calibration))
    c = identified.calibration
    found = read_trust(path)
    assert (found.noise_scale, found.process_scale, found.tempering) == (c.trust.noise, c.trust.process, c.tempering)
    assert found.discrepancy == c.discrepancy


def test_forces_are_read_if_there_are_any(tmp_path):
    forces = {name: [1.0] * FUNCTIONS for name in FORCE_CHANNELS}
    data = {"trust": {"noise": 2.0, "process": 0.5}, "tempering": 0.1,
            "discrepancy": {"forces": forces, "offsets": {"r": 0.5}, "tempering": 0.3}}  # fmt: skip
    path = tmp_path / "car.json"
    path.write_text(json.dumps(data))
    assert read_trust(path).discrepancy.tempering == 0.3
    path.write_text(json.dumps(data | {"discrepancy": None}))
    assert read_trust(path) == CarTrust(2.0, 0.5, 0.1, None)


def test_weights_of_other_functions_are_refused(tmp_path):
    path = tmp_path / "car.json"
    discrepancy = {"forces": {name: [1.0, 2.0] for name in FORCE_CHANNELS}, "offsets": {}, "tempering": 0.3}
    path.write_text(json.dumps({"trust": {"noise": 2.0, "process": 0.5}, "tempering": 0.1, "discrepancy": discrepancy}))
    with pytest.raises(InvalidCalibrationError, match=f"has 2 weights for {FORCE_CHANNELS[0]}, expected {FUNCTIONS}"):
        read_trust(path)


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
        (["--tempering", "0"], "above 0, up to 1"),
        (["--tempering", "1.5"], "above 0, up to 1"),
        (["--noise-scale", "-1"], "factors above 0"),
        (["--most-seconds", "5"], "give 12 or more"),
        (["--calibration", "nothing.json"], "nothing.json: cannot be read"),
        (["--calibration", "nothing.json", "--tempering", "0.5"], "not both"),
    ],
)
def test_bad_trust_is_one_sentence(tmp_path, capsys, arguments, says):
    vehicle = tmp_path / "car.yaml"
    VehicleParameters().to_yaml(vehicle)
    assert main(["diagnose", str(tmp_path), "--vehicle", str(vehicle), *arguments]) == BAD_INPUT
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_an_effect_that_came_later_asks_to_calibrate_again(other_car, tmp_path):
    """As from a package that was installed since, or a catalogue that has grown."""
    path, written = tmp_path / "car.json", json.loads(to_json(other_car.found.calibration))
    path.write_text(json.dumps(written))
    trust = read_trust(path)
    trust.check_knows(tuple(CATALOGUE), path)  # columns that were missing are no effect that was
    with pytest.raises(
        InvalidCalibrationError, match=r"car.json: .* not know steering_gain.*calibrate again.*--exclude"
    ):
        trust.check_knows((*CATALOGUE, "steering_gain"), path)
    before = written | {"catalogue": [name for name in CATALOGUE if name != "gyro_bias"]}
    path.write_text(json.dumps(before))
    read_trust(path).check_knows([name for name in CATALOGUE if name != "gyro_bias"], path)
    with pytest.raises(InvalidCalibrationError, match="does not know gyro_bias"):
        read_trust(path).check_knows(tuple(CATALOGUE), path)


def test_a_calibration_by_likelihood_needs_no_effects(identified, tmp_path):
    (tmp_path / "car.json").write_text(to_json(identified.calibration))
    read_trust(tmp_path / "car.json").check_knows(("steering_gain",), tmp_path / "car.json")


def test_diagnose_and_check_refuse_an_older_calibration(other_car, tmp_path, capsys):
    written = json.loads(to_json(other_car.found.calibration))
    path, car, logs = tmp_path / "car.json", tmp_path / "car.yaml", tmp_path / "logs"
    path.write_text(json.dumps(written | {"catalogue": [name for name in CATALOGUE if name != "gyro_bias"]}))
    other_car.guess.to_yaml(car)
    write_run(other_car.runs[0], logs / "run_0.csv")
    for name in ("diagnose", "check"):
        assert main([name, str(logs), "--vehicle", str(car), "--calibration", str(path)]) == BAD_INPUT
        error = capsys.readouterr().err
        assert "does not know gyro_bias" in error
        assert "calibrate again" in error
        assert error.count("\n") == 1
