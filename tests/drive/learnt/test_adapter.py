"""BayesianAdapter: equal to the plain functions, replayable, and without effect of what it should refuse."""

import dataclasses

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.drive.learnt.adapter import Adapted, BayesianAdapter, adapt_bank
from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import LAGGED
from drift_drake.drive.learnt.features import Network, features, network_inputs
from drift_drake.drive.learnt.noise import Noise
from drift_drake.drive.learnt.posterior import Posterior, mahalanobis, predict, update

TICKS = 30
TIMES = 0.1 * np.arange(TICKS + 1)
NOTHING_REFUSED = 1e9
OFFSET_TIME = 1.5
PORTS = (("measured_state", slice(0, 7)), ("command", slice(7, 9)), ("lagged_command", slice(9, 11)))


def adapted_alone(model: BayesianModel, posterior: Posterior, x: np.ndarray, *later: np.ndarray) -> Adapted | None:
    """`adapt_bank` of one model that refuses nothing; later: u, u_next, x_next."""
    found = adapt_bank((model,), (posterior,), x[:6], x[None, LAGGED], *later, threshold=NOTHING_REFUSED)
    return None if found is None else found[0]


@pytest.fixture(scope="module")
def record() -> PiecewisePolynomial:
    """Measured state, command and lagged command (11 signals) of some drive at 10 Hz."""
    generator = np.random.default_rng(0)
    centre = np.array([0.5, 11.0, -0.5, 16.0, 0.1, 0.02, 5.0, -0.1, 150.0, -0.1, 150.0])
    spread = np.array([0.2, 0.5, 0.1, 1.0, 0.1, 0.02, 1.0, 0.1, 30.0, 0.1, 30.0])
    return PiecewisePolynomial.FirstOrderHold(TIMES, (centre + spread * generator.normal(size=(TICKS + 1, 11))).T)


@pytest.fixture(scope="module")
def learner(random_model: BayesianModel, physical_network: Network) -> BayesianModel:
    """A model that hears the lagged commands."""
    return dataclasses.replace(random_model, network=physical_network)


@pytest.fixture(scope="module")
def replay(learner: BayesianModel, record: PiecewisePolynomial) -> tuple[Diagram, BayesianAdapter]:
    builder = DiagramBuilder()
    adapter = builder.AddSystem(BayesianAdapter(learner, threshold=NOTHING_REFUSED, offset_time=OFFSET_TIME))
    for name, rows in PORTS:
        part = PiecewisePolynomial.FirstOrderHold(TIMES, record.vector_values(list(TIMES))[rows])
        source = builder.AddSystem(TrajectorySource(part))
        builder.Connect(source.get_output_port(), adapter.GetInputPort(name))
    return builder.Build(), adapter


