"""A recording in parts says why, and noise of slow positions is no reversing."""

import numpy as np
import pandas as pd
import pytest

from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import mapping_from_dict
from drift_drake.gap.logs.importing.recording import Readings
from drift_drake.gap.logs.importing.stretches import moving_stretches, reversing_rows, stretch_of

UNITS = {"v": "m/s", "r": "rad/s", "delta_cmd": "rad", "x": "m", "y": "m", "psi": "rad"}


def stop_and_go(reversing=0.0):
    """A drive that stops from 7.6 to 11.9 s and twice more, and may reverse while it does."""
    t = 0.01 * np.arange(4000)
    v = 8.0 * np.clip(np.sin(2.0 * np.pi * t / 13.0) + 0.5, 0.0, None)
    v = np.where((t > 9.0) & (t < 11.5), -reversing * np.sin(np.pi * (t - 9.0) / 2.5), v)
    steer = 0.08 * np.sin(2.0 * np.pi * t / 5.0)
    r = v * np.tan(steer) / 2.6
    psi, columns = np.cumsum(r) * 0.01, {"t": t, "v": v, "r": r, "delta_cmd": steer}
    return columns | {"psi": psi, "x": np.cumsum(v * np.cos(psi)) * 0.01, "y": np.cumsum(v * np.sin(psi)) * 0.01}


def imported(tmp_path, columns, names, **further):
    pd.DataFrame(columns).to_csv(tmp_path / "lap.csv", index=False)
    signals = {name: {"column": name, "unit": UNITS[name]} for name in names}
    mapping = mapping_from_dict({"clocks": {"log": {"column": "t"}}, "signals": signals, **further})
    runs, report = import_recordings([tmp_path / "lap.csv"], mapping)
    return len(runs), [said for said in report.remarks if "split" in said or "reverses" in said]


def read(columns, lost=(), gaps=()):
    columns = {name: values.copy() for name, values in columns.items()}
    for name, start, stop in lost:
        columns[name][(columns["t"] > start) & (columns["t"] < stop)] = np.nan
    kept = np.all([(columns["t"] <= start) | (columns["t"] >= start + 0.5) for start in gaps], axis=0)
    return {name: values[kept] for name, values in columns.items()} if gaps else columns


@pytest.mark.parametrize(
    ("lost", "gaps", "moving", "count", "said"),
    [
        ((), (), None, 1, ""),
        ((), (), {"speed": 1.0}, 3, "not above 1 m/s (7.29 to 12.21 s, 20.29 to 25.21 s)"),
        ((), (3, 9, 17, 28, 31), None, 6,
         "a gap in time (2.99 to 3.50 s, 8.99 to 9.50 s, 16.99 to 17.50 s and 2 more)"),
        ((("r", 2, 2.6), ("v", 2.4, 4)), (15,), None, 3,
         "no reading of v, r (1.99 to 4.00 s); a gap in time (14.99 to 15.50 s)"),
    ],
)  # fmt: skip
def test_a_recording_in_parts_says_why_and_where_in_one_line(tmp_path, lost, gaps, moving, count, said):
    columns, further = read(stop_and_go(), lost, gaps), {"moving": moving} if moving else {}
    runs, remarks = imported(tmp_path, columns, ("v", "r", "delta_cmd"), **further)
    assert runs == count
    assert remarks == ([f"lap: split into {count} runs: {said}."] if said else [])


@pytest.mark.parametrize("noise", [0.02, 0.1, 0.5])
def test_slow_noisy_positions_of_a_car_that_stands_do_not_reverse(tmp_path, noise):
    columns, rng = stop_and_go(), np.random.default_rng(1)
    for name in ("x", "y"):  # read ten times a second, on lines between
        t, values = columns["t"][::10], columns[name][::10] + noise * rng.standard_normal(400)
        columns[name] = np.interp(columns["t"], t, values)
    columns["psi"] = columns["psi"] + 0.01 * rng.standard_normal(4000)
    assert imported(tmp_path, columns, ("x", "y", "psi", "delta_cmd")) == (1, [])


@pytest.mark.parametrize("noise", [0.002, 0.02])
def test_a_car_that_reverses_is_still_seen_in_them(tmp_path, noise):
    columns, rng = stop_and_go(reversing=1.5), np.random.default_rng(1)
    for name in ("x", "y"):
        columns[name] = columns[name] + noise * rng.standard_normal(4000)
    runs, (said,) = imported(tmp_path, columns, ("x", "y", "psi", "delta_cmd"))
    assert runs == 3
    assert "reverses from 9." in said


def mapped(names, **further):
    signals = {name: {"column": name, "unit": UNITS.get(name, "m/s")} for name in names}
    return mapping_from_dict({"clocks": {"log": {"column": "t"}}, "signals": signals, **further})


def readings(t, **signals):
    return Readings(t, np.arange(len(t)), signals)


def test_a_stop_of_half_a_second_ends_a_stretch_of_positions():
    """The car stands from 4.0 to 4.5 s."""
    t = 0.01 * np.arange(1000)
    way, zeros = 5.0 * (np.minimum(t, 4.0) + np.maximum(t - 4.5, 0.0)), 0.0 * t
    found = readings(t, x=way, y=zeros, psi=zeros, delta_cmd=zeros)
    before, after = moving_stretches(found, mapped(found.signals, moving={"speed": 1.0, "shortest": 1.0}))
    assert t[before.stop - 1] == pytest.approx(4.0, abs=0.06)
    assert t[after.start] == pytest.approx(4.5, abs=0.06)


def test_a_measured_velocity_goes_before_the_one_of_positions():
    t = 0.01 * np.arange(300)
    vx, vy, zeros = 5.5 + 0.0 * t, 0.2 + 0.0 * t, 0.0 * t
    found = readings(t, x=5.0 * t, y=zeros, psi=zeros, vx=vx, vy=vy, delta_cmd=zeros)
    columns = stretch_of(found, slice(0, 300), mapped(found.signals)).columns
    np.testing.assert_allclose(columns["v"], np.hypot(vx, vy))
    np.testing.assert_allclose(columns["beta"], np.arctan2(vy, vx))


def test_a_car_that_creeps_forwards_does_not_reverse():
    v = np.where(np.arange(600) < 200, 0.3, 6.0)
    assert not reversing_rows({"v": v}, 0.01).any()
