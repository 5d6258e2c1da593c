"""Runs as tables: round trip, and one clear sentence for each kind of bad input."""

import os

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.log.cases import case_folders
from drift_drake.car.log.table import InvalidLogError, Run, read_case, read_run, stated_noise, write_run
from drift_drake.gap.logs.importing.formats.files import read_topics

ROWS = 80


def columns():
    t = np.arange(ROWS) * 0.01
    return {"t": t, "r": 0.1 * np.sin(t), "v": 10.0 + t, "delta_cmd": 0.02 * np.cos(t), "beta": 0.01 * t}


def written(tmp_path, **changes):
    data = columns() | changes
    path = tmp_path / "run_0.csv"
    pd.DataFrame({name: values for name, values in data.items() if values is not None}).to_csv(path, index=False)
    return path


def test_round_trip_keeps_columns_and_leaves_absent_ones_out(tmp_path):
    run = Run(name="run_3", **columns())
    write_run(run, tmp_path / "run_3.csv")
    back = read_run(tmp_path / "run_3.csv")
    assert back.name == "run_3"
    assert back.omega_r is None
    for name, values in columns().items():
        np.testing.assert_allclose(back.column(name), values, rtol=1e-8, atol=1e-8)
    assert back.period == pytest.approx(0.01)


def test_rows_and_without_cut_a_run():
    run = Run(name="a", **columns())
    assert len(run.rows(10, 70)) == 60
    assert run.without("beta").beta is None


def test_case_is_read_in_the_order_of_numbers(tmp_path):
    for number in (10, 2, 0):
        write_run(Run(name="x", **columns()), tmp_path / f"run_{number}.csv")
    assert [run.name for run in read_case(tmp_path)] == ["run_0", "run_2", "run_10"]


def test_a_run_that_is_there_twice_is_refused(tmp_path):
    for ending in (".csv", ".csv.gz"):
        write_run(Run(name="x", **columns()), tmp_path / f"run_0{ending}")
    with pytest.raises(InvalidLogError, match=r"run_0.csv and run_0.csv.gz are both run_0; keep one"):
        read_case(tmp_path)


def clock(row, change):
    t = columns()["t"]
    t[row:] += change
    return t


def gap(row):
    v = columns()["v"]
    v[row] = np.nan
    return v


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"v": None}, "missing column v"),
        ({"v": gap(7)}, r"column v holds nan in row 9 \(1 such rows\)"),
        ({"t": clock(30, -0.2)}, "clock does not advance at row 30"),
        ({"t": clock(30, 0.05)}, "clock is irregular at row 30"),
        ({"delta_cmd": np.full(ROWS, 12.0)}, "column delta_cmd reaches 12.*looks like degrees"),
        ({"beta": np.full(ROWS, 25.0)}, "column beta reaches 25.*looks like degrees"),
        ({"psi": np.linspace(0.0, 300.0, ROWS)}, "column psi does not agree with r.*degrees"),
        ({"v": np.full(ROWS, -9.0)}, "column v is negative"),
        ({"v": np.full(ROWS, 300.0)}, "column v reaches 300"),
    ],
)
def test_bad_columns_get_one_sentence(tmp_path, changes, says):
    path = written(tmp_path, **changes)
    with pytest.raises(InvalidLogError, match=says) as caught:
        read_run(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_text_in_a_column_is_named(tmp_path):
    path = written(tmp_path)
    path.write_text(path.read_text().replace("10.5", "fast"))
    with pytest.raises(InvalidLogError, match="column v holds 'fast"):
        read_run(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "file is empty"),
        ("t,r,v,delta_cmd\n", "0 rows; a run needs at least 50"),
        ('t,"r\n1,2\n', "cannot be read"),
    ],
)
def test_unreadable_files_get_one_sentence(tmp_path, text, says):
    path = tmp_path / "run_0.csv"
    path.write_text(text)
    with pytest.raises(InvalidLogError, match=says):
        read_run(path)


def test_missing_files_and_folders_get_one_sentence(tmp_path):
    with pytest.raises(InvalidLogError, match="No such file"):
        read_run(tmp_path / "run_9.csv")
    with pytest.raises(InvalidLogError, match="no such folder"):
        read_case(tmp_path / "nothing")
    with pytest.raises(InvalidLogError, match="holds no runs"):
        read_case(tmp_path)


def test_a_pipe_in_place_of_a_log_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "run_0.csv")
    for read in (read_case, lambda folder: read_topics(folder / "run_0.csv")):
        with pytest.raises(InvalidLogError, match="it is a pipe or device, no file"):
            read(tmp_path)
    with pytest.raises(InvalidLogError, match="no such folder"):
        case_folders(tmp_path / "run_0.csv")


def test_a_coarse_clock_is_refused():
    data = columns()
    data["t"] = np.arange(ROWS) * 0.1
    with pytest.raises(InvalidLogError, match="too coarse"):
        Run(name="slow", **data)


@pytest.mark.parametrize("header", ["t,r,v,delta_cmd, v", "t,r,v,delta_cmd,v"])
def test_a_column_that_is_there_twice_is_refused(tmp_path, header):
    path = tmp_path / "run_0.csv"
    rows = [f"{0.01 * i:.2f},0.1,10,0.02,11" for i in range(ROWS)]
    path.write_text("\n".join([header, *rows]))
    with pytest.raises(InvalidLogError, match=r"run_0.csv: column v is there twice; keep one, or rename the other"):
        read_run(path)


@pytest.mark.parametrize("ending", ["gz", "xz", "bz2", "zip"])
def test_truncated_archives_get_one_sentence(tmp_path, ending):
    path = tmp_path / f"run_0.csv.{ending}"
    pd.DataFrame(columns()).to_csv(path, index=False)
    whole = path.read_bytes()
    for kept in (len(whole) // 2, len(whole) - 3, 7):
        path.write_bytes(whole[:kept])
        with pytest.raises(InvalidLogError, match="cannot be read as a table") as caught:
            read_run(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_other_encodings_get_one_sentence(tmp_path, encoding):
    path = tmp_path / "run_0.csv"
    path.write_bytes("t,r,v,delta_cmd,größe\n0,0,10,0,1\n".encode(encoding))
    with pytest.raises(InvalidLogError, match="cannot be read as a table"):
        read_run(path)


def test_a_log_at_the_slowest_rate_is_read(tmp_path):
    path = tmp_path / "run_0.csv"
    path.write_text("t,r,v,delta_cmd\n" + "".join(f"{0.05 * k:.2f},0.1,12,0.02\n" for k in range(ROWS)))
    assert read_run(path).period == pytest.approx(0.05)


def test_a_clock_in_milliseconds_is_guessed():
    data = columns()
    with pytest.raises(InvalidLogError, match=r"too coarse.*it looks like milliseconds, convert t"):
        Run(name="slow", **data | {"t": 1000.0 * data["t"]})


def test_a_stated_noise_that_nothing_has_is_refused(tmp_path):
    (tmp_path / "import.json").write_text('{"mapping": {}, "runs": [{"std": {"v": 1e18}}]}')
    with pytest.raises(InvalidLogError, match="is no report of 'drift-drake import'"):
        stated_noise(tmp_path)
