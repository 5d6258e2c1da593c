"""The learnt one-step model: its parts, its Jacobians, its path coordinates."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import derivatives
from drift_drake.car.step_model import StepModel
from drift_drake.drive.gathering.information import StageInformation, UpdatedInformation
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel, PathStep, euler_step, residual
from drift_drake.drive.learnt.command_lag import LAG, LAGGED
from drift_drake.drive.learnt.features import Network, features, network_inputs

CAR = VehicleParameters().constants()
OTHER_LAG = np.array([0.2, 0.03])


@pytest.fixture(scope="module", params=["z alone", "with physical inputs", "of other lags"])
def network(request, random_network: Network, physical_network: Network) -> Network:
    if request.param == "of other lags":
        return physical_network._replace(lag=tuple(OTHER_LAG))
    return random_network if request.param == "z alone" else physical_network


def lag_of(network: Network) -> np.ndarray:
    return np.array(network.lag)


def model_of(network: Network, theta: np.ndarray, path_step: PathStep = "trapezoid") -> BayesianStepModel:
    return BayesianStepModel(network, theta, CAR, path_step)


@pytest.fixture(scope="module")
def theta() -> np.ndarray:
    scale = np.array([0.05, 0.1, 0.02, 1.0])
    return scale[:, None] * np.random.default_rng(5).normal(size=(4, 16))


def horizon(count: int = 45) -> tuple[np.ndarray, ...]:
    generator = np.random.default_rng(6)
    centre, spread = np.array([0.4, 11.0, -0.5, 17.0, 0.0, 0.0]), np.array([0.5, 2.0, 0.2, 3.0, 0.8, 0.15])
    x = centre + spread * generator.normal(size=(count, 6))
    u = np.array([-0.2, 180.0]) + np.array([0.2, 60.0]) * generator.normal(size=(count, 2))
    u_next = u + np.array([0.05, 20.0]) * generator.normal(size=(count, 2))
    curvature = generator.uniform(-0.06, 0.06, count)
    lagged = u + np.array([0.1, 40.0]) * generator.normal(size=(count, 2))
    return np.hstack([x, lagged]), u, u_next, curvature


def test_step_is_euler_of_the_nominal_car_plus_the_learnt_part(network: Network, theta: np.ndarray) -> None:
    x, u, u_next, curvature = horizon()
    step = model_of(network, theta, "euler").step(x, u, u_next, curvature)
    given = x[:, LAGGED] + LAG / lag_of(network) * (u - x[:, LAGGED])  # to a car of typical lags
    expected = x[:, :6] + 0.1 * derivatives(x[:, :6], given, curvature, CAR)
    expected[:, 3] = 0.0
    np.testing.assert_allclose(euler_step(x[:, :6], given, curvature, CAR), expected, rtol=0, atol=1e-12)
    learnt = np.sum(theta * features(network, network_inputs(x, u, u_next)), axis=-1)
    expected[:, :4] += learnt
    np.testing.assert_allclose(step[:, :6], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(residual(x, given, step, CAR), learnt, rtol=0, atol=1e-12)


@pytest.mark.parametrize("path_step", ["euler", "trapezoid"])
def test_the_lagged_commands_run_after_the_commands(network: Network, theta: np.ndarray, path_step: PathStep) -> None:
    x, u, u_next, curvature = horizon()
    step = model_of(network, theta, path_step).step(x, u, u_next, curvature)
    lagged, fine = x[:, LAGGED], 10_000
    for k in range(fine):  # implicit midpoint steps of lag d lagged/dt = command - lagged
        command = u + (k + 0.5) / fine * (u_next - u)
        ratio = 0.1 / fine / lag_of(network)
        lagged = ((1.0 - 0.5 * ratio) * lagged + ratio * command) / (1.0 + 0.5 * ratio)
    np.testing.assert_allclose(step[:, LAGGED], lagged, rtol=1e-7, atol=1e-9)


def test_a_car_of_other_lags_is_a_typical_one_given_other_commands(
    physical_network: Network, theta: np.ndarray
) -> None:
    """The same states, road wheel and engine torque at both ends of the step: the same motion."""
    x, u, u_next, curvature = horizon()
    other = physical_network._replace(lag=tuple(OTHER_LAG))
    step = model_of(other, theta).step(x, u, u_next, curvature)
    given, given_next = (a + LAG / OTHER_LAG * (c - a) for a, c in ((x[:, LAGGED], u), (step[:, LAGGED], u_next)))
    typical = model_of(physical_network, theta).step(x, given, given_next, curvature)
    np.testing.assert_allclose(step[:, :6], typical[:, :6], rtol=0, atol=1e-12)
    assert np.abs(step[:, :4] - model_of(physical_network, theta).step(x, u, u_next, curvature)[:, :4]).max() > 0.01


@pytest.mark.parametrize("path_step", ["euler", "trapezoid"])
def test_jacobians_equal_finite_differences(network: Network, theta: np.ndarray, path_step: PathStep) -> None:
    model = model_of(network, theta, path_step)
    x, u, u_next, curvature = horizon()
    value, a, b, b_next = model.linearize(x, u, u_next, curvature)
    np.testing.assert_allclose(value, model.step(x, u, u_next, curvature), rtol=0, atol=1e-13)
    assert value.shape == (45, 8)
    variables, scales = np.hstack([x, u, u_next]), np.array([1, 10, 1, 10, 1, 1, 1, 100, 1, 100, 1, 100.0])

    def step(flat: np.ndarray) -> np.ndarray:
        return model.step(flat[:, :8], flat[:, 8:10], flat[:, 10:], curvature)

    jacobian = np.concatenate([a, b, b_next], axis=-1)
    for j in range(12):
        h = np.zeros(12)
        h[j] = 1e-6 * scales[j]
        numeric = (step(variables + h) - step(variables - h)) / (2.0 * h[j])
        np.testing.assert_allclose(jacobian[:, :, j] * scales[j], numeric * scales[j], rtol=0, atol=5e-7)


@pytest.mark.parametrize("path_step", ["euler", "trapezoid"])
def test_the_weighted_curvature_is_the_weighted_jacobians_derivative(
    network: Network, theta: np.ndarray, path_step: PathStep
) -> None:
    model = model_of(network, theta, path_step)
    x, u, u_next, curvature = horizon()
    weights = np.random.default_rng(8).normal(size=(45, 8)) / np.array([1, 10, 1, 10, 1, 1, 1, 100])
    variables, scales = np.hstack([x, u, u_next]), np.array([1, 10, 1, 10, 1, 1, 1, 100, 1, 100, 1, 100.0])
    numeric = np.empty((45, 12, 12))
    for j in range(12):
        moved = variables + np.array([1e-6, -1e-6])[:, None, None] * scales[j] * np.eye(12)[j]
        up, down = (model.weighted_gradient(p[:, :8], p[:, 8:10], p[:, 10:], curvature, weights) for p in moved)
        numeric[:, j] = (up - down) * scales / 2e-6
    found = model.weighted_curvature(x, u, u_next, curvature, weights) * scales[:, None] * scales
    close = np.abs(found - numeric).max(axis=(1, 2)) < 1e-4 * np.abs(numeric).max()
    assert close.sum() >= 44  # one stage lies where a tyre begins to slide: its second derivatives jump there


def test_the_expanded_model_is_the_same(network: Network, theta: np.ndarray) -> None:
    x, u, u_next, curvature = horizon()
    model = model_of(network, theta)
    np.testing.assert_allclose(
        model.expanded().step(x, u, u_next, curvature), model.step(x, u, u_next, curvature), rtol=0, atol=1e-12
    )
    found, expected = (m.linearize(x, u, u_next, curvature) for m in (model.expanded(), model))
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-10)
    changed = model.expanded().with_theta(2.0 * theta)
    np.testing.assert_allclose(
        changed.step(x, u, u_next, curvature), model.with_theta(2.0 * theta).step(x, u, u_next, curvature), atol=1e-12
    )


@pytest.mark.parametrize("updated", [False, True])
def test_second_derivatives_with_a_cost_are_the_sum(network: Network, theta: np.ndarray, updated: bool) -> None:
    """Whether the cost's features are the model's own or taken by themselves."""
    x, u, u_next, curvature = horizon(9)
    model, weights = model_of(network, theta), np.random.default_rng(8).normal(size=(9, 8))
    kind = UpdatedInformation if updated else StageInformation
    apart = kind(network, 0.1 * np.eye(64), 1.7).expansion(x, u, u_next)
    own = kind(network, 0.1 * np.eye(64), 1.7, model.expansions).expansion(x, u, u_next)
    expected = model.weighted_curvature(x, u, u_next, curvature, weights) + apart.curvature()
    for cost in (apart, own):
        found = model.curvature_with(x, u, u_next, curvature, weights, cost)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_another_theta_changes_the_step_and_not_the_first_model(network: Network, theta: np.ndarray) -> None:
    x, u, u_next, curvature = horizon(10)
    model = model_of(network, theta)
    before = model.step(x, u, u_next, curvature)
    np.testing.assert_array_equal(
        model.with_theta(2.0 * theta).step(x, u, u_next, curvature),
        model_of(network, 2.0 * theta).step(x, u, u_next, curvature),
    )
    np.testing.assert_array_equal(model.step(x, u, u_next, curvature), before)


def test_an_offset_moves_the_learnt_states_and_what_follows_from_them(network: Network, theta: np.ndarray) -> None:
    x, u, u_next, curvature = horizon(10)
    model, offset = model_of(network, theta), np.array([0.02, -0.05, 0.01, 0.1])
    moved = model.with_theta(np.append(theta.ravel(), offset))
    difference = moved.step(x, u, u_next, curvature) - model.step(x, u, u_next, curvature)
    np.testing.assert_allclose(difference[:, :4], np.tile(offset, (10, 1)), atol=1e-12)
    assert np.abs(difference[:, 4:6]).min() > 0.0
    found, expected = moved.linearize(x, u, u_next, curvature), StepModel.linearize(moved, x, u, u_next, curvature)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-4)
    again = moved.with_theta(theta).step(x, u, u_next, curvature)  # which says nothing of an offset
    np.testing.assert_array_equal(again, model.step(x, u, u_next, curvature))


def test_two_numbers_after_an_offset_are_the_lags_of_steering_and_torque(
    physical_network: Network, theta: np.ndarray
) -> None:
    x, u, u_next, curvature = horizon(10)
    given = np.concatenate([theta.ravel(), np.zeros(4), OTHER_LAG])
    found = model_of(physical_network, np.zeros((4, 16))).with_theta(given)
    np.testing.assert_array_equal(found.lag, OTHER_LAG)
    expected = model_of(physical_network._replace(lag=tuple(OTHER_LAG)), theta).step(x, u, u_next, curvature)
    np.testing.assert_allclose(found.step(x, u, u_next, curvature), expected, rtol=0, atol=1e-12)


def test_trapezoid_follows_a_circle_that_euler_leaves(network: Network) -> None:
    # A body that turns steadily along a circle must stay on a path of that circle; the learnt part is set to say so.
    radius, v, beta = 18.0, 11.0, -0.5
    u, curvature = np.array([[-0.3, 150.0]]), np.array([1.0 / radius])
    x = np.hstack([[[v / radius, v, beta, 15.0, 0.0, 0.0]], u])  # the lags are settled
    learnt = residual(x, u, x, CAR)
    constant = Network(
        network.input_offset, network.input_scale, network.w1, network.b1, network.w2, network.b2,
        np.zeros_like(network.w_out), np.tile(learnt[0][:, None], (1, 16)), network.nominal)  # fmt: skip
    theta = np.full((4, 16), 1.0 / 16.0)
    start = x.copy()
    for _ in range(10):
        x = BayesianStepModel(constant, theta, CAR, path_step="trapezoid").step(x, u, u, curvature)
    np.testing.assert_allclose(x, start, rtol=0, atol=1e-9)
    assert abs(BayesianStepModel(constant, theta, CAR, path_step="euler").step(start, u, u, curvature)[0, 5]) > 1e-3
