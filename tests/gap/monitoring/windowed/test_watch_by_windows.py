"""A car that no single-track model follows, calibrated by prediction and watched: files, command, Drake's system."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydrake.systems.framework import FixedInputPortValue

import drift_drake
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.given_vehicle import GivenVehicle
from drift_drake.car.log.table import Run, write_run
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.main import BAD_INPUT, main
from drift_drake.common.run_folder import to_json
from drift_drake.gap.estimation.scores import block_scores, make_day
from drift_drake.gap.estimation.windows import windowed
from drift_drake.gap.monitoring.baselines import OfPrediction, baseline_given, calibrated_watcher, learn_baseline
from drift_drake.gap.monitoring.in_loop import GapMonitor, events_of, logged_ports
from drift_drake.gap.monitoring.watch import rows_of, watched
from drift_drake.gap.monitoring.windowed.baseline import sums_of_all, windows_of, with_errors_ahead
from drift_drake.gap.monitoring.windowed.monitor import WindowMonitor
from experiments.monitoring.drives import changed_double_track_drive
from tests.conftest import OtherCar

ONSET = 4.0


@pytest.fixture(scope="module")
def files(other_car: OtherCar, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibrated car as `identify` writes it, a drive with late steering from 4 s on, and one without a change."""
    folder = tmp_path_factory.mktemp("watched")
    found = other_car.found
    write_vehicle(folder / "car.yaml", found.vehicle, found.effects)
    watching = learn_baseline(other_car.runs, found.vehicle, found.effects, other_car.normal)
    (folder / "car.json").write_text(to_json({"normal": other_car.normal, "watching": watching}))
    late = changed_double_track_drive("slalom", make_effects({"steering_delay": 0.08}), ONSET, 3, 11.0)
    write_run(late, folder / "late.csv")
    write_run(changed_double_track_drive("slalom", Effects(), ONSET, 4, 8.0), folder / "same.csv")
    return folder


@pytest.fixture(scope="module")
def monitor(other_car: OtherCar, files: Path) -> WindowMonitor:
    baseline = baseline_given(files / "car.json")
    assert isinstance(baseline, OfPrediction)
    given = GivenVehicle(other_car.found.vehicle, other_car.found.effects)
    found = calibrated_watcher(baseline, other_car.runs[0], given)
    assert isinstance(found, WindowMonitor)
    return found


def run_of(files: Path, name: str) -> Run:
    return drift_drake.read_run(files / f"{name}.csv")


def watch(files: Path, name: str, *more: str) -> int:
    return main(["watch", str(files / f"{name}.csv"), "--vehicle", str(files / "car.yaml"), "--calibration",
                 str(files / "car.json"), *more])  # fmt: skip


def test_the_sums_of_a_drives_windows_are_those_of_a_day(monitor: WindowMonitor, other_car: OtherCar) -> None:
    """`gap.estimation.scores` takes a whole run at once, with internal states carried from its first row."""
    run, p, normal = other_car.runs[0], monitor.projection, other_car.normal
    windows = windows_of(monitor, run)
    whole = windowed(run, run.filled, normal.stride)
    day = make_day([whole], p.constants, p.own, normal.names, normal.units, normal, 1)
    assert len(windows) == len(whole.starts)
    found = sums_of_all(monitor, windows)
    n = len(normal.names)
    expected = block_scores(day, day.errors, normal.scales, normal.precision).sum(axis=0)[:n]
    total = np.sum([one.score for one in found], axis=0)
    scale = np.sqrt(np.diag(np.sum([one.information for one in found], axis=0)))
    fast = [normal.names.index(name) for name in ("friction_level", "steering_delay", "gyro_bias", "torque_gain_error")]
    np.testing.assert_allclose((total[fast] / scale[fast]), (expected[fast] / scale[fast]), atol=0.1)


