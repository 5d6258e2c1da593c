"""A car whose usual driving the equations do not follow: its baseline is no change."""

import dataclasses
import json

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.log.table import InvalidLogError, Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.cli.main import BAD_INPUT, main
from drift_drake.gap.monitoring import monitor
from drift_drake.gap.monitoring.bank import gated_row
from drift_drake.gap.monitoring.baselines import (
    BaselineScores,
    baseline_given,
    calibrated_monitor,
    learn_baseline_scores,
)
from drift_drake.gap.monitoring.events import InvalidBaselineScoresError
from drift_drake.gap.monitoring.watch import monitor_of, rows_of, watched
from experiments.monitoring.drives import changed_drive

VEHICLE = VehicleParameters()
ODD = make_effects({"front_stiffness_error": -0.08, "steering_lag": 0.01})  # of the real car, always


def drive(seed: int) -> Run:
    return changed_drive("slalom", ODD, 0.0, seed, 6.0)


@pytest.fixture(scope="module")
def scores():
    return learn_baseline_scores([drive(3), drive(4)], VEHICLE, Effects())


@pytest.fixture(scope="module")
def calibration(scores, tmp_path_factory):
    path = tmp_path_factory.mktemp("calibration") / "car.json"
    path.write_text(json.dumps({"watching": scores.as_data()}))
    return path


def least_none(monitor, run) -> float:
    return min(judged.verdict[0] for judged in watched(monitor, rows_of(run)))


def test_the_baseline_is_no_change(calibration):
    other = drive(2)
    assert least_none(monitor_of(other, VEHICLE, Effects()), other) < 0.05
    scores = baseline_given(calibration)
    assert isinstance(scores, BaselineScores)
    assert least_none(calibrated_monitor(scores, other, VEHICLE, Effects()), other) > 0.5


def test_a_bank_that_is_lost_on_the_way_leaves_scores(monkeypatch):
    run, rows = drive(3), iter(range(10_000))

    def losing(*arguments):
        bank, innovations, left = gated_row(*arguments)
        return (
            (bank._replace(z=bank.z * np.nan), innovations, left)
            if next(rows) % 300 == 299
            else (bank, innovations, left)
        )

    monkeypatch.setattr(monitor, "gated_row", losing)
    assert np.isfinite(learn_baseline_scores([run, drive(4)], VEHICLE, Effects()).excess).all()


def test_scores_survive_the_file(calibration, scores):
    found = baseline_given(calibration)
    assert isinstance(found, BaselineScores)
    assert (found.period, found.noise, found.nodes) == (scores.period, scores.noise, scores.nodes)
    np.testing.assert_allclose(found.excess, scores.excess, atol=1e-6)


def test_another_log_or_vehicle_is_refused(scores):
    run = drive(1).rows(0, 50)
    with pytest.raises(InvalidLogError, match="no column ay, which the calibration's logs had"):
        calibrated_monitor(scores, run.without("ay"), VEHICLE, Effects())
    with pytest.raises(InvalidLogError, match=r"one each 0\.02 s"):
        calibrated_monitor(dataclasses.replace(scores, period=0.02), run, VEHICLE, Effects())
    with pytest.raises(InvalidBaselineScoresError, match="another vehicle file"):
        calibrated_monitor(scores, run, VEHICLE.replace(mass=2.0 * VEHICLE.mass), Effects())


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda _: {}, "has no normal scores"),
        (lambda data: {"watching": {**data, "excess": [[1.0]]}}, "excess must hold"),
        (lambda data: {"watching": {**data, "noise": {"wind": 1.0}}}, "noise must be of r, v"),
        (lambda _: {"watching": {"period": 0.01}}, "not what 'identify' writes"),
        (lambda data: {"watching": {**data, "nodes": 3}}, "not what 'identify' writes"),
    ],
)
def test_a_bad_calibration_is_one_sentence(scores, tmp_path, capsys, change, says):
    path, log, car = tmp_path / "car.json", tmp_path / "run_0.csv", tmp_path / "car.yaml"
    path.write_text(json.dumps(change(scores.as_data())))
    write_run(drive(1).rows(0, 50), log)
    VEHICLE.to_yaml(car)
    assert main(["watch", str(log), "--vehicle", str(car), "--calibration", str(path)]) == BAD_INPUT
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
