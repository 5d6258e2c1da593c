"""Recordings made of a simulated drive come back as the drive, and real recordings hold together."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from importing_bench import WHEELBASE, rows, steering, truth

from drift_drake.gap.logs.clock_offset import estimate_offset
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import mapping_from_dict, read_mapping
from drift_drake.gap.logs.importing.recording import InvalidRecordingError

DATA = Path(__file__).parents[4] / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the real logs of ../shared/data are not here")

POINT = (0.9, -0.3)  # [m] of the markers, ahead and left of the centre of gravity
POSITION_NOISE, HEADING_NOISE, GYRO_NOISE = 4e-4, 8e-4, 0.01
LATE = 0.062  # [s] that the slow readings arrive after they are taken
EPOCH = 1.7e9

CAPTURED = {
    "wheelbase": WHEELBASE,
    "frame": "ned",
    "clocks": {
        "frames": {"column": "frame time", "regular": True},
        "sensors": {"column": "uptime", "unit": "ms", "blank": 0, "align": {"signal": "gyro", "against": "r"}},
    },
    "signals": {
        "x": {"column": "north", "unit": "mm"},
        "y": {"column": "east", "unit": "mm"},
        "psi": {"column": "compass", "unit": "deg", "offset": 0.02},
        "gyro": {"column": "gyro", "unit": "deg/s", "clock": "sensors", "sign": -1},
        "wheel": {"column": "steering wheel", "unit": "deg", "clock": "sensors", "sign": -1},
        "torque": {"column": "torque", "unit": "N m", "clock": "sensors"},
    },
    "measured_point": list(POINT),
    "constants": {"ratio": 15.0},
    "formulas": {"delta_cmd": "wheel / ratio", "tau_cmd": "torque"},
}


def captured_table(late=LATE, seed=0):
    """A motion capture's frames, with sensors and commands at 20 Hz that come late, in NED and degrees."""
    generator = np.random.default_rng(seed)
    exact = truth()
    frames = exact.iloc[::2]
    t, psi = frames["t"].to_numpy(), frames["psi"].to_numpy()
    x = frames["x"] + POINT[0] * np.cos(psi) - POINT[1] * np.sin(psi)
    y = frames["y"] + POINT[0] * np.sin(psi) + POINT[1] * np.cos(psi)
    taken = np.floor((t - late) / 0.05) * 0.05
    seen = np.where(taken < 0.0, 0.0, taken)
    gyro = np.interp(seen, exact["t"], exact["r"])
    noise = generator.standard_normal(round(seen[-1] / 0.05) + 2)[np.round(seen / 0.05).astype(int)]
    started = taken >= 0.0
    return pd.DataFrame(
        {
            "frame time": EPOCH + t + generator.uniform(-3e-4, 3e-4, len(t)),
            "north": 1e3 * (x + POSITION_NOISE * generator.standard_normal(len(t))),
            "east": -1e3 * (y + POSITION_NOISE * generator.standard_normal(len(t))),
            "compass": np.mod(-np.degrees(psi - 0.02 + HEADING_NOISE * generator.standard_normal(len(t))), 360.0),
            "uptime": np.where(started, 77_000.0 + 1e3 * seen, 0.0),
            "gyro": np.where(started, -np.degrees(gyro + GYRO_NOISE * noise), 0.0),
            "steering wheel": np.where(started, -15.0 * np.degrees(steering(seen)), 0.0),
            "torque": np.where(started, np.interp(seen, exact["t"], exact["tau_cmd"]), 0.0),
        }
    )


def imported(folder, table, mapping, name="drive"):
    folder.mkdir(exist_ok=True)
    table.to_csv(folder / f"{name}.csv", index=False)
    return import_recordings([folder / f"{name}.csv"], mapping_from_dict(mapping))


