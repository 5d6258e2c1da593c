"""Logs are screened for bad samples once, whatever is said of them."""

import pytest
from kinematic_log import kinematic_log

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.check.check import check
from drift_drake.gap.logs.screening import screened


def test_a_check_with_a_vehicle_looks_through_each_run_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes most of an hour's log's time."""
    looked, screen = [], screened.screen
    monkeypatch.setattr(screened, "screen", lambda run: looked.append(run.name) or screen(run))
    runs = [kinematic_log(12.0, seed=seed) for seed in range(2)]
    check(runs, VehicleParameters(), workers=1)
    assert sorted(looked) == sorted(run.name for run in runs)
