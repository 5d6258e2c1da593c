"""Information about a task: what an unknown theta costs along a reference, against the closed loop itself."""

import numpy as np
import pytest
from control_problems import check_curvature, check_gradient, stages

from drift_drake.drive.gathering.control_information import ControlInformation, Task, figure_8_task, sensitivities
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.features import features, network_inputs
from drift_drake.drive.learnt.posterior import update_all
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.mpc.ocp import OcpWeights
from drift_drake.drive.mpc.tracking import lqr_gains

ALPHA = 1.7
WEIGHTS = OcpWeights().state()


@pytest.fixture(scope="module")
def believed(model: BayesianModel) -> BayesianStepModel:
    return step_model(model, model.prior())


@pytest.fixture(scope="module")
def task(model: BayesianModel) -> Task:
    """Two seconds into the first transition."""
    x, u, curvature = figure_8_task(model.vehicle)
    return Task(x[30:51], u[30:51], curvature[30:50])


@pytest.fixture(scope="module")
def cost(model: BayesianModel, believed: BayesianStepModel, task: Task) -> ControlInformation:
    return ControlInformation(model, believed, model.prior().covariance, task, WEIGHTS, ALPHA)


def test_the_task_is_a_lap_of_the_figure_8(model: BayesianModel) -> None:
    x, u, curvature = figure_8_task(model.vehicle)
    assert x.shape == (len(u), 8)
    assert len(curvature) == len(u) - 1
    assert x[:, 2].min() < -0.55
    assert x[:, 2].max() > 0.55  # drifts to both sides
    assert (x[:, 4:6] == 0.0).all()


def deviations(believed: BayesianStepModel, task: Task, theta: np.ndarray) -> np.ndarray:
    """sqrt(Q) d_k [N, 6] in the closed loop of a car of another theta."""
    x, u, curvature = task.x[:-1], task.u, task.curvature
    _, a, b, b_next = believed.linearize(x, u[:-1], u[1:], curvature)
    gains, followed = lqr_gains(a, b + b_next), believed.step(x, u[:-1], u[1:], curvature)
    car, d, found = believed.with_theta(theta), np.zeros(8), []
    for k in range(len(x)):
        correction = gains[k] @ d
        at = (x[[k]] + d, u[[k]] + correction, u[[k + 1]] + correction, curvature[[k]])
        d = car.step(*at)[0] - followed[k]
        found.append(np.sqrt(WEIGHTS) * d[:6])
    return np.array(found)


def test_the_sensitivities_are_the_closed_loops(model: BayesianModel, believed: BayesianStepModel, task: Task) -> None:
    rows, _ = sensitivities(model, believed, task, WEIGHTS)
    theta = model.prior().mean
    direction = np.random.default_rng(0).normal(size=64)
    step = 1e-4 * (direction.reshape(4, 16) * model.sigma[:, None])
    up, down = (deviations(believed, task, theta + sign * step) for sign in (1.0, -1.0))
    expected = (up - down).ravel() / 2e-4
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(rows @ direction, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def test_the_noise_costs_what_each_steps_errors_cost(
    model: BayesianModel, believed: BayesianStepModel, task: Task
) -> None:
    """Of a task that starts at step j, the first step's error in each learnt state; summed over j."""
    short = Task(task.x[:6], task.u[:6], task.curvature[:5])
    _, noise = sensitivities(model, believed, short, WEIGHTS)
    _, a, b, b_next = believed.linearize(short.x[:-1], short.u[:-1], short.u[1:], short.curvature)
    closed = a + (b + b_next) @ lqr_gains(a, b + b_next)
    enters = believed.disturbance(short.x[:-1], short.u[:-1], short.u[1:], short.curvature)
    expected = 0.0
    for j in range(5):
        for i in range(4):
            d = enters[j, :, i] * model.sigma[i]
            for k in range(j, 5):
                expected += float(WEIGHTS @ d[:6] ** 2)
                d = closed[k + 1] @ d if k < 4 else d
    assert noise == pytest.approx(expected, rel=1e-9)


def test_an_error_of_the_step_enters_the_path_too(
    model: BayesianModel, believed: BayesianStepModel, task: Task
) -> None:
    at = task.x[:-1], task.u[:-1], task.u[1:], task.curvature
    theta = model.prior().mean.copy()
    moved = theta.copy()
    moved[2, 3] += 1e-5
    change = (believed.with_theta(moved).step(*at) - believed.with_theta(theta).step(*at)) / 1e-5
    phi = features(model.network, network_inputs(*at[:3]))[:, 2, 3]
    np.testing.assert_allclose(change, believed.disturbance(*at)[:, :, 2] * phi[:, None], rtol=1e-4, atol=1e-7)
    assert np.abs(change[:, 5]).max() > 0.01
    euler = step_model(model, model.prior(), "euler").disturbance(*at)
    assert (euler[:, 4:] == 0.0).all()


def test_the_value_is_by_how_much_the_expected_cost_falls(
    model: BayesianModel, believed: BayesianStepModel, task: Task, cost: ControlInformation
) -> None:
    x, u, u_next = stages(7, 0)
    rows, noise = sensitivities(model, believed, task, WEIGHTS)
    prior, phi = model.prior(), features(model.network, network_inputs(x, u, u_next))
    after = update_all(prior, model.sigma, phi, np.zeros((7, 4)), model.sample_weight)
    before, left = (noise + np.trace(rows @ belief.covariance @ rows.T) for belief in (prior, after))
    assert cost.information(x, u, u_next) == pytest.approx(0.5 * np.log(before / left), rel=1e-7)
    assert cost.value(x, u, u_next) == pytest.approx(-ALPHA * 0.5 * np.log(before / left), rel=1e-7)
    assert before > 1.2 * left


def test_the_derivatives_are_exact(cost: ControlInformation) -> None:
    check_gradient(cost, 1e-6)


def test_curvature_is_taken_with_the_expected_cost_held_below(
    model: BayesianModel, believed: BayesianStepModel, task: Task, cost: ControlInformation
) -> None:
    rows, noise = sensitivities(model, believed, task, WEIGHTS)

    def expected(x: np.ndarray, u: np.ndarray, u_next: np.ndarray) -> float:
        phi = features(model.network, network_inputs(x, u, u_next))
        after = update_all(model.prior(), np.ones(4), phi, np.zeros((len(x), 4)), model.sample_weight)
        return float(noise + np.trace(rows @ after.covariance @ rows.T))

    held = expected(*stages(4, 2))
    check_curvature(cost, lambda *at: ALPHA * 0.5 * expected(*at) / held)
