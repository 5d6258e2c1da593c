"""One drive in every format comes back as the drive, its topics on clocks of their own; and `--look` maps it."""

import numpy as np
import pandas as pd
import pytest
import yaml
from importing_bench import truth
from recorder_files import EPOCH, arrays, mapping, topics, write_bag, write_json_mcap, write_mdf

from drift_drake.car.log.table import read_case
from drift_drake.cli.main import main
from drift_drake.gap.logs.importing.formats.arrays import topics_of_arrays
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError, read_topics
from drift_drake.gap.logs.importing.formats.topics import topics_of_messages, with_yaw
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.look import guessed_mapping, look, mapping_text
from drift_drake.gap.logs.importing.mapping import mapping_from_dict

OWN = {"imu": "imu.t", "gps": "gps.t", "drive": "drive.t"}
STAMPED = {"imu": "/imu.log_time", "gps": "/gps.log_time", "drive": "/drive.log_time"}
ARRAYS = mapping(OWN, "imu.gyro[2]", "imu.acc[1]", "gps.velocity[0]", "gps.velocity[1]")
COMMAND = {"column": "/drive.data[0]", "unit": "rad", "clock": "drive"}


def with_slashes(content, **changes):
    signals = {name: entry | {"column": f"/{entry['column']}"} for name, entry in content["signals"].items()}
    return content | {"signals": signals | changes}


def written(kind, folder):
    """A file of that kind, and a mapping for it."""
    match kind:
        case "mcap":
            pytest.importorskip("mcap", reason="MCAP is an extra: pip install 'drift_drake[ros]'")
            write_json_mcap(folder / "drive.mcap")
            return folder / "drive.mcap", with_slashes(mapping(STAMPED))
        case "bag" | "bag_mcap" | "bag_file":
            pytest.importorskip("rosbags", reason="bags are an extra: pip install 'drift_drake[ros]'")
            write_bag(folder / "bag", mcap=kind == "bag_mcap")
            stamps = STAMPED | {"imu": "/imu.header.stamp", "gps": "/gps.header.stamp"}
            names = mapping(stamps, ay="imu.linear_acceleration.y", vx="gps.twist.linear.x", vy="gps.twist.linear.y")
            content = with_slashes(names, delta_cmd=COMMAND)
            return next((folder / "bag").glob("*.db3")) if kind == "bag_file" else folder / "bag", content
        case "mf4":
            pytest.importorskip("asammdf", reason="MDF is an extra: pip install 'drift_drake[mdf]'")
            write_mdf(folder / "drive.mf4")
            clocks = {name: f"{name}.time" for name in OWN}
            content = mapping(clocks, "imu.r", "imu.ay", "gps.vx", "gps.vy")
            content["signals"]["delta_cmd"]["column"] = "delta_cmd"  # there is one in all topics
            return folder / "drive.mf4", content
        case "mat":
            pytest.importorskip("pymatreader", reason="MATLAB files are an extra: pip install 'drift_drake[matlab]'")
            import scipy.io

            scipy.io.savemat(folder / "drive.mat", arrays())
            return folder / "drive.mat", ARRAYS
        case "npz":
            flat = {f"{topic}.{name}": values for topic, part in arrays().items() for name, values in part.items()}
            np.savez(folder / "drive.npz", **flat)
            return folder / "drive.npz", ARRAYS
    h5py = pytest.importorskip("h5py", reason="HDF5 is an extra: pip install 'drift_drake[hdf5]'")
    with h5py.File(folder / "drive.h5", "w") as file:
        for topic, part in arrays().items():
            for name, values in part.items():
                file[f"{topic}/{name}"] = values
    return folder / "drive.h5", ARRAYS


@pytest.mark.parametrize("kind", ["mcap", "bag", "bag_mcap", "bag_file", "mf4", "mat", "npz", "h5"])
def test_a_drive_comes_back(tmp_path, kind):
    path, content = written(kind, tmp_path)
    (run,), report = import_recordings([path], mapping_from_dict(content))
    assert not [text for text in report.remarks if "read each" not in text]
    exact = truth()
    t = run.t  # after the first reading of the inertial unit, which is at zero
    for name, allowed in {"r": 1e-3, "v": 3e-3, "beta": 1e-3, "ay": 0.02, "delta_cmd": 5e-4}.items():
        np.testing.assert_allclose(run.column(name), np.interp(t, exact["t"], exact[name]), atol=allowed, err_msg=name)
    assert {"gps", "drive"} == set(next(iter(report.clocks.values())))
    assert all(abs(clock.offset) < 1e-6 for clock in next(iter(report.clocks.values())).values())


