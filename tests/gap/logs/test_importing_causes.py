"""Import names the one cause: units that a mapping states wrongly, clocks, and a run that is given twice."""

import re

import numpy as np
import pandas as pd
import pytest
from importing_bench import WHEELBASE, column_doubts, rows

from drift_drake.cli.import_logs import summary
from drift_drake.common.units import DIMENSIONS
from drift_drake.gap.logs.importing.clocks import clock_doubts
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import mapping_from_dict

NAMES = ("x", "y", "psi", "r", "v", "beta", "omega_r", "ax", "ay", "delta_cmd")
SI = {"x": "m", "y": "m", "psi": "rad", "r": "rad/s", "v": "m/s", "beta": "rad", "omega_r": "m/s", "ax": "m/s^2",
      "ay": "m/s^2", "delta_cmd": "rad"}  # fmt: skip


def imported(folder, table, names=NAMES, clock="s", **units):
    table.to_csv(folder / "drive.csv", index=False)
    signals = {name: {"column": name, "unit": units.get(name, SI[name])} for name in names}
    data = {"clocks": {"c": {"column": "t", "unit": clock}}, "signals": signals, "wheelbase": WHEELBASE}
    return import_recordings([folder / "drive.csv"], mapping_from_dict(data))


def test_km_per_hour_mapped_as_mph_is_one_sentence(tmp_path):
    table = pd.DataFrame(rows(noise=1.0))
    table["v"] *= 3.6
    _, report = imported(tmp_path, table, v="mph")
    (remark,) = report.remarks
    assert "column v looks like km/h converted as if they were mph" in remark
    assert "give its unit as km/h in the mapping" in remark


@pytest.mark.parametrize("others", ["ay", "ax", "ay beta", "ay psi", "omega_r ay"])
@pytest.mark.parametrize(("true", "unit"), [("km/h", "mph"), ("km/h", "kn"), ("mph", "m/s")])
def test_a_unit_is_named_before_scales_that_no_unit_has(tmp_path, others, true, unit):
    table = pd.DataFrame(rows(noise=1.0))
    table["v"] /= DIMENSIONS["speed"][1][true]
    _, report = imported(tmp_path, table, ("r", "v", "delta_cmd", *others.split()), v=unit)
    assert f"column v looks like {true}" in report.remarks[0]
    assert f"give its unit as {true} in the mapping" in report.remarks[0]


def test_a_scale_that_no_unit_has_is_named_as_such(tmp_path):
    table = pd.DataFrame(rows(noise=1.0))
    table["v"] *= 1.3 * 3.6
    _, report = imported(tmp_path, table, ("r", "v", "delta_cmd", "ay", "psi"), v="km/h")
    assert re.search(r"column v reads 3[01] % too large", report.remarks[0])


@pytest.mark.parametrize("unit", ["mph", "m/s"])
def test_speeds_that_have_one_wrong_unit_are_named_together(tmp_path, unit):
    table = pd.DataFrame(rows(noise=1.0))
    for name in ("v", "omega_r"):
        table[name] *= 3.6
    units = {"v": unit, "omega_r": unit}
    _, report = imported(tmp_path, table, ("r", "v", "delta_cmd", "omega_r", "psi", "ax", "ay"), **units)
    assert len(report.remarks) == 2
    for name, remark in zip(("v", "omega_r"), report.remarks, strict=True):
        assert f"column {name} looks like km/h" in remark


def test_a_clock_in_us_read_as_ns_is_the_cause(tmp_path):
    table = pd.DataFrame(rows(noise=1.0))
    table["t"] = np.round(1e6 * table["t"])
    with pytest.raises(InvalidRecordingError, match=r"looks like us \(100 Hz\); give its unit as us"):
        imported(tmp_path, table, clock="ns")


@pytest.mark.parametrize(("unit", "size"), [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)])
def test_clocks_in_their_unit_are_not_doubted(unit, size):
    for rate in (10.0, 100.0, 1000.0):
        assert clock_doubts("t", np.arange(500) / rate, unit) == []
    wrong = clock_doubts("t", np.arange(500) * 0.01 / size, "s")
    assert wrong == [] if unit == "s" else f"it looks like {unit} " in wrong[0]


