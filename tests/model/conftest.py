"""A small model and quick drives for the tests of this room."""

import numpy as np
import pytest

from drift_drake.model.checkpoint import BayesianModel
from drift_drake.model.features import INPUT_OFFSET, INPUT_SCALE, Network, features, input_scaling
from drift_drake.vehicle.parameters import VehicleParameters


def untrained(physical: bool) -> Network:
    """Untrained features: smooth, of order one."""
    generator = np.random.default_rng(3)
    offset, scale = input_scaling(physical)

    def normal(*shape: int) -> np.ndarray:
        return generator.normal(size=shape) / np.sqrt(shape[-2] if len(shape) > 1 else 8)

    nominal = VehicleParameters().constants() if physical else None
    return Network(offset, scale, normal(len(offset), 128), normal(128), normal(128, 128), normal(128),
                   normal(4, 128, 16), normal(4, 16), nominal)  # fmt: skip


@pytest.fixture(scope="session")
def random_network() -> Network:
    return untrained(physical=False)


@pytest.fixture(scope="session")
def physical_network() -> Network:
    return untrained(physical=True)


@pytest.fixture(scope="session")
def random_model(random_network: Network) -> BayesianModel:
    """An untrained model with a wide prior, wider still in one direction that all states share, as a tyre's friction
    is; samples tell of some states more."""
    generator = np.random.default_rng(8)
    shared = features(random_network, INPUT_OFFSET + 0.5 * INPUT_SCALE).ravel()
    shared /= np.linalg.norm(shared)
    narrow = np.eye(64) - np.outer(shared, shared) * 2.0 / 3.0
    factor = narrow @ (np.eye(64) + 0.1 * generator.normal(size=(64, 64)))
    sigma = np.array([0.05, 0.1, 0.02, 0.5])
    mean = sigma[:, None] * generator.normal(size=(4, 16))
    weight = np.array([0.3, 0.5, 0.2, 0.4])
    return BayesianModel(random_network, mean, factor, sigma, weight, VehicleParameters(), {"note": "untrained"})
