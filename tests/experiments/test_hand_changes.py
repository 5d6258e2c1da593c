"""Changes put into a log by hand look like the catalogue's effects."""

import json

import numpy as np
import pytest

from drift_drake.car.actuated import STAGES, first_order_lag
from drift_drake.car.log.table import Run, read_case, write_run
from experiments.other_worlds.changes import CHANGES
from experiments.other_worlds.hand_changes import (
    HandChanges,
    NoDataError,
    import_all,
    magnitudes_of,
    studies_of,
    write_changed,
)
from experiments.other_worlds.hand_scores import hand_text, write_scores
from experiments.other_worlds.scoring import Row

PERIOD = 0.02


def command(t):
    return 0.2 * np.sin(3.0 * t)


@pytest.fixture
def run():
    t = np.arange(300) * PERIOD
    heading = np.angle(np.exp(1j * 1.5 * t))  # wraps
    return Run("run", t, np.cos(t), 2.0 + 0.1 * np.sin(t), command(t), np.full(300, 0.3), 0.1 * np.sin(2.0 * t),
               2.0 + 0.1 * np.sin(t), psi=heading)  # fmt: skip


@pytest.mark.parametrize("q", [0.05, 0.06])
def test_a_delayed_command_is_logged_earlier(run, q):
    changed = CHANGES["steering_delay"](run, q)
    np.testing.assert_allclose(changed.delta_cmd, command(changed.t + q), atol=2e-4)
    np.testing.assert_array_equal(changed.r, run.r[: len(changed)])
    assert len(run) - len(changed) == 3


@pytest.mark.parametrize("q", [-0.05, 0.05])
def test_a_wrong_clock_stamps_both_commands(run, q):
    changed = CHANGES["command_clock_error"](run, q)
    np.testing.assert_allclose(changed.delta_cmd, command(changed.t - q), atol=2e-4)
    np.testing.assert_array_equal(changed.r, run.r[3:] if q > 0.0 else run.r[:-3])


def test_the_lag_of_the_changed_command_is_the_recorded_one(run):
    changed = CHANGES["steering_lag"](run, 0.1)
    fine = np.interp(np.arange(STAGES * 299 + 1) / STAGES, np.arange(300), changed.delta_cmd)
    lagged = first_order_lag(fine, float(run.delta_cmd[0]), PERIOD / STAGES, 0.1)[::STAGES]
    np.testing.assert_allclose(lagged[40:-1], run.delta_cmd[40:-1], atol=2e-3)


def test_late_sensors_leave_commands_alone_and_headings_unwrapped(run):
    changed = CHANGES["sensor_latency"](run, 0.05)
    np.testing.assert_array_equal(changed.delta_cmd, run.delta_cmd[3:])
    np.testing.assert_allclose(changed.r, np.cos(changed.t - 0.05), atol=2e-4)
    np.testing.assert_allclose(np.diff(changed.psi), 1.5 * PERIOD, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "column", "expected"),
    [
        ("steering_offset", "delta_cmd", lambda a: a - 0.02),
        ("gyro_bias", "r", lambda a: a + 0.02),
        ("sideslip_bias", "beta", lambda a: a + 0.02),
        ("wheel_radius_error", "omega_r", lambda a: a * 1.02),
        ("torque_gain_error", "tau_cmd", lambda a: a / 1.02),
        ("steering_ratio_error", "delta_cmd", lambda a: a / 1.02),
        ("gyro_gain_error", "r", lambda a: a * 1.02),
        ("speed_gain_error", "v", lambda a: a * 1.02),
    ],
)
def test_one_column_is_changed_alone(run, name, column, expected):
    changed = CHANGES[name](run, 0.02)
    for field in ("r", "v", "delta_cmd", "tau_cmd", "beta", "omega_r", "psi"):
        values = run.column(field)
        np.testing.assert_array_equal(changed.column(field), expected(values) if field == column else values)


def test_a_change_needs_its_column(run):
    with pytest.raises(ValueError, match="column omega_r is missing"):
        CHANGES["wheel_radius_error"](run.without("omega_r"), 0.02)


def test_magnitudes_are_twice_the_limit_in_both_signs():
    limits = {"gyro_bias": {"least": 0.02}, "sensor_latency": {"least": 0.03}, "steering_delay": {"least": None}}
    chosen, skipped = magnitudes_of({"details": {"detection": limits}})
    assert chosen == {"gyro_bias": [0.04, -0.04], "sensor_latency": [0.06]}
    assert skipped["steering_delay"] == "these logs have no detection limit"
    assert "column" in skipped["torque_gain_error"]
    nothing, skipped = magnitudes_of({"details": {}})
    assert not nothing
    assert set(skipped) == set(CHANGES)


def test_no_study_asks_about_logs_that_it_was_calibrated_on():
    studies = studies_of(["a0", "a1", "a2", "a3"], ["p0", "p1", "p2", "p3"])
    assert all(study.asked not in study.calibrated_on for study in studies)
    left_out = [study for study in studies if study.name.startswith("without_")]
    assert [study.asked for study in left_out] == ["a0", "a1", "a2", "a3", "p0", "p1", "p2"]
    split = next(study for study in studies if study.name == "small_car_split")
    assert split.calibrated_on == ("a0", "a1")


def test_a_changed_case_keeps_its_import_report(run, tmp_path):
    case, out = tmp_path / "case", tmp_path / "changed"
    case.mkdir()
    write_run(run, case / "run_0.csv")
    (case / "import.json").write_text('{"runs": []}')
    for _ in range(2):
        write_changed(case, out, "gyro_bias", 0.5)
    (changed,) = read_case(out)
    np.testing.assert_allclose(changed.r, run.r + 0.5, atol=1e-8)
    assert (out / "import.json").exists()


def test_the_table_tells_logs_as_they_are_and_each_change(tmp_path):
    found = {"gyro_bias": {"estimate": 0.05, "low": 0.03, "high": 0.07}}
    none = {"verdict": "none", "causes": [], "posterior": {"none": 0.9}, "ambiguity": ["none"], "magnitudes": {},
            "reduction": {"estimate": 0.0}, "details": {"nats_from_normal": {"none": 2.0}}, "warnings": ["short"],
            "seconds": 1.0, "cpu_seconds": 1.0}  # fmt: skip
    named = none | {"verdict": "effect", "causes": ["gyro_bias"], "posterior": {"gyro_bias": 0.9},
                    "ambiguity": ["gyro_bias"], "magnitudes": found}  # fmt: skip
    rows = [Row("split", "small_car", "rest", {}, none), Row("split", "small_car", "b", {"gyro_bias": 0.04}, named)]
    text = hand_text(rows, {"split": {"torque_gain_error": "no column"}})
    assert "| split: rest | none | none 0.90; nats from normal: none 2.0 | short |" in text
    assert "| split: gyro_bias | 0.04 | gyro_bias | yes | yes |" in text
    assert "- split: no torque_gain_error, no column" in text
    write_scores(rows, {}, {}, "", tmp_path)
    assert json.loads((tmp_path / "scores.json").read_text())["all"]["right"]["hits"] == 2


def test_data_that_are_not_there_are_one_sentence(tmp_path):
    with pytest.raises(NoDataError, match="dart/floor_a: has no recordings"):
        import_all(HandChanges(data=tmp_path), tmp_path / "logs")
