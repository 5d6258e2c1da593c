"""Information gathering end to end: plans, drives, learning, and the weight of later rounds."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast, get_args

import numpy as np
import pandas as pd
import pytest

from diagrams.information_gathering import Options, main
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import STATES
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.gathering import plan as planning
from drift_drake.drive.gathering.config import ENDS, GatheringConfig, Objective, problem_data
from drift_drake.drive.gathering.gather import gather, learn_drive
from drift_drake.drive.gathering.plan import (
    InfeasiblePlanError,
    Trajectory,
    info_ocp,
    information_cost,
    information_expected,
    information_gained,
    plan_again,
    plan_drive,
    round_alpha,
)
from drift_drake.drive.learnt.checkpoint import BayesianModel, InvalidCheckpointError
from drift_drake.drive.learnt.command_lag import LAGGED, lagged_commands
from drift_drake.drive.learnt.posterior import covariance_norms
from drift_drake.drive.learnt.quality import learn, step_model
from drift_drake.drive.learnt.samples import samples_from_log
from drift_drake.drive.mpc.sqp import LineSearchSqp, SqpOptions, SqpResult
from experiments.benchmarks.vehicles import draw_effects
from experiments.gathering.recipe import lane_for_pictures

CONFIG = GatheringConfig(steps=12, v_end=11.0, starts=3, max_iterations=60)
PARAMETERS = VehicleParameters()
EFFECTS = draw_effects("validation", 0, 0)


@pytest.fixture(scope="module")
def ocp(model: BayesianModel) -> Trajectory:
    return plan_drive(model, model.prior(), CONFIG, 0.0)


@pytest.fixture(scope="module")
def info(model: BayesianModel) -> Trajectory:
    return plan_drive(model, model.prior(), CONFIG, CONFIG.alpha)


def test_the_problem_is_the_papers() -> None:
    data = problem_data(GatheringConfig())
    np.testing.assert_array_equal(data.x_init, [0.0, 7.5, 0.0, 7.5, 0.0, 0.0])
    assert data.x_ref.shape == (46, 6)
    np.testing.assert_array_equal(data.x_ref[-1], [0.0, 20.0, 0.0, 20.0, 0.0, 0.0])
    np.testing.assert_allclose(np.diff(data.x_ref[:, 1]), 12.5 / 45)


def test_a_lane_is_narrowed_by_what_is_not_known_of_the_car(model: BayesianModel) -> None:
    prior, slim = model.prior(), dataclasses.replace(CONFIG, half_width=0.7)  # 0.2 m to either side
    known = prior._replace(covariance=1e-6 * prior.covariance, q=1e6 * prior.q)
    free, narrow = (
        plan_drive(model, prior, dataclasses.replace(slim, tightening=kappa), slim.alpha) for kappa in (0.0, 100.0)
    )
    assert np.abs(free.x[:, 4]).max() > 0.15
    assert np.abs(narrow.x[:, 4]).max() < 0.5 * np.abs(free.x[:, 4]).max()
    a, b = (plan_drive(model, known, dataclasses.replace(slim, tightening=kappa), 0.0) for kappa in (0.0, 1.0))
    np.testing.assert_allclose(a.x, b.x, atol=0.02)
    with pytest.raises(InvalidOptionError, match="tightening is -1; give 0 or more"):
        GatheringConfig(tightening=-1.0)


def test_the_ocp_drives_straight_and_info_ocp_does_not(ocp: Trajectory, info: Trajectory) -> None:
    assert ocp.status == "converged"
    assert np.abs(ocp.x[:, 4]).max() < 0.05
    assert info.information > 1.5 * ocp.information
    assert np.abs(info.u[:, 0]).max() > 0.02


def test_info_ocp_says_what_each_cost_and_constraint_is(model: BayesianModel) -> None:
    problem = info_ocp(model, model.prior(), CONFIG)
    said = [b.evaluator().get_description() for b in (*problem.GetAllCosts(), *problem.GetAllConstraints())]
    assert all(said)
    assert {"information, times -alpha", "sideslip, softened", "straight at the end, softened", "dynamics"} < set(said)
    guess = problem.GetInitialGuess(problem.decision_variables())
    information, *_ = (b for b in problem.GetAllCosts() if "information" in b.evaluator().get_description())
    assert problem.EvalBinding(information, guess)[0] < 0.0
    plain = info_ocp(model, model.prior(), CONFIG, alpha=0.0)
    assert len(plain.GetAllCosts()) == len(problem.GetAllCosts()) - 1


def test_plans_keep_their_bounds(info: Trajectory) -> None:
    lane = CONFIG.half_width - CONFIG.margin
    assert np.abs(info.x[:, 4]).max() < lane + 1e-3
    assert np.abs(info.x[:, 2]).max() < CONFIG.max_sideslip + 1e-3
    assert np.abs(info.x[:, 3] - info.x[:, 1]).max() < CONFIG.max_slip + 1e-2
    assert np.abs(info.u[:, 0]).max() <= PARAMETERS.steering_limit + 1e-6
    assert info.u[:, 1].max() <= PARAMETERS.torque_max + 1e-3


def test_a_plans_lagged_commands_are_those_of_its_commands(info: Trajectory) -> None:
    assert info.x.shape == (CONFIG.steps + 1, 8)
    expected = lagged_commands(0.1 * np.arange(CONFIG.steps + 1), info.u)
    scale = np.array([0.3, 100.0])
    np.testing.assert_allclose(info.x[:, LAGGED] / scale, expected / scale, rtol=0, atol=1e-3)


def test_a_plans_path_is_the_learnt_cars(model: BayesianModel, info: Trajectory) -> None:
    """Its course turns with the learnt yaw rate and sideslip, not (as under Euler's step) with the nominal car's."""
    believed = step_model(model, model.prior())
    followed = believed.step(info.x[:-1], info.u[:-1], info.u[1:], np.zeros(CONFIG.steps))
    np.testing.assert_allclose(followed[:, 4:6], info.x[1:, 4:6], rtol=0, atol=2e-3)
    euler = step_model(model, model.prior(), "euler").step(info.x[:-1], info.u[:-1], info.u[1:], np.zeros(CONFIG.steps))
    assert np.abs(euler[:, 5] - info.x[1:, 5]).max() > 0.01


def test_a_bound_that_binds_is_kept(model: BayesianModel, info: Trajectory) -> None:
    """Half the wheel spin of the free plan."""
    free = np.abs(info.x[:, 3] - info.x[:, 1]).max()
    tight = plan_drive(model, model.prior(), dataclasses.replace(CONFIG, max_slip=0.5 * free), CONFIG.alpha)
    assert np.abs(tight.x[:, 3] - tight.x[:, 1]).max() < 0.5 * free + 0.02


def test_what_is_driven_is_learnt(model: BayesianModel, ocp: Trajectory, info: Trajectory) -> None:
    prior, totals = model.prior(), {}
    for name, trajectory in (("ocp", ocp), ("info", info)):
        table, ending = gather(trajectory, EFFECTS, PARAMETERS, CONFIG, 0)
        assert ending == "time"
        assert table["e"].abs().max() < CONFIG.half_width
        np.testing.assert_allclose(table[list(STATES)].to_numpy()[0], trajectory.x[0, :6], atol=0.3)
        after = learn_drive(model, prior, table, CONFIG)
        samples = samples_from_log(table, None, 0, 0)
        assert len(samples.x) == CONFIG.steps
        np.testing.assert_array_equal(samples.x[0, LAGGED], samples.u[0])
        np.testing.assert_array_equal(after.mean, learn(model, prior, samples).mean)
        totals[name] = covariance_norms(after)[1]
        # The car drives what was planned, so that it tells what was expected.
        expected = information_expected(model, prior, trajectory)
        assert information_gained(prior, after) == pytest.approx(expected, rel=0.3)
        obtained = information_cost(model, prior, "updated").information(samples.x, samples.u, samples.u_next)
        assert information_gained(prior, after) == pytest.approx(obtained, rel=1e-6)
    assert totals["info"] < totals["ocp"] < covariance_norms(prior)[1]


def test_a_drive_replays_to_the_bit(info: Trajectory) -> None:
    first, again, other = (gather(info, EFFECTS, PARAMETERS, CONFIG, seed)[0] for seed in (3, 3, 4))
    pd.testing.assert_frame_equal(first, again, check_exact=True)
    assert (first - other).abs().max().max() > 0.0


def test_a_later_rounds_repeat_of_the_first_drive_keeps_its_worth(model: BayesianModel, info: Trajectory) -> None:
    prior = model.prior()
    same = dataclasses.replace(CONFIG, objective_later=CONFIG.objective)
    assert round_alpha(model, prior, info, same) == pytest.approx(CONFIG.alpha)
    after = learn_drive(model, prior, gather(info, EFFECTS, PARAMETERS, CONFIG, 0)[0], CONFIG)
    alpha = round_alpha(model, after, info, CONFIG)
    again = information_cost(model, after, "drifts").information(info.x[:-1], info.u[:-1], info.u[1:])
    assert alpha > 2.0 * CONFIG.alpha
    assert alpha * again == pytest.approx(CONFIG.alpha * info.information)


def test_later_rounds_plan_for_the_drifts_to_come(
    model: BayesianModel, info: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[Any, ...]] = []
    monkeypatch.setattr(planning, "plan_drive", lambda *arguments: calls.append(arguments) or info)
    belief = learn_drive(model, model.prior(), gather(info, EFFECTS, PARAMETERS, CONFIG, 0)[0], CONFIG)
    plan_again(model, belief, info, CONFIG, 7)
    plan_again(model, belief, info, dataclasses.replace(CONFIG, objective_later="updated"))
    alpha = round_alpha(model, belief, info, CONFIG)
    assert calls[0] == (model, belief, dataclasses.replace(CONFIG, objective="drifts"), alpha, 7)
    assert calls[1][2].objective == "updated"


def test_a_plan_for_drifts_tells_more_of_them(model: BayesianModel, info: Trajectory) -> None:
    """More than plans for the paper's objectives, from the same belief."""
    belief = learn_drive(model, model.prior(), gather(info, EFFECTS, PARAMETERS, CONFIG, 0)[0], CONFIG)
    plans = {
        objective: plan_again(model, belief, info, dataclasses.replace(CONFIG, objective_later=objective), 1)
        for objective in get_args(Objective)
    }
    cost = information_cost(model, belief, "drifts")
    reported = {name: cost.information(drive.x[:-1], drive.u[:-1], drive.u[1:]) for name, drive in plans.items()}
    assert plans["drifts"].information == pytest.approx(reported["drifts"])
    assert reported["drifts"] > 1.05 * max(reported["eq8"], reported["updated"])


def test_a_checkpoint_without_drifts_is_named(model: BayesianModel) -> None:
    with pytest.raises(
        InvalidCheckpointError, match="names no drifts to plan for; train it anew, or choose objective 'updated'"
    ):
        information_cost(dataclasses.replace(model, drifts=None), model.prior(), "drifts")


def test_informative_plans_end_straight(model: BayesianModel, info: Trajectory) -> None:
    def excess(end: np.ndarray) -> float:
        sizes = [abs(sum(weight * end[state] for state, weight in weights.items())) for weights, _ in ENDS]
        return max(size / limit for size, (_, limit) in zip(sizes, ENDS, strict=True))

    free = plan_drive(model, model.prior(), dataclasses.replace(CONFIG, ends_straight=False), CONFIG.alpha)
    assert excess(info.x[-1]) < 1.01 < excess(free.x[-1])


def test_a_plan_that_is_not_feasible_is_refused(model: BayesianModel) -> None:
    with pytest.raises(InfeasiblePlanError, match="widen the lane, lower alpha or allow more iterations"):
        plan_drive(model, model.prior(), dataclasses.replace(CONFIG, starts=1, max_iterations=1), CONFIG.alpha)


def test_the_guess_that_leads_furthest_is_gone_on_with_and_the_next_where_it_fails() -> None:
    asked: list[tuple[float, int]] = []

    def solve(z: np.ndarray, y: np.ndarray | None = None, most: int | None = None) -> SqpResult:
        assert most is not None
        asked.append((z[0], most))
        cost, further = float(z[0]), y is not None
        residual = 0.1 if further and cost == 1.0 else 0.0  # from the first, the most promising, nothing feasible comes
        return SqpResult(z, z, cost - 10.0 * further, residual, "iterations", [])

    solver = cast(LineSearchSqp, SimpleNamespace(solve=solve, options=SqpOptions(max_iterations=60)))
    best = planning._best(solver, [np.array([cost]) for cost in (3.0, 1.0, 2.0)], False)
    assert best.cost == -8.0
    trial = planning.TRIAL
    assert asked == [(3.0, trial), (1.0, trial), (2.0, trial), (1.0, 60 - trial), (2.0, 60 - trial)]


def test_further_first_guesses_are_tried_where_none_leads_to_a_plan(
    model: BayesianModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []
    best = planning._best

    def fails_first(solver: LineSearchSqp, guesses: list[np.ndarray], only_converged: bool) -> SqpResult:
        asked.append(len(guesses))
        if len(asked) == 1:
            raise planning.InfeasiblePlanError("none")
        return best(solver, guesses, only_converged)

    monkeypatch.setattr(planning, "_best", fails_first)
    found = plan_drive(model, model.prior(), dataclasses.replace(CONFIG, starts=2), CONFIG.alpha)
    assert asked == [2, 4]
    assert found.information > 0.0
    asked.clear()
    with pytest.raises(planning.InfeasiblePlanError):
        plan_drive(model, model.prior(), CONFIG, 0.0)  # the plain OCP has no other guess


def test_the_lane_of_pictures_is_as_long_as_the_farthest_drive() -> None:
    near, far = (pd.DataFrame({"s": [0.0, s]}) for s in (5.0, 40.0))
    assert lane_for_pictures(CONFIG, [near]).distance == pytest.approx(0.5 * (7.5 + 11.0) * 1.2)
    assert lane_for_pictures(CONFIG, [near, far]).distance == pytest.approx(40.0)


def test_the_command_prints_four_models_and_which_to_drive_with(capsys: pytest.CaptureFixture[str]) -> None:
    main(Options(gathering=CONFIG))
    lines = capsys.readouterr().out.splitlines()
    head = next(i for i, line in enumerate(lines) if "alpha" in line)
    totals = {line.split()[0]: float(line.split()[-1]) for line in lines[head + 1 : -2] if "planned" not in line}
    assert list(totals) == ["prior", "Once-OCP", "Once-Info", "Twice-Info"]
    assert totals["Twice-Info"] < totals["Once-Info"] < totals["Once-OCP"] < totals["prior"]
    assert "likeliest with lags of" in lines[-2]
    assert "no car was identified" in lines[-1]  # of drives of 1.2 s


def test_the_graph_is_drawn(tmp_path: Path) -> None:
    main(Options(gathering=CONFIG, graph=True, out=tmp_path))
    assert list(tmp_path.glob("information_gathering.*"))
