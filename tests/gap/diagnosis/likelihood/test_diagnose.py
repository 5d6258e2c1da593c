"""A diagnosis end to end on short runs: the answer's contract, bad runs, missing columns, the corrected vehicle."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest
from browser import check_charts, needs_browser

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.cases import case_folders
from drift_drake.car.log.table import InvalidLogError, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.answers.answer import InvalidAnswerError, read_answer
from drift_drake.gap.diagnosis.answers.apply import corrected_vehicle
from drift_drake.gap.diagnosis.likelihood.diagnose import diagnose
from drift_drake.gap.diagnosis.likelihood.isolability import Isolability
from drift_drake.gap.diagnosis.reports.report import report_html, worst_runs
from drift_drake.gap.diagnosis.reports.trials import half_second_ahead
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import no_effects
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.prior import Interval
from drift_drake.gap.estimation.usable import seen_effects

FEW = ("rear_stiffness_error", "aero_drag", "steering_lag")


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


def test_a_case_that_is_cut_says_so(stiffness_case):
    cut = diagnose(stiffness_case[1], VehicleParameters(), catalogue=FEW[:1], most_seconds=6.5)
    assert cut.answer.causes == [FEW[0]]
    assert set(cut.answer.where["runs"]) == {"run_0", "run_2"}
    assert "of 12 s of logs 6 s are used, 2 pieces spread evenly over them" in cut.answer.warnings


def test_the_corrected_vehicle_has_the_effect_and_the_tolerances(diagnosis):
    vehicle, effects = corrected_vehicle(VehicleParameters(), diagnosis.answer)
    assert effects.rear_stiffness_error == diagnosis.answer.magnitudes["rear_stiffness_error"].estimate
    assert vehicle.gear_ratio != VehicleParameters().gear_ratio
    same, _ = corrected_vehicle(VehicleParameters(), diagnosis.answer, tolerances=False)
    assert same == VehicleParameters()


@pytest.fixture(scope="module")
def report(diagnosis, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report_html(diagnosis), encoding="utf-8")
    return path


def test_the_report_is_one_file_that_says_the_verdict_and_what_comes_next(report, diagnosis):
    text = report.read_text(encoding="utf-8")
    assert diagnosis.answer.causes[0] in text
    assert text.count("plotly.js v") == 1
    for said in ("corrected car", "drift-drake apply", "How far the gap is reduced", "<dt>ambiguity set</dt>"):
        assert said in text
    for outside in ("<script src", 'src="http', "url(http", "@import"):
        assert outside not in text


def as_verdict(diagnosis, verdict):
    answer = dataclasses.replace(diagnosis.answer, verdict=verdict, causes=[], magnitudes={})
    limits = {"mass_error": {"unit": "-", "least": 0.05, "taken_for": "none"}}
    answer = dataclasses.replace(answer, posterior={verdict: 1.0, **answer.posterior}, ambiguity=[verdict],
                                 details=answer.details | {"detection": limits})  # fmt: skip
    return report_html(dataclasses.replace(diagnosis, answer=answer))


def test_without_a_gap_predictions_driving_and_limits_are_drawn(diagnosis):
    html = as_verdict(diagnosis, "none")
    assert "What these logs could have shown" in html
    assert html.count('class="timeline"') == len(diagnosis.runs)
    assert '"name":"nominal"' in html
    for absent in ("Where the gap is", "drift-drake apply", '"name":"corrected"'):
        assert absent not in html


def test_of_an_unknown_gap_no_corrected_car_is_drawn(diagnosis):
    html = as_verdict(diagnosis, "unknown")
    assert "Where the gap is, when, and in which force" in html
    assert '"name":"nominal"' in html
    for absent in ("drift-drake apply", '"name":"corrected"', "How far the gap is reduced"):
        assert absent not in html


@needs_browser
def test_the_reports_of_all_verdicts_open_in_a_browser(report, diagnosis, tmp_path):
    others = [tmp_path / f"{verdict}.html" for verdict in ("none", "unknown")]
    for path in others:
        path.write_text(as_verdict(diagnosis, path.stem), encoding="utf-8")
    check_charts(report, *others)


def test_a_rival_is_laid_over_its_prediction_that_of_the_car_with_it(report, diagnosis, browser):
    name, run = diagnosis.answer.causes[0], worst_runs(diagnosis)[0]
    page = browser.new_page()
    page.goto(report.as_uri())
    page.get_by_role("button", name=name).click()
    left = page.evaluate("""document.querySelector("#overlay .chart").data
      .filter(line => line.name === "with the effect tried").map(line => [...line.y])[1]""")
    nothing = no_effects(diagnosis.problem)
    q = diagnosis.answer.magnitudes[name].estimate
    fit = dataclasses.replace(nothing, names=(name,), theta=np.append(nothing.theta, q))
    rows, predicted = half_second_ahead(diagnosis.problem, fit, run)
    np.testing.assert_allclose(left, diagnosis.problem.runs[run].y[rows, 0] - predicted[:, 0], atol=1e-4)
    said = float(re.search(r"are (\S+) of", page.locator("#said").inner_text())[1])
    assert said < 0.3
    page.close()


def test_limits_to_first_order_grow_with_the_likeness_to_another_effect():
    found = Isolability(("mass_error", "cg_shift"), np.array([[1.0, 0.99], [0.99, 1.0]]), np.array([1e-3, 1e-3]))
    apart = dataclasses.replace(found, likeness=np.eye(2))
    near, far = (one.limits(VehicleParameters())["mass_error"] for one in (found, apart))
    assert far == {"unit": "-", "least": pytest.approx(5.34e-3, rel=1e-2), "taken_for": "none"}
    assert near["least"] == pytest.approx(3.29e-3 / np.sqrt(1 - 0.99**2), rel=1e-3)
    assert near["taken_for"] == "cg_shift"
    vague = dataclasses.replace(apart, deviation=np.array([1.0, 1.0]))
    assert vague.limits(VehicleParameters())["mass_error"]["least"] is None


def test_missing_columns_narrow_the_catalogue(stiffness_case):
    names, warnings = seen_effects([run.without("tau_cmd", "psi") for run in stiffness_case[1]], list(CATALOGUE))
    assert "torque_lag" not in names
    assert "gyro_bias" not in names
    assert "friction_level" in names
    assert any("tau_cmd" in warning and "missing" in warning for warning in warnings)


def test_torque_that_is_not_logged_is_fed_through_the_wheel_speed(stiffness_case):
    runs = [run.without("tau_cmd") for run in stiffness_case[1]]
    problem = make_problem(runs, VehicleParameters())
    theta = np.append(np.zeros(problem.nuisances), stiffness_case[0].effects["rear_stiffness_error"])
    innovations = filter_case(problem, theta, ("rear_stiffness_error",)).innovations
    e = np.concatenate([e[run.counted] for run, e in zip(problem.runs, innovations, strict=True)])
    assert np.mean(e**2) < 1.3


def test_folders_of_cases_are_distinguished_from_cases(stiffness_case, tmp_path):
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
    assert answer.details["tempering"] == 1.0
    assert answer.sentence().endswith("tolerances and the sensors' noise.")
    light = dataclasses.replace(answer, details={"tempering": 0.0011})
    assert "model discrepancy, at a likelihood tempering exponent of 0.0011 (probability 0.60)" in light.sentence()


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
    ("details", "says"),
    [
        ({"with": {"steering_lag": "x"}}, r"details\.with\.steering_lag: 'x' is no number"),
        ({"with": {"nothing": 1.0}}, r"details\.with names 'nothing'"),
        ({"with": [1.0]}, r"details\.with is \[1\.0\], not an object"),
        ({"at_least": 5}, r"details\.at_least is 5, not a list of names"),
        ({"familiar": "x"}, r"details\.familiar: 'x' is no number"),
        ({"detection": {"mass_error": {"least": "x"}}}, r"details\.detection\.mass_error\.least: 'x' is no number"),
        ({"detection": {"mass_error": {}}}, r"details\.detection\.mass_error\.least: 'missing' is no number"),
        ({"detection": 5}, r"details\.detection is 5, not an object"),
    ],
)
def test_details_that_are_read_are_checked(diagnosis, tmp_path, details, says):
    path = tmp_path / "answer.json"
    dataclasses.replace(diagnosis.answer, details=details).write(path)
    with pytest.raises(InvalidAnswerError, match=says):
        read_answer(path)


def test_a_share_that_is_not_known_is_said(diagnosis):
    nearest = {"magnitudes": {}, "removes": None, "free_forces_remove": None}
    answer = dataclasses.replace(
        diagnosis.answer, verdict="unknown", posterior={"unknown": 1.0}, details={"nearest": nearest}
    )
    assert "the calibrated car as it is, removes an unknown share of it" in answer.sentence()


def test_a_nearest_hypothesis_that_stretches_the_vehicle_file_says_so(diagnosis):
    magnitudes = {"aero_drag": {"estimate": 0.3, "low": 0.2, "high": 0.4}}
    nearest = {"magnitudes": magnitudes, "removes": 0.95, "free_forces_remove": 0.97}
    answer = dataclasses.replace(
        diagnosis.answer, verdict="unknown", posterior={"unknown": 1.0}, details={"nearest": nearest},
        tolerances={"rear_stiffness": 19.1, "mass": -0.4, "torque": -5.2},
    )  # fmt: skip
    assert "with rear_stiffness +19 and torque -5 tolerances off, removes 95 %" in answer.sentence()
    assert "tolerances" not in dataclasses.replace(answer, tolerances={"mass": -0.4}).sentence()


@pytest.mark.parametrize(
    ("text", "says"), [("{", "not JSON"), ("{}", "missing case, verdict"), (None, "cannot be read")]
)
def test_bad_answers_get_one_sentence(tmp_path, text, says):
    path = tmp_path / "answer.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InvalidAnswerError, match=says):
        read_answer(path)
