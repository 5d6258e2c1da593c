"""The transport delay is exact where it says so, and holds the first value before."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.sensors import TransportDelay

KNOTS = np.arange(0.0, 1.01, 0.01)
SIGNAL = np.stack([np.sin(7.0 * KNOTS) + 1.0, np.sign(np.sin(40.0 * KNOTS))])  # linear between the rows only


def delayed(delay, log_period=0.001, duration=0.6, start=0.0, **options):
    """(times, output) of the delay under the piecewise-linear signal."""
    builder = DiagramBuilder()
    signal = builder.AddNamedSystem("signal", TrajectorySource(PiecewisePolynomial.FirstOrderHold(KNOTS, SIGNAL)))
    delay = builder.AddNamedSystem("delay", TransportDelay(2, delay, **options))
    builder.Connect(signal.get_output_port(), delay.get_input_port())
    log = LogVectorOutput(delay.get_output_port(), builder, log_period)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    context.SetTime(start)
    simulator = Simulator(diagram, context)
    simulator.AdvanceTo(start + duration)
    found = log.FindLog(context)
    return found.sample_times(), found.data()


def signal_at(times):
    return np.stack([np.interp(np.maximum(times, 0.0), KNOTS, row) for row in SIGNAL])


@pytest.mark.parametrize("delay", [0.0, 0.0007, 0.005, 0.01, 0.02, 0.0334, 0.15])
def test_signal_linear_between_rows_is_late_by_exactly_the_delay(delay):
    times, output = delayed(delay)
    np.testing.assert_allclose(output, signal_at(times - delay), atol=1e-12)
    assert len(times) == 601


@pytest.mark.parametrize("period", [0.005, 0.01])
def test_period_of_the_rows_is_a_parameter(period):
    times, output = delayed(0.043, period=period)
    np.testing.assert_allclose(output, signal_at(times - 0.043), atol=1e-12)


def test_smooth_signal_is_exact_where_rows_were_taken():
    builder = DiagramBuilder()
    cubic = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
        np.linspace(0.0, 1.0, 6), np.array([[0.0, 1.0, -1.0, 2.0, 0.0, 1.0]])
    )
    signal = builder.AddNamedSystem("signal", TrajectorySource(cubic))
    delay = builder.AddNamedSystem("delay", TransportDelay(1, 0.037, offset=0.003))
    builder.Connect(signal.get_output_port(), delay.get_input_port())
    log = LogVectorOutput(delay.get_output_port(), builder, 0.01)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    Simulator(diagram, context).AdvanceTo(0.9)
    found = log.FindLog(context)
    expected = [cubic.value(max(t - 0.037, 0.0)).item() for t in found.sample_times()]
    np.testing.assert_allclose(found.data()[0], expected, atol=1e-12)


def test_before_the_start_the_first_value_is_held():
    times, output = delayed(0.1, start=0.2, duration=0.3)
    early = times < 0.3
    np.testing.assert_allclose(output[:, early], np.repeat(signal_at(np.array([0.2])), early.sum(), axis=1), atol=1e-12)
    np.testing.assert_allclose(output[:, ~early], signal_at(times[~early] - 0.1), atol=1e-12)


def test_direct_feedthrough_only_within_a_period():
    assert TransportDelay(1, 0.0).HasAnyDirectFeedthrough()
    assert TransportDelay(1, 0.004).HasAnyDirectFeedthrough()
    assert not TransportDelay(1, 0.01).HasAnyDirectFeedthrough()
    assert not TransportDelay(1, 0.1).HasAnyDirectFeedthrough()


def test_zero_delay_has_no_state():
    assert TransportDelay(3, 0.0).num_discrete_state_groups() == 0


def test_output_is_zero_until_initialized():
    for delay in (0.004, 0.05):
        system = TransportDelay(1, delay)
        context = system.CreateDefaultContext()
        system.get_input_port().FixValue(context, [5.0])
        assert system.get_output_port().Eval(context) == [0.0]
        simulator = Simulator(system, context)
        simulator.Initialize()
        assert system.get_output_port().Eval(context) == [5.0]


def test_clock_that_goes_backwards():
    system = TransportDelay(1, 0.02)
    context = system.CreateDefaultContext()
    system.get_input_port().FixValue(context, [5.0])
    Simulator(system, context).AdvanceTo(1.0)
    context.SetTime(0.5)
    with pytest.raises(RuntimeError, match=r"the clock went backwards to 0\.5 s; initialize again"):
        system.get_output_port().Eval(context)


def test_a_context_can_be_initialized_again():
    system = TransportDelay(1, 0.02)
    context = system.CreateDefaultContext()
    system.get_input_port().FixValue(context, [5.0])
    simulator = Simulator(system, context)
    simulator.AdvanceTo(1.0)
    context.SetTime(0.0)
    system.get_input_port().FixValue(context, [7.0])
    simulator.Initialize()
    assert system.get_output_port().Eval(context) == [7.0]


@pytest.mark.parametrize("delay", [-0.1, float("nan"), float("inf")])
def test_a_delay_that_is_none(delay):
    with pytest.raises(ValueError, match=r"delay is .*; give it in seconds, zero or more"):
        TransportDelay(1, delay)


@pytest.mark.parametrize("period", [0.0, -0.01, float("nan")])
def test_a_period_that_is_none(period):
    with pytest.raises(ValueError, match=r"period is .*; give it in seconds, above zero"):
        TransportDelay(1, 0.1, period)
