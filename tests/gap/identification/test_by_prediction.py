"""Calibration by prediction: what is held out, what is believed, and the car that comes out."""

import dataclasses

import numpy as np
import pytest
from browser import check_charts, check_looks, needs_browser

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import InvalidLogError
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.robust_fit import RobustFit
from drift_drake.gap.estimation.unknowns import deviations_of
from drift_drake.gap.estimation.windows import HORIZONS, thinned, windowed
from drift_drake.gap.identification import by_prediction
from drift_drake.gap.identification import identify as identification
from drift_drake.gap.identification.agreement import Agreement
from drift_drake.gap.identification.by_prediction import (
    held_out_windows,
    is_held,
    of_kind,
    prior_of,
    row_by_row,
    split,
)
from drift_drake.gap.identification.calibration import directions
from drift_drake.gap.identification.identify import WHITE, identify
from drift_drake.gap.identification.report import report_html


@pytest.fixture(scope="module")
def runs(other_car):
    return [windowed(run) for run in other_car.runs]


def test_thinning_keeps_windows_evenly(runs):
    count = sum(len(run.starts) for run in runs)
    few = thinned(runs, count // 3)
    assert sum(len(run.starts) for run in few) <= count // 3 + len(runs)
    assert set(np.diff(few[0].starts)) == {few[0].starts[1] - few[0].starts[0]}
    assert [len(run.starts) for run in thinned(runs, count)] == [len(run.starts) for run in runs]


def test_no_fitted_window_reaches_into_a_held_out_block(runs):
    fitted, judged = split(runs)
    assert sum(len(run.starts) for run in judged) > 0
    for fit_run, judge_run in zip(fitted, judged, strict=True):
        for start in fit_run.starts:
            assert not np.any(is_held(fit_run, np.arange(start, start + HORIZONS * fit_run.stride_rows + 1)))
        assert np.all(is_held(judge_run, judge_run.starts))


def test_runs_of_three_seconds_are_held_out_too(other_car):
    fitted, judged = split([windowed(run.rows(0, 300)) for run in other_car.runs])
    assert min(sum(len(run.starts) for run in part) for part in (fitted, judged)) > 0
    assert all(not np.any(is_held(run, run.starts)) for run in fitted)


def test_judging_windows_start_in_every_row_between_two_of_a_held_out_block(runs):
    run = runs[0]
    _, judged = split(runs)
    held = run.starts[is_held(run, run.starts)]  # of one block: the run is 6 s long
    assert np.array_equal(judged[0].starts, np.arange(held[0], held[-1] + 1))
    apart = dataclasses.replace(run, starts=run.starts[[0, 1, 5]])  # rows left out in between
    step = int(run.starts[1] - run.starts[0])
    expected = [*range(run.starts[0], run.starts[0] + step), run.starts[1], run.starts[5]]
    assert np.array_equal(row_by_row(apart), expected)
    assert np.array_equal(row_by_row(dataclasses.replace(run, starts=run.starts[:1])), run.starts[:1])


def test_the_calibrated_car_predicts_held_out_parts_better(other_car):
    held = other_car.found.calibration.held_out
    assert held.low <= held.ratio <= held.high < 1.0
    assert np.shape(held.before) == np.shape(held.after) == (HORIZONS, 4)


def test_the_calibrated_car_is_near_the_true_one_where_it_has_such_parameters(other_car):
    truth, found = CARS["coupe"], other_car.found.vehicle
    assert found.yaw_inertia == pytest.approx(truth.yaw_inertia, rel=0.2)
    assert found.gear_ratio == pytest.approx(truth.gear_ratio, rel=0.1)
    assert found.mass == other_car.guess.mass  # which was not asked for


def test_a_comparison_with_itself_is_one(other_car, runs):
    _, judged = split(runs)
    guess = other_car.guess.constants()
    plain, biased = (guess, Effects()), (guess, Effects(gyro_bias=0.2))
    same = held_out_windows(judged, plain, plain)
    assert same.ratio == same.low == same.high == 1.0
    assert same.before == same.after
    assert same.worse == ()
    moved = held_out_windows(judged, plain, biased)
    assert moved.worse[0] == "r"  # and what follows from it
    assert all(low <= then[-1] / first[-1] <= high for (low, high), then, first
               in zip(moved.by_state, np.transpose(moved.after), np.transpose(moved.before), strict=True))  # fmt: skip
    fed = [dataclasses.replace(run, fed=True, used=np.array([True, False, True, False, True])) for run in judged]
    assert held_out_windows(fed, plain, plain).states == ("r", "beta")


def test_a_bias_of_a_sensor_is_hardly_believed_on_the_day_of_calibration(other_car):
    bias = prior_of("gyro_bias", other_car.guess, frozenset())
    assert 0.0 < bias < CATALOGUE["gyro_bias"].least_for(other_car.guess)  # below a gap, as on any recording
    assert prior_of("mass_error", other_car.guess, frozenset({"mass"})) == pytest.approx(0.02)


def test_what_recordings_disagree_about_is_reported_in_the_vehicle_files_names(other_car, monkeypatch):
    def apart(pulled, left):
        every = np.ones(len(left), dtype=bool)
        return Agreement(100.0 * left, every, np.argmax(np.abs(pulled), axis=0))

    monkeypatch.setattr(by_prediction, "agreement", apart)
    runs = [windowed(run.rows(0, 300)) for run in other_car.runs]
    left = by_prediction.fit_by_prediction(
        runs, other_car.guess, Effects(), ["yaw_inertia_error", "cg_shift"], [], frozenset(),
        ["yaw_inertia_error", "cg_shift"], lambda *_: None,
    ).left_open  # fmt: skip
    assert list(left.disagreed) == ["yaw_inertia", "front_axle_distance"]
    assert set(left.disagreed.values()) <= {run.name for run in other_car.runs}
    assert np.all(left.stated > left.deviations)  # as wide as recordings differ


def test_a_delay_may_be_a_cars_every_day(other_car):
    for name in ("steering_delay", "sensor_latency", "gyro_gain_error", "command_clock_error"):
        assert prior_of(name, other_car.guess, frozenset()) >= CATALOGUE[name].high


def test_logs_of_another_kind_of_car_choose_prediction(other_car, monkeypatch):
    monkeypatch.setattr(identification, "FURTHER", ())
    tried, by_likelihood = [], identification.identify_by_likelihood
    monkeypatch.setattr(
        identification, "identify_by_likelihood", lambda *given: tried.append(by_likelihood(*given)) or tried[0]
    )
    found = identify([run.rows(0, 300) for run in other_car.runs[:2]], other_car.guess, effects=(), watching=False)
    assert tried[0].calibration.tempering < WHITE
    assert found.calibration.criterion == "prediction"
    assert "innovations are not white" in found.calibration.warnings[0]


def test_a_calibration_by_prediction_states_parameters_and_tolerances(other_car):
    identified = other_car.found
    c = identified.calibration
    assert c.criterion == "prediction"
    assert not any("not white" in warning for warning in c.warnings)  # it was asked for
    assert c.normal is not None
    assert identified.vehicle.mass == other_car.guess.mass
    assert {"friction", "front_stiffness", "rear_stiffness"} <= set(c.parameters)
    for name, p in c.parameters.items():
        assert p.low <= p.estimate <= p.high
        assert p.deviation <= p.prior
        car = identified.vehicle if hasattr(identified.vehicle, name) else identified.effects
        assert p.estimate == pytest.approx(getattr(car, name))
    tolerance, p = identified.vehicle.tolerance, c.parameters["friction"]
    stated = p.deviation / p.estimate  # with what the recordings differ by, where they disagree
    assert tolerance.friction <= stated if "friction" in c.disagreed else tolerance.friction == pytest.approx(stated)


def test_a_car_that_the_equations_follow_is_calibrated_by_likelihood(strange_car_runs, monkeypatch):
    def asked(*_args):
        raise NotImplementedError

    monkeypatch.setattr(identification, "FURTHER", ())
    monkeypatch.setattr(identification, "identify_by_likelihood", asked)
    with pytest.raises(NotImplementedError):
        identify(strange_car_runs, VehicleParameters(), effects=("steering_lag",))


def test_prediction_without_sideslip_is_refused(other_car):
    runs = [run.without("beta") for run in other_car.runs]
    with pytest.raises(InvalidLogError, match=r"short: column beta is missing; .* --criterion likelihood"):
        identify(runs, other_car.guess, case="short", criterion="prediction")


@needs_browser
def test_the_reports_charts_are_drawn(other_car, tmp_path, browser):
    path = tmp_path / "report.html"
    path.write_text(report_html(other_car.found), encoding="utf-8")
    check_charts(path)
    check_looks(browser, path)


def test_the_report_plays_both_cars_on_every_run_and_shows_what_is_used(other_car):
    html = report_html(other_car.found)
    assert html.count('"name":"first guess","legendgroup"') >= 4 * len(other_car.runs)  # states of each run
    assert html.count('class="timeline"') == len(other_car.runs)
    assert "RMS error" in html
    alone = dataclasses.replace(other_car.found, runs=(), first=None)
    assert "Measured against both cars" not in report_html(alone)


def test_what_a_car_has_none_of_is_known_not_identified() -> None:
    """A deviation relative to zero is none, and no direction of what the logs leave open."""
    car = CARS["coupe"].replace(steering_compliance=0.0).constants()
    unknowns = deviations_of(car)
    names, n = tuple(unknown.name for unknown in unknowns), len(unknowns)
    fit = RobustFit(names, np.zeros(n), np.zeros((1, 5, 5)), np.ones((5, 5)), np.eye(n))
    found = of_kind(car, fit, unknowns)
    assert {name: p.kind for name, p in found.items() if p.kind != "free"} == {"steering_compliance": "known"}
    assert found["steering_compliance"].estimate == found["steering_compliance"].high == 0.0
    open_ones = {name for one in directions(found, np.eye(n)) for name in one.parts}
    assert open_ones == set(names) - {"steering_compliance"}
