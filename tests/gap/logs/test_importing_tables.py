"""Text tables of every dialect, unit and clock: a look maps them, and the drive comes back."""

import bz2
import gzip
import itertools
import lzma

import numpy as np
import pytest
import yaml
from table_dialects import CLOCKS, NAMES, SIGNALS, assert_the_drive, columns, drive, table, texts

pytest.importorskip("hypothesis", reason="property tests need the extra `test`")
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drift_drake.cli.main import main
from drift_drake.gap.logs.importing.formats import text_tables
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError, read_topics
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.look import look, mapping_text
from drift_drake.gap.logs.importing.mapping import InvalidMappingError, mapping_from_dict, read_mapping
from drift_drake.gap.logs.importing.recording import contradicted, read_recording

UNITS = {
    "r": ("rad/s", "deg/s", "°/s", "DEG/S", "deg s-1", "mrad/s", "Grad/s"),
    "v": ("m/s", "km/h", "KM/H", "kmph", "KPH", "MPH", "miles/h", "knots", "kts", "ft/s", "cm/s", "m.s-1"),
    "ay": ("m/s^2", "m/s²", "g", "G", "Gal", "ft/s2", "m/s/s"),
    "delta_cmd": ("rad", "deg", "°", "Degrees", "mrad"),
}


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    names=st.sampled_from(sorted(NAMES)),
    units=st.tuples(*(st.sampled_from(UNITS[key]) for key in SIGNALS)),
    clock=st.sampled_from(sorted(CLOCKS)),
    separator=st.sampled_from([",", ";", "\t", "|"]),
    decimal=st.sampled_from([".", ","]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"]),
    quoted=st.booleans(),
    place=st.sampled_from(["name", "row"]),
    above=st.sampled_from(["", "# recorder\n# car A\n", '"Format","Logger"\n"Rate","100","Hz"\n\n', "Car: A\n\n"]),
    ending=st.sampled_from(["\n", "\r\n"]),
)
def test_a_drive_comes_back(
    tmp_path_factory, names, units, clock, separator, decimal, encoding, quoted, place, above, ending
):
    quoted = quoted or (separator == "," and decimal == ",")
    cells = columns(NAMES[names], units, clock, unit_in_name=place == "name")
    text = table(cells, separator, decimal, quoted, ("", *units) if place == "row" else ())
    path = tmp_path_factory.mktemp("drive") / "drive.csv"
    path.write_bytes((above + text).replace("\n", ending).encode(encoding))
    assert_the_drive(path)


LOGGERS = {  # what race loggers write above their rows
    "aim": ('"Format","AiM CSV File"\n"Session","A"\n"Sample Rate","100"\n"Beacon Markers","1.5","3.2","5.5","9.1"\n'
            '"Segment Times","0:01.500","0:01.700"\n\n{names}\n{names}\n{units}\n"1","2","3","4","5"\n\n'),
    "motec": ('"Format","MoTeC CSV File",,,"Workbook","x",,\n"Venue","V",,,"Worksheet","y"\n"Sample Rate","100","Hz"\n'
              '"Beacon Markers",""\n\n\n{names}\n{units}\n\n\n'),
    "racechrono": ("This file is created using RaceChrono v7 ( http://racechrono.com/ ).\nFormat,3\nNote,\n\n{names}\n"
                   "{units}\n100: gps,200: gyro,100: gps,calc,calc\n"),
    "grouped": ",IMU,GPS,IMU,CAN\n{names}\n{units}\n",
    "commented": "% logger\n% car\n{names}\n{units}\n",
}  # fmt: skip


@pytest.mark.parametrize("logger", sorted(LOGGERS))
@pytest.mark.parametrize("quoted", [True, False])
def test_lines_above_the_rows(tmp_path, logger, quoted):
    units = ("deg/s", "KPH", "G", "deg")
    cells = columns(("Time", "GPS Yaw Rate", "GPS Speed", "GPS LatAcc", "Steering Angle"), units, unit_in_name=False)
    _, *rows = table(cells, quoted=quoted).splitlines()
    mark = '"' if quoted else ""
    names = ",".join(f"{mark}{name}{mark}" for name in cells)
    head = LOGGERS[logger].format(names=names, units=",".join(f"{mark}{unit}{mark}" for unit in ("s", *units)))
    (tmp_path / "drive.csv").write_text(head + "\n".join(rows) + "\n")
    assert_the_drive(tmp_path / "drive.csv")