def test_captured_motion_comes_back(tmp_path):
    runs, report = imported(tmp_path, captured_table(), CAPTURED)
    (run,), (described,) = runs, report.runs
    assert report.remarks == []
    assert run.name == described.recording == "drive"
    assert run.ax is None
    assert run.omega_r is None
    assert described.noise["position"] == pytest.approx(POSITION_NOISE, rel=0.08)
    assert described.noise["heading"] == pytest.approx(HEADING_NOISE, rel=0.08)
    exact = truth()
    middle = (run.t > 0.5) & (run.t < run.t[-1] - 0.5)
    for name in ("psi", "r", "v", "beta"):
        error = (run.column(name) - np.interp(run.t, exact["t"], exact[name]))[middle]
        error = np.angle(np.exp(1j * error)) if name == "psi" else error
        # Promised for a motion as rough as white jerk; this one is smoother.
        assert np.std(error) < 1.3 * described.std[name], name
        assert abs(np.mean(error)) < 0.5 * described.std[name] + 1e-4, name
    for name in ("x", "y"):
        np.testing.assert_allclose(run.column(name), np.interp(run.t, exact["t"], exact[name]), atol=5e-3)


def test_offset_of_the_clocks_is_found_and_put_right(tmp_path):
    deviations = []
    for seed in range(6):
        late = 0.02 + 0.02 * seed
        runs, report = imported(tmp_path, captured_table(late, seed), CAPTURED)
        clock = report.clocks["drive"]["sensors"]
        assert clock.std is not None
        assert clock.std < 0.01
        assert clock.gain == pytest.approx(1.0, abs=0.05)
        true = EPOCH - 77.0
        deviations.append((clock.offset - true) / clock.std)
        # Frames are 10 ms apart: readings stand in the first row after their arrival.
        assert clock.arrival - late == pytest.approx(0.005, abs=0.007 + 3.0 * clock.std)
        commands = np.interp(runs[0].t, truth()["t"], truth()["delta_cmd"])
        np.testing.assert_allclose(runs[0].delta_cmd, commands, atol=0.1 * (4.0 * clock.std + 0.002) + 4e-4)
    assert np.max(np.abs(deviations)) < 3.5
    assert np.sqrt(np.mean(np.square(deviations))) < 1.8


def test_a_gyroscope_in_another_unit_is_noticed(tmp_path):
    mapping = CAPTURED | {"signals": CAPTURED["signals"] | {"gyro": CAPTURED["signals"]["gyro"] | {"unit": "rad/s"}}}
    _, report = imported(tmp_path, captured_table(), mapping)
    assert len(report.remarks) == 1
    assert "gyro looks like degrees: it is 57." in report.remarks[0]


def test_a_clock_may_be_aligned_with_a_position(tmp_path):
    table, exact = captured_table(), truth()
    table["place"] = np.interp((table["uptime"] - 77_000.0) / 1e3, exact["t"], exact["y"])
    clocks = CAPTURED["clocks"] | {
        "sensors": CAPTURED["clocks"]["sensors"] | {"align": {"signal": "p", "against": "y"}}
    }
    place = {"column": "place", "unit": "mm", "clock": "sensors", "frame": None}
    mapping = CAPTURED | {"clocks": clocks, "signals": CAPTURED["signals"] | {"p": place}}
    _, report = imported(tmp_path, table, mapping)
    assert report.clocks["drive"]["sensors"].std is not None
    assert len(report.remarks) == 1
    assert "p is 0.001 times what the motion's y says: check its unit or scale" in report.remarks[0]


def test_a_clock_that_nothing_aligns_is_reported(tmp_path):
    table = captured_table()
    table["gyro"] = np.where(table["uptime"] > 0.0, np.random.default_rng(0).standard_normal(len(table)), 0.0)
    _, report = imported(tmp_path, table, CAPTURED)
    assert any("the offset of clock sensors is not known from gyro" in remark for remark in report.remarks)
    assert report.clocks["drive"]["sensors"].std is None
    assert report.clocks["drive"]["sensors"].arrival == 0.0


PLAIN = {
    "clocks": {"logger": {"column": "t"}},
    "signals": {
        "vx": {"column": "u", "unit": "km/h"},
        "vy": {"column": "w", "unit": "m/s"},
        "r": {"column": "r", "unit": "rad/s"},
        "ay": {"column": "ay", "unit": "g"},
        "omega_r": {"column": "rpm", "unit": "rpm", "radius": 0.337},
        "delta_cmd": {"column": "delta", "unit": "rad"},
    },
}