def test_outputs_equal_the_plain_functions(
    learner: BayesianModel, record: PiecewisePolynomial, replay: tuple[Diagram, BayesianAdapter]
) -> None:
    diagram, adapter = replay
    simulator = Simulator(diagram)
    simulator.AdvanceTo(TIMES[-1] + 0.01)
    context = adapter.GetMyContextFromRoot(simulator.get_context())
    posterior, offset, noise = learner.prior(), np.zeros(4), Noise()
    for k in range(TICKS):
        now, then = record.value(TIMES[k])[:, 0], record.value(TIMES[k + 1])[:, 0]
        x, u, u_next = now[[0, 1, 2, 3, 4, 5, 9, 10]], now[7:9], then[7:9]
        phi = features(learner.network, network_inputs(x, u, u_next))
        y = residual(x, u, then[:4], learner.vehicle.constants())
        noise = noise.after(mahalanobis(predict(posterior, learner.sigma, phi), y) ** 2)
        posterior = update(posterior, learner.sigma, phi, y, learner.sample_weight)
        offset += 0.1 / OFFSET_TIME * (y - np.sum(posterior.mean * phi, axis=-1) - offset)
    for port, expected in (("posterior_mean", posterior.mean), ("posterior_covariance", posterior.covariance)):
        np.testing.assert_allclose(adapter.GetOutputPort(port).Eval(context), expected.ravel(), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(adapter.GetOutputPort("noise").Eval(context), noise, rtol=1e-9)
    np.testing.assert_array_equal(adapter.GetOutputPort("counters").Eval(context), [TICKS, 0])
    parameters = adapter.GetOutputPort("parameters").Eval(context)
    np.testing.assert_array_equal(parameters[:64], adapter.GetOutputPort("posterior_mean").Eval(context))
    np.testing.assert_allclose(parameters[64:68], offset, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(parameters[68:], learner.lag)


def test_a_cloned_context_replays_to_the_bit(replay: tuple[Diagram, BayesianAdapter]) -> None:
    diagram, adapter = replay
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.23)
    clone: Context = simulator.get_context().Clone()
    simulator.AdvanceTo(2.5)
    again = Simulator(diagram, clone)
    again.AdvanceTo(2.5)
    for name in ("posterior_mean", "posterior_covariance", "noise", "counters"):
        port = adapter.GetOutputPort(name)
        np.testing.assert_array_equal(
            port.Eval(adapter.GetMyContextFromRoot(simulator.get_context())),
            port.Eval(adapter.GetMyContextFromRoot(again.get_context())),
        )


def test_frozen_adapter_keeps_its_posterior_and_thaws(replay: tuple[Diagram, BayesianAdapter]) -> None:
    diagram, adapter = replay
    simulator = Simulator(diagram)
    context = adapter.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    simulator.AdvanceTo(1.05)
    before = adapter.posterior(context)
    adapter.set_frozen(context, True)
    simulator.AdvanceTo(2.05)
    np.testing.assert_array_equal(adapter.posterior(context).mean, before.mean)
    np.testing.assert_array_equal(adapter.GetOutputPort("counters").Eval(context), [10, 0])
    adapter.set_frozen(context, False)
    simulator.AdvanceTo(2.55)
    np.testing.assert_array_equal(adapter.GetOutputPort("counters").Eval(context), [15, 0])
    assert np.abs(adapter.posterior(context).mean - before.mean).max() > 0.0


def stepped(model: BayesianModel, ticks: list[np.ndarray]) -> tuple[BayesianAdapter, Context]:
    """An adapter that has seen the given rows of (state and lagged commands [8], delta, tau), one a tick."""
    adapter = BayesianAdapter(model)
    context = adapter.CreateDefaultContext()
    for row in ticks:
        adapter.GetInputPort("measured_state").FixValue(context, np.append(row[:6], 0.0))
        adapter.GetInputPort("lagged_command").FixValue(context, row[LAGGED])
        adapter.GetInputPort("command").FixValue(context, row[8:])
        context.SetDiscreteState(adapter.EvalUniquePeriodicDiscreteUpdate(context))
    return adapter, context


def consistent_rows(model: BayesianModel, count: int) -> list[np.ndarray]:
    """Rows that the model's prior mean predicts exactly, one step after the other from the same state."""
    rows = [np.array([0.5, 11.0, -0.5, 16.0, 0.0, 0.0, -0.1, 150.0, -0.1, 150.0])]
    for _ in range(count):
        x, u = rows[-1][:8], rows[-1][8:]
        phi = features(model.network, network_inputs(x, u, u))
        h = x[:4] - residual(x, u, x, model.vehicle.constants())
        rows.append(np.concatenate([h + np.sum(model.prior_mean * phi, axis=-1), rows[-1][4:]]))
    return rows


def test_without_a_time_there_is_no_offset(learner: BayesianModel) -> None:
    rows = [row + 0.01 * k for k, row in enumerate(consistent_rows(learner, 3))]
    adapter, context = stepped(learner, rows)
    np.testing.assert_array_equal(adapter.GetOutputPort("parameters").Eval(context)[64:68], 0.0)


@pytest.mark.parametrize("place", [1, 8])
def test_what_is_not_finite_is_refused_and_counted(random_model: BayesianModel, place: int) -> None:
    rows = consistent_rows(random_model, 5)
    rows[2] = rows[2].copy()
    rows[2][place] = np.nan
    adapter, context = stepped(random_model, rows)
    # A bad measurement or command spoils the step that ends with it and the one that starts with it.
    np.testing.assert_array_equal(adapter.GetOutputPort("counters").Eval(context), [3, 2])
    assert np.isfinite(adapter.posterior(context).covariance).all()


def test_a_lagged_command_that_is_not_finite_spoils_the_step_that_starts_with_it(random_model: BayesianModel) -> None:
    rows = consistent_rows(random_model, 5)
    rows[2] = rows[2].copy()
    rows[2][LAGGED] = np.nan
    adapter, context = stepped(random_model, rows)
    np.testing.assert_array_equal(adapter.GetOutputPort("counters").Eval(context), [4, 1])
    assert np.isfinite(adapter.posterior(context).covariance).all()


@pytest.mark.parametrize("count", [0, 3])
def test_what_is_far_out_of_distribution_is_refused(random_model: BayesianModel, count: int) -> None:
    """After so many samples: of the prior, where the states are coupled, and where each is known by itself."""
    rows = consistent_rows(random_model, count)
    x, u = rows[-1][:8], rows[-1][8:]
    phi = features(random_model.network, network_inputs(x, u, u))
    adapter, context = stepped(random_model, rows)
    posterior = adapter.posterior(context)
    prediction = predict(posterior, random_model.sigma, phi)
    h = x[:4] - residual(x, u, x, random_model.vehicle.constants())
    # Of sideslip, with the other states where they were predicted: unlikelier than by itself, for they would go along.
    deviation = np.array([0.0, 0.0, 1.0 / np.sqrt(np.linalg.inv(prediction.covariance)[2, 2]), 0.0])
    assert count > 0 or deviation[2] < 0.8 * np.sqrt(prediction.variance[2])
    for distance, taken in ((7.9, count + 1), (8.1, count)):
        spike = np.concatenate([h + prediction.mean + distance * deviation, rows[-1][4:]])
        np.testing.assert_allclose(mahalanobis(prediction, prediction.mean + distance * deviation), distance)
        adapter, context = stepped(random_model, [*rows, spike])
        np.testing.assert_array_equal(adapter.GetOutputPort("counters").Eval(context), [taken, count + 1 - taken])


def test_a_car_that_became_another_one_is_learnt_anew(learner: BayesianModel, record: PiecewisePolynomial) -> None:
    adapter = BayesianAdapter(learner, threshold=NOTHING_REFUSED)
    context, trust = adapter.CreateDefaultContext(), [1.0, 1.0, 1.0, 0.0, 0.0]
    for k, trusted in enumerate(trust):
        now = record.value(TIMES[k])[:, 0]
        for name, rows in PORTS:
            adapter.GetInputPort(name).FixValue(context, now[rows])
        adapter.GetInputPort("trusted").FixValue(context, [trusted])
        context.SetTime(TIMES[k])
        context.SetDiscreteState(adapter.EvalUniquePeriodicDiscreteUpdate(context))
    posterior = learner.prior()
    for k in (2, 3):  # the samples that end when it is first not trusted, and after
        now, then = record.value(TIMES[k])[:, 0], record.value(TIMES[k + 1])[:, 0]
        x, x_next = (np.concatenate([row[:6], row[9:11]]) for row in (now, then))
        found = adapted_alone(learner, posterior, x, now[7:9], then[7:9], x_next)
        assert found is not None
        posterior = found.posterior
    np.testing.assert_allclose(adapter.posterior(context).mean, posterior.mean, rtol=1e-7, atol=1e-10)


def test_a_bank_believes_the_lags_that_the_samples_are_likeliest_under(
    learner: BayesianModel, record: PiecewisePolynomial
) -> None:
    """Each pair of lags learns as an adapter of its own would; evidence is the sum of their densities."""
    lags = np.array([[0.05, 0.1], [0.2, 0.1], [0.02, 0.3]])
    adapter = BayesianAdapter(learner, threshold=NOTHING_REFUSED, lags=lags)
    context = adapter.CreateDefaultContext()
    np.testing.assert_array_equal(adapter.GetOutputPort("parameters").Eval(context)[68:], lags[0])
    generator = np.random.default_rng(2)
    lagged = [record.value(t)[9:11, 0] + np.array([0.05, 20.0]) * generator.normal(size=(3, 2)) for t in TIMES[:9]]
    beliefs, evidence = [learner.prior()] * 3, np.zeros(3)
    for k, t in enumerate(TIMES[:9]):
        now = record.value(t)[:, 0]
        for name, rows in PORTS[:2]:
            adapter.GetInputPort(name).FixValue(context, now[rows])
        adapter.GetInputPort("lagged_command").FixValue(context, lagged[k].ravel())
        context.SetDiscreteState(adapter.EvalUniquePeriodicDiscreteUpdate(context))
        if k == 0:
            continue
        then = record.value(TIMES[k - 1])[:, 0]
        for i, lag in enumerate(lags):
            x = np.append(then[:6], lagged[k - 1][i])
            found = adapted_alone(learner.with_lag(lag), beliefs[i], x, then[7:9], now[7:9], now[:6])
            assert found is not None
            beliefs[i], evidence[i] = found.posterior, evidence[i] + found.density
    best = int(np.argmax(evidence))
    assert adapter.believed(context) == best
    np.testing.assert_allclose(adapter.posterior(context).mean, beliefs[best].mean, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(adapter.GetOutputPort("parameters").Eval(context)[68:], lags[best])
    np.testing.assert_array_equal(adapter.GetOutputPort("internal_states").Eval(context), lagged[-1][best])
    assert adapter.HasDirectFeedthrough(
        adapter.GetInputPort("lagged_command").get_index(), adapter.GetOutputPort("internal_states").get_index()
    )
    assert not any(
        adapter.HasDirectFeedthrough(i, adapter.GetOutputPort("parameters").get_index())
        for i in range(adapter.num_input_ports())
    )
    adapter.set_posterior(context, learner.prior())
    assert adapter.believed(context) == 0


def test_a_bank_refuses_what_none_of_its_models_expects(learner: BayesianModel) -> None:
    """A spike; what one of them expects is no spike."""
    lags, rows = np.array([[0.05, 0.1], [0.2, 0.1]]), consistent_rows(learner, 2)
    models, prior = [learner.with_lag(lag) for lag in lags], learner.prior()
    x, u, lagged = rows[0][:6], rows[0][8:], np.array([rows[0][LAGGED], [0.3, 20.0]])
    for factor, taken in ((0.0, True), (1.0, False)):
        spike = rows[1][:6] + factor * np.array([40.0, 0.0, 4.0, 0.0, 0.0, 0.0])
        found = adapt_bank(models, [prior, prior], x, lagged, u, u, spike, 8.0)
        assert (found is not None) == taken
    found = adapt_bank(models, [prior, prior], x, lagged, u, u, rows[1][:6], 8.0)
    assert found is not None
    for learnt, model, own in zip(found, models, lagged, strict=True):
        alone = adapted_alone(model, prior, np.append(x, own), u, u, rows[1][:6])
        assert alone is not None
        np.testing.assert_allclose(learnt.posterior.mean, alone.posterior.mean, rtol=1e-10)
