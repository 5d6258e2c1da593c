"""`drift_drake.replay`: a path and a run come to the same errors."""

from pathlib import Path

import pytest

import drift_drake
from drift_drake.car.log.table import read_run
from drift_drake.view.playback.side_by_side import CarModel


def test_a_path_and_a_run_are_played_alike(files: Path, cars: dict[str, CarModel]) -> None:
    one = drift_drake.replay(files / "run_0.csv", files / "car.yaml", files / "true.yaml")
    other = drift_drake.replay(read_run(files / "run_0.csv"), cars["nominal"].parameters, tuple(cars["corrected"]))
    assert one.comparison.rms["r"]["corrected"] < one.comparison.rms["r"]["nominal"]
    assert other.comparison.rms["r"] == pytest.approx(one.comparison.rms["r"])
    assert "position [m]" in one.sentence()
    one.write(files / "replay.html")
    assert (files / "replay.html").stat().st_size > 10_000