@pytest.mark.parametrize("kind", ["trailing", "footer", "comments between", "sep=", "blanks", "savetxt"])
def test_odd_tables(tmp_path, kind):
    units = ("deg/s", "km/h", "g", "deg")
    cells = columns(("time", "yaw_rate", "speed", "acc_y", "steering_angle"), units)
    text = table(cells)
    match kind:
        case "trailing":
            text = text.replace("\n", ",\n")
        case "footer":
            text += "End of log\n"
        case "comments between":
            text = text.replace("\n4.000,", "\n# lap 2\n4.000,").replace(",", ";")
        case "sep=":
            text = "sep=;\n" + table(cells, ";", ",")
        case "blanks":
            text = table({name.replace(" [", "["): values for name, values in cells.items()}, "   ")
        case "savetxt":
            text = "# " + table({name.replace(" [", "["): values for name, values in cells.items()}, " ")
    (tmp_path / "drive.csv").write_text(text)
    assert_the_drive(tmp_path / "drive.csv")


@pytest.mark.parametrize("packed", [gzip, bz2, lzma])
@pytest.mark.parametrize("separator", [",", ";"])
def test_a_packed_table_by_another_name(tmp_path, packed, separator):
    text = table(columns(NAMES["short"], ("deg/s", "km/h", "g", "deg")), separator=separator)
    (tmp_path / "a.csv").write_bytes(packed.compress(text.encode()))
    assert_the_drive(tmp_path / "a.csv")


def test_a_table_without_a_header_numbers_its_columns(tmp_path):
    (tmp_path / "drive.csv").write_text("".join(f"{0.01 * k:.2f},{k},2\n" for k in range(60)))
    (topic,) = read_topics(tmp_path / "drive.csv")
    assert list(topic.table) == ["column 1", "column 2", "column 3"]
    assert len(topic.table) == 60


@pytest.mark.parametrize("names", [
    "timestamp,arbitration_id,extended,remote,error,dlc,data", "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2",
])  # fmt: skip
def test_frames_in_a_table_are_refused(tmp_path, names):
    rows = [",".join(f"{i + k}" for k in range(names.count(",") + 1)) for i in range(20)]
    (tmp_path / "frames.csv").write_text("\n".join([names, *rows]) + "\n")
    with pytest.raises(InvalidRecordingError, match="is a table of raw CAN frames, which is not read; save them as"):
        look(tmp_path / "frames.csv")


def test_signals_are_guessed_without_a_clock(tmp_path, capsys):
    cells = columns(NAMES["english"], ("deg/s", "km/h", "g", "deg"))
    cells.pop("time")
    (tmp_path / "drive.csv").write_text(table(cells))
    assert main(["import", "--look", str(tmp_path / "drive.csv")]) == 0
    (tmp_path / "mine.yaml").write_text(text := capsys.readouterr().out)
    assert set(SIGNALS) <= set(yaml.safe_load(text)["signals"])
    assert (
        "name it in place of '?' under 'clocks', or write the rate of its rows there, as in 'recorder: 100 Hz'" in text
    )
    command = ["--mapping", str(tmp_path / "mine.yaml"), "--out", str(tmp_path / "out")]
    assert main(["import", str(tmp_path / "drive.csv"), *command]) == 2
    assert "clocks.recorder.column is '?'; name the column of times" in capsys.readouterr().err
    mapping = yaml.safe_load(text)
    for rate, period in (("100 Hz", 0.01), ("0.05 kHz", 0.02)):
        (tmp_path / "mine.yaml").write_text(yaml.safe_dump(mapping | {"clocks": {"recorder": rate}}))
        (run,), report = import_recordings([tmp_path / "drive.csv"], read_mapping(tmp_path / "mine.yaml"))
        exact = drive()
        assert run.t[-1] == pytest.approx(period * (len(exact["t"]) - 1), abs=0.011)
        for key in SIGNALS:
            right = np.interp(run.t, period * np.arange(len(exact["t"])), exact[key])
            np.testing.assert_allclose(run.column(key), right, atol=3e-2, err_msg=key)
        assert not any("clock" in remark for remark in report.remarks)


