"""Clocks of text tables: of every kind, one for each signal, in rows or columns of their own."""

import datetime

import numpy as np
import pandas as pd
import pytest
from table_dialects import CLOCKS, COUNT, NAMES, SIGNALS, assert_the_drive, columns, drive, table, texts

from drift_drake.gap.logs.importing.clocks import clock_of, seconds, time_unit
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError
from drift_drake.gap.logs.importing.formats.times import clock_seconds, seconds_of, with_times
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.look import look
from drift_drake.gap.logs.importing.mapping import mapping_from_dict
from drift_drake.gap.logs.importing.recording import read_recording


@pytest.mark.parametrize("clock", sorted(CLOCKS))
def test_clocks_of_every_kind(tmp_path, clock):
    units = ("deg/s", "km/h", "g", "deg")
    (tmp_path / "drive.csv").write_text(table(columns(NAMES["english"], units, clock)))
    recording = assert_the_drive(tmp_path / "drive.csv")
    assert not recording.remarks


@pytest.mark.parametrize("name", ["Elapsed", "Lap"])
def test_times_as_text_are_a_clock_whatever_their_name(tmp_path, name):
    text = table(columns(NAMES["english"], ("deg/s", "km/h", "g", "deg"), sorted(CLOCKS)[0])).split("\n")
    clock = [name, *(f"{int(t // 60):02d}:{t % 60:06.3f}" for t in drive()["t"])]
    rows = [",".join([at, *line.split(",")[1:]]) for at, line in zip(clock, text, strict=False) if line]
    (tmp_path / "drive.csv").write_text("\n".join([*rows, ""]))
    assert_the_drive(tmp_path / "drive.csv")


