"""Identification on short runs: the truth within the intervals, the vehicle file, what the logs cannot tell."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from browser import check_charts, needs_browser

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.log.table import InvalidLogError
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle
from drift_drake.drive.manoeuvres.options import Simulate
from drift_drake.drive.manoeuvres.simulate import simulate_drive
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.identification.by_likelihood import check_peak, stretched
from drift_drake.gap.identification.estimate import mean_square
from drift_drake.gap.identification.identify import identify
from drift_drake.gap.identification.report import report_html


def test_the_truth_lies_near_the_estimates(identified, strange_car_truth):
    for name in ("yaw_inertia", "front_axle_distance", "friction", "rear_stiffness", "steering_lag"):
        p = identified.calibration.parameters[name]
        assert abs(p.estimate - strange_car_truth[name]) < 3.5 * p.deviation, name
        assert p.deviation < 0.3 * p.prior
        assert p.low < p.estimate < p.high


def test_what_was_known_stays_within_its_tolerance(identified):
    p = identified.calibration.parameters["mass"]
    assert p.kind == "known"
    assert p.deviation <= p.prior * (1.0 + 1e-9)


def test_a_likelihood_without_a_peak_is_refused_with_what_to_do():
    check_peak("day", np.eye(2))
    with pytest.raises(InvalidLogError, match=r"day: the likelihood has no peak.*--known mass.*--criterion prediction"):
        check_peak("day", np.array([[1.0, 0.0], [0.0, np.nan]]))


def test_a_known_parameter_that_came_out_elsewhere_is_doubted(identified):
    p = identified.calibration.parameters["mass"]
    assert stretched({"mass": p}) == []
    (warning,) = stretched({"mass": dataclasses.replace(p, estimate=p.start - 7.0 * p.prior)})
    assert "7 tolerances off" in warning


def test_the_calibrated_vehicle_explains_the_logs(identified, strange_car_runs, tmp_path):
    write_vehicle(tmp_path / "car.yaml", identified.vehicle, identified.effects)
    vehicle, effects = read_vehicle(tmp_path / "car.yaml")
    assert effects.steering_lag == identified.calibration.parameters["steering_lag"].estimate
    problem = make_problem(strange_car_runs, vehicle, own=effects)
    assert mean_square(problem, np.zeros(problem.nuisances), ()) < 1.2
    before = make_problem(strange_car_runs, VehicleParameters())
    assert mean_square(before, np.zeros(before.nuisances), ()) > 10.0
    p = identified.calibration.parameters["friction"]
    assert vehicle.tolerance.friction == pytest.approx(p.deviation / vehicle.friction)


def test_held_out_errors_shrink(identified):
    held = identified.calibration.held_out
    assert held.low <= held.ratio <= held.high < 0.5
    assert held.states == ("r", "v", "beta", "omega_r")
    assert np.all(np.array(held.after)[2] < np.array(held.before)[2])


def test_effects_that_are_not_there_are_left_out(identified):
    assert identified.calibration.left_out == ["aero_drag"]
    assert identified.effects.aero_drag == 0.0


def test_without_torque_what_only_torque_tells_stays_not_identified(strange_car_runs):
    runs = [run.without("tau_cmd") for run in strange_car_runs[:2]]
    names = ("steering_lag", "steering_offset", "torque_lag")  # the second a parameter of the vehicle file
    found = identify(runs, VehicleParameters(), effects=names, criterion="likelihood", watching=False)
    c = found.calibration
    assert c.parameters["steering_offset"].kind == "free"
    assert "effect steering_offset: calibrated anyway, as a parameter of the vehicle file" in c.warnings
    assert "torque_lag" not in c.parameters
    assert {"gear_ratio", "rear_axle_inertia"} <= {name for direction in c.not_identified for name in direction.parts}
    assert c.parameters["gear_ratio"].deviation == pytest.approx(c.parameters["gear_ratio"].prior, rel=0.01)


def test_bad_names_and_logs_get_one_sentence(strange_car_runs):
    with pytest.raises(InvalidVehicleError, match="heaviness is no parameter"):
        identify(strange_car_runs, VehicleParameters(), known=("heaviness",))
    with pytest.raises(InvalidVehicleError, match="wind is no effect"):
        identify(strange_car_runs, VehicleParameters(), effects=("wind",))
    with pytest.raises(InvalidLogError, match="no run has"):
        identify([strange_car_runs[0].rows(0, 100)], VehicleParameters())
    short = [run.rows(0, 200) for run in strange_car_runs]
    with pytest.raises(InvalidLogError, match=r"for a part to be held out, 2 s at most; .* has 2.5 s in a row"):
        identify(short, VehicleParameters(), criterion="likelihood")


def test_the_report_is_one_file(identified, strange_car_runs, tmp_path):
    (tmp_path / "report.html").write_text(report_html(identified), encoding="utf-8")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert identified.calibration.case in text
    # Estimates, errors, correlations; accelerations and steering over speed; each run.
    assert text.count('class="chart"') == 3 + 2 + len(strange_car_runs)
    assert "Every direction is identified" in text
    for outside in ("<script src", 'src="http', "url(http", "@import"):
        assert outside not in text


@needs_browser
def test_the_reports_charts_are_drawn(identified, tmp_path):
    (tmp_path / "report.html").write_text(report_html(identified), encoding="utf-8")
    check_charts(tmp_path / "report.html")


def test_an_axles_inertia_is_not_taken_for_a_lag():
    """From a torque lag of 50 ms the likelihood leads into a valley with a tenth of the axle's inertia."""
    car = VehicleParameters()
    true = make_effects({"steering_lag": 0.08, "aero_drag": 1.2})
    runs = [
        simulate_drive(Simulate(name, Path("car.yaml"), Path(f"{name}.csv"), duration=6.0), car, true)[0]
        for name in ("slalom", "straight")
    ]
    found = identify(runs, car, criterion="likelihood", watching=False).calibration
    assert "torque_lag" in found.left_out
    assert (
        found.parameters["rear_axle_inertia"].low < car.rear_axle_inertia < found.parameters["rear_axle_inertia"].high
    )