@pytest.mark.parametrize("kind", ["mcap", "bag", "mf4", "mat", "h5"])
def test_a_first_look_prints_a_mapping_that_works(tmp_path, capsys, kind):
    path, _ = written(kind, tmp_path)
    assert main(["import", "--look", str(path)]) == 0
    text = capsys.readouterr().out
    assert "100 Hz" in text
    assert "40 Hz" in text
    content = yaml.safe_load(text)
    if kind == "bag":  # a bare array has no name to go by
        assert "Nothing here looks like delta_cmd" in text
        content["clocks"]["drive"] = {"column": "/drive.log_time"}
        content["signals"]["delta_cmd"] = COMMAND
    mine = tmp_path / "mine.yaml"
    mine.write_text(yaml.safe_dump(content))
    assert main(["import", str(path), "--mapping", str(mine), "--out", str(tmp_path / "case")]) == 0


def test_a_look_at_a_table_reads_units_off_its_names():
    t = 1e3 * topics()["imu"][0]
    read = 0.01 * t  # as a vehicle's may be
    table = pd.DataFrame(
        {"time_ms": t, "yaw_rate_deg_s": read, "speed [km/h]": read, "steering_angle_deg": read, "note": "a"}
    )
    content, missing, _ = guessed_mapping([topics_of_arrays({"a": t})[0].__class__("", table)])
    assert not missing
    assert content["clocks"] == {"recorder": {"column": "time_ms", "unit": "ms"}}
    units = {name: signal["unit"] for name, signal in content["signals"].items()}
    assert units == {"r": "deg/s", "v": "km/h", "delta_cmd": "deg"}


def test_messages_flatten():
    class Slots:
        __slots__ = ("_hidden", "w", "x", "y", "z")

        def __init__(self, angle):
            self._hidden, self.x, self.y = 1, 0.0, 0.0
            self.z, self.w = np.sin(angle / 2), np.cos(angle / 2)

    stamp = {"sec": 5, "nanosec": 250_000_000}
    message = {"stamp": stamp, "q": Slots(1.2), "name": "car", "image": bytes(10), "rows": [1.0, [2.0, 3.0]]}
    (topic,) = topics_of_messages([("/a", 7_000_000_000, message)])
    table = with_yaw(topic.table)
    assert table["/a.stamp"][0] == 5.25
    assert table["/a.q.yaw"][0] == pytest.approx(1.2)
    assert table["/a.rows[1][1]"][0] == 3.0
    assert not [name for name in table if "hidden" in name or "name" in name or "image" in name]