def test_packed_times_are_doubted():
    seconds = 3500.0 + np.arange(0.0, 240.0, 0.1)
    packed = 1e4 * (seconds // 3600) + 100.0 * (seconds % 3600 // 60) + seconds % 60
    (sentence,) = clock_doubts("time", packed, "s")
    assert "jumps by 40 each time" in sentence
    assert clock_doubts("time", seconds, "s") == []
    gap = np.where(seconds > 3600.0, seconds + 40.0, seconds)
    assert clock_doubts("time", gap + 3.0, "s") == []


def test_columns_that_cannot_be_checked_are_named(tmp_path):
    table = pd.DataFrame(rows(noise=1.0))
    _, report = imported(tmp_path, table, ("r", "v", "delta_cmd"))
    assert report.remarks == []
    assert "no other column tells whether" in summary(report)
    (tmp_path / "all").mkdir()
    _, report = imported(tmp_path / "all", table)
    assert report.unchecked == ()
    assert "whether v and omega_r are exchanged" in summary(report)
    assert "nothing looks wrong" not in summary(report)


def test_a_recording_given_twice_counts_once(tmp_path):
    table = pd.DataFrame(rows(noise=1.0))
    _, report = imported(tmp_path, table)
    table.to_csv(tmp_path / "again.csv", index=False)
    mapping = mapping_from_dict({"clocks": {"c": {"column": "t"}},
                                 "signals": {name: {"column": name, "unit": SI[name]} for name in NAMES}})  # fmt: skip
    runs, report = import_recordings([tmp_path / "drive.csv", tmp_path / "again.csv"], mapping)
    assert [run.name for run in runs] == [run.name for run in report.runs] == ["drive"]
    assert any("again is rows of drive once more: counted once" in remark for remark in report.remarks)


def test_a_spin_is_no_heading_with_another_zero():
    t = np.arange(0.0, 20.0, 0.01)
    beta = np.where(t > 4.0, np.clip((t - 4.0) * 0.3, 0.0, 2.4), 0.0)
    course = 0.4 * np.sin(0.5 * t)
    v = np.full(len(t), 9.0)
    swing = np.gradient(course, 0.01)
    x, y = (np.cumsum(v * side) * 0.01 for side in (np.cos(course), np.sin(course)))
    r, delta = swing - np.gradient(beta, 0.01), 0.1 * np.sin(t)
    columns = {"x": x, "y": y, "psi": course - beta, "r": r, "v": v, "beta": beta, "delta_cmd": delta}
    assert not any("off its heading" in text for text in column_doubts({"t": t} | columns, 0.01))


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("column", ["r", "ay", "omega_r"])
def test_a_frozen_column_is_named_in_place_of_what_it_makes_of_others(share, column):
    """A yaw rate that stands still looks like gravity in the lateral acceleration."""
    table = rows(noise=1.0)
    at = round((1.0 - share) * len(table["t"]))
    table[column][at:] = table[column][at]
    (sentence,) = column_doubts(table, 0.01, WHEELBASE)
    assert sentence.startswith(f"column {column} is frozen from {table['t'][at]:.2f} to {table['t'][-1]:.2f} s")


def test_a_column_that_freezes_twice_is_one_sentence():
    table = rows(noise=1.0)
    for at in (200, 700):
        table["r"][at : at + 150] = table["r"][at]
    (sentence,) = column_doubts(table, 0.01, WHEELBASE)
    assert "column r is frozen for 2.98 s in 2 stretches, the first from 2.00 to 3.49 s" in sentence


def test_a_heading_and_a_yaw_rate_that_are_each_other_are_one_sentence():
    table = rows(noise=1.0)
    table["r"], table["psi"] = table["psi"], table["r"]
    sentences = column_doubts({name: table[name] for name in ("t", "r", "v", "psi", "ay", "delta_cmd")}, 0.01)
    assert sentences == [sentence for sentence in sentences if "columns r and psi look swapped" in sentence]
    assert len(sentences) == 1
