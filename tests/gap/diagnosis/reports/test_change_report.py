"""The report of a change: what each verdict shows and leaves out, and that nothing comes from elsewhere."""

import dataclasses
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from browser import check_charts, check_looks, needs_browser

from drift_drake.car.effects.catalogue import CATALOGUE, shown_by
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.reports.change_report import by_horizon, coverage_rows, overlay, report_html, worst_run
from drift_drake.gap.estimation.prior import REACH
from drift_drake.gap.evidence.limit_rows import limit_rows
from drift_drake.view.pages.page import Source


def text_of(html):
    """What is read, without pictures and marks."""
    html = re.sub(r"<(script|style).*?</\1>", " ", html, flags=re.DOTALL)
    return unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html.replace("<wbr>", ""))))


def test_a_named_cause_is_shown_with_its_pictures_and_the_command_that_applies_it(late_day):
    source = Source("drift-drake diagnose late", Path("late"), Path("car.yaml"), Path("car.json"), Path("late.json"))
    html = report_html(late_day, source)
    said = text_of(html)
    answer = late_day.answer
    assert answer.sentence() in said
    assert html.count('class="chart"') == 5  # with both of how it was driven
    assert '"name":"corrected"' in html
    assert "drift-drake apply late.json --vehicle car.yaml --out corrected.yaml" in said
    for word in (
        "transport delay of the steering command",
        "run_3",
        "car.json",
        "drift_drake 0",
        *answer.where["states"],
    ):
        assert word in said
    assert all(region in said for region in answer.where["regions"])
    for loaded in ("<script src", 'src="http', "url(http", "@import"):
        assert loaded not in html


@needs_browser
def test_its_charts_are_drawn(late_day, plain_day, tmp_path):
    paths = tmp_path / "late.html", tmp_path / "plain.html"
    for path, day in zip(paths, (late_day, plain_day), strict=True):
        path.write_text(report_html(day), encoding="utf-8")
    check_charts(*paths)


def test_it_is_readable_in_the_dark_and_on_a_phone(late_day, plain_day, tmp_path, browser):
    paths = tmp_path / "late.html", tmp_path / "plain.html"
    for path, day in zip(paths, (late_day, plain_day), strict=True):
        path.write_text(report_html(day), encoding="utf-8")
    check_looks(browser, *paths)


def test_a_rival_is_laid_over_by_a_click_and_its_size_by_a_slider(late_day, tmp_path, browser):
    path = tmp_path / "late.html"
    path.write_text(report_html(late_day), encoding="utf-8")
    page = browser.new_page()
    page.goto(path.as_uri())
    drawn = """document.querySelector("#overlay .chart").data
      .filter(line => line.name === "with the effect tried").map(line => [...line.y])"""
    assert [len(y) for y in page.evaluate(drawn)] == [0] * 8
    page.get_by_role("button", name="steering_delay").click()
    predicted = page.evaluate(drawn)
    day, run = late_day.search.day, worst_run(late_day)
    right = day.errors_with({"steering_delay": late_day.answer.magnitudes["steering_delay"].estimate})
    windows = day.run == run
    # Half a second ahead, between two sizes that were simulated; every second of the lines is of errors.
    np.testing.assert_allclose(predicted[1], right[windows, -1, 0], atol=0.02)
    said = float(re.search(r"are (\S+) of", page.locator("#said").inner_text())[1])
    assert said < 0.1
    page.get_by_label("size").focus()
    page.keyboard.press("Home")  # the least size
    assert page.locator("#said").inner_text().startswith("0 s: squared errors are 1 of")
    np.testing.assert_allclose(page.evaluate(drawn)[1], day.errors[windows, -1, 0], atol=1e-3)
    place = """[...document.querySelectorAll("#overlay .js-line")]
      .filter(line => line.style.stroke === "rgb(204, 121, 167)")
      .map(line => line.getBBox()).flatMap(box => [box.x, box.y, box.width, box.height])"""
    moved = page.evaluate(place)
    assert len(moved) == 4 * 8
    page.wait_for_timeout(1500)  # until the chart itself has drawn the lines that the slider moved
    np.testing.assert_allclose(page.evaluate(place), moved, atol=1.0)
    page.close()


