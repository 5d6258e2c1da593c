"""Time series: units, bounds and transitions are where they should be."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.view.pictures.time_series import sideslip_error, time_series
from drift_drake.view.style import save

NOMINAL = VehicleParameters()


def panel(figure, label):
    return next(axes for axes in figure.axes if axes.get_ylabel() == label)


def line(axes, label):
    return next(item for item in axes.get_lines() if item.get_label() == label).get_ydata()


def test_signals_are_in_degrees_and_kilometres_per_hour(eight, perfect_run, tmp_path):
    figure = time_series({"driven": perfect_run}, eight, NOMINAL)
    assert save(figure, tmp_path / "series.png").stat().st_size > 20_000
    np.testing.assert_allclose(line(panel(figure, "sideslip [deg]"), "driven"), np.rad2deg(perfect_run["beta"]))
    np.testing.assert_allclose(line(panel(figure, "speed [km/h]"), "driven"), 3.6 * perfect_run["v"])
    np.testing.assert_allclose(line(panel(figure, "yaw rate [deg/s]"), "reference"), np.rad2deg(perfect_run["r"]))
    np.testing.assert_allclose(line(panel(figure, "sideslip error [deg]"), "driven"), 0.0, atol=1e-9)
    assert panel(figure, "rear rim speed [km/h]").get_xlabel() == "time [s]"


def test_inputs_come_with_their_bounds(eight, perfect_run):
    figure = time_series({"driven": perfect_run}, eight, NOMINAL)
    steering = [item.get_ydata()[0] for item in panel(figure, "steering angle [deg]").get_lines()[:2]]
    torque = [item.get_ydata()[0] for item in panel(figure, "engine torque [N m]").get_lines()[:2]]
    np.testing.assert_allclose(steering, np.rad2deg([-NOMINAL.steering_limit, NOMINAL.steering_limit]))
    assert torque == [NOMINAL.torque_min, NOMINAL.torque_max]


def test_faults_and_what_follows_are_drawn_for_a_single_run(eight, perfect_run):
    late = perfect_run["t"] > perfect_run["t"].iloc[-1] - 1.0
    faulted = perfect_run.assign(reading=late.astype(float), stopping=late.astype(float))

    def words(figure):
        return [text.get_text() for text in panel(figure, "steering angle [deg]").get_legend().get_texts()]

    one, two = (
        time_series({"driven": faulted}, eight, NOMINAL),
        time_series({"a": faulted, "b": faulted}, eight, NOMINAL),
    )
    assert {"being stopped", "reading screened out"} <= set(words(one))
    assert words(two) == words(time_series({"driven": perfect_run}, eight, NOMINAL)) == ["bound", "transition"]
    steady = perfect_run[~eight.transition(perfect_run["s"].to_numpy(dtype=float))].iloc[:50]
    assert words(time_series({"driven": steady}, eight, NOMINAL)) == ["bound"]


def test_transitions_are_shaded_where_the_reference_has_them(eight, perfect_run):
    axes = panel(time_series({"driven": perfect_run}, eight, NOMINAL), "sideslip [deg]")
    (band,) = axes.patches
    inside = eight.transition(perfect_run["s"].to_numpy())
    begin, end = perfect_run["t"].to_numpy()[inside][[0, -1]]
    assert band.get_x() == pytest.approx(begin)
    assert band.get_x() + band.get_width() == pytest.approx(end, abs=0.03)


def test_several_runs_are_lined_up_by_path_position(eight, perfect_run):
    late = perfect_run.iloc[20:]
    figure = time_series({"one": perfect_run, "late": late}, eight, NOMINAL)
    assert panel(figure, "rear rim speed [km/h]").get_xlabel() == "path position s [m]"


def test_the_lane_is_drawn_where_the_car_comes_near_it(eight, perfect_run):
    far = time_series({"driven": perfect_run}, eight, NOMINAL)
    near = time_series({"driven": perfect_run.assign(e=2.0)}, eight, NOMINAL)
    assert [text.get_text() for text in panel(far, "lateral error e [m]").texts] == ["lane: -3 to 3 m"]
    assert {value[0] for value in (item.get_ydata() for item in panel(near, "lateral error e [m]").get_lines())} >= {
        -3.0, 3.0}  # fmt: skip


def test_sideslip_error_is_driven_minus_wanted(eight, perfect_run):
    run = perfect_run.assign(beta=perfect_run["beta"] + 0.1)
    np.testing.assert_allclose(sideslip_error(run, eight), 0.1, atol=1e-12)


def test_a_run_without_a_column_is_named(eight, perfect_run):
    with pytest.raises(ValueError, match=r"run 'driven' lacks the column\(s\) tau"):
        time_series({"driven": perfect_run.drop(columns="tau")}, eight, NOMINAL)
