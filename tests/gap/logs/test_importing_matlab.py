"""MATLAB files: Simulink's logs go by their names on their own clocks; arrays, structs, tables and objects are read."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError, read_topics
from drift_drake.gap.logs.importing.formats.matlab import read_mat
from drift_drake.gap.logs.importing.look import look

pytest.importorskip("pymatreader", reason="MATLAB files are an extra: pip install 'drift_drake[matlab]'")
INPUTS = Path(__file__).parents[4] / "shared" / "inputs" / "09_mat_of_simulink"
T = 0.01 * np.arange(120)
SLOW = 0.02 * np.arange(60)


def written(folder, **content):
    import scipy.io

    scipy.io.savemat(folder / "a.mat", content)
    return {topic.name: topic for topic in read_topics(folder / "a.mat")}


def timed(t, values, **more):
    return {"time": t[:, None], "signals": {"values": values, **more}}


def test_structures_with_time_go_by_their_names(tmp_path):
    stacked = np.moveaxis(np.stack([T, 2.0 * T, 3.0 * T])[:, None, :], 0, 0)  # 3 x 1 x n, as of a vector
    logs = {"speed": timed(T, 12.0 + T[:, None]), "rate": timed(T, T[:, None]), "slow": timed(SLOW, SLOW[:, None])}
    topics = written(tmp_path, logs=logs, acc=timed(T, stacked))
    fast, slow = topics["logs(120 rows)"], topics["logs(60 rows)"]
    assert {"logs.speed", "logs.rate"} <= set(fast.table)
    np.testing.assert_allclose(fast.table["logs.speed"], 12.0 + T)
    np.testing.assert_allclose(fast.table[fast.clock], T)
    assert slow.clock == "logs.slow.time"
    np.testing.assert_allclose(slow.table["logs.slow"], SLOW)
    np.testing.assert_allclose(topics["series"].table["acc[2]"], 3.0 * T)


def test_several_signals_go_by_their_labels(tmp_path):
    signals = np.array(
        [(T[:, None], "rate"), (2.0 * T[:, None], "speed")], dtype=[("values", object), ("label", object)]
    )
    (topic,) = written(tmp_path, scope={"time": T[:, None], "signals": signals}).values()
    assert set(topic.table) == {"scope.time", "scope.rate", "scope.speed"}
    np.testing.assert_allclose(topic.table["scope.speed"], 2.0 * T)


def test_a_structure_without_time_is_on_tout(tmp_path):
    topics = written(tmp_path, tout=T, yout={"time": np.zeros((0, 0)), "signals": {"values": T[:, None] ** 2}})
    (topic,) = [found for found in topics.values() if "yout" in found.table]
    assert topic.clock == "tout"
    np.testing.assert_allclose(topic.table["yout"], T**2)
    (topic,) = written(tmp_path, tout=T, yout=np.stack([2.0 - T, 2.0 * T], axis=1)).values()
    assert topic.clock == "tout"
    assert {"yout[0]", "yout[1]"} <= set(topic.table)


def test_a_timeseries_as_a_structure_and_elements_of_a_data_set(tmp_path):
    elements = np.array(
        [{"Name": name, "Values": {"Time": T, "Data": k * T}} for k, name in enumerate(("rate", "speed"), 1)],
        dtype=object,
    )
    topics = written(tmp_path, ts={"Name": "steer", "Time": T, "Data": -T}, logsout=elements)
    np.testing.assert_allclose(topics["series"].table["ts"], -T)
    assert topics["series"].clock == "ts.Time"
    np.testing.assert_allclose(topics["logsout"].table["logsout.speed"], 2.0 * T)


@pytest.mark.parametrize("timed", [True, False])
def test_an_array_of_channels_goes_by_their_names(tmp_path, timed):
    kind = [(name, object) for name in ("name", "data", "unit", *(["time"] if timed else []))]
    channels, t = np.zeros(2, dtype=kind), 0.01 * np.arange(100)
    for number, (name, unit) in enumerate((("YawRate", "deg/s"), ("VehicleSpeed", "km/h"))):
        channels[number] = (name, (number + np.sin(t))[:, None], unit, *([t[:, None]] if timed else []))
    written(tmp_path, log=channels, **({} if timed else {"t": t}))
    signals = look(tmp_path / "a.mat").mapping["signals"]
    assert (signals["r"]["unit"], signals["v"]["unit"]) == ("deg/s", "km/h")
    assert "YawRate" in signals["r"]["column"]


def test_pairs_of_times_and_values_and_paths_that_are_none(tmp_path):
    position = np.stack([10.0 * T, T**2], axis=1)
    topics = written(tmp_path, VehSpd=np.stack([T, 3.0 + T], axis=1), position=position, jumping=position[::-1])
    (topic,) = [found for found in topics.values() if "VehSpd" in found.table]
    assert topic.clock == "VehSpd.time"
    np.testing.assert_allclose(topic.table["VehSpd"], 3.0 + T)
    rest = {str(name) for found in topics.values() for name in found.table}
    assert {"position[0]", "position[1]", "jumping[0]", "jumping[1]"} <= rest


@pytest.mark.parametrize("version", ["v7", "v7.3"])
@pytest.mark.filterwarnings("ignore")  # the writer's, on units of times
def test_tables_and_objects_are_read(tmp_path, version):
    matio = pytest.importorskip("matio", reason="MATLAB files are an extra: pip install 'drift_drake[matlab]'")
    from matio.utils import MatlabOpaque

    timetable = pd.DataFrame({"speed": 2.0 * T, "rate": T}, index=pd.to_timedelta(T, unit="s"))
    timetable.index.name = "Time"
    info = MatlabOpaque(properties={"Time_": T[:, None].copy()}, classname="tsdata.timemetadata")
    series = MatlabOpaque(properties={"Data_": -T[:, None], "TimeInfo": info}, classname="timeseries")
    odd = MatlabOpaque(properties={"Gain": np.array([[2.0]])}, classname="Controller")
    content = {"tt": timetable, "ts": series, "odd": odd, "plain": T}
    matio.save_to_mat(str(tmp_path / "a.mat"), content, version=version)
    topics = {topic.name: topic for topic in read_mat(tmp_path / "a.mat")}
    np.testing.assert_allclose(topics["tt"].table["tt.speed"], 2.0 * T, atol=1e-9)
    np.testing.assert_allclose(topics["tt"].table[topics["tt"].clock], T, atol=1e-9)
    np.testing.assert_allclose(topics["series"].table["ts"], -T)
    np.testing.assert_allclose(topics[""].table["plain"], T)
    assert {str(name) for topic in topics.values() for name in topic.table} == {
        "tt.Time", "tt.speed", "tt.rate", "ts.Time", "ts", "plain",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["simulink.mat", "pairs.mat", "tout.mat", "simple.mat"])
def test_the_given_files_have_their_speed(name):
    if not (INPUTS / name).exists():
        pytest.skip("the given inputs are not here")
    found = [
        topic.table[column].to_numpy()
        for topic in read_topics(INPUTS / name)
        for column in topic.table
        if str(column).split(".")[-1] in ("speed", "Speed", "VehSpd", "yout[1]")
    ]
    assert [bool(np.all((values > 11.5) & (values < 44.0))) for values in found] == [True]


def test_a_file_without_arrays_is_refused(tmp_path):
    with pytest.raises(InvalidRecordingError, match="holds no arrays of numbers with rows"):
        written(tmp_path, note="nothing")