def test_an_effect_far_beyond_normal_errors_shifts_the_scores_in_proportion(
    monitor: WindowMonitor, other_car: OtherCar
) -> None:
    """A gyroscope's bias of ten normal errors and more, which are clipped at four: its size is what the scores say."""
    run, p, bias = other_car.runs[0], monitor.projection, 0.08
    (k,) = (i for i, node in enumerate(p.nodes) if node.name == "gyro_bias")
    windows = windows_of(monitor, dataclasses.replace(run, r=run.r + bias))
    sums = sums_of_all(monitor, windows[:10])
    score, shift = np.sum([one.score for one in sums], axis=0), np.sum([one.shift[:, k] for one in sums], axis=0)
    assert -p.nodes[k].magnitude * (shift @ score) / (shift @ shift) == pytest.approx(bias, rel=0.1)


def test_windows_that_are_predicted_ahead_are_judged_as_row_by_row(monitor: WindowMonitor, other_car: OtherCar) -> None:
    run = other_car.runs[0]
    late = dataclasses.replace(run, delta_cmd=np.concatenate([run.delta_cmd[8:], np.full(8, run.delta_cmd[-1])]))
    ahead = with_errors_ahead(monitor, late)
    assert len(ahead.ahead) == len(windows_of(monitor, late))
    one_by_one, at_once = (list(watched(by, rows_of(late))) for by in (monitor, ahead))
    assert [now.events for now in at_once] == [now.events for now in one_by_one]
    assert any(now.events for now in at_once)
    np.testing.assert_allclose(at_once[-1].verdict, one_by_one[-1].verdict, rtol=1e-6, atol=1e-9)


