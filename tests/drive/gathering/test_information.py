"""The information objective against the paper's formulas, and Info-OCP's solutions against SNOPT and IPOPT."""

import numpy as np
import pytest
from control_problems import check_against_referees, check_curvature, check_gradient, lane_ocp, stages
from scipy.linalg import block_diag

from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.information import InformationCost, StageInformation, UpdatedInformation, bent
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.features import features, network_inputs
from drift_drake.drive.learnt.posterior import state_blocks, update, weighed
from drift_drake.drive.mpc.ocp import OptimalControlProblem
from drift_drake.drive.mpc.sqp import LineSearchSqp, SqpOptions

ALPHA = 1.7
KINDS = {False: StageInformation, True: UpdatedInformation}


def cost(model: BayesianModel, updated: bool) -> InformationCost:
    return KINDS[updated](model.network, model.prior().covariance, ALPHA)


def rows(model: BayesianModel, x: np.ndarray, u: np.ndarray, u_next: np.ndarray) -> np.ndarray:
    """Phi [4, 64] of one stage: each state's features in its own place."""
    return block_diag(*(phi[None] for phi in features(model.network, network_inputs(x, u, u_next))))


@pytest.mark.parametrize("updated", [False, True])
def test_without_coupling_the_value_is_equation_8(model: BayesianModel, updated: bool) -> None:
    """Each state by itself, with its covariance of before the drive or after the stages before by eq. (6)."""
    x, u, u_next = stages(5, 0)
    blocks = state_blocks(model.prior().covariance).copy()
    objective = KINDS[updated](model.network, block_diag(*blocks), ALPHA)
    expected = 0.0
    for k in range(5):
        phi = features(model.network, network_inputs(x[k], u[k], u_next[k]))
        for i in range(4):
            gain = blocks[i] @ phi[i]
            expected += 0.5 * np.log(1.0 + phi[i] @ gain)
            if updated:
                blocks[i] -= np.outer(gain, gain) / (1.0 + phi[i] @ gain)
    assert objective.information(x, u, u_next) == pytest.approx(expected, rel=1e-8)
    assert objective.value(x, u, u_next) == pytest.approx(-ALPHA * expected, rel=1e-8)


def test_the_value_is_what_the_determinant_loses_at_each_stage(model: BayesianModel) -> None:
    x, u, u_next = stages(5, 0)
    precision = np.linalg.inv(model.prior().covariance)
    expected = 0.0
    for k in range(5):
        phi = rows(model, x[k], u[k], u_next[k])
        expected += 0.5 * (np.linalg.slogdet(precision + phi.T @ phi)[1] - np.linalg.slogdet(precision)[1])
    assert cost(model, False).information(x, u, u_next) == pytest.approx(expected, rel=1e-9)
    assert cost(model, False).value(x, u, u_next) == pytest.approx(-ALPHA * expected, rel=1e-9)
    # States that know of each other tell less together than each by itself.
    apart = StageInformation(model.network, block_diag(*state_blocks(model.prior().covariance)), ALPHA)
    assert expected < apart.information(x, u, u_next)


def test_the_updated_value_is_the_recursion_of_equation_5(model: BayesianModel) -> None:
    x, u, u_next = stages(7, 1)
    belief, expected = model.prior(), 0.0
    for k in range(7):
        phi = rows(model, x[k], u[k], u_next[k])
        expected += 0.5 * np.linalg.slogdet(np.eye(4) + phi @ belief.covariance @ phi.T)[1]
        own = features(model.network, network_inputs(x[k], u[k], u_next[k]))
        belief = update(belief, model.sigma, own, np.zeros(4))
    assert cost(model, True).information(x, u, u_next) == pytest.approx(expected, rel=1e-8)
    before, after = (np.linalg.slogdet(c)[1] for c in (model.prior().covariance, belief.covariance))
    assert expected == pytest.approx(0.5 * (before - after), rel=1e-7)
    assert expected < cost(model, False).information(x, u, u_next)


@pytest.mark.parametrize("updated", [False, True])
def test_a_weighed_covariance_gives_what_weighed_samples_tell(model: BayesianModel, updated: bool) -> None:
    x, u, u_next = stages(6, 4)
    weight = np.array([0.1, 1.0, 0.4, 0.03])
    prior = model.prior()
    belief, expected = prior, 0.0
    for k in range(6):
        own = features(model.network, network_inputs(x[k], u[k], u_next[k]))
        after = update(belief, model.sigma, own, np.zeros(4), weight)
        expected += 0.5 * (np.linalg.slogdet(belief.covariance)[1] - np.linalg.slogdet(after.covariance)[1])
        belief = after if updated else prior
    objective = KINDS[updated](model.network, weighed(prior.covariance, weight), 1.0)
    assert objective.information(x, u, u_next) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("updated", [False, True])
