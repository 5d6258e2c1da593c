"""`drift-drake check`: what it says of logs without a vehicle file, with one, and of a single run's file."""

import json

import numpy as np
import pytest
from browser import check_charts, check_looks, needs_browser

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.main import main
from drift_drake.gap.diagnosis.check.check import check


@pytest.fixture(scope="module")
def files(stiffness_case, tmp_path_factory):
    folder = tmp_path_factory.mktemp("check")
    for index, run in enumerate(stiffness_case[1]):
        write_run(run, folder / "monday" / f"run_{index}.csv")
    write_vehicle(folder / "car.yaml", VehicleParameters(), Effects())
    return folder


def test_without_a_vehicle_file_quality_alone_is_said(files, capsys):
    assert main(["check", str(files / "monday"), "--json", "-"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert len(found["runs"]) == 4
    first = found["runs"][0]
    assert first["rate"] == pytest.approx(100.0)
    assert first["missing"] == []
    assert first["noise"]["r"] == pytest.approx(0.002, rel=0.4)
    assert found["detection"] == {}
    assert "columns: all of the log format" in err


def test_bad_samples_and_missing_columns_are_said(stiffness_case, tmp_path, capsys):
    run = stiffness_case[1][0]
    v = run.v.copy()
    v[100] = 55.0
    write_run(Run(run.name, run.t, run.r, v, run.delta_cmd), tmp_path / "one.csv")
    assert main(["check", str(tmp_path / "one.csv"), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["case"] == "one"
    assert found["runs"][0]["bad"] == {"v": 1}
    assert "tau_cmd" in found["runs"][0]["missing"]
    assert any("v has a spike" in remark for remark in found["remarks"])


def test_with_a_vehicle_file_limits_are_no_finer_than_its_tolerances(files, capsys):
    assert main(["check", str(files / "monday"), "--vehicle", str(files / "car.yaml"), "--json", "-"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert sum(found["regions"].values()) == pytest.approx(12.0, abs=1.0)
    # Both scale the same friction, so that the effect cannot be seen within the tolerance.
    assert found["detection"]["friction_level"]["least"] > 2.0 * VehicleParameters().tolerance.friction
    assert found["detection"]["gyro_bias"]["least"] < 0.01
    assert "would be named, from this magnitude on" in err


def test_for_a_calibration_the_missing_drives_and_the_outlook_are_said(other_car, tmp_path, capsys):
    for index, run in enumerate(other_car.runs):
        write_run(run, tmp_path / "monday" / f"run_{index}.csv")
    other_car.guess.to_yaml(tmp_path / "start.yaml")
    asked = ["check", str(tmp_path / "monday"), "--vehicle", str(tmp_path / "start.yaml"), "--for-calibration"]
    assert main([*asked, "--json", "-"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)["for_calibration"]
    assert found["good_enough"] == (not any(one["grave"] for one in found["missing"]))
    assert "to calibrate a car on: " in err
    for one in found["missing"]:
        assert one["drive"] in err
    now, twice, four = found["outlook"]["steering_offset"]
    assert four <= twice <= now
    # As the calibration itself says, which has been fitted.
    assert 0.4 < now / other_car.found.calibration.outlook["steering_offset"][0] < 2.5


def test_gentle_logs_are_not_good_enough(tmp_path, capsys):
    t = np.arange(0.0, 30.0, 0.01)
    noise = np.random.default_rng(0).normal(size=(2, len(t)))
    r = 0.02 * np.sin(t)
    run = Run("run_0", t, r + 1e-3 * noise[0], 20.0 + 0.02 * noise[1], r * 2.5 / 20.0)
    write_run(run, tmp_path / "motorway" / "run_0.csv")
    VehicleParameters().to_yaml(tmp_path / "start.yaml")
    assert main(["check", str(tmp_path / "motorway"), "--vehicle", str(tmp_path / "start.yaml"),
                 "--for-calibration"]) == 0  # fmt: skip
    out = capsys.readouterr().out
    assert "to calibrate a car on: not good enough; 'drift-drake identify' refuses them" in out
    assert "slowly tightened until the car slides" in out
    assert "would stay at the first guess: friction" in out


def test_mistakes_are_one_sentence(files, capsys):
    assert main(["check", str(files / "monday"), "--for-calibration"]) == 2
    assert "give --vehicle" in capsys.readouterr().err
    assert main(["check", str(files / "monday"), "--calibration", str(files / "car.yaml")]) == 2
    assert "give --vehicle too" in capsys.readouterr().err
    assert main(["check", str(files / "nothing")]) == 2
    assert "no such folder" in capsys.readouterr().err


@pytest.mark.parametrize(("verdicts", "code"), [(["none", "none"], 0), (["none", "unknown"], 3), (["effect"], 3)])
def test_a_gap_has_an_exit_code_where_it_is_asked_for(files, monkeypatch, verdicts, code):
    from types import SimpleNamespace

    from drift_drake.cli import diagnose as command

    answers = [SimpleNamespace(verdict=verdict) for verdict in verdicts]
    monkeypatch.setattr(command, "_diagnose_one", lambda *_: answers[0])
    monkeypatch.setattr(command, "_diagnose_many", lambda *_: answers)
    monkeypatch.setattr(command, "case_folders", lambda case: [case] * len(answers))
    asked = ["diagnose", str(files / "monday"), "--vehicle", str(files / "car.yaml")]
    if len(answers) == 1:
        assert main([*asked, "--exit-code"]) == code
    else:
        monkeypatch.setattr(command, "case_folders", lambda _case: [files, files])
        assert main([*asked, "--exit-code"]) == code
    assert main(asked) == 0


def test_a_mistyped_effect_or_column_is_guessed(files, capsys):
    asked = ["diagnose", str(files / "monday"), "--vehicle", str(files / "car.yaml")]
    assert main([*asked, "--effects", "frictionlevel"]) == 2
    assert "did you mean friction_level" in capsys.readouterr().err
    assert main([*asked, "--without", "bta"]) == 2
    assert "did you mean beta" in capsys.readouterr().err


@needs_browser
def test_a_report_shows_what_is_used_and_what_would_be_seen(files, tmp_path, browser):
    plain, page = tmp_path / "plain.html", tmp_path / "check.html"
    assert main(["check", str(files / "monday"), "--report", str(plain)]) == 0
    assert "Nothing looks wrong" in plain.read_text(encoding="utf-8")
    words = ["check", str(files / "monday"), "--vehicle", str(files / "car.yaml"), "--report", str(page)]
    assert main(words) == 0
    text = page.read_text(encoding="utf-8")
    assert text.count('class="timeline"') == 4
    assert text.count('role="listitem"') > 20  # least sizes of effects
    assert "drift-drake check" in text
    check_charts(page)
    check_looks(browser, plain, page)


def test_a_small_cars_effects_are_seen():
    """A relaxation length near zero is stiffer than a row's steps can follow: it must not hide all other effects."""
    small = VehicleParameters(
        mass=1.58, yaw_inertia=0.0048, front_axle_distance=0.08, rear_axle_distance=0.0935, wheel_radius=0.03,
        rear_axle_inertia=2e-4, gear_ratio=1.0, friction=1.0, front_stiffness=50.0, rear_stiffness=50.0,
        torque_min=-0.1, torque_max=0.6, steering_limit=0.45,
    )  # fmt: skip
    rng, t = np.random.default_rng(0), 0.02 * np.arange(1000)
    delta = 0.08 * (np.sin(1.3 * t) + np.sin(2.9 * t))
    v, length = 2.0 + 0.4 * np.sin(0.7 * t), small.front_axle_distance + small.rear_axle_distance
    r, beta = v * np.tan(delta) / length, small.rear_axle_distance * np.tan(delta) / length
    levels = {"r": (r, 0.01), "v": (v, 0.01), "beta": (beta, 0.003), "omega_r": (v, 0.01)}
    noisy = {name: values + level * rng.normal(size=len(t)) for name, (values, level) in levels.items()}
    run = Run(name="small", t=t, delta_cmd=delta, tau_cmd=np.full(len(t), 0.01), **noisy)
    found = check([run], small).detection
    seen = {name for name, limit in found.items() if limit["least"] is not None}
    assert {"friction_level", "steering_lag", "steering_offset", "sensor_latency"} <= seen
