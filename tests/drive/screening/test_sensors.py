"""Sampling, holding, noise and its seed, biases and latency of the sensors."""

import dataclasses

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.sensors import LOG_ROW, MEASURED_STATE, SIGNALS, NoiseLevels, Sensors

SIZES = {"state": 6, "path_position": 1, "pose": 3, "acceleration": 2}
SLOPES = np.arange(1.0, 13.0)  # of the twelve signals, so that each has its own value at each time


class Reader(LeafSystem):
    """Remembers in its Context what a discrete update at 100 Hz sees."""

    def __init__(self, size):
        LeafSystem.__init__(self)
        self.DeclareVectorInputPort("u", size)
        self.DeclareDiscreteState(size)
        self.DeclarePeriodicDiscreteUpdateEvent(0.01, 0.0, self._read)
        self.DeclareStateOutputPort("seen", self.DeclareDiscreteState(1))

    def _read(self, context, discrete):
        discrete.set_value(0, self.get_input_port().Eval(context))


class Bench:
    """Sensors before signals that grow linearly with time: signal i is slope i times t."""

    def __init__(self, noise=None, effects=Effects(), log_period=0.01):
        builder = DiagramBuilder()
        self.sensors = builder.AddNamedSystem("sensors", Sensors(noise or NoiseLevels.none(), effects))
        at = 0
        for name, size in SIZES.items():
            ends = np.stack([np.zeros(size), 1000.0 * SLOPES[at : at + size]], axis=1)
            line = PiecewisePolynomial.FirstOrderHold([0.0, 1000.0], ends)
            source = builder.AddNamedSystem(f"true_{name}", TrajectorySource(line))
            builder.Connect(source.get_output_port(), self.sensors.GetInputPort(name))
            at += size
        self.reader = builder.AddNamedSystem("reader", Reader(len(LOG_ROW)))
        builder.Connect(self.sensors.GetOutputPort("log_row"), self.reader.get_input_port())
        self.logs = {
            name: LogVectorOutput(self.sensors.GetOutputPort(name), builder, log_period)
            for name in ("measured_state", "log_row")
        }
        self.diagram = builder.Build()

    def run(self, duration, seed=None, log="log_row"):
        """(times, data) of the log of a fresh Context."""
        context = self.diagram.CreateDefaultContext()
        if seed is not None:
            self.sensors.set_seed(context, seed)
        Simulator(self.diagram, context).AdvanceTo(duration)
        found = self.logs[log].FindLog(context)
        return found.sample_times(), found.data()


def slopes_of(names):
    return np.array([SLOPES[SIGNALS.index(name)] for name in names])


def test_ports_are_named():
    sensors = Sensors()
    inputs = [sensors.get_input_port(i) for i in range(sensors.num_input_ports())]
    outputs = [sensors.get_output_port(i) for i in range(sensors.num_output_ports())]
    assert {port.get_name(): port.size() for port in inputs} == SIZES
    assert {port.get_name(): port.size() for port in outputs} == {"measured_state": 7, "log_row": 10}


def test_rows_of_the_log_are_those_of_the_log_format():
    assert LOG_ROW == ("t", "x", "y", "psi", "r", "v", "beta", "omega_r", "ax", "ay")
    assert {field.name for field in dataclasses.fields(NoiseLevels)} == set(SIGNALS)


def test_perfect_sensors_say_the_truth_at_the_sampling_times():
    bench = Bench()
    times, rows = bench.run(0.3)
    np.testing.assert_allclose(times, 0.01 * np.arange(31), atol=1e-12)
    np.testing.assert_allclose(rows[0], times, atol=1e-12)
    np.testing.assert_allclose(rows[1:], np.outer(slopes_of(LOG_ROW[1:]), times), atol=1e-9)
    times, states = bench.run(0.3, log="measured_state")
    np.testing.assert_allclose(states, np.outer(slopes_of(MEASURED_STATE), times), atol=1e-9)


def test_a_sample_is_held_until_the_next():
    times, rows = Bench(log_period=0.0025).run(0.1)
    sampled = 0.01 * np.floor(times / 0.01 + 1e-6)
    np.testing.assert_allclose(rows[0], sampled, atol=1e-12)
    np.testing.assert_allclose(rows[1:], np.outer(slopes_of(LOG_ROW[1:]), sampled), atol=1e-9)


