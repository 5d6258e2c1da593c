"""The lane drives that meta-training takes its contexts from."""

from pathlib import Path

import numpy as np
import pytest

from drift_drake.model.samples import PHASE_STRIDE, load_samples
from drift_drake.vehicle.parameters import VehicleParameters
from experiments import lane_drives
from experiments.drives import join_vehicles


def test_a_vehicle_is_driven_along_plans_of_the_pool(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lane_drives, "DRIVES", 3)  # the third with random steering
    slalom = lane_drives.lane_plan((None, 0, 0))
    assert slalom is not None
    assert np.ptp(slalom.x[:, 4]) > 0.1
    job = (tmp_path, "train", 1, 0, [slalom, slalom, slalom])
    endings = lane_drives.lane_drives(job)  # type: ignore[arg-type]
    assert sum(endings.values()) == 3
    folder = tmp_path / "train" / "vehicle_01"
    table = join_vehicles([folder], "lane_phases", 3)
    assert len(table.drives()) == 30
    assert sorted(set(table.vehicle)) == [1 + PHASE_STRIDE * phase for phase in range(10)]
    limits = VehicleParameters()
    assert np.abs(table.u[:, 0]).max() <= limits.steering_limit
    assert limits.torque_min <= table.u[:, 1].min() <= table.u[:, 1].max() <= limits.torque_max
    every_tenth = load_samples(folder / "lane.npz")
    np.testing.assert_array_equal(table.of_vehicle(1).x, every_tenth.x)
    before = (folder / "lane.npz").stat().st_mtime_ns
    assert lane_drives.lane_drives(job) == endings  # type: ignore[arg-type]
    assert (folder / "lane.npz").stat().st_mtime_ns == before
