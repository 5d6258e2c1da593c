"""Information gathering as the paper has it: its model, its objective in every round, its step, no bounds beyond."""

import dataclasses

import numpy as np
import pytest
from learnt_models import trainable_count

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import gather, learn_drive
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_drive, round_alpha
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model, paper_checkpoint
from drift_drake.drive.learnt.quality import step_model
from experiments.benchmarks.vehicles import draw_effects
from experiments.gathering.recipe import PAPER_ALPHA, Recipe, as_in_paper

CONFIG = as_in_paper(GatheringConfig(steps=12, v_end=11.0, starts=2, max_iterations=60))
EFFECTS = draw_effects("validation", 0, 0)


@pytest.fixture(scope="module")
def model() -> BayesianModel:
    return load_model(paper_checkpoint())


@pytest.fixture(scope="module")
def info(model: BayesianModel) -> Trajectory:
    return plan_drive(model, model.prior(), CONFIG, CONFIG.alpha)


def test_the_model_is_the_papers(model: BayesianModel) -> None:
    assert trainable_count(model) == 27012
    assert model.network.input_offset.shape == (8,)
    np.testing.assert_array_equal(model.sample_weight, np.ones(4))
    precision = np.linalg.inv(model.prior().covariance).reshape(4, 16, 4, 16)
    between = [np.abs(precision[i, :, j]).max() for i in range(4) for j in range(4) if i != j]
    assert max(between) < 1e-9 * np.abs(precision).max()
    config = model.record["config"]
    assert (config["horizons"], config["epochs"], config["learning_rate"], config["decay"]) == (
        [10],
        1000,
        1e-3,
        0.9975,
    )


def test_a_plans_path_is_eulers(model: BayesianModel, info: Trajectory) -> None:
    followed = step_model(model, model.prior(), "euler").step(info.x[:-1], info.u[:-1], info.u[1:], np.zeros(12))
    np.testing.assert_allclose(followed[:, 4:6], info.x[1:, 4:6], rtol=0, atol=2e-3)


def test_plans_are_not_bounded_beyond_the_lane(model: BayesianModel, info: Trajectory) -> None:
    narrow = dataclasses.replace(CONFIG, max_slip=0.1)
    free = plan_drive(model, model.prior(), narrow, narrow.alpha)
    np.testing.assert_array_equal(free.x, info.x)
    held = dataclasses.replace(narrow, bounded=True, qp="stagewise")  # OSQP does not bring it to convergence
    bounded = plan_drive(model, model.prior(), held, narrow.alpha)
    assert np.abs(bounded.x[:, 3] - bounded.x[:, 1]).max() < np.abs(free.x[:, 3] - free.x[:, 1]).max()


def test_the_information_weighs_the_same_in_every_round(model: BayesianModel, info: Trajectory) -> None:
    after = learn_drive(model, model.prior(), gather(info, EFFECTS, VehicleParameters(), CONFIG, 0)[0], CONFIG)
    assert round_alpha(model, after, info, CONFIG) == CONFIG.alpha
    assert CONFIG.objective == CONFIG.objective_later == "eq8"


def test_a_plan_that_has_not_converged_is_none(model: BayesianModel, info: Trajectory) -> None:
    assert info.status == "converged"
    hasty = dataclasses.replace(CONFIG, starts=1, max_iterations=3)
    with pytest.raises(InfeasiblePlanError, match="converged in 3 iterations; lower alpha or allow more iterations"):
        plan_drive(model, model.prior(), hasty, CONFIG.alpha)
    feasible = plan_drive(model, model.prior(), dataclasses.replace(hasty, only_converged=False, bounded=True), 0.1)
    assert feasible.status != "converged"


def test_the_recipe_has_a_weight_of_its_own() -> None:
    assert Recipe(as_in_paper=True).resolved().gathering.alpha == PAPER_ALPHA
    assert Recipe(as_in_paper=True, paper_alpha=4.0).resolved().gathering.alpha == 4.0
    total = Recipe(as_in_paper=True, paper_objective="updated").resolved().gathering
    assert total == dataclasses.replace(as_in_paper(GatheringConfig()), objective="updated", objective_later="updated")
    assert Recipe().resolved().gathering == GatheringConfig()
    with pytest.raises(InvalidOptionError, match=r"--gathering.alpha 3: .* give --paper-alpha 3"):
        Recipe(as_in_paper=True, gathering=GatheringConfig(alpha=3.0)).resolved()
