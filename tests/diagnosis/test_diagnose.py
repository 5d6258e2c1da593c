"""A diagnosis end to end on short runs: the answer's contract, bad runs, missing columns, the corrected vehicle."""

import dataclasses
import json
import math
import shutil
import subprocess

import numpy as np
import pytest

from drift_drake.diagnosis.answer import InvalidAnswerError, read_answer
from drift_drake.diagnosis.correction import corrected_vehicle
from drift_drake.diagnosis.diagnose import diagnose
from drift_drake.diagnosis.report import write_report
from drift_drake.estimation.interval import Interval
from drift_drake.estimation.problem import filter_case, make_problem
from drift_drake.estimation.seen_effects import seen_effects
from drift_drake.logs.cases import case_folders
from drift_drake.logs.table import InvalidLogError, write_run
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.parameters import VehicleParameters

FEW = ("rear_stiffness_error", "aero_drag", "steering_lag")


BROWSER = shutil.which("chromium") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def diagnosis(stiffness_case):
    seen = []
    done = diagnose(
        stiffness_case[1],
        VehicleParameters(),
        case="short",
        catalogue=FEW,
        progress=lambda _, share: seen.append(share),
    )
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    return done


def test_the_cause_is_found_with_its_magnitude(diagnosis, stiffness_case):
    answer = diagnosis.answer
    truth = stiffness_case[0].effects["rear_stiffness_error"]
    assert answer.verdict == "effect"
    assert answer.causes == ["rear_stiffness_error"]
    interval = answer.magnitudes["rear_stiffness_error"]
    assert interval.low < truth < interval.high
    assert "rear_stiffness_error" in answer.sentence()
    assert answer.details["suspicions"] == []


def test_the_answer_follows_the_contract(diagnosis, tmp_path):
    path = tmp_path / "answer.json"
    diagnosis.answer.write(path)
    data = json.loads(path.read_text())
    assert set(data) >= {
        "case", "verdict", "causes", "posterior", "ambiguity", "magnitudes", "where", "reduction", "seconds"
    }  # fmt: skip
    assert sum(data["posterior"].values()) == pytest.approx(1.0, abs=1e-4)
    assert all(name == "+".join(sorted(name.split("+"))) for name in data["posterior"])
    assert sum(data["where"]["states"].values()) == pytest.approx(1.0, abs=1e-4)
    assert sum(data["where"]["runs"].values()) == pytest.approx(1.0, abs=1e-4)
    assert set(data["where"]["states"]) == {"r", "v", "beta", "omega_r"}
    assert data["reduction"]["low"] <= data["reduction"]["estimate"] <= data["reduction"]["high"] <= 1.0
    assert data["reduction"]["estimate"] > 0.5
    assert read_answer(path).causes == diagnosis.answer.causes


def test_the_corrected_vehicle_has_the_effect_and_the_tolerances(diagnosis):
    vehicle, effects = corrected_vehicle(VehicleParameters(), diagnosis.answer)
    assert effects.rear_stiffness_error == diagnosis.answer.magnitudes["rear_stiffness_error"].estimate
    assert vehicle.gear_ratio != VehicleParameters().gear_ratio
    same, _ = corrected_vehicle(VehicleParameters(), diagnosis.answer, tolerances=False)
    assert same == VehicleParameters()


@pytest.fixture(scope="module")
def report(diagnosis, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(diagnosis, path)
    return path


def test_the_report_is_one_file_that_says_the_verdict(report, diagnosis):
    text = report.read_text()
    assert diagnosis.answer.causes[0] in text
    assert text.count("<svg") == 8
    for outside in ("<link", "<script", 'src="http', "url(http"):
        assert outside not in text


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_the_report_opens_in_a_browser(report):
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", report.as_uri()]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    assert shown.count("<svg") == 8
    assert "How far it shrinks" in shown


def test_missing_columns_narrow_the_catalogue(stiffness_case):
    names, warnings = seen_effects([run.without("tau_cmd", "psi") for run in stiffness_case[1]], list(CATALOGUE))
    assert "torque_lag" not in names
    assert "gyro_bias" not in names
    assert "friction_level" in names
    assert any("tau_cmd is missing" in warning for warning in warnings)


def test_torque_that_is_not_logged_is_fed_through_the_wheel_speed(stiffness_case):
    runs = [run.without("tau_cmd") for run in stiffness_case[1]]
    problem = make_problem(runs, VehicleParameters())
    theta = np.append(np.zeros(problem.nuisances), stiffness_case[0].effects["rear_stiffness_error"])
    innovations = filter_case(problem, theta, ("rear_stiffness_error",)).innovations
    e = np.concatenate([e[run.counted] for run, e in zip(problem.runs, innovations, strict=True)])
    assert np.mean(e**2) < 1.3


def test_folders_of_cases_are_told_from_cases(stiffness_case, tmp_path):
    with pytest.raises(InvalidLogError, match="holds no runs"):
        case_folders(tmp_path)
    with pytest.raises(InvalidLogError, match="no such folder"):
        case_folders(tmp_path / "nothing")
    (tmp_path / "one").mkdir()
    write_run(stiffness_case[1][0], tmp_path / "one" / "run_0.csv")
    assert case_folders(tmp_path) == [tmp_path / "one"]
    assert case_folders(tmp_path / "one") == [tmp_path / "one"]


def test_none_says_how_little_a_row_was_worth(diagnosis):
    answer = dataclasses.replace(diagnosis.answer, verdict="none", causes=[], posterior={"none": 0.6})
    assert answer.details["row_weight"] == 1.0
    assert answer.sentence().endswith("tolerances and the sensors' noise.")
    light = dataclasses.replace(answer, details={"row_weight": 0.0011})
    assert "everyday misfit, with a row worth 0.0011 (probability 0.60)" in light.sentence()


def test_a_number_that_is_none_is_written_as_null_and_no_reduction_of_an_effect(diagnosis, tmp_path):
    where = diagnosis.answer.where | {"horizons": {"2 s": math.nan}}
    path = tmp_path / "answer.json"
    dataclasses.replace(diagnosis.answer, where=where).write(path)
    assert json.loads(path.read_text())["where"]["horizons"] == {"2 s": None}
    assert read_answer(path).causes == diagnosis.answer.causes
    dataclasses.replace(diagnosis.answer, reduction=Interval(math.nan, 0.0, 1.0)).write(path)
    with pytest.raises(InvalidAnswerError, match=r"reduction.estimate: None is no number"):
        read_answer(path)
    path.write_text(path.read_text().replace("null", "NaN"))
    with pytest.raises(InvalidAnswerError, match="holds 'NaN', which is no finite number"):
        read_answer(path)


@pytest.mark.parametrize(
    ("text", "says"), [("{", "not JSON"), ("{}", "missing case, verdict"), (None, "cannot be read")]
)
def test_bad_answers_get_one_sentence(tmp_path, text, says):
    path = tmp_path / "answer.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InvalidAnswerError, match=says):
        read_answer(path)
