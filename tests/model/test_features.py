"""The network at run time: parameter count, shapes, Jacobians."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from drift_drake.model.feature_expansion import FeatureExpansion
from drift_drake.model.features import (
    FEATURE_COUNT,
    HIDDEN_COUNT,
    INPUT_COUNT,
    INPUT_OFFSET,
    INPUT_SCALE,
    PAPER_COUNT,
    MeanFunction,
    Network,
    all_inputs,
    feature_jacobian,
    features,
    information_gain,
    network_inputs,
)
from drift_drake.model.posterior import state_blocks


@pytest.fixture(scope="module", params=["z alone", "with physical inputs"])
def network(request, random_network: Network, physical_network: Network) -> Network:
    return random_network if request.param == "z alone" else physical_network


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    return INPUT_OFFSET + INPUT_SCALE * np.random.default_rng(4).normal(size=(45, INPUT_COUNT))


def central_difference(function, z: np.ndarray) -> np.ndarray:
    columns = []
    for j in range(INPUT_COUNT):
        step = np.zeros(INPUT_COUNT)
        step[j] = 1e-5 * INPUT_SCALE[j]
        columns.append((function(z + step) - function(z - step)) / (2.0 * step[j]))
    return np.stack(columns, axis=-1)


def test_features_are_the_networks_formula(network: Network, points: np.ndarray) -> None:
    z = points[0]
    inputs = all_inputs(z, network.nominal)
    h1 = np.tanh(network.w1.T @ ((inputs - network.input_offset) / network.input_scale) + network.b1)
    h2 = np.tanh(network.w2.T @ h1 + network.b2)
    expected = np.stack([network.w_out[i].T @ h2 + network.b_out[i] for i in range(4)])
    np.testing.assert_allclose(features(network, z), expected, rtol=0, atol=1e-13)
    assert features(network, points.reshape(9, 5, INPUT_COUNT)).shape == (9, 5, 4, FEATURE_COUNT)
    assert network.w2.shape == (HIDDEN_COUNT, HIDDEN_COUNT)


def test_inputs_are_states_commands_and_lagged_commands() -> None:
    x, u, u_next = np.arange(8.0), np.array([10.0, 11.0]), np.array([12.0, 13.0])
    z = network_inputs(x, u, u_next)
    np.testing.assert_array_equal(z, [0, 1, 2, 3, 10, 11, 12, 13, 6, 7])  # of the path's e and dphi nothing
    batch = network_inputs(np.tile(x, (2, 3, 1)), np.tile(u, (2, 3, 1)), np.tile(u_next, (2, 3, 1)))
    np.testing.assert_array_equal(batch, np.tile(z, (2, 3, 1)))


def test_the_papers_network_alone_does_not_hear_the_lagged_commands(
    random_network: Network, physical_network: Network, points: np.ndarray
) -> None:
    other = points.copy()
    other[:, PAPER_COUNT:] += INPUT_SCALE[PAPER_COUNT:]
    np.testing.assert_array_equal(features(random_network, points), features(random_network, other))
    np.testing.assert_array_equal(feature_jacobian(random_network, points)[1][..., PAPER_COUNT:], 0.0)
    assert np.abs(features(physical_network, points) - features(physical_network, other)).max(axis=(1, 2)).min() > 1e-2


def test_feature_jacobian_equals_finite_differences(network: Network, points: np.ndarray) -> None:
    phi, jacobian = feature_jacobian(network, points)
    np.testing.assert_allclose(phi, features(network, points), rtol=0, atol=1e-13)
    numeric = central_difference(lambda z: features(network, z), points)
    np.testing.assert_allclose(jacobian * INPUT_SCALE, numeric * INPUT_SCALE, rtol=0, atol=1e-8)


def test_the_expansion_has_the_features_their_jacobian_and_its_differences(
    network: Network, points: np.ndarray
) -> None:
    expansion, (phi, jacobian) = FeatureExpansion(network, points), feature_jacobian(network, points)
    np.testing.assert_allclose(expansion.phi, phi, rtol=0, atol=1e-13)
    tangents = np.moveaxis(expansion.tangents, 1, 3)
    np.testing.assert_allclose(tangents * INPUT_SCALE, jacobian * INPUT_SCALE, rtol=0, atol=1e-12)
    weights = np.random.default_rng(7).normal(size=phi.shape)
    numeric = central_difference(lambda z: np.einsum("nif,nifz->nz", weights, feature_jacobian(network, z)[1]), points)
    scale = INPUT_SCALE[:, None] * INPUT_SCALE
    found = expansion.second(weights)
    # Those of the physical inputs are one-sided differences.
    np.testing.assert_allclose(found * scale, numeric * scale, rtol=0, atol=1e-4 * np.abs(numeric * scale).max())


def test_mean_function_folds_theta(network: Network, points: np.ndarray) -> None:
    generator = np.random.default_rng(5)
    theta, other = generator.normal(size=(2, 4, FEATURE_COUNT))
    mean = MeanFunction(network, theta)
    phi, slope = feature_jacobian(network, points)
    value, jacobian = mean.linearize(points)
    np.testing.assert_allclose(mean.value(points), value, rtol=0, atol=1e-13)
    np.testing.assert_allclose(value, np.sum(phi * theta, axis=-1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        jacobian * INPUT_SCALE, np.einsum("nifj,if->nij", slope, theta) * INPUT_SCALE, atol=1e-12
    )
    # Another theta, another batch size: neither disturbs what was returned, nor what the first one returns.
    kept = value.copy()
    changed = mean.with_theta(other).value(points[:7])
    np.testing.assert_allclose(changed, np.sum(phi[:7] * other, axis=-1), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(value, kept)
    np.testing.assert_array_equal(mean.linearize(points)[0], kept)


def test_information_gain_without_coupling_is_equation_8(network: Network, points: np.ndarray) -> None:
    factor = np.random.default_rng(6).normal(size=(4, FEATURE_COUNT, FEATURE_COUNT))
    covariance = factor @ factor.transpose(0, 2, 1)
    gain, gradient = information_gain(network, block_diag(*covariance), points)
    phi, slope = feature_jacobian(network, points)
    spread = 1.0 + np.einsum("nif,ifg,nig->ni", phi, covariance, phi)
    np.testing.assert_allclose(gain, 0.5 * np.log(spread).sum(axis=1), rtol=1e-12)
    by_phi = np.einsum("ifg,nig->nif", covariance, phi) / spread[..., None]
    expected = np.einsum("nif,nifz->nz", by_phi, slope)
    np.testing.assert_allclose(gradient * INPUT_SCALE, expected * INPUT_SCALE, rtol=1e-9, atol=1e-11)


def test_information_gain_is_what_the_determinant_loses_and_its_gradient_is_exact(
    network: Network, points: np.ndarray
) -> None:
    factor = np.random.default_rng(6).normal(size=(64, 64))
    covariance = factor @ factor.T
    gain, gradient = information_gain(network, covariance, points)
    phi = features(network, points)
    rows = np.stack([block_diag(*(one[None] for one in states)) for states in phi])  # [n, 4, 64]
    before = np.linalg.inv(covariance)
    after = before + rows.transpose(0, 2, 1) @ rows
    expected = 0.5 * (np.linalg.slogdet(after)[1] - np.linalg.slogdet(before)[1])
    np.testing.assert_allclose(gain, expected, rtol=1e-8)
    numeric = central_difference(lambda z: information_gain(network, covariance, z)[0], points)
    np.testing.assert_allclose(gradient * INPUT_SCALE, numeric * INPUT_SCALE, rtol=0, atol=1e-7)
    # Coupled states tell of each other: together they bring less than each by itself would.
    apart = block_diag(*state_blocks(covariance))
    assert (gain < information_gain(network, apart, points)[0] - 1e-3).all()


def test_information_gain_under_a_covariance_for_each_point(network: Network, points: np.ndarray) -> None:
    factor = np.random.default_rng(7).normal(size=(3, 64, 64))
    covariance = factor @ factor.transpose(0, 2, 1)
    together = information_gain(network, covariance, points[:3])
    for k in range(3):
        alone = information_gain(network, covariance[k], points[k])
        for whole, part in zip(together, alone, strict=True):
            np.testing.assert_allclose(whole[k], part, rtol=1e-12, atol=1e-12)
