"""The detection experiment: what it counts, and a run as a user makes it."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.executors import ExecutorConfig
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.drive.reference.trajectory import figure_8
from experiments.drifting import out_of_distribution
from experiments.drifting import runs as drift_runs
from experiments.drifting.out_of_distribution import GROUPS, DetectionConfig, alarm_time, judge, main, share


def test_the_first_alarm_is_when_the_window_first_exceeds_the_threshold() -> None:
    distances = [1.0] * 30 + [9.0] * 10
    assert alarm_time(distances, 4.5, window=4) == pytest.approx(3.2)
    assert alarm_time(distances, 4.5, window=4, since=3.5) == pytest.approx(3.6)
    assert alarm_time(distances, 10.0, window=4) == np.inf


def test_a_share_comes_with_its_interval() -> None:
    assert share(0, 10) == pytest.approx({"count": 0, "total": 10, "share": 0.0, "low": 0.0, "high": 0.3085}, abs=1e-4)
    assert share(10, 10)["low"] == pytest.approx(0.6915, abs=1e-4)


def test_groups_are_judged_by_a_threshold_from_the_calibration() -> None:
    generator = np.random.default_rng(0)

    def drive(group: str, level: float, outcome: str = "completed") -> dict[str, Any]:
        distances = level * generator.chisquare(4, size=270)
        distances[130:] *= 6.0 if group == "friction drop" else 1.0
        return {"group": group, "outcome": outcome, "duration": 27.0, "distances": list(distances)}

    results = [drive("calibration", 1.0) for _ in range(10)]
    results += [drive("in distribution", 1.0) for _ in range(4)]
    results += [drive("wide", 5.0, "spin") for _ in range(3)]
    results += [drive("friction drop", 1.0, "left the lane") for _ in range(3)]
    results += [drive("friction drop", 1.0) | {"duration": 5.0}]  # lost before the drop
    groups = judge(results, DetectionConfig())["groups"]
    assert groups["in distribution"]["alarms"]["count"] == 0
    assert groups["wide"]["alarms"]["count"] == groups["wide"]["lost_with_alarm"] == 3
    assert groups["friction drop"]["alarms"]["total"] == 3
    assert 0.9 < groups["friction drop"]["median_time"] < 3.0


def test_the_experiment(
    here: ExecutorConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    course = dataclasses.replace(figure_8(VehicleParameters()), distance=20.0)
    for module in (drift_runs, out_of_distribution):
        monkeypatch.setattr(module, "reference", lambda _: course)
    config = DetectionConfig(vehicles=1, window=3, drop_time=0.5, run_on=here, out=tmp_path,
                             control=ControlConfig(horizon=12, period=0.05, delay=0.05))  # fmt: skip
    main(config)
    assert "| friction drop | " in capsys.readouterr().out
    assert set(json.loads((tmp_path / "numbers.json").read_text())["groups"]) == set(GROUPS)
    assert (tmp_path / "statistic.png").exists()
    found = json.loads((tmp_path / "calibration-000-0.json").read_text())
    assert len(found["distances"]) == pytest.approx(10.0 * found["duration"], abs=2.0)
    assert np.isfinite(found["distances"]).all()
