"""The detector: its statistic, its calibration, and the system in a diagram."""

import dataclasses

import numpy as np
import pytest
from learnt_models import sample_theta
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial
from scipy.stats import chi2

from drift_drake.drive.learnt.adapter import DEFAULT_THRESHOLD, BayesianAdapter, adapt_bank
from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import LAGGED
from drift_drake.drive.learnt.features import Network, features, network_inputs
from drift_drake.drive.learnt.out_of_distribution import (
    NullDistribution,
    OutOfDistributionDetector,
    calibrate,
    squared_distance,
    statistics,
)
from drift_drake.drive.learnt.posterior import predict

TICKS = 12
WINDOW = 4
STATES = [0, 1, 2, 3, 4, 5, 9, 10]  # of the rows: measured, lagged commands


def test_the_statistic_is_a_running_mean() -> None:
    values = statistics(np.arange(6.0), 3)
    np.testing.assert_allclose(values, [np.nan, np.nan, 1.0, 2.0, 3.0, 4.0])
    assert np.isnan(statistics(np.arange(2.0), 3)).all()


def test_calibration_finds_the_freedom_of_independent_and_of_repeated_samples() -> None:
    generator = np.random.default_rng(0)
    independent = [chi2.rvs(4, size=2000, random_state=generator) for _ in range(5)]
    found = calibrate(independent, window=20)
    assert found.mean == pytest.approx(4.0, rel=0.03)
    assert found.freedom == pytest.approx(80.0, rel=0.15)
    # Each sample five times: a window of twenty holds about four independent ones.
    repeated = [np.repeat(chi2.rvs(4, size=2000, random_state=generator), 5) for _ in range(5)]
    assert calibrate(repeated, window=20).freedom == pytest.approx(4.0 * 4.7, rel=0.15)


def test_the_threshold_keeps_its_promise() -> None:
    generator = np.random.default_rng(1)
    drives = [chi2.rvs(4, size=200, random_state=generator) for _ in range(1000)]
    threshold = NullDistribution(mean=4.0, freedom=80.0, window=20).threshold(false_alarms=0.1, duration=20.0)
    alarms = np.mean([np.nanmax(statistics(drive)) > threshold for drive in drives])
    assert 0.01 < alarms < 0.1


def test_no_drive_as_long_as_the_window_is_refused() -> None:
    with pytest.raises(ValueError, match="give longer drives"):
        calibrate([np.ones(5)], window=20)


def test_the_system_agrees_with_the_functions(random_model: BayesianModel, physical_network: Network) -> None:
    """With an adapter: every step is judged by the belief from before it was learnt from."""
    learner = dataclasses.replace(random_model, network=physical_network)
    generator = np.random.default_rng(0)
    centre = np.array([0.5, 11.0, -0.5, 16.0, 0.1, 0.02, 5.0, -0.1, 150.0, -0.1, 150.0])
    rows = centre + 0.05 * centre * generator.normal(size=(TICKS + 1, 11))
    rows[9:, 0] += 3.0  # another car
    builder = DiagramBuilder()
    adapter = builder.AddSystem(BayesianAdapter(learner))
    detector = builder.AddSystem(OutOfDistributionDetector(learner, threshold=np.inf, window=WINDOW))
    times = 0.1 * np.arange(TICKS + 1)
    ports = (("measured_state", slice(0, 7)), ("command", slice(7, 9)), ("lagged_command", slice(9, 11)))
    for name, part in ports:
        source = builder.AddSystem(TrajectorySource(PiecewisePolynomial.FirstOrderHold(times, rows[:, part].T)))
        for system in (adapter, detector):
            builder.Connect(source.get_output_port(), system.GetInputPort(name))
    for name in ("parameters", "posterior_covariance"):
        builder.Connect(adapter.GetOutputPort(name), detector.GetInputPort(name))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    mine = detector.GetMyMutableContextFromRoot(context)

    belief, distances = learner.prior(), []
    for k in range(TICKS):
        x, x_next = rows[k, STATES], rows[k + 1, STATES]
        u, u_next = rows[k, 7:9], rows[k + 1, 7:9]
        distances.append(squared_distance(learner, belief, x, u, u_next, x_next))
        found = adapt_bank((learner,), (belief,), x, x[None, LAGGED], u, u_next, x_next, DEFAULT_THRESHOLD)
        belief = belief if found is None else found[0].posterior
        simulator.AdvanceTo(times[k + 1] + 0.05 if k + 1 < TICKS else times[-1])
        simulator.AdvancePendingEvents()
        assert detector.GetOutputPort("distance").Eval(mine)[0] == pytest.approx(distances[-1], rel=1e-6)
    expected = statistics(np.array(distances), WINDOW)
    assert detector.GetOutputPort("statistic").Eval(mine)[0] == pytest.approx(expected[-1], rel=1e-6)
    assert detector.GetOutputPort("alarm").Eval(mine)[0] == 0.0
    mine.get_mutable_numeric_parameter(0).SetFromVector([0.9 * expected[-1]])
    assert detector.GetOutputPort("alarm").Eval(mine)[0] == 1.0
    # A clone holds all that the future depends on.
    clone = context.Clone()
    again = detector.GetMyContextFromRoot(clone)
    np.testing.assert_array_equal(detector.GetOutputPort("statistic").Eval(again),
                                  detector.GetOutputPort("statistic").Eval(mine))  # fmt: skip


