"""A small model, and a table of drives with short trainings on it, for the tests of this folder."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.features import INPUT_OFFSET, INPUT_SCALE, Network, features, input_scaling
from drift_drake.drive.learnt.samples import Samples, save_samples
from drift_drake.drive.learnt.training_config import TrainingConfig


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
    """An untrained model with a broad prior, broader still in one direction that all states share, as a tyre's friction
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


@pytest.fixture(scope="session")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three cars that differ in grip, in random states of a drift: noisy steps of a made-up residual."""
    generator = np.random.default_rng(0)
    car = VehicleParameters().constants()
    parts = []
    for vehicle in range(3):
        count = 60
        x = np.zeros((count, 6))
        x[:, :4] = np.array([0.4, 11.0, -0.5, 16.0]) + np.array([0.2, 1.0, 0.2, 2.0]) * generator.normal(
            size=(count, 4)
        )
        u = np.array([-0.1, 150.0]) + np.array([0.1, 40.0]) * generator.normal(size=(count, 2))
        x = np.hstack([x, u])  # settled lags
        truth = car._replace(friction=0.8 + 0.1 * vehicle)
        x_next = x.copy()
        x_next[:, :4] -= residual(x, u, x, truth)
        x_next[:, 3] = x[:, 3] + 0.002 * (u[:, 1] - 150.0)
        x_next[:, :4] += np.array([0.01, 0.05, 0.005, 0.1]) * generator.normal(size=(count, 4))
        parts.append(Samples(x, u, u, x_next, np.zeros(count), np.full(count, vehicle),
                             2 * vehicle + (np.arange(count) >= 30)))  # fmt: skip
    path = tmp_path_factory.mktemp("table") / "train.npz"
    save_samples(Samples(*(np.concatenate(columns) for columns in zip(*parts, strict=True))), path)
    return path


@pytest.fixture(scope="session")
def config(table: Path, tmp_path_factory: pytest.TempPathFactory) -> TrainingConfig:
    output = tmp_path_factory.mktemp("model") / "model.npz"
    return TrainingConfig(
        data=table, output=output, validation=table, lane=None, epochs=30, batch=128, threads=1, horizons=(5, 20),
        temper=False, learning_rate=1e-3,
    )  # fmt: skip


@pytest.fixture(scope="session")
def transfer(config: TrainingConfig) -> TrainingConfig:
    return dataclasses.replace(
        config, lane=config.data, validation_lane=config.data, epochs=20, epoch_batches=5, batch_tasks=8,
        learning_rate=2e-3, output=config.output.with_name("transfer.npz"),
    )  # fmt: skip
