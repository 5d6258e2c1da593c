"""The network at run time: parameter count, shapes, Jacobians."""

import numpy as np
import pytest

from drift_drake.drive.learnt.command_lag import LAGGED
from drift_drake.drive.learnt.features import (
    FEATURE_COUNT,
    HIDDEN_COUNT,
    INPUT_COUNT,
    INPUT_OFFSET,
    INPUT_SCALE,
    PAPER_COUNT,
    FeatureExpansion,
    MeanFunction,
    Network,
    all_inputs,
    features,
    network_inputs,
)


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


def test_commands_are_scaled_alike_at_both_ends_of_a_step_and_behind_the_lags() -> None:
    """Else a command that is held would look like one that changes."""
    x, u = np.arange(8.0), np.array([0.2, 90.0])
    x[LAGGED] = u
    scaled = (network_inputs(x, u, u) - INPUT_OFFSET) / INPUT_SCALE
    np.testing.assert_array_equal(scaled[4:].reshape(3, 2), np.tile(scaled[4:6], (3, 1)))


def test_the_papers_network_alone_does_not_hear_the_lagged_commands(
    random_network: Network, physical_network: Network, points: np.ndarray
) -> None:
    other = points.copy()
    other[:, PAPER_COUNT:] += INPUT_SCALE[PAPER_COUNT:]
    np.testing.assert_array_equal(features(random_network, points), features(random_network, other))
    np.testing.assert_array_equal(FeatureExpansion(random_network, points).tangents[:, PAPER_COUNT:], 0.0)
    assert np.abs(features(physical_network, points) - features(physical_network, other)).max(axis=(1, 2)).min() > 1e-2


def tangents(network: Network, z: np.ndarray) -> np.ndarray:
    """d phi / dz [n, 4, 16, 10]."""
    return np.moveaxis(FeatureExpansion(network, z).tangents, 1, 3)


def test_the_expansion_has_the_features_and_their_differences(network: Network, points: np.ndarray) -> None:
    expansion, phi = FeatureExpansion(network, points), features(network, points)
    np.testing.assert_allclose(expansion.phi, phi, rtol=0, atol=1e-13)
    numeric = central_difference(lambda z: features(network, z), points)
    np.testing.assert_allclose(tangents(network, points) * INPUT_SCALE, numeric * INPUT_SCALE, rtol=0, atol=1e-8)
    weights = np.random.default_rng(7).normal(size=phi.shape)
    numeric = central_difference(lambda z: np.einsum("nif,nifz->nz", weights, tangents(network, z)), points)
    scale = INPUT_SCALE[:, None] * INPUT_SCALE
    found = expansion.second(weights)
    # Those of the physical inputs are one-sided differences.
    np.testing.assert_allclose(found * scale, numeric * scale, rtol=0, atol=1e-4 * np.abs(numeric * scale).max())


def test_mean_function_folds_theta(network: Network, points: np.ndarray) -> None:
    generator = np.random.default_rng(5)
    theta, other = generator.normal(size=(2, 4, FEATURE_COUNT))
    mean = MeanFunction(network, theta)
    phi, slope = features(network, points), tangents(network, points)
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