def blanks(offsets, blank=""):
    """Each signal in rows of its own, some milliseconds after the first."""
    exact = drive()
    written = []
    for number, key in enumerate(SIGNALS):
        t = exact["t"][:: number + 1] + offsets[number]
        values = np.interp(t, exact["t"], exact[key])
        written += [(at, number, value) for at, value in zip(t, values, strict=True)]
    lines = ["time,yaw_rate [rad/s],speed [m/s],acc_y [m/s2],steering_angle [rad]"]
    for t, number, value in sorted(written):
        cells = [blank] * len(SIGNALS)
        cells[number] = f"{value:.7f}"
        lines.append(f"{t:.4f},{','.join(cells)}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("blank", ["", "-", "SNA"])
def test_signals_in_rows_of_their_own_have_a_clock_each(tmp_path, blank):
    (tmp_path / "drive.csv").write_text(blanks((0.0, 0.003, 0.006, 0.008), blank))
    found = look(tmp_path / "drive.csv")
    assert len(found.mapping["clocks"]) == 4
    assert any("rows of their own" in note for note in found.notes)
    (run,), report = import_recordings([tmp_path / "drive.csv"], mapping_from_dict(found.mapping))
    exact = drive()
    for key in SIGNALS:
        np.testing.assert_allclose(run.column(key), np.interp(run.t, exact["t"], exact[key]), atol=3e-2, err_msg=key)
    assert all(clock.offset == clock.arrival == 0.0 for clock in report.clocks["drive"].values())
    one = {"clocks": {"all": {"column": "time"}}}
    one["signals"] = {
        key: {k: v for k, v in line.items() if k != "clock"} for key, line in found.mapping["signals"].items()
    }
    with pytest.raises(InvalidRecordingError, match=r"drive.csv: .* are read in rows of their own; give each a clock"):
        read_recording(tmp_path / "drive.csv", mapping_from_dict(one))


def test_each_signal_with_times_of_its_own(tmp_path):
    exact = drive()
    names = ("yaw_rate", "speed", "acc_y", "steering_angle")
    cells = {}
    for number, (name, key) in enumerate(zip(names, SIGNALS, strict=True)):
        cells |= {f"{name}_time": texts(exact["t"] + 0.001 * number), name: texts(exact[key])}
    (tmp_path / "drive.csv").write_text(table(cells))
    assert len(look(tmp_path / "drive.csv").mapping["clocks"]) == 4
    assert_the_drive(tmp_path / "drive.csv")


def test_clocks_side_by_side_that_run_apart(tmp_path):
    """Each block of columns has a clock and rows of its own; a lap's time next to the clock is no such clock."""
    exact = drive()
    cells = {}
    for number, key in enumerate(SIGNALS, 1):
        part = [*texts(exact["t"][::number]), *[""] * (COUNT - len(exact["t"][::number]))]
        values = [*texts(exact[key][::number]), *[""] * (COUNT - len(exact["t"][::number]))]
        cells |= {f"Time_{number}": part, NAMES["english"][number]: values}
    (tmp_path / "drive.csv").write_text(table(cells))
    found = look(tmp_path / "drive.csv").mapping
    assert len(found["clocks"]) == 4
    assert_the_drive(tmp_path / "drive.csv")
    (run,), _ = import_recordings([tmp_path / "drive.csv"], mapping_from_dict(found))
    for key in SIGNALS:
        np.testing.assert_allclose(run.column(key), np.interp(run.t, exact["t"], exact[key]), atol=3e-2, err_msg=key)
    timed = {"time": texts(exact["t"]), "yaw rate": texts(exact["r"]), "lap time": texts(exact["t"] % 7.0)}
    timed |= {"speed": texts(exact["v"]), "road wheel angle": texts(exact["delta_cmd"])}
    (tmp_path / "laps.csv").write_text(table(timed))
    assert list(look(tmp_path / "laps.csv").mapping["clocks"].values()) == [{"column": "time"}]


def test_seconds_and_nanoseconds_in_two_columns_are_one_clock(tmp_path):
    exact = drive()
    cells = columns(NAMES["english"], ("deg/s", "km/h", "g", "deg"))
    cells.pop("time")
    stamps = {"stamp.secs": [f"{1714557600 + int(t)}" for t in exact["t"]]}
    stamps["stamp.nsecs"] = [f"{round(t % 1.0 * 1e9)}" for t in exact["t"]]
    (tmp_path / "drive.csv").write_text(table(stamps | cells))
    assert_the_drive(tmp_path / "drive.csv")


def test_a_clock_of_whole_seconds_is_too_coarse(tmp_path):
    cells = columns(NAMES["english"], ("deg/s", "km/h", "g", "deg"))
    cells["time"] = [str(int(t)) for t in drive()["t"]]
    (tmp_path / "drive.csv").write_text(table(cells))
    content = mapping_from_dict(look(tmp_path / "drive.csv").mapping)
    with pytest.raises(
        InvalidRecordingError, match=r"the clock 'time' ticks each 1 s, and a log needs readings each 0\.2 s"
    ):
        import_recordings([tmp_path / "drive.csv"], content)


def test_a_packed_clock_taken_for_seconds_is_doubted(tmp_path):
    units = ("deg/s", "km/h", "g", "deg")
    (tmp_path / "drive.csv").write_text(table(columns(NAMES["english"], units, "packed")))
    content = look(tmp_path / "drive.csv").mapping
    assert content["clocks"]["recorder"] == {"column": "time", "unit": "hhmmss"}


@pytest.mark.parametrize(("name", "turn"), [("seconds of day", 86400.0), ("iTOW", 604800.0)])
def test_seconds_of_the_day_or_week_go_on_as_it_ends(tmp_path, name, turn):
    exact = drive()
    cells = columns(NAMES["english"], ("deg/s", "km/h", "g", "deg"))
    cells = {name: texts((turn - 8.0 + exact["t"]) % turn)} | {k: q for k, q in cells.items() if k != "time"}
    (tmp_path / "drive.csv").write_text(table(cells))
    assert_the_drive(tmp_path / "drive.csv")


def test_a_second_clock_that_repeats_its_readings_is_none_of_other_rows(tmp_path):
    """A receiver's time, five times a second in rows of the table's clock."""
    exact = drive()
    cells = {"time": texts(exact["t"]), "yaw rate": texts(exact["r"])}
    cells |= {"gps time": texts(np.floor(5.0 * exact["t"]) / 5.0)}
    cells |= {"speed": texts(exact["v"]), "road wheel angle": texts(exact["delta_cmd"])}
    (tmp_path / "drive.csv").write_text(table(cells))
    assert list(look(tmp_path / "drive.csv").mapping["clocks"].values()) == [{"column": "time"}]


T = 0.01 * np.arange(400)


@pytest.mark.parametrize("other", [np.floor(T), 1.0 + np.sin(T)], ids=["held", "to and fro"])
def test_a_duration_is_no_clock_next_to_the_column_that_always_advances(other):
    """By units alone: the names are Latvian, of a delay and of the time."""
    topic = Topic("", pd.DataFrame({"aizture [s]": other, "laiks [s]": T, "speed [m/s]": 3.0 + np.sin(T)}))
    assert clock_of(topic) == "laiks [s]"


def test_days_of_a_recorder_whose_clock_was_never_set():
    """Spreadsheets number 1970-01-01, where such clocks begin, 25569: here a minute later, ten rows a second."""
    began = (datetime.date(1970, 1, 1) - datetime.date(1899, 12, 30)).days
    topic = Topic("", pd.DataFrame({"time": began + (60.0 + 10.0 * T) / 86400.0}))
    assert time_unit(topic, "time") == "day"
    np.testing.assert_allclose(np.diff(seconds(topic, "time")), 0.1, atol=1e-5)


def test_a_negative_reading_is_no_midnight():
    """-1 stands for none in a receiver's time of day: what comes after it is of the same day."""
    given = np.array([80_000.0, 80_000.1, -1.0, 80_000.3, 80_000.4])
    np.testing.assert_array_equal(clock_seconds(given, "s"), given)


@pytest.mark.parametrize(("zone", "hours"), [("Z", 0.0), ("+02:00", 2.0), ("-05:00", -5.0), ("-0330", -3.5)])
def test_times_of_a_zone_are_since_1970_in_universal_time(zone, hours):
    at = datetime.datetime(2024, 5, 1, 12, 0, tzinfo=datetime.timezone(datetime.timedelta(hours=hours)))
    found = seconds_of(pd.Series([f"2024-05-01T12:00:0{second}{zone}" for second in range(3)]))
    np.testing.assert_array_equal(found, at.timestamp() + np.arange(3.0))


def test_a_stamp_behind_other_columns_is_one_clock():
    stamps = {"stamp.sec": [1714557600, 1714557601], "stamp.nanosec": [750000000, 250000000]}
    joined, clocks = with_times(pd.DataFrame({"seq": [7, 8]} | stamps))
    assert clocks == ["stamp.sec"]
    assert joined["stamp.sec"].tolist() == [1714557600.75, 1714557601.25]
