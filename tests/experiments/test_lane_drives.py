"""The lane drives that meta-training takes its contexts from."""

import dataclasses
import functools
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.plan import Trajectory
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.posterior import Posterior, covariance_norms
from drift_drake.drive.learnt.quality import adapted
from drift_drake.drive.learnt.samples import PHASE_STRIDE, Samples, load_samples, save_samples
from experiments.gathering import lane_drives
from experiments.model.drives import join_vehicles

PLANNED: list[tuple[Posterior, Trajectory, GatheringConfig]] = []
DRIVEN: list[Trajectory] = []


def own_plan(real: Any, model: BayesianModel, belief: Posterior, first: Trajectory, config: Any, seed: int) -> Any:
    """The real one with a short search, which notes what it was given."""
    PLANNED.append((belief, first, config))
    gain = covariance_norms(model.prior())[1] / covariance_norms(belief)[1]
    assert gain > 1.0  # it knows of the drive before
    found = real(model, belief, first, dataclasses.replace(config, starts=1, max_iterations=3), seed)
    assert found is None or np.isfinite(found.u).all()
    return found


def execution(real: Any, trajectory: Trajectory, *rest: Any) -> Any:
    """The real one, which notes what is driven."""
    DRIVEN.append(trajectory)
    return real(trajectory, *rest)


def test_the_pool_begins_with_information_gatherings_own_first_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[Any, ...]] = []
    monkeypatch.setattr(lane_drives, "plan_drive", lambda *arguments: calls.append(arguments))
    for number in (0, 1):  # in every round
        lane_drives.lane_plan((lane_drives.LaneDrivesConfig(round=number), 0))
    for _, belief, config, alpha in calls:
        np.testing.assert_array_equal(belief.covariance, load_model().prior().covariance)
        assert config == GatheringConfig()
        assert alpha == GatheringConfig().alpha
    assert len(calls) == 2


def test_a_vehicle_is_driven_along_the_first_plan_plans_of_the_pool_and_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    schedule = ("first", "own", "pool", "own", "shaken")
    monkeypatch.setattr(lane_drives, "SCHEDULE", schedule)
    monkeypatch.setattr(lane_drives, "own_plan", functools.partial(own_plan, lane_drives.own_plan))
    monkeypatch.setattr(lane_drives, "execution", functools.partial(execution, lane_drives.execution))
    PLANNED.clear()
    DRIVEN.clear()
    slalom = lane_drives.lane_plan((lane_drives.LaneDrivesConfig(), 3))
    assert slalom is not None
    assert np.ptp(slalom.x[:, 4]) > 0.1
    config = lane_drives.LaneDrivesConfig(output=tmp_path)
    pool = [slalom._replace(cost=float(k)) for k in range(6)]
    endings = lane_drives.lane_drives((config, "train", 1, pool))
    assert sum(endings.values()) == len(DRIVEN) == 5
    others = [other.cost for other in pool[1:]]
    assert DRIVEN[0] is pool[0]
    assert DRIVEN[2].cost in others
    assert DRIVEN[4].cost in others
    assert DRIVEN[4].cost != DRIVEN[2].cost
    assert np.abs(DRIVEN[4].u - slalom.u)[:, 0].max() > 1e-3
    # After the first plan its own are as information gathering's; after one of the pool they are of a random lane.
    assert [first.cost for _, first, _ in PLANNED] == [0.0, DRIVEN[2].cost]
    assert PLANNED[0][2] == GatheringConfig(max_iterations=lane_drives.ITERATIONS)
    assert PLANNED[1][2].v_end != GatheringConfig().v_end
    folder = tmp_path / "train" / "vehicle_01"
    table = join_vehicles([folder], "lane_phases", 5)
    assert len(table.drives()) == 50
    assert sorted(set(table.vehicle)) == [1 + PHASE_STRIDE * phase for phase in range(10)]
    limits = VehicleParameters()
    assert np.abs(table.u[:, 0]).max() <= limits.steering_limit
    assert limits.torque_min <= table.u[:, 1].min() <= table.u[:, 1].max() <= limits.torque_max
    every_tenth = load_samples(folder / "lane.npz")
    np.testing.assert_array_equal(table.of_vehicle(1).x, every_tenth.x)
    # What an own plan knows is what was driven since the last that was not of its own.
    model = load_model()
    for (belief, _, _), drive in zip(PLANNED, (0, 2), strict=True):
        reported = adapted(model, every_tenth.where(every_tenth.drive == drive))
        np.testing.assert_allclose(belief.covariance, reported.covariance, rtol=1e-9, atol=1e-9)
    before = (folder / "lane.npz").stat().st_mtime_ns
    assert lane_drives.lane_drives((config, "train", 1, pool)) == endings
    assert (folder / "lane.npz").stat().st_mtime_ns == before

    lane_drives.lane_drives((dataclasses.replace(config, round=1), "train", 1, pool))
    both = lane_drives.join_rounds([folder], 2, "")
    assert set(both.vehicle) == {1}
    assert len(both.drives()) == 10
    np.testing.assert_array_equal(both.x[: len(every_tenth.x)], every_tenth.x)
    assert not np.array_equal(both.x[len(every_tenth.x) :], every_tenth.x)  # other noise, another plan of its own


def test_rounds_may_lack_vehicles(tmp_path: Path) -> None:
    """Two vehicles in round 0, none in round 1, the second of them in round 2."""
    generator = np.random.default_rng(0)
    drives = np.repeat(np.arange(len(lane_drives.SCHEDULE)), 3)
    count = len(drives)
    folders = [tmp_path / name for name in ("vehicle_04", "vehicle_05", "vehicle_06")]
    written = []
    for index, name in ((4, "lane"), (5, "lane"), (5, "lane_2")):
        x, u = generator.normal(size=(count, 8)), generator.normal(size=(count, 2))
        samples = Samples(x, u, u, x + 0.1, np.zeros(count), np.full(count, index), drives)
        folders[index - 4].mkdir(exist_ok=True)
        save_samples(samples, folders[index - 4] / f"{name}.npz")
        written.append(samples)
    joined = lane_drives.join_rounds(folders, 3, "")
    np.testing.assert_array_equal(joined.x, np.concatenate([samples.x for samples in written]))
    np.testing.assert_array_equal(joined.vehicle, np.repeat([4, 5, 5], count))
    parts = joined.drives()
    assert len(parts) == 3 * len(lane_drives.SCHEDULE)
    assert all(one.drive[0] != other.drive[0] for one, other in itertools.combinations(parts, 2))
