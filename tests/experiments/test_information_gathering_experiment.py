"""The information gathering experiment's books, and its sentence where the drives are missing."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.plan import Trajectory
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.command_lag import LAGGED, lagged_commands
from drift_drake.drive.learnt.features import FEATURE_COUNT
from drift_drake.drive.learnt.posterior import covariance_norms, update_all
from drift_drake.drive.learnt.samples import Samples
from experiments.drifting.errors import drifting_errors, judged_by_halves
from experiments.gathering.information_gathering import (
    InformationConfig,
    MissingDrivesError,
    full_weight_total,
    main,
    make_shared,
    random_steering,
)
from experiments.gathering.recipe import PAPER_ALPHA
from experiments.gathering.summary import markdown, stop_round, summarise, summarise_halves


def judged(total: float, error: float) -> dict[str, Any]:
    norms = [0.7 * total, 0.1 * total, 0.1 * total, 0.1 * total]
    return {"norms": norms, "total": total, "full_weight_total": 0.1 * total, "one_step": [error] * 4,
            "rollout": [error] * 4, "one_step_scaled": error, "rollout_scaled": error}  # fmt: skip


def driven(total: float, error: float, gain: float, ending: str = "time") -> dict[str, Any]:
    return judged(total, error) | {
        "driven_s": 4.5, "predicted": gain, "obtained": gain, "ending": ending, "max_e": 1.0, "max_beta": 0.2,
        "left_lane": ending == "spin", "plan_seconds": 4.0,
    }  # fmt: skip


def vehicle(twice: float, error: float, ending: str = "time") -> dict[str, Any]:
    return {
        "prior": judged(100.0, 3.0), "Once-OCP": driven(50.0, 2.5, 5.0), "random steering": driven(40.0, 2.5, 6.0),
        "slalom": driven(30.0, 2.5, 9.0), "rounds": [driven(20.0, 2.0, 20.0), driven(twice, error, 10.0, ending)],
    }  # fmt: skip


def test_counts_and_spreads() -> None:
    summary = summarise([vehicle(4.0, 1.0), vehicle(5.0, 2.2), vehicle(60.0, 1.5, "spin")], 0.1)
    assert list(summary["counts"].values()) == [2, 2, 2, 2]
    assert summary["prior total over Twice-Info's"]["median"] == pytest.approx(20.0)
    twice = summary["models"]["Twice-Info"]
    assert twice["total"] == {"best": 4.0, "median": 5.0, "worst": 60.0}
    assert twice["not driven to the end"] == 1
    assert twice["left the lane"] == 1
    assert summary["models"]["Once-Info"]["left the lane"] == 0
    assert "33.98" in markdown(summary | {"plan_seconds": {"OCP": 0.3}})


def test_plans_that_failed_are_counted_and_shown() -> None:
    """Without a second plan nothing is driven in its place; all vehicles may lack one."""
    without = vehicle(4.0, 1.0)
    del without["rounds"][1]
    without["stopped"] = "no first guess led to a plan that converged"
    found = vehicle(5.0, 2.0)
    found["rounds"][1]["status"] = "iterations"
    summary = summarise([without, found], 0.1)
    assert summary["plans"] == {"driven": 3, "not converged": 1, "failed": {"2": 1}}
    assert summary["rounds"][1]["vehicles"] == summary["models"]["Twice-Info"]["vehicles"] == 1
    text = markdown(summary | {"plan_seconds": {"OCP": 0.3}})
    assert "3 driven, 1 of them not converged; 1 failed and were not driven (1 of round 2)" in text
    alone = markdown(summarise([without, without], 0.1) | {"plan_seconds": {"OCP": 0.3}})
    assert "2 failed and were not driven (2 of round 2)" in alone


def test_a_track_has_no_baselines_and_its_drives_may_stop() -> None:
    found = vehicle(4.0, 1.0, "enough")
    del found["slalom"], found["random steering"]
    summary = summarise([found], 0.1)
    assert list(summary["models"]) == ["prior", "Once-OCP", "Once-Info", "Twice-Info"]
    assert summary["models"]["Twice-Info"]["not driven to the end"] == 0
    assert "| 2 | 4.5 (4.5 to 4.5) |" in markdown(summary | {"plan_seconds": {"OCP": 0.3}})


def test_the_rounds_stop_when_little_is_promised() -> None:
    gains = [100.0, 20.0, 11.0, 14.0, 5.0]
    rounds = [{"predicted": gain, "obtained": gain} for gain in gains]
    assert stop_round(rounds, 0.1) == 2
    assert stop_round(rounds, 0.05) == 4
    assert stop_round(rounds, 0.01) == 5


def test_missing_drives_are_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(
        MissingDrivesError, match=r"held_out\.npz: no such file; make the drives with `python -m experiments"
    ):
        main(InformationConfig(drives=tmp_path))


def test_the_papers_recipe_has_plans_of_a_cars_motion() -> None:
    """With one first guess, and with several."""
    shared = make_shared(InformationConfig(as_in_paper=True).resolved())
    for plan in (shared.ocp, shared.info, shared.slalom):
        assert plan.status == "converged"
        assert plan.x[:, 1].min() > 2.0
        assert np.abs(plan.x[:, 2]).max() < 0.3
    assert shared.info.alpha == PAPER_ALPHA


def test_random_steering_is_lagged_as_its_own_commands_are() -> None:
    config = GatheringConfig(steps=12)
    x, u = np.tile([0.0, 10.0, 0.0, 10.0, 0.3, 0.0, 0.0, 50.0], (13, 1)), np.tile([0.0, 50.0], (13, 1))
    shaken = random_steering(Trajectory(x, u, 1.0, 2.0, "converged"), config, np.random.default_rng(0))
    np.testing.assert_array_equal(shaken.x[:, :6], x[:, :6])
    np.testing.assert_array_equal(shaken.u[:, 1], u[:, 1])
    assert shaken.u[:, 0].std() > 0.01
    np.testing.assert_allclose(shaken.x[:, LAGGED], lagged_commands(0.1 * np.arange(13), shaken.u), rtol=1e-12)


def test_the_total_at_full_weight_is_that_of_samples_that_count_in_full() -> None:
    model = load_model()
    generator = np.random.default_rng(0)
    phi, y = generator.normal(size=(30, 4, FEATURE_COUNT)), generator.normal(size=(30, 4))
    assert (model.sample_weight < 1.0).all()
    belief = update_all(model.prior(), model.sigma, phi, y, model.sample_weight)
    full = update_all(model.prior(), model.sigma, phi, y)
    assert full_weight_total(model, belief) == pytest.approx(covariance_norms(full)[1], rel=1e-6)


def test_halves_of_the_own_drives_judge_what_the_other_half_taught() -> None:
    model = load_model()
    generator = np.random.default_rng(1)
    count = 60
    x = np.array([0.5, 13.0, -0.5, 17.0, 0.0, 0.0]) + 0.1 * generator.normal(size=(4 * count, 6))
    u = np.array([-0.2, 150.0]) + np.array([0.05, 20.0]) * generator.normal(size=(4 * count, 2))
    x = np.hstack([x, u])  # settled lags
    truth = model.prior().mean + 0.5 * generator.normal(size=model.prior_mean.shape)
    x_next = BayesianStepModel(model.network, truth, model.vehicle.constants(), path_step="trapezoid").step(
        x, u, u, np.zeros(len(x))
    )
    samples = Samples(x, u, u, x_next, np.zeros(len(x)), np.zeros(len(x), dtype=int), np.repeat(np.arange(4), count))
    prior = model.prior()
    found = judged_by_halves(model, {"prior": prior, "Once-Info": prior._replace(mean=truth)}, samples)
    assert list(found) == ["prior", "prior and own drives", "Once-Info", "Once-Info and own drives"]
    assert found["Once-Info"]["one_step"] < 1e-6  # it is the truth
    assert found["prior and own drives"]["one_step"] < 0.5 * found["prior"]["one_step"]
    halves = [drifting_errors(model, prior, samples.where(samples.drive % 2 == k))["one_step_scaled"] for k in (0, 1)]
    assert found["prior"]["one_step"] == pytest.approx(np.sqrt(np.mean(np.square(halves))))
    summary = summarise_halves([found, found])
    assert summary["prior"]["one_step"]["below Once-Info"] == 0
    assert summary["prior"]["one_step"]["median"] == pytest.approx(found["prior"]["one_step"])
    short = {name: kinds | {"rollout": None} for name, kinds in found.items()}  # as JSON holds it: no drift of 2 s
    alone, both = (summarise_halves(vehicles)["prior"]["rollout"] for vehicles in ([found], [found, short]))
    assert both["below Once-Info"] == alone["below Once-Info"]
