"""Recorders' own formats: what was written is read, units and signs right; what cannot be is refused by its name."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from recorder_writers import DBC, write_frames, write_ulog, write_vbo, write_xrk

from drift_drake.car.log.table import read_case
from drift_drake.cli.main import main
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError, read_topics
from drift_drake.gap.logs.importing.formats.vbo import seconds_of_day
from drift_drake.gap.logs.importing.look import look

LAT, LONG = 48.5, 9.1  # [deg]
INPUTS = Path(__file__).parents[4] / "shared" / "inputs"


def lap(t):
    """A car that weaves to the north-east: position [deg], speed [m/s], heading [rad] clockwise, yaw rate, steering."""
    r = 0.3 * np.sin(1.3 * t)  # to the left
    heading = 0.6 - 0.3 / 1.3 * (1.0 - np.cos(1.3 * t))
    v = 15.0 + np.sin(0.4 * t)
    period = t[1] - t[0]
    north, east = np.cumsum(v * np.cos(heading)) * period, np.cumsum(v * np.sin(heading)) * period
    lat = LAT + np.degrees(north / 6.367e6)
    return lat, LONG + np.degrees(east / 6.389e6 / np.cos(np.radians(LAT))), v, heading, r, 0.2 * r


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"encoding": "cp1252", "replaced": [("(c) made", "© made")]},
        {"replaced": [("sats time", "time"), ("\n012 ", "\n")]},
        {"replaced": [("velocity kmh", "velocity")]},
        {"replaced": [(".", ",")]},
    ],
)
def test_a_vbo_comes_back_with_its_units_and_signs(tmp_path, changes):
    t = 86399.0 - 2.0 + 0.01 * np.arange(400)  # on through midnight
    lat, long, v, heading, r, steering = lap(t - t[0])
    write_vbo(tmp_path / "lap.vbo", t, lat, long, v, heading, r, steering, **changes)
    (topic,) = read_topics(tmp_path / "lap.vbo")
    table = topic.table
    np.testing.assert_allclose(table["time"] - table["time"][0], t - t[0], atol=1e-3)
    np.testing.assert_allclose(table["lat"], lat, atol=1e-6)
    np.testing.assert_allclose(table["long"], long, atol=1e-6)
    np.testing.assert_allclose(table["yaw_rate"], np.degrees(r), atol=1e-4)
    assert topic.clock == "time"
    stated = {"lat": "deg", "long": "deg", "velocity": "km/h", "heading": "deg", "yaw_rate": "deg/s", "steering": "deg"}
    assert {name: topic.units[name] for name in stated} == stated


@pytest.mark.parametrize(
    ("changes", "yaw_rate", "steering"),
    [
        ({"units": "rad/s\nrad\n"}, "rad/s", "rad"),
        ({"units": "rad/s\n"}, "rad/s", ""),  # the last is blank
        ({"units": "C\nrad/s\nrad\n"}, "deg/s", "deg"),  # one more than channels: whose is which is not stated
        ({"units": "rad/s\nrad\n", "replaced": [("height\nyaw", "yaw")]}, "rad/s", "rad"),  # a header line is missing
        ({"units": "\ns\ndeg\ndeg\nkm/h\ndeg\nm\nrad/s\nrad\n"}, "rad/s", "rad"),  # a line for each column
    ],
)
def test_a_unit_of_a_vbo_is_that_of_its_own_column(tmp_path, changes, yaw_rate, steering):
    t = 0.01 * np.arange(400)
    write_vbo(tmp_path / "lap.vbo", t, *lap(t), **changes)
    (topic,) = read_topics(tmp_path / "lap.vbo")
    assert topic.units["yaw_rate"] == yaw_rate
    assert topic.units["steering"] == (steering or "deg")
    assert (topic.units["velocity"], topic.units["height"]) == ("km/h", "m")


def test_a_vbo_is_imported_as_it_is_guessed(tmp_path, capsys):
    t = 36058.0 + 0.01 * np.arange(600)
    lat, long, v, heading, r, steering = lap(t - t[0])
    write_vbo(tmp_path / "lap.vbo", t, lat, long, v, heading, r, steering)
    assert main(["import", "--look", str(tmp_path / "lap.vbo")]) == 0
    text = capsys.readouterr().out
    (tmp_path / "m.yaml").write_text(text)
    command = ["import", str(tmp_path / "lap.vbo"), "--mapping", str(tmp_path / "m.yaml"), "--out"]
    assert main([*command, str(tmp_path / "case")]) == 0
    said = capsys.readouterr().out
    assert "course" not in said
    (run,) = read_case(tmp_path / "case")
    assert (run.name, len(run)) == ("lap", 600)
    np.testing.assert_allclose(run.v, v, atol=2e-3)
    np.testing.assert_allclose(run.r, r, atol=1e-4)
    driven = np.hypot(np.diff(run.x), np.diff(run.y)).sum()
    assert driven == pytest.approx(0.01 * v[1:].sum(), rel=0.05)
    turned = np.arctan2(run.y[-1] - run.y[-100], run.x[-1] - run.x[-100])  # from north to the left
    assert turned == pytest.approx(-float(heading[-100:].mean()), abs=0.02)
    mapping = yaml.safe_load(text)
    mapping["signals"]["r"]["sign"] = -1
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(mapping))
    assert main([*command, str(tmp_path / "mirrored")]) == 0
    assert "r turns against the course" in capsys.readouterr().out


@pytest.mark.parametrize("time", ["1" + 400 * "0", "1e400", "100010.00", "-"])
def test_a_vbo_whose_times_stand_still_or_are_none_is_looked_at(tmp_path, time):
    rows = [f"12 {time if i % 3 else f'1000{10 + 0.1 * i:05.2f}'} 2900.{i:02d} -0600.{i:02d} 50 90" for i in range(40)]
    (tmp_path / "a.vbo").write_text(
        "\n".join(["[column names]", "sats time lat long velocity heading", "[data]", *rows])
    )
    assert main(["import", "--look", str(tmp_path / "a.vbo")]) == 0


def test_other_makers_vbo_has_degrees_and_standing_receivers_no_position(tmp_path):
    rows = ["0 10.00 0.00000 0.00000 50 90 30"]
    rows += [f"12 {10 + 0.1 * i:.2f} 28.40000 -81.40000 50 90 30" for i in range(1, 9)]
    names = "sats time lat long velocity heading height"
    (tmp_path / "a.vbo").write_text(f"[column names]\n{names}\n\n[data]\n" + "\n".join([*rows, "12 10.9"]))
    (topic,) = read_topics(tmp_path / "a.vbo")
    assert len(topic.table) == 9  # the last row breaks off
    assert np.isnan(topic.table["lat"][0])
    np.testing.assert_allclose(topic.table["long"][1:], -81.4)
    (tmp_path / "b.vbo").write_text("[header]\ntime\n[column names]\nsats time lat long\n[data]\n")
    with pytest.raises(InvalidRecordingError, match=r"has no rows below \[data\]"):
        read_topics(tmp_path / "b.vbo")


def test_times_of_day_in_their_spellings():
    packed, text = ["095959.90", "100000.00", "100000.10"], ["09:59:59.90", "10:00:00.00", "10:00:00.10"]
    for times in (packed, text):
        np.testing.assert_allclose(seconds_of_day(pd.Series(times)), [35999.9, 36000.0, 36000.1])
    np.testing.assert_allclose(
        seconds_of_day(pd.Series(["36058.0", "36072.0", "36100.0"])), [36058.0, 36072.0, 36100.0]
    )


def test_a_px4_log_comes_back(tmp_path):
    pytest.importorskip("pyulog", reason="PX4 is an extra: pip install 'drift_drake[px4]'")
    t = np.arange(200) * 10_000
    yaw = 0.5 + 1e-6 * t
    rates = [(a, 0.0, 0.0, 0.1 * i) for i, a in enumerate(t)]
    attitude = [(a, np.cos(q / 2), 0.0, 0.0, np.sin(q / 2)) for a, q in zip(t, yaw, strict=True)]
    gps = [(a, int(1e7 * LAT) + i, int(-1e7 * LONG), 12.0) for i, a in enumerate(t[::10])]
    write_ulog(
        tmp_path / "drive.ulg",
        {
            "vehicle_angular_velocity": ({"timestamp": "uint64_t", "xyz": "float[3]"}, rates),
            "vehicle_attitude": ({"timestamp": "uint64_t", "q": "float[4]"}, attitude),
            "vehicle_gps_position": (
                {"timestamp": "uint64_t", "lat": "int32_t", "lon": "int32_t", "vel_m_s": "float"},
                gps,
            ),
        },
    )
    topics = {topic.name: topic for topic in read_topics(tmp_path / "drive.ulg")}
    np.testing.assert_allclose(topics["vehicle_attitude"].table["vehicle_attitude.yaw"], yaw, atol=1e-6)
    assert topics["vehicle_gps_position"].table["vehicle_gps_position.lat"][0] == pytest.approx(LAT)
    assert topics["vehicle_gps_position"].table["vehicle_gps_position.lon"][0] == pytest.approx(-LONG)
    found = look(tmp_path / "drive.ulg")
    assert found.mapping["frame"] == "ned"
    assert found.mapping["signals"]["r"]["column"] == "vehicle_angular_velocity.xyz[2]"
    assert {topic.name: topic.rate for topic in found.topics}["vehicle_attitude"] == pytest.approx(100.0)


def test_an_aim_log_comes_back(tmp_path, capsys):
    pytest.importorskip("libxrk", reason="AiM is an extra: pip install 'drift_drake[aim]'")
    rate = 10.0 * np.sin(0.01 * np.arange(300))
    channels = [("YawRate", 5, 10, rate), ("Speed", 16, 20, np.full(150, 43.2)), ("SteerAng", 4, 10, -rate)]
    write_xrk(tmp_path / "lap.xrk", [*channels, ("Odd", 77, 10, rate)])
    fast, slow = sorted(read_topics(tmp_path / "lap.xrk"), key=lambda topic: -len(topic.table))
    np.testing.assert_allclose(fast.table["YawRate"], rate, atol=1e-5)
    np.testing.assert_allclose(fast.table[fast.clock], 0.01 * np.arange(300), atol=1e-9)
    np.testing.assert_allclose(slow.table[slow.clock], 0.02 * np.arange(150), atol=1e-9)
    assert (fast.units["YawRate"], fast.units["SteerAng"], slow.units["Speed"]) == ("deg/s", "deg", "km/h")
    assert not capsys.readouterr().out
    (tmp_path / "lap.xrk").write_bytes((tmp_path / "lap.xrk").read_bytes()[:100])
    with pytest.raises(InvalidRecordingError, match=r"cannot be read as AiM \.xrk"):
        read_topics(tmp_path / "lap.xrk")


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    cantools = pytest.importorskip("cantools", reason="CAN is an extra: pip install 'drift_drake[can]'")
    path = tmp_path_factory.mktemp("dbc") / "car.dbc"
    path.write_text(DBC)
    return path, cantools.database.load_file(path)


@pytest.mark.parametrize("ending", ["log", "asc", "blf", "trc", "mf4"])
def test_can_frames_come_back_by_their_database(tmp_path, database, ending):
    if ending == "mf4":
        pytest.importorskip("asammdf", reason="MDF is an extra: pip install 'drift_drake[mdf]'")
    t = 1.7e9 + 0.01 * np.arange(200)
    yaw_rate, angle = np.round(20.0 * np.sin(t - t[0]), 2), np.round(-5.0 * np.cos(t - t[0]), 2)
    speed = np.where(np.arange(200) == 7, 655.35, 43.2)
    write_frames(tmp_path / f"drive.{ending}", database[1], t, yaw_rate, speed, angle)
    topics = {topic.name: topic for topic in read_topics(tmp_path / f"drive.{ending}", [database[0]])}
    motion = topics["Motion"].table
    np.testing.assert_allclose(motion["Motion.time"] - motion["Motion.time"][0], t - t[0], atol=1e-4)
    np.testing.assert_allclose(motion["Motion.YawRate"], yaw_rate, atol=1e-9)
    assert np.flatnonzero(motion["Motion.Speed"].isna()).tolist() == [7]  # not available
    np.testing.assert_allclose(motion["Motion.AccY"], -1.25)
    np.testing.assert_allclose(topics["Steering"].table["Steering.SteeringAngle"], angle[::2], atol=1e-9)
    first = topics["Extended"].table["Extended.First"]
    assert first.isna().sum() == len(first) / 2  # multiplexed: every other frame
    assert topics["Motion"].units["Motion.Speed"] == "km/h"
    left_out = {name: why for topic in topics.values() for name, why in topic.left_out.items()}
    assert left_out["Steering.State"] == "no number, only texts (on)"
    assert left_out["0x7FF"] == "200 frames, not in the database"
    with pytest.raises(InvalidRecordingError, match=r"raw CAN frames, which say nothing .* --dbc"):
        read_topics(tmp_path / f"drive.{ending}")


def test_candump_as_it_is_shown_and_a_log_that_breaks_off(tmp_path, database, capsys):
    lines = [f" (1700000000.{i:02d}0000)  can0  100   [8]  38 FF E0 10 05 DC 00 00" for i in range(60)]
    (tmp_path / "shown.txt").write_text("\n".join(lines) + "\n (17000")
    (topic,) = read_topics(tmp_path / "shown.txt", [database[0]])
    np.testing.assert_allclose(topic.table["Motion.YawRate"], -2.0)
    steps = "date Thu Nov 26 10:00:00.000 2026\nbase hex  timestamps relative\ninternal events logged\n"
    steps += "".join(f" 0.010000 1  100             Rx   d 8 {38 + i:02X} FF E0 10 05 DC 00 00\n" for i in range(9))
    (tmp_path / "steps.asc").write_text(steps)
    (topic,) = read_topics(tmp_path / "steps.asc", [database[0]])
    np.testing.assert_allclose(np.diff(topic.table["Motion.time"]), 0.01)
    (tmp_path / "untimed.log").write_text("  can0  100   [8]  38 FF E0 10 05 DC 00 00\n" * 9)
    with pytest.raises(InvalidRecordingError, match="frames without times; record them with candump -l"):
        read_topics(tmp_path / "untimed.log", [database[0]])
    (tmp_path / "other.dbc").write_text(DBC.replace("BO_ 256", "BO_ 257").replace("VAL_ 256", "VAL_ 257"))
    with pytest.raises(
        InvalidRecordingError,
        match=r"none of its CAN frames is in other.dbc; it holds .* 0x100.*: give --dbc the database",
    ):
        read_topics(tmp_path / "shown.txt", [tmp_path / "other.dbc"])
    (tmp_path / "broken.dbc").write_text("no database")
    with pytest.raises(InvalidRecordingError, match=r"broken.dbc is no CAN database that can be read"):
        read_topics(tmp_path / "shown.txt", [tmp_path / "broken.dbc"])
    assert main(["import", "--look", str(tmp_path / "shown.txt"), "--dbc", str(database[0])]) == 0
    assert "Motion.YawRate [deg/s]" in capsys.readouterr().out
    assert main(["import", "--look", str(tmp_path / "shown.txt"), "--dbc", str(tmp_path / "none.dbc")]) == 2


def test_mdf_texts_and_invalid_samples_are_no_numbers(tmp_path):
    asammdf = pytest.importorskip("asammdf", reason="MDF is an extra: pip install 'drift_drake[mdf]'")
    t, count = 0.01 * np.arange(300), np.arange(300)
    raw = (1200 + count).astype("u2")
    raw[5], raw[9] = 65535, 65534
    scaled = {"a": 0.01, "b": 0.0}
    conversions = {
        "range": {"lower_0": 65534, "upper_0": 65535, "text_0": "SNA", "default_addr": scaled},
        "values": {"val_0": 65535, "text_0": "SNA", "val_1": 65534, "text_1": "Init", "default_addr": scaled},
        "gear": {"val_0": 0, "text_0": "P", "val_1": 1, "text_1": "D"},
        "line": {"a": 0.5, "b": 1.0},
    }
    invalid = count % 100 == 0
    signals = [
        asammdf.Signal(raw, t, name="range", unit="km/h", conversion=conversions["range"]),
        asammdf.Signal(raw, t, name="values", unit="km/h", conversion=conversions["values"]),
        asammdf.Signal((count // 150).astype("u1"), t, name="gear", conversion=conversions["gear"]),
        asammdf.Signal(np.array([b"note"] * 300), t, name="note", encoding="utf-8"),
        asammdf.Signal(raw, t, name="line", conversion=conversions["line"], invalidation_bits=invalid),
        asammdf.Signal(count.astype(float), t, name="plain", invalidation_bits=invalid),
        asammdf.Signal(count.astype(float), t, name="never", invalidation_bits=np.ones(300, dtype=bool)),
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals, acq_name="car")
        file.save(tmp_path / "drive.mf4")
    (topic,) = read_topics(tmp_path / "drive.mf4")
    expected = np.where(raw > 65000, np.nan, 0.01 * raw)
    for name in ("range", "values"):
        np.testing.assert_allclose(topic.table[f"car.{name}"], expected)
    np.testing.assert_allclose(topic.table["car.line"], np.where(invalid, np.nan, 0.5 * raw + 1.0))
    np.testing.assert_allclose(topic.table["car.plain"], np.where(invalid, np.nan, count))
    assert topic.left_out == {
        "car.gear": "no number, only texts (P, D)",
        "car.note": "text or bytes",
        "car.never": "all samples are marked invalid",
    }


@pytest.mark.parametrize("name", ["sna.mf4", "sna_never.mf4", "inval.mf4", "groups.mf4", "groups.mdf"])
def test_the_given_mdf_files_are_read(name):
    pytest.importorskip("asammdf", reason="MDF is an extra: pip install 'drift_drake[mdf]'")
    path = INPUTS / "08_mdf_text_and_invalid" / name
    if not path.exists():
        pytest.skip("the given inputs are not here")
    missing = {"sna.mf4": 3, "inval.mf4": 5}.get(name, 0)
    found = [topic.table[column] for topic in read_topics(path) for column in topic.table if column.endswith("VehSpd")]
    assert [int(values.isna().sum()) for values in found] == [missing]


REFUSED = {
    "run.ld": (bytes.fromhex("4000000000000000483400002c510000") + bytes(64), r"MoTeC .ld, .*as CSV"),
    "run.bin": (bytes.fromhex("4000000000000000483400002c510000") + bytes(64), r"MoTeC .ld"),
    "run.drk": (b"\0\1\2\3", r"AiM .drk, .*RaceStudio"),
    "run.xlsx": (b"PK\x03\x04" + b"[Content_Types].xml" + bytes(40), r"an Excel workbook, .*as CSV"),
    "run.data": (b"TDSm" + bytes(40), r"TDMS"),
    "run.vbb": (b"\0\1", r"VBOX .vbb, .*\.vbo"),
    "run.nmea": (b"$GPRMC,101010.00,A,4830.0,N,00906.0,E,20,10,010124,,\r\n", r"NMEA"),
    "run.gpx": (b"<?xml version='1.0'?>\n<gpx version='1.1'></gpx>", r"GPX"),
    "run.jsonl": (b'{"t": 0.0, "speed": 3.0}\n', r"JSON.*read_json"),
    "run.pkl": (b"\x80\x04\x95", r"pickle"),
    "run.npy": (b"\x93NUMPY\x01\x00", r"array without names"),
    "car.dbc": (b'VERSION ""\n', r"database of CAN messages"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_format_that_is_not_read_is_refused_by_its_name(tmp_path, name):
    content, said = REFUSED[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidRecordingError, match=f"{name}: is .*{said}") as caught:
        read_topics(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_format_is_recognised_by_its_first_bytes(tmp_path):
    t = 0.01 * np.arange(50)
    np.savez(tmp_path / "a.npz", t=t, v=t)
    (tmp_path / "table.dat").write_text("t,v\n" + "\n".join(f"{a},{a}" for a in t))
    assert list(read_topics(tmp_path / "table.dat")[0].table) == ["t", "v"]
    asammdf = pytest.importorskip("asammdf", reason="MDF is an extra: pip install 'drift_drake[mdf]'")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(t, t, name="v", unit="m/s")], acq_name="car")
        file.save(tmp_path / "drive.mf4")
    (tmp_path / "drive.mf4").rename(tmp_path / "drive.xyz")
    assert read_topics(tmp_path / "drive.xyz")[0].name == "car"


def test_a_missing_extra_is_one_sentence(tmp_path, monkeypatch):
    import builtins

    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name.split(".")[0] in ("pyulog", "libxrk", "can"):
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    for name, extra in (("a.ulg", "px4"), ("a.xrk", "aim"), ("a.blf", "can")):
        (tmp_path / name).write_bytes(b"LOGG" if extra == "can" else b"x")
        with pytest.raises(InvalidRecordingError, match=rf"install the extra: pip install 'drift_drake\[{extra}\]'"):
            read_topics(tmp_path / name)
