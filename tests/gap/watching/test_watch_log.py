"""`drift_drake.watch`: a path and a run come to the same events."""

from pathlib import Path

import pytest

import drift_drake
from drift_drake.car.log.table import Run, read_run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import DriftDrakeError


def test_a_path_and_a_run_come_to_the_same_events(changed_run: Run, tmp_path: Path) -> None:
    write_run(changed_run, tmp_path / "run_0.csv")
    reported: list[dict[str, object]] = []
    one = drift_drake.watch(tmp_path / "run_0.csv", VehicleParameters(), tell=reported.extend)
    other = drift_drake.watch(read_run(tmp_path / "run_0.csv"), VehicleParameters())
    assert one.events == other.events == reported
    assert one.events
    assert one.sentence() == ""
    assert one.judged == other.judged > 4.0


def test_where_nothing_changes_it_is_said(changed_run: Run) -> None:
    seen = drift_drake.watch(changed_run.rows(0, 200), VehicleParameters())
    assert seen.events == []
    assert "nothing has changed in the" in seen.sentence()


def test_what_cannot_be_watched_is_said(changed_run: Run) -> None:
    with pytest.raises(DriftDrakeError, match="give the path of a file that grows"):
        drift_drake.watch(changed_run, VehicleParameters(), follow=True)
    with pytest.raises(DriftDrakeError, match="int is none; give a run's path or a Run"):
        drift_drake.watch(3, VehicleParameters())  # type: ignore[arg-type]
    with pytest.raises(DriftDrakeError, match="the calibration: has no normal scores to watch with"):
        drift_drake.watch(changed_run, VehicleParameters(), calibration=object())