def test_files_that_cannot_be_read_are_named(tmp_path):
    for ending in (".mcap", ".mf4", ".mat", ".npz", ".h5", ".db3", ".bag"):
        path = tmp_path / f"broken{ending}"
        path.write_bytes(b"no such format")
        with pytest.raises(
            InvalidRecordingError, match=f"broken{ending}: (cannot be read as|reading .* needs)"
        ) as caught:
            read_topics(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(InvalidRecordingError, match="is a folder and no ROS 2 bag"):
        read_topics(tmp_path)


def test_a_signal_needs_a_clock_of_its_topic(tmp_path):
    path, content = written("npz", tmp_path)
    content = content | {"signals": content["signals"] | {"vx": {"column": "gps.velocity[0]", "unit": "m/s"}}}
    with pytest.raises(InvalidRecordingError, match=r"'gps.velocity\[0\]' is in gps, and its clock 'imu' in imu"):
        import_recordings([path], mapping_from_dict(content))
    content["signals"]["vx"] = {"column": "velocity[7]", "unit": "m/s", "clock": "gps"}
    with pytest.raises(InvalidRecordingError, match="did you mean"):
        import_recordings([path], mapping_from_dict(content))


def test_two_absolute_clocks_of_one_table_share_their_epoch(tmp_path):
    exact = truth()
    seen = np.arange(0.0, 23.0, 0.01)
    taken = seen - 0.008  # the second clock's readings are 8 ms older than their rows

    def at(t, name):
        return np.interp(t, exact["t"], exact[name])

    data = {"time": EPOCH + seen, "r": at(seen, "r"), "stamp": EPOCH + taken}
    data |= {"vx": at(taken, "v") * np.cos(at(taken, "beta")), "vy": at(taken, "v") * np.sin(at(taken, "beta"))}
    pd.DataFrame(data | {"steer": at(seen, "delta_cmd")}).to_csv(tmp_path / "one.csv", index=False)
    clocks = {"a": {"column": "time"}, "b": {"column": "stamp"}}
    signals = {
        "r": {"column": "r", "unit": "rad/s"},
        "delta_cmd": {"column": "steer", "unit": "rad"},
        "vx": {"column": "vx", "unit": "m/s", "clock": "b"},
        "vy": {"column": "vy", "unit": "m/s", "clock": "b"},
    }
    (run,), report = import_recordings(
        [tmp_path / "one.csv"], mapping_from_dict({"clocks": clocks, "signals": signals})
    )
    assert report.clocks["one"]["b"].offset == 0.0
    assert report.clocks["one"]["b"].arrival == pytest.approx(0.008, abs=1e-6)
    np.testing.assert_allclose(run.beta, at(run.t, "beta"), atol=2e-4)
    clocks["b"]["epoch"] = "own"
    _, report = import_recordings([tmp_path / "one.csv"], mapping_from_dict({"clocks": clocks, "signals": signals}))
    assert report.clocks["one"]["b"].offset == pytest.approx(0.008, abs=1e-6)


def plain(changes):
    t = np.arange(0.0, 12.0, 0.01)
    exact = truth()
    data = {name: np.interp(t, exact["t"], exact[name]) for name in ("r", "v", "delta_cmd")}
    return pd.DataFrame({"time": t, **data, **changes(t)})


PLAIN = {
    "clocks": {"a": {"column": "time"}},
    "signals": {
        "r": {"column": "r", "unit": "rad/s"},
        "v": {"column": "v", "unit": "m/s"},
        "delta_cmd": {"column": "delta_cmd", "unit": "rad"},
    },
}


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("r", "ERR", "a reading was left out of 'r': 'ERR' at 5.000 s after the first reading."),
        ("v", 1e9, "a reading was left out of 'v': 1e+09 at 5.000 s"),
        ("time", 900.0, "a reading was left out of 'time': a time out of order (900)"),
        ("time", 1.0, "a reading was left out of 'time': a time out of order (1)"),
    ],
)
def test_one_bad_row_is_cut_out_and_reported(tmp_path, column, value, said):
    table = plain(lambda _: {})
    good = table.copy()
    table[column] = table[column].astype(object)
    table.loc[500, column] = value
    table.to_csv(tmp_path / "one.csv", index=False)
    (run,), report = import_recordings([tmp_path / "one.csv"], mapping_from_dict(PLAIN))
    assert any(said in text for text in report.remarks), report.remarks
    np.testing.assert_allclose(run.r, good["r"], atol=1e-3)
    np.testing.assert_allclose(run.v, good["v"], atol=1e-3)


def test_reversing_is_cut_and_reported_and_a_spin_is_not(tmp_path):
    def backwards(t):
        return {"v": 10.0 * np.cos(0.6 * t), "r": 0.0 * t, "delta_cmd": 0.001 * np.sin(t)}

    plain(backwards).to_csv(tmp_path / "one.csv", index=False)
    runs, report = import_recordings([tmp_path / "one.csv"], mapping_from_dict(PLAIN))
    assert len(runs) == 2
    assert any("the car reverses from 2." in text for text in report.remarks)
    assert any("cut out, since there is no sideslip" in text for text in report.remarks)
    assert all(np.min(run.v) >= -0.5 for run in runs)

    def with_sideslip(t):
        vx = 10.0 * np.cos(0.6 * t)
        return {"vx": vx, "vy": 0.02 * vx, "r": 0.0 * t, "delta_cmd": 0.001 * np.sin(t)}

    plain(with_sideslip).to_csv(tmp_path / "three.csv", index=False)
    signals = PLAIN["signals"] | {name: {"column": name, "unit": "m/s"} for name in ("vx", "vy")}
    signals.pop("v")
    runs, report = import_recordings([tmp_path / "three.csv"], mapping_from_dict(PLAIN | {"signals": signals}))
    assert any("the car reverses from 2." in text and "a run of its own" in text for text in report.remarks)
    assert [bool(np.median(np.abs(run.beta)) > 3.0) for run in runs] == [False, True, False]
    assert all(np.min(run.v) >= 0.0 for run in runs)

    def spinning(t):
        beta = np.clip(t - 5.0, 0.0, 2.8)
        return {"vx": 10.0 * np.cos(beta), "vy": 10.0 * np.sin(beta), "r": np.where(beta > 0, -0.5, 0.0)}

    plain(spinning).to_csv(tmp_path / "two.csv", index=False)
    signals = PLAIN["signals"] | {name: {"column": name, "unit": "m/s"} for name in ("vx", "vy")}
    signals.pop("v")
    runs, report = import_recordings([tmp_path / "two.csv"], mapping_from_dict(PLAIN | {"signals": signals}))
    assert len(runs) == 1
    assert not any("reverses" in text for text in report.remarks)


