"""The lane drives that meta-training takes its contexts from."""

import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagrams.information_gathering import Trajectory
from drift_drake.model.checkpoint import BayesianModel
from drift_drake.model.posterior import Posterior, covariance_norms
from drift_drake.model.samples import PHASE_STRIDE, load_samples
from drift_drake.vehicle.parameters import VehicleParameters
from experiments import lane_drives
from experiments.drives import join_vehicles

PLANNED: list[Posterior] = []


def own_plan(real: Any, model: BayesianModel, belief: Posterior, first: Trajectory, config: Any, seed: int) -> Any:
    """The real one with a short search, which notes what it was told."""
    PLANNED.append(belief)
    gain = covariance_norms(model.prior())[1] / covariance_norms(belief)[1]
    assert gain > 1.0  # it knows of the drive before
    found = real(model, belief, first, dataclasses.replace(config, starts=1, max_iterations=3), seed)
    assert found is None or np.isfinite(found.u).all()
    return found


def test_a_vehicle_is_driven_along_plans_of_the_pool_and_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lane_drives, "SCHEDULE", ("pool", "own", "shaken"))
    monkeypatch.setattr(lane_drives, "own_plan", functools.partial(own_plan, lane_drives.own_plan))
    slalom = lane_drives.lane_plan((lane_drives.LaneDrivesConfig(), 0))
    assert slalom is not None
    assert np.ptp(slalom.x[:, 4]) > 0.1
    config = lane_drives.LaneDrivesConfig(output=tmp_path)
    pool = [slalom, slalom, slalom]
    endings = lane_drives.lane_drives((config, "train", 1, pool))
    assert PLANNED
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
    assert lane_drives.lane_drives((config, "train", 1, pool)) == endings
    assert (folder / "lane.npz").stat().st_mtime_ns == before

    lane_drives.lane_drives((dataclasses.replace(config, round=1), "train", 1, pool))
    both = lane_drives.join_rounds([folder], 2, "")
    assert set(both.vehicle) == {1}
    assert len(both.drives()) == 6
    np.testing.assert_array_equal(both.x[: len(every_tenth.x)], every_tenth.x)
    assert not np.array_equal(both.x[len(every_tenth.x) :], every_tenth.x)  # other noise, another plan of its own