@pytest.mark.parametrize("stated", ["name", "round", "row"])
def test_an_unknown_unit_is_asked_for(tmp_path, stated):
    exact = drive()
    cells = {"time": texts(exact["t"]), "yaw_rate": texts(exact["r"]), "speed": texts(exact["v"])}
    cells["steering_angle"] = texts(exact["delta_cmd"])
    name = {"name": "speed [wug/s]", "round": "speed (wug/s)", "row": "speed"}[stated]
    cells = {name if key == "speed" else key: values for key, values in cells.items()}
    units = ("s", "rad/s", "wug/s", "rad") if stated == "row" else ()
    (tmp_path / "drive.csv").write_text(table(cells, units=units))
    found = look(tmp_path / "drive.csv")
    assert found.mapping["signals"]["v"] == {"column": name, "unit": "?"}
    assert any("'wug/s'" in note and "is not known" in note for note in found.notes)
    with pytest.raises(
        InvalidMappingError, match=r"signals.v.unit is '\?'; write the recorder's unit; known are m/s, "
    ):
        mapping_from_dict(found.mapping)


def test_a_mapping_that_contradicts_the_file_is_doubted(tmp_path):
    units = ("deg/s", "km/h", "g", "deg")
    (tmp_path / "drive.csv").write_text(table(columns(NAMES["english"], units)))
    content = look(tmp_path / "drive.csv").mapping
    content["signals"]["v"]["unit"] = "mph"
    remarks = read_recording(tmp_path / "drive.csv", mapping_from_dict(content)).remarks
    assert remarks == [
        "the file states 'km/h' for column 'speed [km/h]', and signals.v.unit is 'mph': see which is right."
    ]


def test_the_g_of_a_name_may_be_the_centre_of_gravity(tmp_path):
    (tmp_path / "drive.csv").write_text(table(columns(NAMES["english"], ("rad/s", "m/s", "m/s^2", "rad"))))
    topic = read_topics(tmp_path / "drive.csv")[0]
    assert contradicted(topic, "axG", "m/s^2", "signals.ax.unit") == []
    assert contradicted(topic, "ax_g", "m/s^2", "signals.ax.unit") != []


HEADERS = {
    "names": ["Time", "Yaw Rate", "Vehicle Speed", "Steering Angle"],
    "units": ["s", "deg/s", "km/h", "deg"],
    "sensors": ["", "IMU_7", "CAN_2", "POT_1"],
    "numbers": ["CH1", "CH2", "CH3", "CH4"],
    "types": ["double", "float", "float", "float"],
}


@pytest.mark.parametrize("others", [("sensors",), ("numbers",), ("types", "numbers"), ()])
def test_lines_of_names_units_and_sensors_stand_in_any_order(tmp_path, others):
    columns = drive()
    rows = np.column_stack(
        [columns["t"], np.degrees(columns["r"]), 3.6 * columns["v"], np.degrees(columns["delta_cmd"])]
    )
    body = "\n".join(",".join(f"{x:.6f}" for x in row) for row in rows)
    for number, order in enumerate(itertools.permutations(["names", "units", *others])):
        path = tmp_path / f"{number}.csv"
        path.write_text("\n".join([*(",".join(HEADERS[line]) for line in order), body, ""]))
        found = look(path).mapping
        assert {key: line["column"] for key, line in found["signals"].items()} == dict(
            zip(("r", "v", "delta_cmd"), HEADERS["names"][1:], strict=True)
        ), order
        assert [line["unit"] for line in found["signals"].values()] == HEADERS["units"][1:], order


