"""Recorders whose axes are positive to the right are recognised, or it is said that nothing tells."""

import numpy as np
import pandas as pd
import pytest
from importing_bench import rows

from drift_drake.gap.logs.importing.evidence import Trace, clockwise, sense
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.guess import guessed_mapping
from drift_drake.gap.logs.importing.handedness import is_compass
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import mapping_from_dict

RIGHT, LEFT = -1.0, 1.0


def drive(side, noise=1.0):
    """What recorders call a drive's signals, positive to one side; x is the east, y the north."""
    d = rows(noise=noise)
    course, metres = d["psi"] + d["beta"], 6.371e6 * np.pi / 180.0
    known = {"t": d["t"], "speed": d["v"], "yaw_rate": side * d["r"], "ay": side * d["ay"]}
    ways = {
        "heading": {"heading": (90.0 - np.degrees(d["psi"])) % 360.0},
        "course": {"course": (90.0 - np.degrees(course)) % 360.0},
        "velocity": {"vel_n": d["v"] * np.sin(course), "vel_e": d["v"] * np.cos(course)},
        "position": {"easting": d["x"], "northing": d["y"]},
        "gps": {"lat": 52.0 + d["y"] / metres, "lon": d["x"] / metres / np.cos(np.radians(52.0))},
        "held": {"lat": (52.0 + d["y"] / metres)[np.arange(len(d["t"])) // 10 * 10],
                 "lon": (d["x"] / metres / np.cos(np.radians(52.0)))[np.arange(len(d["t"])) // 10 * 10]},
        "yaw": {"yaw": side * d["psi"]},
        "nothing": {},
    }  # fmt: skip
    return d, known | {"steer": side * d["delta_cmd"]}, ways


def imported(tmp_path, columns, mapping):
    pd.DataFrame(columns).to_csv(tmp_path / "a.csv", index=False)
    return import_recordings([tmp_path / "a.csv"], mapping_from_dict(mapping))


@pytest.mark.parametrize("side", [LEFT, RIGHT])
@pytest.mark.parametrize("way", ["heading", "course", "velocity", "position", "gps", "held"])
def test_axes_that_are_positive_to_the_right_are_recognised(tmp_path, way, side):
    d, known, ways = drive(side)
    guess = guessed_mapping([Topic("", pd.DataFrame(known | ways[way]))])
    assert guess.mapping["frame"] == ("ned" if side == RIGHT else "iso8855")
    assert any("is positive to the right" in note for note in guess.notes) == (side == RIGHT)
    assert not any("Nothing here tells" in note for note in guess.notes)
    if way in ("gps", "held"):
        pytest.importorskip("pyproj", reason="positions are an extra: pip install 'drift_drake[gps]'")
    (run,), _ = imported(tmp_path, known | ways[way], guess.mapping)
    for name in ("r", "ay", "delta_cmd"):
        assert np.corrcoef(run.column(name), np.interp(run.t, d["t"], d[name]))[0, 1] > 0.9


@pytest.mark.parametrize("way", ["yaw", "nothing"])
def test_where_nothing_tells_it_is_said_with_the_line_that_answers(way):
    _, known, ways = drive(RIGHT)
    guess = guessed_mapping([Topic("", pd.DataFrame(known | ways[way]))])
    assert guess.mapping["frame"] == "iso8855"
    assert any("Nothing here tells whether r is positive to the left" in note for note in guess.notes)
    topics = [Topic("/imu", pd.DataFrame({f"/imu.{name}": values for name, values in known.items()}))]
    assert not any("Nothing here tells" in note for note in guessed_mapping(topics).notes)  # of ROS it is known


@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_a_column_that_turns_against_the_yaw_rate_has_its_own_frame(side):
    _, known, ways = drive(side)
    steer = {"steer": -known["steer"]}
    found = guessed_mapping([Topic("", pd.DataFrame(known | ways["gps"] | steer))])
    assert found.mapping["signals"]["delta_cmd"]["frame"] == ("iso8855" if side == RIGHT else "ned")
    assert any("delta_cmd turns against r" in note for note in found.notes)


def test_the_name_of_a_yaw_rate_that_is_positive_downwards():
    _, known, _ = drive(RIGHT)
    known["Angular rate down (rad/s)"] = known.pop("yaw_rate")
    assert guessed_mapping([Topic("", pd.DataFrame(known))]).mapping["frame"] == "ned"


def test_a_heading_without_a_yaw_rate_is_turned():
    _, known, ways = drive(LEFT)
    del known["yaw_rate"]
    found = guessed_mapping([Topic("", pd.DataFrame(known | ways["heading"]))]).mapping
    assert (found["frame"], found["signals"]["psi"]["frame"]) == ("iso8855", "ned")


@pytest.mark.parametrize("way", ["heading", "course"])
def test_a_compass_next_to_a_position_without_a_yaw_rate(way):
    pytest.importorskip("pyproj", reason="positions are an extra: pip install 'drift_drake[gps]'")
    d, known, ways = drive(LEFT)
    del known["yaw_rate"]
    found = guessed_mapping([Topic("", pd.DataFrame(known | ways["gps"] | ways[way]))]).mapping
    assert (found["frame"], found["signals"]["course"]["frame"]) == ("iso8855", "ned")
    sliding = {"heading": (90.0 - np.degrees(d["psi"] - 0.5)) % 360.0}  # not where the car moves
    found = guessed_mapping([Topic("", pd.DataFrame(known | ways["gps"] | sliding))]).mapping
    assert (found["frame"], found["signals"]["psi"]["frame"]) == ("iso8855", "ned")


@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_without_a_yaw_rate_a_compass_tells_the_side_of_the_others(side):
    d, known, ways = drive(side)
    del known["yaw_rate"]
    columns = known | ways["heading"] | {"x": d["x"], "y": d["y"]}
    found = guessed_mapping([Topic("", pd.DataFrame(columns))]).mapping
    assert found["frame"] == ("ned" if side == RIGHT else "iso8855")
    lines = {name: line.get("frame", found["frame"]) for name, line in found["signals"].items()}
    assert (lines["psi"], lines["y"]) == ("ned", "iso8855")
    assert {lines["ay"], lines["delta_cmd"]} == {found["frame"]}


def test_without_a_yaw_rate_a_log_that_is_mirrored_as_a_whole_is_asked():
    d, known, _ = drive(LEFT)
    del known["yaw_rate"]
    found = guessed_mapping([Topic("", pd.DataFrame(known | {"x": d["x"], "y": d["y"], "yaw": d["psi"]}))])
    assert any("mirrored as a whole" in note for note in found.notes)


def wrapped(angle):
    return np.angle(np.exp(1j * angle))


@pytest.mark.parametrize(
    ("heading", "line"),
    [
        (lambda psi: psi, {}),
        (lambda psi: 0.5 * np.pi - psi, {"frame": "ned", "offset": 1.570796}),  # from the axis of y, clockwise
        (lambda psi: psi - 0.5 * np.pi, {"offset": 1.570796}),  # the same, to the left
        (lambda psi: -psi, {"frame": "?"}),
    ],
)
@pytest.mark.parametrize("rate", [True, False])
def test_a_heading_is_held_against_the_way_of_x_and_y(tmp_path, heading, line, rate):
    d = rows(noise=1.0)
    columns = {name: d[name] for name in ("t", "x", "y", "delta_cmd")} | ({"v": d["v"], "r": d["r"]} if rate else {})
    columns["car_heading"] = wrapped(heading(d["psi"]))
    found = guessed_mapping([Topic("", pd.DataFrame(columns))])
    if rate and line == {"frame": "?"}:
        line = {"frame": "ned"}  # the yaw rate says which of the two is mirrored
    assert {key: value for key, value in found.mapping["signals"]["psi"].items() if key in ("frame", "offset")} == line
    if line == {"frame": "?"}:
        assert any("car_heading turns against the way of x, y" in note for note in found.notes)
        return
    (run,), _ = imported(tmp_path, columns, found.mapping)
    if "offset" in line or not line:
        assert np.abs(np.mean(wrapped(run.psi - np.interp(run.t, d["t"], d["psi"])))) < 0.02


@pytest.mark.parametrize("side", [LEFT, RIGHT])
@pytest.mark.parametrize("names", [("pos_n", "pos_e"), ("Hochwert [m]", "Rechtswert [m]"), ("pos_nord", "pos_ost")])
def test_names_of_north_and_east(names, side):
    d, known, _ = drive(side)
    place = dict(zip(names, (d["y"], d["x"]), strict=True))
    guess = guessed_mapping([Topic("", pd.DataFrame(known | place))])
    assert guess.mapping["frame"] == ("ned" if side == RIGHT else "iso8855")
    assert not any("Nothing here tells" in note for note in guess.notes)


@pytest.mark.parametrize("side", [LEFT, RIGHT])
@pytest.mark.parametrize("clockwise", [LEFT, RIGHT])
def test_a_heading_from_the_east_next_to_latitude_and_longitude(tmp_path, side, clockwise):
    pytest.importorskip("pyproj", reason="positions are an extra: pip install 'drift_drake[gps]'")
    d, known, ways = drive(side)
    columns = known | ways["gps"] | {"yaw": clockwise * d["psi"]}
    found = guessed_mapping([Topic("", pd.DataFrame(columns))])
    (run,), report = imported(tmp_path, columns, found.mapping)
    course = np.arctan2(np.gradient(run.y), np.gradient(run.x))
    assert abs(np.median(wrapped(run.psi + np.interp(run.t, d["t"], d["beta"]) - course))) < 0.03
    assert not report.remarks
    assert any("yaw is counted from the east" in note for note in found.notes)


def test_x_and_y_that_turn_against_the_yaw_rate():
    _, known, ways = drive(LEFT)
    d = rows(noise=1.0)
    found = guessed_mapping([Topic("", pd.DataFrame(known | ways["heading"] | {"x": d["y"], "y": d["x"]}))])
    lines = found.mapping["signals"]
    assert (found.mapping["frame"], lines["y"]["frame"], lines["psi"]["frame"]) == ("iso8855", "ned", "ned")


@pytest.mark.parametrize("axes", ["x east, y north", "x north, y east"])
def test_a_compass_next_to_x_and_y(tmp_path, axes):
    d = rows(noise=1.0)
    x, y = (d["x"], d["y"]) if axes == "x east, y north" else (d["y"], d["x"])
    compass = {"heading": d["psi"], "course_over_ground": d["psi"] + d["beta"]}
    columns = {"t": d["t"], "x": x, "y": y, "yaw_rate": -d["r"], "speed": d["v"], "steer": -d["delta_cmd"]}
    columns |= {name: np.mod(np.degrees(0.5 * np.pi - angle), 360.0) for name, angle in compass.items()}
    found = guessed_mapping([Topic("", pd.DataFrame(columns))])
    (run,), report = imported(tmp_path, columns, found.mapping)
    course = np.arctan2(np.gradient(run.y), np.gradient(run.x))
    assert found.mapping["frame"] == "ned"
    assert abs(np.median(wrapped(run.psi + run.beta - course))) < 0.03
    assert np.median(np.abs(run.r - np.interp(run.t, d["t"], d["r"]))) < 0.05
    assert not report.remarks


def test_a_course_that_x_and_y_speak_for_as_much_as_a_compass_is_asked(tmp_path):
    d = rows(noise=1.0)
    columns = {"Zeit [s]": d["t"], "x [m]": d["x"], "y [m]": d["y"], "Gierrate [rad/s]": d["r"]}
    columns |= {"Geschwindigkeit [m/s]": d["v"], "Lenkwinkel [rad]": d["delta_cmd"]}
    columns["Kurswinkel [°]"] = np.degrees(d["psi"] + d["beta"])
    found = guessed_mapping([Topic("", pd.DataFrame(columns))])
    assert found.mapping["frame"] == "iso8855"
    assert any("Nothing here tells whether r is positive to the left" in note for note in found.notes)
    _, report = imported(tmp_path, columns, found.mapping)
    (said,) = report.remarks
    assert "'Kurswinkel [°]' may be a compass' heading" in said


@pytest.mark.parametrize(("name", "said"), [("Kurswinkel [°]", True), ("course_over_ground [deg]", False)])
def test_a_course_of_which_only_the_range_speaks_for_a_compass_is_doubted(name, said):
    d, known, _ = drive(LEFT)
    found = guessed_mapping([Topic("", pd.DataFrame(known | {name: np.degrees(d["psi"] + d["beta"])}))])
    assert found.mapping["frame"] == "ned"
    assert any("Only its range speaks for a compass" in note for note in found.notes) == said


def test_steering_against_a_heading_and_its_way_is_asked():
    d = rows(noise=1.0)
    columns = {"t": d["t"], "x": d["x"], "y": -d["y"], "heading": wrapped(-d["psi"]), "steer": d["delta_cmd"]}
    found = guessed_mapping([Topic("", pd.DataFrame(columns))])
    assert found.mapping["signals"]["delta_cmd"]["frame"] == "?"
    assert any("steer turns against heading and the way of x, y" in note for note in found.notes)


def test_a_mapping_that_contradicts_the_position_or_a_compass_is_doubted(tmp_path):
    pytest.importorskip("pyproj", reason="positions are an extra: pip install 'drift_drake[gps]'")
    _, known, ways = drive(RIGHT)
    mapping = guessed_mapping([Topic("", pd.DataFrame(known | ways["gps"]))]).mapping
    (_,), report = imported(tmp_path, known | ways["gps"], mapping)
    assert not report.remarks
    (_,), report = imported(tmp_path, known | ways["gps"], mapping | {"frame": "iso8855"})
    (said,) = report.remarks
    assert "r turns against the position: r, ay, delta_cmd are mirrored" in said
    mapping = guessed_mapping([Topic("", pd.DataFrame(known | ways["heading"]))]).mapping
    (_,), report = imported(tmp_path, known | ways["heading"], mapping | {"frame": "iso8855"})
    (said,) = report.remarks
    assert "'heading' is a compass' heading" in said


@pytest.mark.parametrize(
    ("name", "values", "degrees", "course", "compass"),
    [
        ("heading", [10.0, 1.0, 359.0, 350.0], True, False, True),
        ("True_Heading", [100.0, 120.0, 140.0], True, False, True),
        ("heading", [0.0, 90.0, 180.0, 270.0], True, False, False),  # from where it began, to the left
        ("heading", [3.1, -3.1], False, False, False),  # of a robot
        ("yaw", [10.0, 1.0, 359.0], True, False, False),
        ("psi", [10.0, 1.0, 359.0], True, False, False),
        ("bearing", [10.0, 20.0], True, True, True),
        ("course", [0.1, 0.2], False, True, False),  # of a path that import wrote
        ("heading", [np.nan], True, False, False),
    ],
)
def test_what_is_a_compass(name, values, degrees, course, compass):
    assert is_compass(name, np.array(values), degrees, course) == compass


def test_turning_clockwise_and_the_sense_of_two_rates():
    t = 0.1 * np.arange(300)
    north, east = Trace(t, 10.0 * np.cos(0.2 * t), None), Trace(t, 10.0 * np.sin(0.2 * t), None)
    turning = clockwise(north, east)
    np.testing.assert_allclose(turning.values[5:-5], 0.2, rtol=1e-3)
    assert sense(Trace(t, 0.1 + 0.0 * t, None), turning) == 1
    assert sense(Trace(t, -0.1 + 0.0 * t, None), turning) == -1
    noise = np.random.default_rng(0).standard_normal(300)
    assert sense(Trace(t, noise, None), turning) == 0
    assert sense(Trace(t[:10], noise[:10], None), turning) == 0
    assert sense(Trace(t + 1e4, noise, None), turning) == 0
