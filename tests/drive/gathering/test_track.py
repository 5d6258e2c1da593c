"""Gathering on a closed track: longer than a plan, so always planned again, until it has gained enough."""

import dataclasses
from typing import Any

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.gathering.config import GatheringConfig, curvature_along, lane, lane_data, positions
from drift_drake.drive.gathering.gather import (
    continued,
    drive_samples,
    gather,
    learn_drive,
    rest_of_drive,
    rest_of_plan,
    taught,
)
from drift_drake.drive.gathering.plan import Trajectory, information_expected, information_gained, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.reference.stadium import Stadium

TRACK = Stadium(straight=8.0, radius=15.0, transition=8.0)
CONFIG = GatheringConfig(steps=14, lane="track", track=TRACK, duration=2.4, replan=0.5, starts=2, max_iterations=40)
EFFECTS, CAR = make_effects({"friction_level": -0.1}), VehicleParameters()


@pytest.fixture(scope="module")
def plans(model: BayesianModel) -> tuple[Trajectory, Trajectory]:
    """(OCP's, Info-OCP's)."""
    plain, informative = (plan_drive(model, model.prior(), CONFIG, alpha) for alpha in (0.0, CONFIG.alpha))
    return plain, informative


@pytest.fixture(scope="module")
def driven(model: BayesianModel, plans: tuple[Trajectory, Trajectory]) -> tuple[pd.DataFrame, str]:
    return gather(plans[1], EFFECTS, CAR, CONFIG, 0, learning=(model, model.prior()))


def test_the_data_are_the_tracks_where_a_plan_is_expected() -> None:
    course, data = lane(CONFIG), lane_data(CONFIG)
    s = course.horizon(0.0, 0.1, 14).s
    np.testing.assert_allclose(data.x_ref, course.state(s))
    np.testing.assert_array_equal(data.x_init, course.state(0.0))
    assert 0.0 == data.curvature[0] < data.curvature[-1]
    behind = lane_data(CONFIG, s=s - 5.0)
    np.testing.assert_allclose(behind.x_ref, course.state(s - 5.0))
    assert behind.curvature[-1] < data.curvature[-1]


def test_positions_of_the_middle_at_its_speed_are_the_references() -> None:
    along = lane(CONFIG).horizon(3.0, 0.1, 14)
    np.testing.assert_allclose(positions(CONFIG, along.x_ref, 3.0), along.s, atol=0.02)
    np.testing.assert_allclose(curvature_along(CONFIG, along.x_ref, 3.0), along.curvature, atol=1e-4)
    inside = along.x_ref.copy()
    inside[:, 4] = 2.0
    assert positions(CONFIG, inside, 3.0)[-1] > along.s[-1] + 0.3  # the inner line of a bend is shorter


def test_plans_meet_the_bends_where_they_drive_and_the_informative_one_tells_more(
    plans: tuple[Trajectory, Trajectory],
) -> None:
    plain, informative = plans
    assert plain.status == "converged"
    assert np.abs(plain.x[:, 4]).max() < 0.3
    assert np.abs(plain.x[:, 5]).max() < 0.1
    assert informative.information > 1.5 * plain.information
    assert np.abs(informative.x[:, 4]).max() < CONFIG.half_width


def test_a_drive_goes_on_beyond_a_plan_and_is_learnt_with_the_bends(
    model: BayesianModel, driven: tuple[pd.DataFrame, str]
) -> None:
    table, ending = driven
    assert (ending, table["t"].iloc[-1]) == ("time", pytest.approx(CONFIG.duration))
    assert table["e"].abs().max() < CONFIG.half_width
    samples = drive_samples(table, CONFIG)
    expected = lane(CONFIG).path.curvature(table["s"].to_numpy()[5::10])
    np.testing.assert_allclose(samples.curvature, expected[: len(samples.curvature)], atol=3e-3)
    assert information_gained(model.prior(), learn_drive(model, model.prior(), table, CONFIG)) > 1.0


def test_the_plain_drive_is_planned_again_too_and_keeps_to_the_middle(
    model: BayesianModel, plans: tuple[Trajectory, Trajectory]
) -> None:
    table, ending = gather(plans[0], EFFECTS, CAR, CONFIG, 0, learning=(model, model.prior()))
    assert ending == "time"
    assert table["e"].abs().max() < 0.5
    shorter, _ = gather(plans[0], EFFECTS, CAR, CONFIG, 0)  # no belief to plan again with
    assert shorter["t"].iloc[-1] == pytest.approx(1.4)


def test_there_is_always_a_plans_length_ahead(plans: tuple[Trajectory, Trajectory]) -> None:
    assert rest_of_drive(CONFIG, 5) is CONFIG
    left = rest_of_plan(plans[0], 5)
    x, u, s = continued(CONFIG, left.x, left.u, 6.0)
    assert s is not None
    assert (x.shape, u.shape, s.shape) == ((15, 8), (15, 2), (15,))
    np.testing.assert_array_equal(x[:10], left.x)
    np.testing.assert_allclose(x[10:, :6], lane(CONFIG).state(s[10:]), atol=1e-12)
    assert (np.diff(s) > 0.0).all()
    assert rest_of_plan(plans[0], 99).x.shape == (2, 8)


def test_a_drive_ends_once_little_more_is_promised(model: BayesianModel, plans: tuple[Trajectory, Trajectory]) -> None:
    least = dataclasses.replace(CONFIG, stop_below=1.0)
    drive = taught(model, model.prior(), plans[1], EFFECTS, CAR, least, 0)
    assert drive.ending == "enough"
    assert drive.table["t"].iloc[-1] < CONFIG.duration - 0.3
    again = taught(model, drive.belief, plans[0], EFFECTS, CAR, least, 0)  # asks for no information: never enough
    assert again.ending == "time"


def test_a_lane_drive_ends_so_too(model: BayesianModel) -> None:
    config = GatheringConfig(steps=14, v_end=11.0, starts=1, replan=0.4, stop_below=1.0)
    plan = plan_drive(model, model.prior(), config, config.alpha)
    drive = taught(model, model.prior(), plan, EFFECTS, CAR, config, 0)
    assert drive.ending in ("enough", "time")
    left = rest_of_plan(plan, 8)
    assert information_expected(model, drive.belief, left) < information_gained(model.prior(), drive.belief)
    assert drive.ending == "enough"


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"replan": 0.0}, "driven for longer than a plan; give replan up to 4.5 s, such as 0.5"),
        ({"replan": 0.5, "curvature": 0.01}, "a track has bends of its own; leave out the curvature of 0.01"),
        ({"replan": 0.5, "half_width": 12.0}, "cannot have a radius of 20 m; give 24 or more"),
        ({"replan": 0.5, "duration": 0.0}, "duration is 0 s; give 0.1 to 600"),
    ],
)
def test_a_track_that_cannot_be_driven_is_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InvalidOptionError, match=sentence):
        GatheringConfig(lane="track", **options)


def test_a_share_to_stop_below_is_one() -> None:
    with pytest.raises(InvalidOptionError, match=r"stop_below is 1\.5; give 0 to 1"):
        GatheringConfig(stop_below=1.5)