def plain_table(period=0.01):
    exact = rows(period)
    return pd.DataFrame(
        {
            "t": exact["t"],
            "u": 3.6 * exact["v"] * np.cos(exact["beta"]),
            "w": exact["v"] * np.sin(exact["beta"]),
            "r": exact["r"],
            "ay": exact["ay"] / 9.80665,
            "rpm": exact["omega_r"] / 0.337 * 30.0 / np.pi,
            "delta": exact["delta_cmd"],
        }
    )


def test_measured_velocity_becomes_speed_and_sideslip(tmp_path):
    (run,), report = imported(tmp_path, plain_table(), PLAIN)
    exact = rows()
    assert report.remarks == []
    assert run.x is run.tau_cmd is run.ax is None
    for name in ("t", "r", "v", "beta", "ay", "omega_r", "delta_cmd"):
        np.testing.assert_allclose(run.column(name), exact[name], rtol=1e-6, atol=1e-9, err_msg=name)


def test_velocity_of_another_point(tmp_path):
    exact, table = rows(), plain_table()
    table["u"] = 3.6 * (exact["v"] * np.cos(exact["beta"]) - exact["r"] * 0.4)
    table["w"] = exact["v"] * np.sin(exact["beta"]) + exact["r"] * 1.1
    (run,), _ = imported(tmp_path, table, PLAIN | {"measured_point": [1.1, 0.4]})
    np.testing.assert_allclose(run.v, exact["v"], rtol=1e-6)
    np.testing.assert_allclose(run.beta, exact["beta"], atol=1e-8)


def test_other_rates_and_uneven_rows_become_rows_of_a_hundredth(tmp_path):
    table = plain_table(0.02)
    table = table.drop(index=range(100, 104))
    (run,), report = imported(tmp_path, table, PLAIN)
    np.testing.assert_allclose(np.diff(run.t), 0.01, atol=1e-9)
    assert np.max(np.abs(run.v - rows()["v"])) < 0.02
    assert any("are read each 0.02 s: the rows between are interpolated" in remark for remark in report.remarks)


def test_gaps_and_stops_end_runs(tmp_path):
    table = plain_table()
    table.loc[table.index[700:740], "r"] = np.nan
    table.loc[table.index[1500:1700], ["u", "w"]] = 0.1
    mapping = PLAIN | {"moving": {"speed": 2.0, "shortest": 3.0}}
    runs, report = imported(tmp_path, table, mapping)
    assert [run.name for run in runs] == ["drive_0", "drive_1", "drive_2"]
    assert [(r.start, r.end) for r in report.runs] == [
        pytest.approx((0.0, 6.98), abs=0.03),
        pytest.approx((7.4, 14.99), abs=0.03),
        pytest.approx((17.0, 24.0), abs=0.03),
    ]
    assert imported(tmp_path, table, PLAIN | {"moving": {"speed": 2.0, "shortest": 7.3}})[1].runs[0].rows > 700


def test_crumbs_between_gaps_are_left_out(tmp_path):
    table = plain_table()
    table.loc[table.index[700:740], "r"] = np.nan
    table.loc[table.index[770:800], "r"] = np.nan
    runs, _ = imported(tmp_path, table, PLAIN)
    assert [len(run) for run in runs] == pytest.approx([699, 1600], abs=3)


def test_a_part_of_a_recording(tmp_path):
    plain_table().to_csv(tmp_path / "drive.csv", index=False)
    whole, _ = import_recordings([tmp_path / "drive.csv"], mapping_from_dict(PLAIN))
    (part,), _ = import_recordings([tmp_path / "drive.csv"], mapping_from_dict(PLAIN), start=3.0, end=9.0)
    assert (part.t[0], part.t[-1]) == (3.0, 9.0)
    np.testing.assert_array_equal(part.v, whole[0].v[300:901])
    with pytest.raises(InvalidRecordingError, match="change 'moving', start or end"):
        import_recordings([tmp_path / "drive.csv"], mapping_from_dict(PLAIN), start=30.0)


