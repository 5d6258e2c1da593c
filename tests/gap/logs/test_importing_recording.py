"""Recorders' tables: units, ticks of clocks, and one sentence for each bad file."""

import numpy as np
import pandas as pd
import pytest

from drift_drake.gap.logs.importing.mapping import mapping_from_dict
from drift_drake.gap.logs.importing.recording import (
    InvalidRecordingError,
    read_recording,
    regular_times,
    topics_of,
)


def mapping(**signals):
    base = {
        "r": {"column": "yaw", "unit": "rad/s"},
        "v": {"column": "speed", "unit": "m/s"},
        "delta_cmd": {"column": "steer", "unit": "rad", "clock": "slow"},
    }
    clocks = {"fast": {"column": "time"}, "slow": {"column": "stamp", "unit": "ms", "blank": 0}}
    return mapping_from_dict({"clocks": clocks, "signals": base | signals})


def table(count=60):
    k = np.arange(count)
    ticks = np.where(k < 5, 0.0, 5000.0 + 100.0 * (k // 10))
    return pd.DataFrame(
        {"time": 0.01 * k, "stamp": ticks, "yaw": 0.1 * k, "speed": 20.0 + 0.0 * k, "steer": 0.01 * (k // 10)}
    )


def written(folder, data):
    data.to_csv(folder / "one.csv", index=False)
    return folder / "one.csv"


def test_a_slow_clock_ticks_where_it_changes(tmp_path):
    recording = read_recording(written(tmp_path, table()), mapping())
    slow = recording.clocks["slow"]
    np.testing.assert_allclose(slow.t, [5.0, 5.1, 5.2, 5.3, 5.4, 5.5])
    np.testing.assert_array_equal(slow.rows, [5, 10, 20, 30, 40, 50])
    np.testing.assert_allclose(slow.signals["delta_cmd"], [0.0, 0.01, 0.02, 0.03, 0.04, 0.05])
    assert len(recording.clocks["fast"].t) == 60


@pytest.mark.parametrize(
    ("name", "signal", "recorded", "expected"),
    [
        ("r", {"unit": "deg/s"}, 180.0, np.pi),
        ("r", {"unit": "deg/s", "frame": "ned"}, 180.0, -np.pi),
        ("r", {"unit": "rpm", "sign": -1}, 60.0, -2.0 * np.pi),
        ("v", {"unit": "km/h"}, 36.0, 10.0),
        ("v", {"unit": "mph"}, 10.0, 4.4704),
        ("omega_r", {"unit": "rpm", "radius": 0.3}, 600.0, 6.0 * np.pi),
        ("omega_r", {"unit": "km/h"}, 36.0, 10.0),
        ("ax", {"unit": "g", "offset": 0.1}, -1.0, -9.70665),
        ("y", {"unit": "mm", "frame": "sae"}, 1500.0, -1.5),
        ("tau_cmd", {"unit": "kN m", "scale": 0.5}, 0.4, 200.0),
        ("x", {"unit": "ft", "sign": -1, "offset": 1.0}, 10.0, -2.048),
        ("pedal", {"unit": "%"}, 40.0, 0.4),
    ],
)
def test_units_signs_frames_offsets(tmp_path, name, signal, recorded, expected):
    data = table().assign(it=recorded)
    recording = read_recording(written(tmp_path, data), mapping(**{name: {"column": "it", **signal}}))
    np.testing.assert_allclose(recording.clocks["fast"].signals[name], expected, rtol=1e-12)


@pytest.mark.parametrize("low", [0.0, -180.0])
def test_headings_are_unwrapped_in_their_own_unit(tmp_path, low):
    true = np.linspace(0.0, 900.0, 60)
    data = table().assign(yaw_angle=np.mod(true - low, 360.0) + low)
    signal = {"column": "yaw_angle", "unit": "deg", "frame": "ned", "offset": 0.5}
    psi = read_recording(written(tmp_path, data), mapping(psi=signal)).clocks["fast"].signals["psi"]
    np.testing.assert_allclose(psi - psi[0], -np.radians(true), atol=1e-12)


@pytest.mark.parametrize("dated", [True, False])
def test_an_index_without_a_name_has_the_times(tmp_path, dated):
    pytest.importorskip("pyarrow", reason="Parquet is an extra: pip install 'drift_drake[parquet]'")
    t = 0.01 * np.arange(300)
    index = pd.to_datetime(1.7e9 + t, unit="s") if dated else pd.Index(t)
    pd.DataFrame({"speed": 10.0 + t, "yaw_rate": t}, index=index).to_parquet(tmp_path / "one.parquet")
    (topic,) = topics_of(tmp_path / "one.parquet")
    np.testing.assert_allclose(topic.table["time"] - topic.table["time"][0], t, atol=1e-6)


def test_parquet_reads_as_csv_does(tmp_path):
    pytest.importorskip("pyarrow", reason="Parquet is an extra: pip install 'drift_drake[parquet]'")
    data = table()
    data.to_parquet(tmp_path / "one.parquet")
    one = read_recording(written(tmp_path, data), mapping())
    other = read_recording(tmp_path / "one.parquet", mapping())
    for name, readings in one.clocks.items():
        np.testing.assert_allclose(other.clocks[name].t, readings.t, rtol=1e-12)
        for key, values in readings.signals.items():
            np.testing.assert_allclose(other.clocks[name].signals[key], values, rtol=1e-12)


def test_regular_times():
    generator = np.random.default_rng(0)
    true = 1.7e9 + 0.010001 * np.arange(3000)
    arrived = true + generator.uniform(-1.0, 1.0, 3000) * 3e-4
    kept = np.delete(np.arange(3000), slice(500, 507))
    found = regular_times(arrived[kept])
    assert np.max(np.abs(found - true[kept])) < 3e-5


def broken(case):
    data = table()
    match case:
        case "text":
            data["yaw"] = data["yaw"].astype(object)
            data.loc[7:12, "yaw"] = "n/a?"
        case "backwards":
            data.loc[30:, "time"] -= 1.0
        case "still":
            data["stamp"] = 0.0
        case "column":
            data = data.drop(columns="speed")
        case "empty column":
            data["speed"] = np.nan
        case "no rows":
            data = data.iloc[:0]
    return data


@pytest.mark.parametrize(
    ("case", "message"),
    [
        (
            "text",
            r"one.csv: column 'yaw' holds 'n/a\?' in row 9, and no number in 6 of 60 rows; numbers or nothing",
        ),
        ("backwards", r"one.csv: the clock 'time' goes backwards in row 32 \(by 0.99 s\)"),
        ("still", "one.csv: the clock 'stamp' never advances"),
        ("column", r"one.csv: missing column 'speed'; did you mean steer\? Its columns are time, stamp, yaw, steer"),
        ("empty column", "one.csv: column 'speed' holds no readings"),
        ("no rows", "one.csv: the file has a header and no rows"),
    ],
)
def test_bad_files(tmp_path, case, message):
    with pytest.raises(InvalidRecordingError, match=message) as caught:
        read_recording(written(tmp_path, broken(case)), mapping())
    assert "\n" not in str(caught.value)


def test_of_two_columns_with_one_name_none_is_taken_for_the_other(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t,v, v,r\n" + "".join(f"{0.01 * k:.2f},10,20,0.1\n" for k in range(100)))
    signals = {"r": {"column": "r", "unit": "rad/s"}, "delta_cmd": {"column": "r", "unit": "rad"}}

    def speed(column: str) -> float:
        content = {"clocks": {"main": {"column": "t"}}, "signals": signals | {"v": {"column": column, "unit": "m/s"}}}
        return float(read_recording(path, mapping_from_dict(content, "mapping")).clocks["main"].signals["v"][0])

    with pytest.raises(InvalidRecordingError, match=r"missing column 'v'; .*v \(column 2\)"):
        speed("v")
    assert (speed("v (column 2)"), speed("v (column 3)")) == (10.0, 20.0)


def test_no_tables(tmp_path):
    with pytest.raises(InvalidRecordingError, match="no such file"):
        read_recording(tmp_path / "absent.csv", mapping())
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(InvalidRecordingError, match="the file is empty"):
        read_recording(tmp_path / "empty.csv", mapping())
    (tmp_path / "noise.csv").write_bytes(bytes(range(128, 256)) * 4)
    with pytest.raises(InvalidRecordingError, match="cannot be read as CSV"):
        read_recording(tmp_path / "noise.csv", mapping())
