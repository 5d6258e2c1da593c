"""Replanning while driving: the rest of a plan is its own solution, and the belief holds what has been driven."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import STATES
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.gathering import gather as gathering
from drift_drake.drive.gathering.config import GatheringConfig, problem_data
from drift_drake.drive.gathering.gather import gather, learn_drive, plan_rest, rest_of_drive, rest_of_plan, taught
from drift_drake.drive.gathering.plan import Trajectory, plan_again, plan_drive, round_alpha
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.learnt.quality import learn, step_model
from drift_drake.drive.learnt.samples import Samples, samples_from_log
from experiments.benchmarks.vehicles import draw_effects

CONFIG = GatheringConfig(steps=14, v_end=11.0, starts=1, max_iterations=60, replan=0.4)
PARAMETERS = VehicleParameters()
EFFECTS = draw_effects("validation", 0, 0)


@pytest.fixture(scope="module")
def info(model: BayesianModel) -> Trajectory:
    return plan_drive(model, model.prior(), CONFIG, CONFIG.alpha)


def as_planned(model: BayesianModel, plan: Trajectory, steps: int) -> Samples:
    """Samples of a car that does as the prior's mean says."""
    x, u = plan.x[:steps], plan.u
    curvature, numbers = np.zeros(steps), np.zeros(steps, dtype=int)
    x_next = step_model(model, model.prior()).step(x, u[:steps], u[1 : steps + 1], curvature)
    return Samples(x, u[:steps], u[1 : steps + 1], x_next, curvature, numbers, numbers)


def test_the_rest_of_a_drive_is_the_drives(info: Trajectory) -> None:
    whole, rest = problem_data(CONFIG), problem_data(rest_of_drive(CONFIG, 6))
    np.testing.assert_allclose(rest.x_ref, whole.x_ref[6:])
    np.testing.assert_array_equal(rest.e_max, whole.e_max[6:])
    np.testing.assert_array_equal(rest_of_plan(info, 6).u, info.u[6:])


def test_at_the_plans_own_states_the_rest_of_it_is_found_again(model: BayesianModel, info: Trajectory) -> None:
    config = dataclasses.replace(CONFIG, objective="drifts", tolerance=1e-5)
    plan = plan_again(model, model.prior(), info, config)
    assert plan.status == "converged"
    belief = learn(model, model.prior(), as_planned(model, plan, 5))
    np.testing.assert_allclose(belief.mean, model.prior().mean, atol=1e-3)  # it has met what it expected
    left = rest_of_plan(plan, 5)
    again = plan_rest(model, belief, left, rest_of_drive(config, 5), plan.alpha, plan.x[5], plan.u[5])
    np.testing.assert_allclose(again.u / [0.3, 100.0], left.u / [0.3, 100.0], rtol=0, atol=5e-3)
    np.testing.assert_allclose(again.x[:, :6], left.x[:, :6], rtol=0, atol=0.02)


def test_a_later_round_is_weighed_as_its_plan_was(model: BayesianModel, info: Trajectory) -> None:
    plan = plan_again(model, model.prior(), info, CONFIG)
    assert plan.alpha == pytest.approx(round_alpha(model, model.prior(), info, CONFIG))
    assert round_alpha(model, model.prior(), plan, CONFIG) == pytest.approx(plan.alpha)


@pytest.fixture(scope="module")
def driven(model: BayesianModel, info: Trajectory) -> tuple[pd.DataFrame, list[tuple[Any, ...]], list[Trajectory]]:
    """(the log, what each replan was given, what it found)."""
    given: list[tuple[Any, ...]] = []
    found: list[Trajectory] = []

    def kept(*arguments: Any) -> Trajectory:
        given.append(arguments)
        found.append(plan_rest(*arguments))
        return found[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gathering, "plan_rest", kept)
        table, ending = gather(info, EFFECTS, PARAMETERS, CONFIG, 3, learning=(model, model.prior()))
    assert ending == "time"
    return table, given, found