def test_recordings_of_the_same_name_are_kept_apart(tmp_path):
    for folder, start in (("monday", 0), ("tuesday", 200)):
        (tmp_path / folder).mkdir()
        plain_table().iloc[start : start + 2000].to_csv(tmp_path / folder / "drive.csv", index=False)
    paths = [tmp_path / folder / "drive.csv" for folder in ("monday", "tuesday")]
    runs, report = import_recordings(paths, mapping_from_dict(PLAIN))
    assert [run.name for run in runs] == list(report.clocks) == ["drive", "drive_1"]


def test_what_looks_wrong_is_said_with_the_run(tmp_path):
    table = plain_table()
    table["ay"] *= -1.0
    _, report = imported(tmp_path, table, PLAIN)
    assert len(report.remarks) == 1
    assert report.remarks[0].startswith("drive: column ay looks mirrored")
    assert report.runs[0].remarks == [report.remarks[0].removeprefix("drive: ")]


def test_what_cannot_be_imported(tmp_path):
    with pytest.raises(InvalidRecordingError, match="no recordings"):
        import_recordings([], mapping_from_dict(PLAIN))
    still = plain_table()
    still[["u", "w"]] = 0.0
    with pytest.raises(InvalidRecordingError, match=r"drive.csv: holds no 50 rows of motion above 2 m/s"):
        imported(tmp_path, still, PLAIN | {"moving": {"speed": 2.0}})
    degrees = plain_table()
    degrees["r"] = np.degrees(degrees["r"])
    with pytest.raises(InvalidRecordingError, match=r"drive.csv: .*column r reaches .* it looks like degrees"):
        imported(tmp_path, degrees, PLAIN)
    with pytest.raises(InvalidRecordingError, match=r"drive.csv: holds no 50 rows of motion without a gap"):
        imported(tmp_path, plain_table().iloc[:40], PLAIN)


@needs_data
@pytest.mark.parametrize("folder", ["floor_a", "floor_b", "free_driving"])
def test_real_small_car(folder):
    """Its gyroscope, which the runs do not use, agrees with the heading's rate on one clock offset at all times."""
    paths = sorted((DATA / "dart" / folder).glob("*.csv"))
    paths = min(paths, key=lambda path: path.stat().st_size), max(paths, key=lambda path: path.stat().st_size)
    runs, report = import_recordings(paths, read_mapping("dart"))
    assert report.remarks == []
    for clocks in report.clocks.values():
        clock = clocks["sensors"]
        assert clock.arrival == pytest.approx(0.047, abs=0.012)
        assert clock.std < 0.006
        assert clock.correlation > 0.98
        assert clock.gain == pytest.approx(1.025, abs=0.03)
    for run, described in zip(runs, report.runs, strict=True):
        assert described.noise["position"] < 5e-4
        assert described.noise["heading"] < 3e-3
        # Positions, heading, speed and sideslip are one motion.
        course = run.psi + run.beta
        np.testing.assert_allclose(np.gradient(run.x, 0.01)[5:-5], (run.v * np.cos(course))[5:-5], atol=0.12)
        np.testing.assert_allclose(np.gradient(run.y, 0.01)[5:-5], (run.v * np.sin(course))[5:-5], atol=0.12)


@needs_data
def test_real_small_car_goes_where_it_points_and_steers_late():
    path = min((DATA / "dart" / "free_driving").glob("*.csv"), key=lambda p: -p.stat().st_size)
    (run,), _ = import_recordings([path], read_mapping("dart"))
    straight = np.abs(run.r) < 0.15
    assert np.count_nonzero(straight) > 1000
    assert abs(np.median(run.beta[straight])) < 0.006
    lag = estimate_offset(run.t, run.r, run.t, run.v * np.tan(run.delta_cmd), 0.0, 0.5)
    assert -lag.offset == pytest.approx(0.16, abs=0.03)


@needs_data
def test_real_racing_car():
    (path,) = (DATA / "revs_250lm").glob("*.csv")
    (run,), report = import_recordings([path], read_mapping("revs_250lm"))
    assert report.remarks == []
    assert len(run) == 30001
    assert run.tau_cmd is run.omega_r is run.x is None
    assert np.max(np.abs(run.beta)) < 0.12