def test_an_update_at_a_sampling_time_sees_that_times_sample():
    """What a controller at 100 Hz reads is not one sample old, and is the row that is logged, noise included."""
    bench = Bench(NoiseLevels())
    context = bench.diagram.CreateDefaultContext()
    bench.sensors.set_seed(context, 5)
    simulator = Simulator(bench.diagram, context)
    simulator.AdvanceTo(0.055)
    seen = bench.reader.GetMyContextFromRoot(context).get_discrete_state(0).value()
    assert seen[0] == pytest.approx(0.05)
    np.testing.assert_array_equal(bench.logs["log_row"].FindLog(context).data()[:, -1], seen)


def test_noise_has_the_standard_deviations_asked_for():
    levels = NoiseLevels()
    bench = Bench(levels)
    for log, names in (("log_row", LOG_ROW[1:]), ("measured_state", MEASURED_STATE)):
        times, data = bench.run(40.0, seed=1, log=log)
        noise = data[-len(names) :] - np.outer(slopes_of(names), times)
        count = len(times)
        for name, series in zip(names, noise, strict=True):
            level = getattr(levels, name)
            # Five standard errors of a mean, of a standard deviation and of a lag-one correlation.
            assert abs(series.mean()) < 5.0 * level / np.sqrt(count), name
            assert abs(series.std() / level - 1.0) < 5.0 / np.sqrt(2.0 * count), name
            assert abs(np.corrcoef(series[1:], series[:-1])[0, 1]) < 5.0 / np.sqrt(count), name
        correlation = np.corrcoef(noise) - np.eye(len(names))
        assert np.abs(correlation).max() < 5.0 / np.sqrt(count)


def test_a_run_replays_to_the_bit_from_its_seed():
    bench = Bench(NoiseLevels(), Effects(sensor_latency=0.025))
    _, first = bench.run(0.5, seed=7)
    _, again = bench.run(0.5, seed=7)
    _, other = bench.run(0.5, seed=8)
    np.testing.assert_array_equal(first, again)
    assert not np.any(first[1:] == other[1:])
    _, rebuilt = Bench(NoiseLevels(), Effects(sensor_latency=0.025)).run(0.5, seed=7)
    np.testing.assert_array_equal(first, rebuilt)


def test_a_cloned_context_goes_on_alike():
    bench = Bench(NoiseLevels())
    context = bench.diagram.CreateDefaultContext()
    bench.sensors.set_seed(context, 3)
    Simulator(bench.diagram, context).AdvanceTo(0.237)
    clone = context.Clone()
    for one in (context, clone):
        Simulator(bench.diagram, one).AdvanceTo(0.5)
    rows = [bench.logs["log_row"].FindLog(one).data()[:, -1] for one in (context, clone)]
    np.testing.assert_array_equal(rows[0], rows[1])


def test_biases_act_on_what_is_measured():
    effects = Effects(gyro_bias=0.03, sideslip_bias=-0.02, wheel_radius_error=0.05)
    times, rows = Bench(effects=effects).run(0.2)
    true = np.outer(slopes_of(LOG_ROW[1:]), times)
    expected = true.copy()
    expected[LOG_ROW.index("r") - 1] += 0.03
    expected[LOG_ROW.index("beta") - 1] -= 0.02
    expected[LOG_ROW.index("omega_r") - 1] *= 1.05
    np.testing.assert_allclose(rows[1:], expected, atol=1e-9)


@pytest.mark.parametrize("latency", [0.02, 0.0234, 0.12])
def test_latency_is_exact_and_leaves_the_noise_white(latency):
    times, rows = Bench(effects=Effects(sensor_latency=latency)).run(0.5)
    np.testing.assert_allclose(rows[0], times, atol=1e-12)
    late = np.maximum(times - latency, 0.0)
    np.testing.assert_allclose(rows[1:], np.outer(slopes_of(LOG_ROW[1:]), late), atol=1e-9)

    noisy = Bench(NoiseLevels(), Effects(sensor_latency=latency))
    times, rows = noisy.run(20.0, seed=2)
    noise = rows[1:] - np.outer(slopes_of(LOG_ROW[1:]), np.maximum(times - latency, 0.0))
    levels = np.array([getattr(NoiseLevels(), name) for name in LOG_ROW[1:]])
    np.testing.assert_allclose(noise.std(axis=1), levels, rtol=5.0 / np.sqrt(2.0 * len(times)))
    for series in noise:
        assert abs(np.corrcoef(series[1:], series[:-1])[0, 1]) < 5.0 / np.sqrt(len(times))


@pytest.mark.parametrize("level", [-0.1, float("nan"), float("inf")])
def test_noise_that_is_no_standard_deviation(level):
    with pytest.raises(ValueError, match=r"noise of ay is .*; give a standard deviation, zero or more"):
        NoiseLevels(ay=level)
