"""Latitude and longitude give a path, its course and lateral acceleration; and what they cannot give is said."""

import json

import numpy as np
import pandas as pd
import pytest
import yaml

from drift_drake.cli.main import main
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError
from drift_drake.gap.logs.importing.import_logs import import_logs
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.look import look
from drift_drake.gap.logs.importing.mapping import InvalidMappingError, mapping_from_dict
from drift_drake.gap.logs.importing.paths import import_paths
from drift_drake.gap.logs.importing.position import course_doubts, path_motion, projected

pytest.importorskip("pyproj", reason="positions are an extra: pip install 'drift_drake[gps]'")
RADIUS, SPEED = 50.0, 15.0  # [m], [m/s] of a circle to the left
PLACES = [(48.5, 9.1), (-33.9, 151.2), (0.0, 0.001), (64.1, -21.9), (10.0, 179.9999)]


def circle(t, place):
    """Latitude, longitude [deg] of a circle to the left that begins to the north, by the ellipsoid's geodesics."""
    from pyproj import Geod

    angle = SPEED / RADIUS * t
    east, north = RADIUS * (np.cos(angle) - 1.0), RADIUS * np.sin(angle)
    azimuth, distance = np.degrees(np.arctan2(east, north)), np.hypot(east, north)
    lat, lon = (np.full(len(t), value) for value in place)
    lon, lat, _ = Geod(ellps="WGS84").fwd(lon, lat, azimuth, distance)
    return lat, lon


@pytest.mark.parametrize("place", PLACES)
def test_positions_are_metres_on_a_plane(tmp_path, place):
    t = 0.1 * np.arange(200)
    lat, lon = circle(t, place)
    x, y = projected(tmp_path, np.radians(lat), np.radians(lon))
    np.testing.assert_allclose(x, RADIUS * np.sin(SPEED / RADIUS * t), atol=2e-3)  # north
    np.testing.assert_allclose(y, RADIUS * (1.0 - np.cos(SPEED / RADIUS * t)), atol=2e-3)  # west


def test_a_receiver_without_a_fix_gives_no_position(tmp_path):
    lat, lon = np.radians([0.0, 48.5, np.nan, 48.5001]), np.radians([0.0, 9.1, 9.1, 9.1])
    x, _ = projected(tmp_path, lat, lon)
    assert np.isnan(x).tolist() == [True, False, True, False]
    with pytest.raises(InvalidRecordingError, match="latitude is up to 2910 deg, and no latitude is; minutes"):
        projected(tmp_path, np.radians([2910.0]), np.radians([500.0]))
    with pytest.raises(InvalidRecordingError, match="hold no position"):
        projected(tmp_path, np.zeros(3), np.zeros(3))


@pytest.mark.parametrize("measured", [False, True])
def test_a_circle_has_its_course_and_acceleration(measured):
    t = 0.04 * np.arange(250)
    rng = np.random.default_rng(0)
    angle = SPEED / RADIUS * t
    x, y = (values + rng.normal(0.0, 0.02, len(t)) for values in (RADIUS * np.sin(angle), RADIUS * (1 - np.cos(angle))))
    v, course = (SPEED + 0.0 * t, angle) if measured else (None, None)
    motion = path_motion(t, x, y, v, course)
    inside = slice(25, -25)
    np.testing.assert_allclose(motion["v"][inside], SPEED, atol=0.3)
    np.testing.assert_allclose(motion["course"][inside], angle[inside], atol=0.03)
    np.testing.assert_allclose(np.median(motion["path_ay"][inside]), SPEED**2 / RADIUS, rtol=0.05)
    assert abs(np.median(motion["path_ax"][inside])) < 0.2


def gps_file(path, t, **more):
    lat, lon = circle(t, PLACES[0])
    heading = np.degrees(-SPEED / RADIUS * t) % 360.0  # clockwise from north
    table = {"Time (s)": t, "Latitude (deg)": lat, "Longitude (deg)": lon, "Speed (km/h)": 3.6 * SPEED + 0.0 * t}
    pd.DataFrame(table | {"Course (deg)": heading} | more).to_csv(path, index=False)