def test_late_steering_is_reported_with_its_onset_and_rivals(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert watch(files, "late", "--json", "-") == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    changes = [event for event in events if event["event"] == "change"]
    assert len(changes) == 1
    assert ONSET < changes[0]["t"] < ONSET + 3.0
    assert changes[0]["onset"] == pytest.approx(ONSET, abs=0.7)  # a window of half a second begins each 0.2 s
    last = [event for event in events if event["event"] in ("change", "cause")][-1]
    assert last["diagnosed"] == pytest.approx(last["t"] - last["onset"], abs=1e-3)
    assert last["t"] == pytest.approx(11.0, abs=0.5)
    assert last["low"] < 0.08 < last["high"]
    like = {"steering_delay", "steering_lag", "sensor_latency"}
    assert last["cause"] in like
    assert last["probability"] >= 0.9 or last["rivals"]
    assert all(event["event"] != "end" for event in events)


def test_nothing_comes_with_what_would_have_been_seen(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert watch(files, "same", "--json", str(files / "events.jsonl")) == 0
    said = capsys.readouterr().out
    (end,) = (json.loads(line) for line in (files / "events.jsonl").read_text().splitlines())
    assert end["event"] == "end"
    assert end["would_show"]["steering_delay"] < 0.08
    assert "nothing has changed in the" in said
    assert "a change would have been reported from" in said
    assert "gyro_bias" in said


def harder_run(files: Path) -> Run:
    """The drive of the same car, braked from 3 s on as the calibration never was."""
    run = run_of(files, "same")
    braked = np.where(run.t > 3.0, -4.0 * np.abs(np.asarray(run.tau_cmd)) - 900.0, run.tau_cmd)
    return dataclasses.replace(run, tau_cmd=braked)


def test_harder_driving_is_said_and_raises_nothing(files: Path) -> None:
    seen = drift_drake.watch(harder_run(files), files / "car.yaml", files / "car.json")
    assert [event["event"] for event in seen.events] == ["not_judged"]
    assert "torque" in seen.events[0]["harder"]
    assert seen.not_judged > 3.0
    assert "driven harder than calibrated" in seen.sentence()


def test_a_rate_of_false_alarms_is_asked_for(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = run_of(files, "late").rows(0, 800)
    often = drift_drake.watch(run, files / "car.yaml", files / "car.json", false_alarms_per_hour=10.0)
    seldom = drift_drake.watch(run, files / "car.yaml", files / "car.json", false_alarms_per_hour=1e-3)
    assert often.events[0]["t"] <= seldom.events[0]["t"]
    assert watch(files, "late", "--false-alarms-per-hour", "0") == BAD_INPUT
    assert "give a rate" in capsys.readouterr().err


@pytest.mark.parametrize("driven", ["late", "harder"])
def test_drakes_system_says_the_same_as_the_batch(files: Path, monitor: WindowMonitor, driven: str) -> None:
    run = run_of(files, driven) if driven == "late" else harder_run(files)
    system = GapMonitor(monitor)
    logged, table = logged_ports(system), list[dict[str, float]]()
    context = system.CreateDefaultContext()
    ports: dict[str, FixedInputPortValue] = {
        name: system.GetInputPort(name).FixValue(context, np.zeros(size))
        for name, size in (("measured_state", 7), ("command", 2), ("log_row", 10))
    }
    rows = list(rows_of(run))[:560]
    batch = list(watched(monitor, iter(rows)))
    verdicts = {round(judged.t, 2): judged for judged in batch}
    for row in rows:
        ports["measured_state"].GetMutableData().get_mutable_value().SetFromVector([*row.y[:4], 0.0, 0.0, 0.0])
        ports["command"].GetMutableData().get_mutable_value().SetFromVector(row.command)
        further = np.zeros(10)
        further[3] = row.y[6]
        ports["log_row"].GetMutableData().get_mutable_value().SetFromVector(further)
        discrete = system.AllocateDiscreteVariables()
        context.SetTime(row.t)
        system.CalcForcedDiscreteVariableUpdate(context, discrete)
        context.SetDiscreteState(discrete)
        if round(row.t, 2) in verdicts:
            found, judged = system.GetOutputPort("posterior").Eval(context), verdicts[round(row.t, 2)]
            np.testing.assert_allclose(found, judged.verdict[:-4], atol=1e-9)
            np.testing.assert_array_equal(system.GetOutputPort("not_judged").Eval(context), judged.seen.time[2:])
        values = {name: value for port, names in logged.values()
                  for name, value in zip(names, port.Eval(context), strict=True)}  # fmt: skip
        table.append({"t": row.t, **values})
    said = [(event["event"], event["t"], event.get("harder")) for one in batch for event in one.events]
    events = events_of(monitor, pd.DataFrame(table))
    assert [(event["event"], event["t"], event.get("harder")) for event in events] == said
    assert said[0][0] == ("change" if driven == "late" else "not_judged")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda data: data | {"watching": None}, "has no normal scores"),
        (lambda data: data | {"watching": data["watching"] | {"cap": -1.0}}, "watching:"),
        (lambda data: data | {"watching": data["watching"] | {"points": [[1.0]]}}, "points must hold 6 numbers"),
        (lambda data: data | {"watching": data["watching"] | {"errors": [1.0]}}, "errors must be a number of each"),
        (lambda data: data | {"watching": {"period": 0.01}}, "not what 'identify' writes"),
        (lambda data: data | {"watching": data["watching"] | {"columns": ["wind"]}}, "columns must be of r, v"),
    ],
)
def test_a_bad_calibration_is_one_sentence(files: Path, tmp_path: Path, capsys, change, says) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "car.json"
    path.write_text(json.dumps(change(json.loads((files / "car.json").read_text()))))
    code = main(["watch", str(files / "same.csv"), "--vehicle", str(files / "car.yaml"), "--calibration", str(path)])
    assert code == BAD_INPUT
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_another_rate_or_a_missing_column_is_refused(files: Path) -> None:
    run = run_of(files, "same")
    with pytest.raises(drift_drake.DriftDrakeError, match="no column psi, which the calibration's logs had"):
        drift_drake.watch(run.without("psi"), files / "car.yaml", files / "car.json")


def test_readings_that_are_missing_or_jump_are_waited_through(files: Path) -> None:
    run = run_of(files, "same")
    r = np.asarray(run.r).copy()
    r[300:303] += 1.0
    seen = drift_drake.watch(dataclasses.replace(run, r=r), files / "car.yaml", files / "car.json")
    assert [event for event in seen.events if event["event"] == "change"] == []