def test_without_a_gap_predictions_driving_and_limits_are_drawn(plain_day):
    html = report_html(plain_day)
    assert html.count('class="chart"') == 3
    assert html.count('class="timeline"') == len(plain_day.runs)
    assert "Where the gap is" not in html
    assert '"name":"corrected"' not in html
    assert "What these logs could have shown" in html
    assert "drift-drake apply" not in html
    for name in plain_day.answer.details["detection"]:
        assert f"{name}" in html.replace("<wbr>", "")


def test_an_unknown_gap_has_a_place_and_no_corrected_car(strange_day):
    html = report_html(strange_day)
    assert html.count('class="chart"') == 5
    assert "Where the gap is" in html
    assert '"name":"corrected"' not in html
    assert "drift-drake apply" not in html
    assert "It acts like gyro_bias by direction of the turn" in html


def test_what_comes_along_and_what_is_a_bound_is_said(late_day):
    details = late_day.answer.details | {"with": {"rear_stiffness_error": 0.12}, "at_least": ["steering_delay"]}
    answer = dataclasses.replace(late_day.answer, details=details)
    said = text_of(report_html(dataclasses.replace(late_day, answer=answer)))
    assert "rear_stiffness_error +0.12 comes along" in said
    assert "at least" in said


def test_names_of_files_are_escaped(plain_day):
    html = report_html(plain_day, Source(case=Path("<b>&")))
    assert "&lt;b&gt;&amp;" in html


def limit(least, taken_for="none"):
    return {"unit": "-", "least": least, "taken_for": taken_for}


def test_bars_are_shares_of_the_practical_range_and_what_cannot_be_named_comes_last():
    car = VehicleParameters()
    limits = {"aero_drag": limit(None, "mass_error"), "mass_error": limit(0.1), "steering_rate_limit": limit(0.6),
              "torque_lag": limit(0.5)}  # fmt: skip
    rows = limit_rows(limits, car)
    assert [row.name for row in rows] == ["mass_error", "steering_rate_limit", "torque_lag", "aero_drag"]
    # Of an asymmetrical range the larger end counts; the lowest rate limit of the range acts most.
    assert rows[0].share == pytest.approx(0.1 / 0.2)
    assert rows[1].share == pytest.approx(CATALOGUE["steering_rate_limit"].range_for(car)[0] / 0.6)
    assert rows[1].least == "up to 0.6 rad/s"
    assert rows[2].share == pytest.approx(0.5 / 0.4)
    assert not rows[3].named
    assert rows[3].share == REACH
    assert rows[3].taken_for == "mass_error"


def test_what_cannot_be_named_is_said_and_a_drive_that_shows_it(plain_day):
    details = plain_day.answer.details | {"detection": {"gyro_bias": limit(None), "mass_error": limit(0.05)}}
    said = text_of(
        report_html(dataclasses.replace(plain_day, answer=dataclasses.replace(plain_day.answer, details=details)))
    )
    assert "gyro_bias cannot be named; else unseen" in said
    assert "standing still, then straight on for some seconds, heading logged gyro_bias" in said


def test_coverage_counts_windows_beyond_what_calibration_drove(plain_day):
    search = plain_day.search
    slow = dataclasses.replace(search.normal, covered=search.normal.covered * np.array([0.1, 1e3, 1e3, 1e3]))
    changed = type("", (), {"day": search.day, "normal": slow})()
    rows, beyond = coverage_rows(dataclasses.replace(plain_day, search=changed))
    assert beyond == rows[0].beyond == 1.0
    assert [row.beyond for row in rows[1:]] == [0.0, 0.0, 0.0]
    _, usual = coverage_rows(plain_day)
    assert usual < 0.2


def test_every_effect_has_one_manoeuvre():
    named = [name for _, names in shown_by(CATALOGUE) for name in names]
    assert sorted(named) == sorted(CATALOGUE)
    ((words, names),) = shown_by(["road_grade"])
    assert names == ["road_grade"]
    assert "coasting" in words


def test_a_state_that_is_not_measured_has_no_chart(late_day):
    """Its errors are zeros that nobody measured."""
    day = late_day.search.day
    cars = {"calibrated": day.errors}
    runs = [dataclasses.replace(run, used=np.array([True, True, True, False, True])) for run in day.runs]
    lacking = dataclasses.replace(day, runs=runs)
    assert "omega_r" in by_horizon(day, late_day.search.normal, cars)
    assert "omega_r" not in by_horizon(lacking, late_day.search.normal, cars)
    assert "omega_r" not in overlay(lacking, late_day.search.normal, 0, cars, {})
    assert "beta" in overlay(lacking, late_day.search.normal, 0, cars, {})