def test_a_gps_log_alone_tells_its_path(tmp_path, capsys):
    gps_file(tmp_path / "lap.csv", 0.04 * np.arange(500))
    assert main(["import", "--look", str(tmp_path / "lap.csv")]) == 0
    text = capsys.readouterr().out
    assert "There is no steering command and no yaw rate, so the sideslip cannot be known" in text
    (tmp_path / "m.yaml").write_text(text)
    out = tmp_path / "out"
    assert main(["import", str(tmp_path / "lap.csv"), "--mapping", str(tmp_path / "m.yaml"), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "check, identify, diagnose, choose and watch cannot be used" in said
    assert "path_0: lap, 0.00 to 19.96 s, 500 rows; up to 15 m/s" in said
    table = pd.read_csv(out / "path_0.csv")
    assert list(table) == ["t", "x", "y", "course", "v", "ax", "ay"]
    inside = slice(25, -25)
    np.testing.assert_allclose(table["ay"][inside], SPEED**2 / RADIUS, rtol=0.05)  # to the left
    np.testing.assert_allclose(table["course"][inside], SPEED / RADIUS * table["t"][inside], atol=0.02)
    report = json.loads((out / "import.json").read_text())
    assert report["paths"] == ["lap"]
    assert main(["check", str(out)]) == 2
    assert "holds no runs" in capsys.readouterr().err
    with pytest.raises(InvalidMappingError, match="gives a path alone"):
        import_logs(tmp_path / "lap.csv", tmp_path / "m.yaml")


MAPPING = {
    "clocks": {"gps": {"column": "Time (s)"}},
    "signals": {
        "latitude": {"column": "Latitude (deg)", "unit": "deg"},
        "longitude": {"column": "Longitude (deg)", "unit": "deg"},
        "delta_cmd": {"column": "steer", "unit": "rad"},
    },
}


def test_the_courses_rate_may_be_taken_for_the_yaw_rate(tmp_path):
    t = 0.02 * np.arange(500)
    gps_file(tmp_path / "lap.csv", t, steer=0.02 + 0.0 * t)
    signals = MAPPING["signals"] | {"latitude": {"column": "Latitude (deg)", "unit": "rad"}}
    mapping = mapping_from_dict(MAPPING | {"signals": signals})
    with pytest.raises(InvalidRecordingError, match="latitude is up to"):
        import_paths([tmp_path / "lap.csv"], mapping)
    (run,), _ = import_recordings(
        [tmp_path / "lap.csv"], mapping_from_dict(MAPPING | {"formulas": {"r": "course_rate"}})
    )
    inside = slice(100, -100)
    np.testing.assert_allclose(run.r[inside], SPEED / RADIUS, rtol=0.05)
    np.testing.assert_allclose(run.v[inside], SPEED, rtol=0.02)
    np.testing.assert_allclose(run.x[inside], RADIUS * np.sin(SPEED / RADIUS * run.t[inside]), atol=0.05)


def test_a_position_on_a_clock_of_its_own(tmp_path):
    t, at = 0.01 * np.arange(800), 0.04 * np.arange(200)
    lat, lon = circle(at, PLACES[0])
    np.savez(
        tmp_path / "lap.npz",
        **{"gps.t": at, "gps.lat": lat, "gps.lon": lon, "car.t": t, "car.r": 0.3 + 0.0 * t, "car.v": 15.0 + 0.0 * t},
        **{"car.steer": 0.02 + 0.0 * t},
    )
    signals = {name: {"column": f"gps.{short}", "unit": "deg", "clock": "gps"}
               for name, short in (("latitude", "lat"), ("longitude", "lon"))}  # fmt: skip
    signals |= {"r": {"column": "car.r", "unit": "rad/s"}, "v": {"column": "car.v", "unit": "m/s"}}
    signals |= {"delta_cmd": {"column": "car.steer", "unit": "rad"}}
    content = {"clocks": {"car": {"column": "car.t"}, "gps": {"column": "gps.t"}}, "signals": signals}
    (run,), _ = import_recordings([tmp_path / "lap.npz"], mapping_from_dict(content))
    np.testing.assert_allclose(run.x, RADIUS * np.sin(SPEED / RADIUS * run.t), atol=0.02)
    np.testing.assert_allclose(run.y, RADIUS * (1.0 - np.cos(SPEED / RADIUS * run.t)), atol=0.02)


@pytest.mark.parametrize(
    ("signals", "said"),
    [
        ({"longitude": None}, "signals.latitude is one half of a position"),
        ({"x": {"column": "x", "unit": "m"}}, "signals have x or y as well as latitude and longitude"),
    ],
)
def test_half_a_position_or_two_are_refused(signals, said):
    content = yaml.safe_load(yaml.safe_dump(MAPPING))
    content["signals"] = {k: v for k, v in (content["signals"] | signals).items() if v is not None}
    content["formulas"] = {"r": "0 * delta_cmd", "v": "0 * delta_cmd"}
    with pytest.raises(InvalidMappingError, match=said):
        mapping_from_dict(content)


def test_a_yaw_rate_against_the_course_or_in_another_unit_is_doubted():
    t = 0.01 * np.arange(1000)
    r = 0.3 * np.sin(0.8 * t)
    course = np.cumsum(r) * 0.01
    assert not course_doubts({"r": r, "course": course + 0.05 * np.sin(t)}, 0.01)
    assert "r turns against the course" in course_doubts({"r": -r, "course": course}, 0.01)[0]
    assert "r is 57.3 times the course's rate" in course_doubts({"r": np.degrees(r), "course": course}, 0.01)[0]
    assert not course_doubts({"r": r}, 0.01)
    assert not course_doubts({"r": 0.0 * r, "course": 0.0 * course}, 0.01)


@pytest.mark.parametrize("slides", [False, True])
def test_a_receivers_heading_is_its_course(tmp_path, slides):
    """By its name it may be either: with nothing else that turns, it is the course where the car goes that way."""
    gps_file(tmp_path / "lap.csv", 0.04 * np.arange(500))
    table = pd.read_csv(tmp_path / "lap.csv").rename(columns={"Course (deg)": "Heading (deg)"})
    table["Heading (deg)"] = (table["Heading (deg)"] + 30.0 * slides) % 360.0
    table.to_csv(tmp_path / "lap.csv", index=False)
    signals = look(tmp_path / "lap.csv").mapping["signals"]
    assert ("psi" in signals, "course" in signals) == (slides, not slides)
    if not slides:
        assert signals["course"] == {"column": "Heading (deg)", "unit": "deg", "frame": "ned"}


def test_degrees_and_minutes_in_one_number_are_no_position(tmp_path):
    gps_file(tmp_path / "lap.csv", 0.04 * np.arange(500))
    table = pd.read_csv(tmp_path / "lap.csv").rename(columns=lambda name: name.split(" ")[0])
    for name in ("Latitude", "Longitude"):
        table[name] = 100.0 * np.floor(table[name]) + 60.0 * (table[name] % 1.0)
    table.to_csv(tmp_path / "lap.csv", index=False)
    found = look(tmp_path / "lap.csv")
    assert not {"latitude", "longitude"} & set(found.mapping["signals"])
    assert any("Latitude and Longitude are no degrees" in note for note in found.notes)