def test_cars_as_the_model_believes_are_as_far_off_as_chi_square(random_model: BayesianModel) -> None:
    """One step of each of many cars, with its noise: the four states' errors go together, and the distance knows."""
    generator = np.random.default_rng(3)
    prior, sigma = random_model.prior(), random_model.sigma
    x, u = np.array([0.5, 11.0, -0.5, 16.0, 0.0, 0.0, -0.1, 150.0]), np.array([-0.1, 150.0])
    phi = features(random_model.network, network_inputs(x, u, u))
    h = x[:4] - residual(x, u, x, random_model.vehicle.constants())
    distances = []
    for theta in sample_theta(prior, sigma, 2000, generator):
        x_next = np.append(h + np.sum(theta * phi, axis=-1) + sigma * generator.standard_normal(4), x[4:])
        distances.append(squared_distance(random_model, prior, x, u, u, x_next))
    assert np.mean(distances) == pytest.approx(4.0, rel=0.05)
    assert np.var(distances) == pytest.approx(8.0, rel=0.2)
    correlation = predict(prior, sigma, phi).covariance
    correlation /= np.sqrt(np.outer(np.diag(correlation), np.diag(correlation)))
    assert np.abs(correlation - np.eye(4)).max() > 0.3


def test_a_step_that_is_not_finite_leaves_the_window_alone(random_model: BayesianModel) -> None:
    detector = OutOfDistributionDetector(random_model, threshold=1.0, window=2)
    context = detector.CreateDefaultContext()
    prior = random_model.prior()
    command = np.array([0.0, 100.0])
    parameters = np.concatenate([prior.mean.ravel(), np.zeros(4), random_model.lag])
    values = {"command": command, "lagged_command": command, "parameters": parameters,
              "posterior_covariance": prior.covariance.ravel()}  # fmt: skip
    for name, value in values.items():
        detector.GetInputPort(name).FixValue(context, value)
    found = []
    for k, v in enumerate([10.0, 10.1, np.nan, 10.2, 10.3]):
        context.SetTime(0.1 * k)
        detector.GetInputPort("measured_state").FixValue(context, np.array([0.1, v, 0.0, v, 0.0, 0.0, 0.0]))
        context.get_mutable_discrete_state().SetFrom(detector.EvalUniquePeriodicDiscreteUpdate(context))
        found.append(float(detector.GetOutputPort("distance").Eval(context)[0]))
    assert np.isnan(found[0])
    assert found[1] == found[2] == found[3]
    assert found[4] != found[3]
    assert np.isfinite(found[4])


def test_the_system_judges_under_the_lags_that_are_believed(
    random_model: BayesianModel, physical_network: Network
) -> None:
    """And not a step between two pairs of them, of whose start it has no lagged commands."""
    model = dataclasses.replace(random_model, network=physical_network)
    detector = OutOfDistributionDetector(model, threshold=1.0, window=2)
    context = detector.CreateDefaultContext()
    prior, u, lagged, lag = model.prior(), np.array([-0.1, 100.0]), np.array([0.1, 60.0]), np.array([0.2, 0.1])
    detector.GetInputPort("command").FixValue(context, u)
    detector.GetInputPort("lagged_command").FixValue(context, lagged)
    detector.GetInputPort("posterior_covariance").FixValue(context, prior.covariance.ravel())
    found, rows = [], [np.array([0.1, 10.0 + 0.1 * k, 0.0, 10.0 + 0.1 * k, 0.0, 0.0]) for k in range(4)]
    for k, pair in enumerate([model.lag, lag, lag, lag]):
        context.SetTime(0.1 * k)
        detector.GetInputPort("measured_state").FixValue(context, np.append(rows[k], 0.0))
        parameters = np.concatenate([prior.mean.ravel(), np.zeros(4), pair])
        detector.GetInputPort("parameters").FixValue(context, parameters)
        context.get_mutable_discrete_state().SetFrom(detector.EvalUniquePeriodicDiscreteUpdate(context))
        found.append(float(detector.GetOutputPort("distance").Eval(context)[0]))
    ends = [np.concatenate([row, lagged]) for row in rows]
    assert np.isnan(found[:2]).all()
    for k in (2, 3):
        expected = squared_distance(model.with_lag(lag), prior, ends[k - 1], u, u, ends[k])
        assert found[k] == pytest.approx(expected, rel=1e-9)
    assert found[3] != pytest.approx(squared_distance(model, prior, ends[2], u, u, ends[3]), rel=0.1)