def test_the_derivatives_are_exact(model: BayesianModel, updated: bool) -> None:
    check_gradient(cost(model, updated), 1e-5)
    check_curvature(cost(model, updated))


def test_traces_of_any_number_of_stages_are_those_of_the_matrices() -> None:
    """tr(L D_a A D_b'), L of each stage, with each state's row of D in that state's place."""
    generator, count = np.random.default_rng(5), 7
    tangents, left = generator.normal(size=(count, 10, 4, 16)), generator.normal(size=(count, 4, 4))
    matrix = generator.normal(size=(64, 64))
    left, matrix = left + left.swapaxes(1, 2), matrix + matrix.T
    found = bent(tangents, (left, matrix))
    for n in range(count):
        d = [block_diag(*(row[None] for row in one)) for one in tangents[n]]
        expected = [[np.trace(left[n] @ a @ matrix @ b.T) for b in d] for a in d]
        np.testing.assert_allclose(found[n], expected, rtol=1e-9, atol=1e-9)


def test_a_models_further_states_carry_no_information(model: BayesianModel) -> None:
    """Those behind the lagged commands."""
    objective = cost(model, False)
    x, u, u_next = stages(3, 3)
    longer = np.concatenate([x, np.ones((3, 2))], axis=1)
    assert objective.value(longer, u, u_next) == objective.value(x, u, u_next)
    gradient = objective.expansion(longer, u, u_next).gradient()
    plain = objective.expansion(x, u, u_next).gradient()
    np.testing.assert_array_equal(gradient[:, :8], plain[:, :8])
    np.testing.assert_array_equal(gradient[:, 8:10], 0.0)
    np.testing.assert_array_equal(gradient[:, 10:], plain[:, 8:])


def info_ocp(model: BayesianModel, steps: int, updated: bool = False, count: int = 2,
             alpha: float = 0.3) -> tuple[OptimalControlProblem, list[np.ndarray]]:  # fmt: skip
    covariance = weighed(model.prior().covariance, model.sample_weight)
    return lane_ocp(model, steps, KINDS[updated](model.network, covariance, alpha), count)


@pytest.mark.parametrize("updated", [pytest.param(False, marks=pytest.mark.slow), True])
def test_the_sqp_finds_what_snopt_and_ipopt_find(model: BayesianModel, updated: bool) -> None:
    """There are several local optima: what is compared is the best value of the same first guesses."""
    check_against_referees(*info_ocp(model, 6, updated))


@pytest.mark.slow
def test_the_sqp_finds_what_snopt_and_ipopt_find_of_ten_starts(model: BayesianModel) -> None:
    check_against_referees(*info_ocp(model, 12, count=10))


def test_each_qp_is_convex(model: BayesianModel) -> None:
    """The objective's own curvature is negative; what goes to OSQP is not."""
    problem, guesses = info_ocp(model, 6)
    solver = LineSearchSqp(problem)
    assert problem.extra_cost is not None
    for guess in guesses:
        z = guess + 0.02 * np.random.default_rng(1).normal(size=guess.size)
        scale = problem.layout.block_scale
        raw = problem.stage_hessian() + problem.extra_cost.expansion(z).curvature() * scale[:, None] * scale
        assert np.linalg.eigvalsh(raw).min() < -1e-3
        blocks = solver._lagrangian_blocks(z, np.zeros(solver.multiplier_count))
        assert np.linalg.eigvalsh(blocks).min() > -1e-9


def test_information_draws_the_plan_from_the_straight_line(model: BayesianModel) -> None:
    problem, guesses = info_ocp(model, 8, alpha=GatheringConfig().alpha)
    result = LineSearchSqp(problem, SqpOptions(max_iterations=60, tolerance=1e-4)).solve(guesses[1])
    x, u, _ = problem.unstack(result.z)
    straight_x, straight_u, _ = problem.unstack(guesses[0])
    objective = StageInformation(model.network, weighed(model.prior().covariance, model.sample_weight), 1.0)
    straight = objective.information(straight_x[:-1], straight_u[:-1], straight_u[1:])
    assert objective.information(x[:-1], u[:-1], u[1:]) > 1.5 * straight