def test_a_small_cars_yaw_rate_is_no_degrees(tmp_path):
    plain(lambda t: {"r": 8.7 * np.sin(2.0 * t), "v": 2.0 + 0.0 * t, "delta_cmd": 0.3 * np.sin(2.0 * t)}).to_csv(
        tmp_path / "one.csv", index=False
    )
    (run,), _ = import_recordings([tmp_path / "one.csv"], mapping_from_dict(PLAIN | {"wheelbase": 0.17}))
    assert np.max(run.r) == pytest.approx(8.7, rel=0.01)


def test_a_yaw_rate_beyond_belief_is_refused_unless_trusted(tmp_path, capsys):
    spinning = {"r": 9.0, "v": 20.0, "delta_cmd": 0.1}
    plain(lambda t: {name: 0.0 * t + value for name, value in spinning.items()}).to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(PLAIN))
    command = ["import", str(tmp_path / "a.csv"), "--mapping", str(tmp_path / "map.yaml"), "--out", str(tmp_path / "m")]
    assert main(command) == 2
    assert "it looks like degrees per second" in capsys.readouterr().err
    assert main([*command, "--trust", "yaw"]) == 2
    assert "--trust yaw: is not a column of the log" in capsys.readouterr().err
    assert main([*command, "--trust", "r"]) == 0
    assert np.max(read_case(tmp_path / "m")[0].r) == pytest.approx(9.0)


def test_a_look_names_what_the_file_lacks(tmp_path):
    pd.DataFrame({"t": np.arange(100) * 0.01, "speed": 1.0}).to_csv(tmp_path / "one.csv", index=False)
    text = mapping_text(look(tmp_path / "one.csv"))
    assert "Nothing here looks like delta_cmd" in text
    assert yaml.safe_load(text)["signals"]["v"] == {"column": "speed", "unit": "m/s"}


def test_a_look_at_a_file_without_numbers_is_refused(tmp_path):
    (tmp_path / "car.yaml").write_text("mass: heavy\nfriction: some\n")
    with pytest.raises(InvalidRecordingError, match=r"car.yaml: holds no column of numbers"):
        look(tmp_path / "car.yaml")


def test_an_angle_that_cannot_be_radians_is_guessed_in_degrees(tmp_path):
    t = np.arange(300) * 0.01
    stamps = 1.7e9 + t
    table = {
        "time": stamps,
        "yaw_rate": 0.2 * np.sin(t),
        "speed": np.full(300, 12.0),
        "steering_wheel": 90.0 * np.sin(t),
    }
    pd.DataFrame(table).to_csv(tmp_path / "lap.csv", index=False)
    found = look(tmp_path / "lap.csv")
    assert found.mapping["signals"]["delta_cmd"]["unit"] == "deg"
    assert "time: 1700000000 to 1700000002.99" in mapping_text(found)


def test_a_column_without_a_number_is_looked_at(tmp_path):
    (tmp_path / "lap.csv").write_text("time,speed,steering_angle\n0.0,10.0,\n0.1,10.0,\n")
    assert "steering_angle" in mapping_text(look(tmp_path / "lap.csv"))


@pytest.mark.parametrize("last", ["7", "7.5", "", "text", "True"])
def test_a_large_table_is_read_in_pieces_as_at_once(tmp_path, monkeypatch, last):
    path = tmp_path / "log.csv"
    path.write_text("t,a,b,b\n" + "".join(f"{0.01 * k!r},{k},{k / 7!r},1\n" for k in range(95)) + f"1,{last},2,\n")
    whole = read_topics(path)[0].table
    monkeypatch.setattr("drift_drake.gap.logs.importing.formats.text_tables.LARGE", 0)
    monkeypatch.setattr("drift_drake.gap.logs.importing.formats.text_tables.PIECE", 10)
    pd.testing.assert_frame_equal(read_topics(path)[0].table, whole)
