"""The replay of a log through the adapter."""

import json
from pathlib import Path

import numpy as np
import pytest

from diagrams.adaptation_replay import AdaptationReplay, ReplayConfig, main, one_step_errors, read_log
from drift_drake.car.log.table import InvalidLogError, Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import LAGGED, lagged_commands
from drift_drake.drive.learnt.features import Network, features, input_scaling, network_inputs
from drift_drake.drive.learnt.quality import adapted
from drift_drake.drive.learnt.samples import Samples


@pytest.fixture(scope="module")
def model() -> BayesianModel:
    generator = np.random.default_rng(3)

    def normal(*shape: int) -> np.ndarray:
        return np.asarray(generator.normal(size=shape) / np.sqrt(shape[-2] if len(shape) > 1 else 8))

    offset, scale = input_scaling(physical=True)
    network = Network(offset, scale, normal(len(offset), 128), normal(128), normal(128, 128), normal(128),
                      normal(4, 128, 16), normal(4, 16), VehicleParameters().constants())  # fmt: skip
    sigma = np.array([0.05, 0.1, 0.02, 0.5])
    factor = np.eye(64) + 0.1 * generator.normal(size=(64, 64))
    weight = np.array([0.3, 0.5, 0.2, 0.4])
    return BayesianModel(network, sigma[:, None] * normal(4, 16), factor, sigma, weight, VehicleParameters(), {})


@pytest.fixture(scope="module")
def log() -> Run:
    t = 3.0 + 0.01 * np.arange(151)
    wave = np.sin(2.0 * t)
    return Run("run", t, r=0.5 + 0.1 * wave, v=11.0 + 0.5 * wave, beta=-0.5 + 0.1 * wave, omega_r=16.0 + wave,
               delta_cmd=-0.1 + 0.1 * wave, tau_cmd=150.0 + 20.0 * wave)  # fmt: skip


def test_the_replay_ends_in_the_posterior_of_the_decimated_log(model: BayesianModel, log: Run) -> None:
    ticks = AdaptationReplay(log, model, threshold=1e9).run()
    np.testing.assert_array_equal(ticks["counters"][-1], [14, 0])  # the sample that ends with the log is still due
    commands = np.stack([log.delta_cmd, log.tau_cmd], axis=1)
    x, u = np.zeros((16, 8)), commands[::10]
    x[:, :4] = np.stack([log.r, log.v, log.beta, log.omega_r], axis=1)[::10]
    x[:, LAGGED] = lagged_commands(log.t, commands)[::10]
    samples = Samples(x[:-1], u[:-1], u[1:], x[1:], np.zeros(15), np.zeros(15, dtype=int), np.zeros(15, dtype=int))
    expected = adapted(model, samples.where(np.arange(14)))
    np.testing.assert_allclose(ticks["mean"][-1], expected.mean, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(ticks["covariance"][-1], expected.covariance, rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(ticks["mean"][0], model.prior_mean)
    np.testing.assert_array_equal(ticks["covariance"][0], model.prior().covariance)
    errors = one_step_errors(log, model, ticks["mean"])
    predicted = np.sum(ticks["mean"][:-1] * features(model.network, network_inputs(x[:-1], u[:-1], u[1:])), axis=-1)
    found = residual(x[:-1], u[:-1], x[1:], model.vehicle.constants())
    np.testing.assert_allclose(errors, found - predicted, rtol=0, atol=1e-9)
    assert errors.shape == (15, 4)
    assert np.abs(errors[-3:]).mean() < np.abs(errors[:3]).mean()


def test_the_command_leaves_the_posterior_and_its_numbers(model: BayesianModel, log: Run, tmp_path: Path) -> None:
    write_run(log, tmp_path / "run.csv")
    model.save(tmp_path / "model.npz")
    main(ReplayConfig(tmp_path / "run.csv", model=tmp_path / "model.npz", threshold=1e9, out=tmp_path / "out"))
    numbers = json.loads((tmp_path / "out" / "numbers.json").read_text())
    with np.load(tmp_path / "out" / "posterior.npz") as stored:
        covariance = stored["covariance"]
    assert covariance.shape == (64, 64)
    assert numbers["taken"] == 14
    norms = [np.linalg.eigvalsh(covariance[k : k + 16, k : k + 16]).max() for k in (0, 16, 32, 48)]
    np.testing.assert_allclose(numbers["norms_after"], norms, rtol=1e-9)
    assert (np.array(numbers["norms_before"]) > norms).all()
    assert (tmp_path / "out" / "adaptation.png").stat().st_size > 1000


def test_bad_logs_are_named(log: Run, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with pytest.raises(InvalidLogError, match=r"run\.csv: cannot be read \(No such file"):
        read_log(path)
    write_run(log.without("beta", "tau_cmd"), path)
    with pytest.raises(InvalidLogError, match=r"run\.csv: no column beta, tau_cmd"):
        read_log(path)
    write_run(log, path)
    np.testing.assert_allclose(read_log(path).beta, log.beta, rtol=1e-8)
