"""The lags of the learnt model: their factors against integration, along a log, and the system in a diagram."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource, VectorLogSink
from pydrake.trajectories import PiecewisePolynomial
from scipy.integrate import solve_ivp

from drift_drake.drive.learnt.command_lag import LAG, CommandLag, lag_factors, lagged_commands

PERIOD, TICKS = 0.01, 120
TIMES = PERIOD * np.arange(TICKS + 1)
SCALE = np.array([0.3, 100.0])  # of (delta, tau)


def integrated(t: np.ndarray, u: np.ndarray, start: np.ndarray) -> np.ndarray:
    """LAG d lagged/dt = u(t) - lagged from `start` at t[0], u linear between the given times; at those times [K, 2]."""
    out = [start]
    for k in range(len(t) - 1):

        def rate(now: float, lagged: np.ndarray, k: int = k) -> np.ndarray:
            share = (now - t[k]) / (t[k + 1] - t[k])
            return ((1.0 - share) * u[k] + share * u[k + 1] - lagged) / LAG

        found = solve_ivp(rate, (t[k], t[k + 1]), out[-1], rtol=1e-10, atol=1e-11, method="DOP853")
        out.append(found.y[:, -1])
    return np.array(out)


def commands(count: int, seed: int = 0) -> np.ndarray:
    return np.array([-0.1, 150.0]) + SCALE * np.random.default_rng(seed).normal(size=(count, 2))


@pytest.mark.parametrize("dt", [1e-3, 0.01, 0.1, 0.37])
def test_the_factors_are_those_of_the_differential_equation(dt: float) -> None:
    keep, by_now, by_next = lag_factors(dt)
    assert keep.shape == by_now.shape == by_next.shape == (2,)
    np.testing.assert_allclose(keep + by_now + by_next, 1.0, rtol=0, atol=1e-15)  # settled stays settled
    start, u, u_next = commands(3)
    expected = integrated(np.array([0.0, dt]), np.stack([u, u_next]), start)[1]
    found = keep * start + by_now * u + by_next * u_next
    np.testing.assert_allclose(found / SCALE, expected / SCALE, rtol=0, atol=1e-9)


def test_steps_in_a_row_are_one_long_step() -> None:
    keep, by_now, by_next = lag_factors(0.01)
    start, u, u_next = commands(3)
    lagged = start
    for k in range(10):
        before, after = (u + share * (u_next - u) for share in (k / 10.0, (k + 1) / 10.0))
        lagged = keep * lagged + by_now * before + by_next * after
    whole = sum(c * value for c, value in zip(lag_factors(0.1), (start, u, u_next), strict=True))
    np.testing.assert_allclose(lagged, whole, rtol=1e-12)


def test_factors_of_many_steps_stand_in_rows() -> None:
    steps = np.array([0.01, 0.02, 0.1])
    for many, alone in zip(lag_factors(steps), zip(*(lag_factors(dt) for dt in steps), strict=True), strict=True):
        np.testing.assert_array_equal(many, np.array(alone))


def test_a_logs_commands_are_lagged_on_any_time_grid() -> None:
    t = 5.0 + np.cumsum(np.random.default_rng(1).uniform(0.002, 0.15, 40))
    u = commands(40)
    found = lagged_commands(t, u)
    np.testing.assert_array_equal(found[0], u[0])  # settled at the first
    np.testing.assert_allclose(found / SCALE, integrated(t, u, u[0]) / SCALE, rtol=0, atol=1e-8)


def test_lags_under_held_commands_stay_settled() -> None:
    u = np.tile([-0.2, 90.0], (30, 1))
    np.testing.assert_allclose(lagged_commands(0.01 * np.arange(30.0), u), u, rtol=1e-13)
    one = np.array([[-0.2, 90.0]])
    np.testing.assert_array_equal(lagged_commands(np.zeros(1), one), one)


@pytest.fixture(scope="module")
def lag_diagram() -> tuple[Diagram, CommandLag, VectorLogSink, np.ndarray]:
    """Commands that are linear between ticks, the lags, and a logger of what they give at the ticks."""
    u = commands(TICKS + 1, seed=2)
    builder = DiagramBuilder()
    source = builder.AddSystem(TrajectorySource(PiecewisePolynomial.FirstOrderHold(TIMES, u.T)))
    lag = builder.AddSystem(CommandLag(PERIOD))
    builder.Connect(source.get_output_port(), lag.GetInputPort("command"))
    sink = LogVectorOutput(lag.GetOutputPort("lagged_command"), builder, PERIOD)
    return builder.Build(), lag, sink, u


def output(lag: CommandLag, root: Context) -> np.ndarray:
    return np.array(lag.GetOutputPort("lagged_command").Eval(lag.GetMyContextFromRoot(root)))


def test_the_system_gives_the_lagged_commands_of_each_tick(
    lag_diagram: tuple[Diagram, CommandLag, VectorLogSink, np.ndarray],
) -> None:
    diagram, lag, sink, u = lag_diagram
    simulator = Simulator(diagram)
    simulator.Initialize()
    np.testing.assert_array_equal(output(lag, simulator.get_context()), u[0])  # settled
    simulator.AdvanceTo(TIMES[-1])
    simulator.AdvancePendingEvents()
    log = sink.FindLog(simulator.get_context())
    np.testing.assert_allclose(log.sample_times(), TIMES, rtol=0, atol=1e-12)
    expected = lagged_commands(TIMES, u)
    np.testing.assert_allclose(log.data().T / SCALE, expected / SCALE, rtol=0, atol=1e-12)
    # At a tick it gives the same before and after its own update.
    np.testing.assert_allclose(output(lag, simulator.get_context()), expected[-1], rtol=1e-12)


def test_a_cloned_context_replays_to_the_bit(
    lag_diagram: tuple[Diagram, CommandLag, VectorLogSink, np.ndarray],
) -> None:
    diagram, lag, _, _ = lag_diagram
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.405)
    clone = simulator.get_context().Clone()
    simulator.AdvanceTo(0.8)
    again = Simulator(diagram, clone)
    again.AdvanceTo(0.8)
    np.testing.assert_array_equal(output(lag, again.get_context()), output(lag, simulator.get_context()))


def test_the_command_feeds_through() -> None:
    """Drake must know: the output at a tick has the command of that tick in it."""
    lag = CommandLag(PERIOD)
    assert lag.HasDirectFeedthrough(0, 0)
    context = lag.CreateDefaultContext()
    found = []
    for command in ([0.1, 100.0], [0.2, 50.0]):
        lag.GetInputPort("command").FixValue(context, command)
        found.append(np.array(lag.GetOutputPort("lagged_command").Eval(context)))
    np.testing.assert_array_equal(found, [[0.1, 100.0], [0.2, 50.0]])


def test_a_broken_command_does_not_stay_in_the_lags() -> None:
    lag = CommandLag(PERIOD)
    context = lag.CreateDefaultContext()
    found = []
    for k, delta in enumerate([0.1, np.nan, 0.2, 0.3]):
        context.SetTime(PERIOD * k)
        lag.GetInputPort("command").FixValue(context, [delta, 100.0])
        found.append(np.array(lag.GetOutputPort("lagged_command").Eval(context)))
        context.SetDiscreteState(lag.EvalUniquePeriodicDiscreteUpdate(context))
    assert np.isnan(found[1][0])
    np.testing.assert_array_equal(found[2], [0.2, 100.0])  # settled
    np.testing.assert_allclose(found[3], lagged_commands(TIMES[:2], np.array([[0.2, 100.0], [0.3, 100.0]]))[1])


def test_several_pairs_of_lags_run_side_by_side() -> None:
    lags = np.array([[0.05, 0.1], [0.2, 0.03]])
    bank, alone = CommandLag(PERIOD, lags), [CommandLag(PERIOD, lag) for lag in lags]
    contexts = [system.CreateDefaultContext() for system in (bank, *alone)]
    for k in range(5):
        found = []
        for system, context in zip((bank, *alone), contexts, strict=True):
            context.SetTime(PERIOD * k)
            system.GetInputPort("command").FixValue(context, np.array([0.1 * k, 100.0 - 20.0 * k]))
            found.append(np.array(system.GetOutputPort("lagged_command").Eval(context)))
            context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
        np.testing.assert_array_equal(found[0], np.concatenate(found[1:]))
