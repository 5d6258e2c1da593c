"""Calibration by prediction and a later change through the command line: files, options, errors."""

import json

import numpy as np
import pytest

from drift_drake.car.log.table import write_run
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle
from drift_drake.cli.main import BAD_INPUT, main
from drift_drake.common.run_folder import to_json
from drift_drake.gap.diagnosis.check import with_vehicle as check_limits
from drift_drake.gap.estimation.partial import partial_effects
from drift_drake.gap.identification import identify as identification


def write_day(folder, runs):
    folder.mkdir()
    for run in runs:
        write_run(run, folder / f"{run.name}.csv")


@pytest.fixture(scope="module")
def files(other_car, tmp_path_factory):
    """The calibrated car as `identify` writes it, and logs of a late day and of half of it."""
    folder = tmp_path_factory.mktemp("days")
    late = other_car.day({"steering_delay": 0.08}, 1)
    write_day(folder / "late", late)
    write_day(folder / "half", late[:2])
    write_vehicle(folder / "car.yaml", other_car.found.vehicle, other_car.found.effects)
    (folder / "car.json").write_text(to_json({"normal": other_car.normal}))
    return folder


def test_identify_takes_several_days_and_writes_the_baseline(other_car, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(identification, "FURTHER", ())
    monkeypatch.chdir(tmp_path)
    for k, name in enumerate(("monday", "tuesday")):
        write_day(tmp_path / name, [run.rows(0, 500) for run in other_car.runs[2 * k : 2 * k + 2]])
    other_car.guess.to_yaml("start.yaml")
    code = main(["identify", "monday", "tuesday", "--vehicle", "start.yaml", "--out", "car.yaml", "--json", "car.json",
                 "--criterion", "prediction", "--car", "single-track", "--effects", "tyre_relaxation", "--quiet",
                 "--known", "mass",
                 "yaw_inertia", "front_axle_distance", "rear_axle_inertia", "torque", "steering_offset"])  # fmt: skip
    assert code == 0
    assert "--calibration car.json" in capsys.readouterr().out
    data = json.loads((tmp_path / "car.json").read_text())
    assert data["case"] == "monday+tuesday"
    assert data["criterion"] == "prediction"
    vehicle, _ = read_vehicle("car.yaml")
    assert vehicle.friction == pytest.approx(data["parameters"]["friction"]["estimate"])
    normal = data["normal"]
    scores = len(normal["names"]) + len(partial_effects(normal["names"]))
    assert np.shape(normal["covariance"]) == np.shape(normal["left_open"]) == (scores, scores)
    assert len(normal["left_out"]) == len(normal["left_out_none"]) == 4  # runs of both days


def diagnose(files, *more, logs="late"):
    return main(["diagnose", str(files / logs), "--vehicle", str(files / "car.yaml"), "--calibration",
                 str(files / "car.json"), "--quiet", "--workers", "1", *more])  # fmt: skip


def test_diagnose_names_the_cause_and_apply_writes_it(files, tmp_path, capsys):
    answer, report = tmp_path / "late.json", tmp_path / "late.html"
    code = diagnose(files, "--json", str(answer), "--report", str(report), "--effects", "steering_delay", "gyro_bias",
                    "friction_level", "--without", "ax", "ay", "x", "y", "--every", "2")  # fmt: skip
    assert code == 0
    data = json.loads(answer.read_text())
    assert data["causes"] == ["steering_delay"]
    assert set(data["details"]["detection"]) == {"steering_delay", "gyro_bias", "friction_level"}
    assert any("columns x, y, ax, ay are missing" in warning for warning in data["warnings"])
    html = report.read_text(encoding="utf-8")
    assert "--every 2" in html
    assert f"drift-drake apply {answer}" in html
    out = tmp_path / "corrected.yaml"
    assert main(["apply", str(answer), "--vehicle", str(files / "car.yaml"), "--out", str(out)]) == 0
    _, own = read_vehicle(files / "car.yaml")
    _, effects = read_vehicle(out)
    added = effects.steering_delay - own.steering_delay
    assert added == pytest.approx(data["magnitudes"]["steering_delay"]["estimate"])
    assert effects.tyre_relaxation == own.tyre_relaxation
    capsys.readouterr()
    code = main(["plan-next", str(answer), "--vehicle", str(files / "car.yaml"), "--out", str(tmp_path / "plan.csv")])
    error = capsys.readouterr().err
    assert code == BAD_INPUT
    sentence = error.splitlines()[-1]  # after what is compiled, the first time
    assert sentence.startswith("drift-drake: ")
    assert "steering_delay has no rival left" in sentence


def test_an_excluded_effect_is_not_considered(files, tmp_path):
    answer = tmp_path / "late.json"
    code = diagnose(files, "--json", str(answer), "--effects", "steering_delay", "mass_error", "--exclude",
                    "steering_delay", logs="half")  # fmt: skip
    assert code == 0
    data = json.loads(answer.read_text())
    assert list(data["details"]["detection"]) == ["mass_error"]
    assert not any("steering_delay" in name for name in data["posterior"])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--without", "beta"], "late: column beta is missing"),
        (["--every", "0"], "--every 0"),
        (["--without", "r"], "--without r"),
        (["--exclude", "wind"], "unknown effect wind"),
        (["--tempering", "0.5"], "--calibration has the scales and the likelihood tempering exponent"),
    ],
)
def test_bad_input_is_one_sentence(files, capsys, options, says):
    assert diagnose(files, *options) == BAD_INPUT
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_a_calibration_of_another_shape_is_refused(files, other_car, tmp_path, capsys):
    (tmp_path / "car.json").write_text(json.dumps({"normal": other_car.normal.as_data() | {"expected": [0.0]}}))
    code = main(["diagnose", str(files / "late"), "--vehicle", str(files / "car.yaml"), "--calibration",
                 str(tmp_path / "car.json"), "--quiet"])  # fmt: skip
    error = capsys.readouterr().err
    assert code == BAD_INPUT
    assert "car.json" in error
    assert error.count("\n") == 1


def test_check_says_what_a_day_could_show_relative_to_the_baseline(files, monkeypatch, capsys):
    monkeypatch.setattr(check_limits, "seen_effects", lambda _runs, _names: (["steering_delay", "gyro_bias"], []))
    code = main(["check", str(files / "half"), "--vehicle", str(files / "car.yaml"), "--calibration",
                 str(files / "car.json"), "--json", "-", "--workers", "1"])  # fmt: skip
    assert code == 0
    detection = json.loads(capsys.readouterr().out)["detection"]
    assert set(detection) == {"steering_delay", "gyro_bias"}
    assert 0.0 < detection["steering_delay"]["least"] < 0.08