def test_numbers_that_no_unit_allows_are_raw_counts(tmp_path):
    columns = drive()
    lines = ["time [s],speed [km/h],yaw_rate [rad/s],steering_angle [rad]"] + [
        f"{t:.2f},{360.0 * v:.0f},{r:.6f},{d:.6f}"
        for t, v, r, d in zip(*(columns[key] for key in ("t", "v", "r", "delta_cmd")), strict=True)
    ]
    path = tmp_path / "raw.csv"
    path.write_text("\n".join(lines) + "\n")
    found = look(path)
    assert found.mapping["signals"]["v"]["unit"] == "?"
    assert any("raw counts" in note for note in found.notes)
    found.mapping["signals"]["v"]["unit"] = "km/h"
    with pytest.raises(
        InvalidRecordingError, match="read as km/h already: give the factor of its raw counts as its 'scale'"
    ):
        import_recordings([path], mapping_from_dict(found.mapping))
    found.mapping["signals"]["v"]["scale"] = 0.01
    (run,), _ = import_recordings([path], mapping_from_dict(found.mapping))
    assert abs(float(np.mean(run.v)) - float(np.mean(columns["v"]))) < 0.1


def test_a_table_with_one_time_is_looked_at(tmp_path):
    (tmp_path / "one.csv").write_text("time,speed,yaw_rate\n1.0,2.0,3.0\n")
    assert "# table: 1 row, " in mapping_text(look(tmp_path / "one.csv"))


def test_numbers_that_nothing_measures(tmp_path):
    """An integer of 400 digits, numbers whose squares overflow, and times that go back and stand still."""
    columns = drive()
    rows = [[f"{t:.2f}", f"{r:.6f}", f"{v:.4f}", f"{d:.6f}"] for t, r, v, d in
            zip(*(columns[key] for key in ("t", "r", "v", "delta_cmd")), strict=True)]  # fmt: skip
    rows[7][1], rows[8][2], rows[9][3] = "1" + 400 * "0", "1e300", "-1e200"
    rows[3:6] = [["0.05", *rows[3][1:]], ["0.02", *rows[4][1:]], ["0.05", *rows[5][1:]]]
    path = tmp_path / "endless.csv"
    path.write_text("\n".join(["time,yaw_rate,speed,steering_angle", *map(",".join, rows), ""]))
    found = look(path)
    assert not found.missing
    speed = next(column for column in found.topics[0].columns if column.name == "speed")
    assert speed.high < 100.0
    import_recordings([path], mapping_from_dict(found.mapping))


@pytest.mark.parametrize(
    ("encoding", "names"),
    [
        ("cp932", "時間[s],車速[km/h],ヨーレート[deg/s],操舵角[deg]"),
        ("gb18030", "时间[s],车速[km/h],横摆角速度[deg/s],前轮转角[deg]"),
        ("big5", "時間[s],車速[km/h],橫擺角速度[deg/s],轉向角[deg]"),
        ("euc_kr", "시간[s],차속[km/h],요레이트[deg/s],조향각[deg]"),
        ("cp1252", "Zeit [s],Geschwindigkeit [km/h],Girhastighet [°/s],Rattvinkel höger [°]"),
        ("cp1250", "Čas [s],Rychlost [km/h],Stáčivá rychlost [°/s],Úhel natočení volantu [°]"),
        ("cp1250", "Czas [s],Prędkość [km/h],Prędkość odchylania [°/s],Kąt obrotu kierownicy [°]"),
        ("cp1250", "t [s],Sebesség [km/h],Legyezési szögsebesség [°/s],Kormányszög [°]"),
        ("cp1251", "Время [сек],Скорость [км/ч],Угловая скорость рыскания [°/сек],Угол поворота руля [°]"),
        ("cp1254", "Zaman [s],H\u0131z [km/sa],Sapma h\u0131z\u0131 [°/s],Direksiyon aç\u0131s\u0131 [°]"),
    ],
)
def test_tables_in_the_encodings_of_their_countries(tmp_path, encoding, names):
    rows = "\n".join(f"{0.01 * k:.2f},{50 + k % 7},{k % 5 - 2.5},{k % 3 - 1.5}" for k in range(50))
    (tmp_path / "a.csv").write_bytes(f"{names}\n{rows}\n".encode(encoding))
    (topic,) = read_topics(tmp_path / "a.csv")
    assert list(topic.table) == names.split(",")


def test_rows_that_are_longer_than_their_header_lose_nothing_without_a_word(tmp_path):
    """Given what pandas would cut off with a warning of its own."""
    path = tmp_path / "a.csv"
    path.write_text("1,2,3\n4,5,6\n")
    with pytest.raises(ValueError, match="rows have more fields than its header has names"):
        text_tables._table(path, header=None, names=range(2), index_col=False)