def test_each_replan_begins_where_the_car_is_with_what_it_has_learnt(
    model: BayesianModel, info: Trajectory, driven: tuple[pd.DataFrame, list[tuple[Any, ...]], list[Trajectory]]
) -> None:
    table, given, found = driven
    assert [arguments[3].steps for arguments in given] == [10, 6]  # at 0.4 and 0.8 s; at 1.2 s too little is left
    samples = samples_from_log(table, None, 0, 0)
    before = [info, *found]
    for step, (_, belief, left, config, alpha, x, u, _), plan in zip((4, 8), given, before, strict=False):
        row = table.iloc[10 * step]
        np.testing.assert_array_equal(x[:6], row[list(STATES)])
        np.testing.assert_array_equal(u, row[["delta_cmd", "tau_cmd"]])
        expected = learn(model, model.prior(), samples.where(np.arange(step)))
        np.testing.assert_array_equal(belief.mean, expected.mean)
        np.testing.assert_array_equal(belief.covariance, expected.covariance)
        np.testing.assert_array_equal(left.u, plan.u[4:])
        assert config.objective == "drifts"
        assert alpha == pytest.approx(round_alpha(model, model.prior(), info, CONFIG))
    for plan, (*_, x, u, _) in zip(found, given, strict=True):
        np.testing.assert_allclose(plan.x[0], x, atol=1e-6)
        np.testing.assert_allclose(plan.u[0], u, atol=1e-4)


def test_commands_go_on_without_a_jump_along_the_new_plans(
    info: Trajectory, driven: tuple[pd.DataFrame, list[tuple[Any, ...]], list[Trajectory]]
) -> None:
    table, _, found = driven
    commands = table[["delta_cmd", "tau_cmd"]].to_numpy() / [0.3, 100.0]
    changes = np.abs(np.diff(commands, axis=0)).max(axis=1)
    replanned = np.isin(np.arange(len(changes)), [39, 40, 41, 79, 80, 81])
    assert changes[replanned].max() < 1.2 * changes[~replanned].max()
    end = found[-1].u[-1] / [0.3, 100.0]
    assert np.abs(commands[-1] - end).max() < 0.3
    assert np.abs(found[0].u[1:5, 0] - info.u[5:9, 0]).max() > 0.01  # what it learnt has changed the plan


def test_a_replanned_drive_replays_and_is_learnt_once(
    model: BayesianModel, info: Trajectory, driven: tuple[pd.DataFrame, list[tuple[Any, ...]], list[Trajectory]]
) -> None:
    drive = taught(model, model.prior(), info, EFFECTS, PARAMETERS, CONFIG, 3)
    pd.testing.assert_frame_equal(drive.table, driven[0], check_exact=True)
    np.testing.assert_array_equal(drive.belief.mean, learn_drive(model, model.prior(), drive.table, CONFIG).mean)


def test_a_plan_that_weighs_no_information_is_driven_as_it_is(model: BayesianModel, info: Trajectory) -> None:
    plain = info._replace(alpha=0.0)
    replanned, _ = gather(plain, EFFECTS, PARAMETERS, CONFIG, 3, learning=(model, model.prior()))
    pd.testing.assert_frame_equal(replanned, gather(plain, EFFECTS, PARAMETERS, CONFIG, 3)[0], check_exact=True)


def test_where_no_rest_is_found_the_plan_before_goes_on(
    model: BayesianModel, info: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = SimpleNamespace(failed=True, primal_residual=0.0)
    monkeypatch.setattr(gathering, "LineSearchSqp", lambda *_: SimpleNamespace(solve=lambda _: failed))
    belief: Posterior = model.prior()
    left = rest_of_plan(info, 5)
    assert plan_rest(model, belief, left, rest_of_drive(CONFIG, 5), 8.0, info.x[5], info.u[5]) is left


def test_a_period_shorter_than_a_step_is_refused() -> None:
    with pytest.raises(InvalidOptionError, match=r"replan is 0\.05 s; give 0\.1 s or more, or 0 for never"):
        GatheringConfig(replan=0.05)
