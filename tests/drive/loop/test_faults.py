"""Faults between the parts of a loop, and the screen that keeps bad readings from the controller."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import MEASURED_STATE, NoiseLevels
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.loop.fault_systems import ActuatorFaults, PlanFaults, SensorFaults, SolverFaults
from drift_drake.drive.loop.faults import Change, Fault, parse_fault, patch_friction, with_patches
from drift_drake.drive.screening.screen import FROZEN, ReadingKind, Screen, reading_kind, spoilt_channels

PERIOD = 0.01
GOOD = np.array([0.1, 12.0, -0.1, 13.0, 0.2, 0.05, 3.0])


def reading(t: float) -> np.ndarray:
    """A car that goes straight on and brakes a little."""
    return GOOD + t * np.array([0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 12.0])


class Source(LeafSystem):
    """Readings, or plans that start now: [t, t]."""

    def __init__(self, values: object, size: int) -> None:
        LeafSystem.__init__(self)
        self.DeclareVectorOutputPort(
            "y", size, lambda context, output: output.SetFromVector(values(context.get_time()))
        )


def logged(source: LeafSystem, system: LeafSystem, names: tuple[str, ...] = (), end: float = 1.0) -> list[np.ndarray]:
    """What the system gives each period [rows, size], a port each."""
    builder = DiagramBuilder()
    builder.AddSystem(source)
    builder.AddSystem(system)
    builder.Connect(source.get_output_port(), system.get_input_port(0))
    ports = [system.GetOutputPort(name) for name in names] or [system.get_output_port(0)]
    sinks: list[VectorLogSink] = [LogVectorOutput(port, builder, PERIOD) for port in ports]
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(end - 0.5 * PERIOD)
    return [sink.FindLog(simulator.get_context()).data().T for sink in sinks]


def faulted(*faults: str) -> np.ndarray:
    return logged(Source(reading, 7), SensorFaults([parse_fault(text) for text in faults]))[0]


def exact() -> np.ndarray:
    return np.array([reading(PERIOD * k) for k in range(100)])


def test_a_fault_acts_in_its_time_alone() -> None:
    x, good = faulted("dropout:0.2:0.1", "bias:0.5:0.2:0.3:r"), exact()
    assert np.isnan(x[20:30]).all()
    np.testing.assert_allclose(x[50:70, 0] - good[50:70, 0], 0.3)
    good[20:30], good[50:70, 0] = np.nan, x[50:70, 0]
    np.testing.assert_array_equal(x, good)


def test_readings_freeze_come_late_and_lose_a_channel() -> None:
    x, good = faulted("freeze:0.2:0.1", "delay:0.5:0.2:0.05", "nan:0.8:0.1:0:omega_r"), exact()
    np.testing.assert_array_equal(x[20:30], np.tile(good[19], (10, 1)))
    np.testing.assert_array_equal(x[30], good[30])
    np.testing.assert_array_equal(x[50:70], good[45:65])
    assert np.isnan(x[80:90, MEASURED_STATE.index("omega_r")]).all()
    assert np.isnan(x).sum() == 10


def test_a_freeze_from_the_start_repeats_the_first_reading() -> None:
    np.testing.assert_array_equal(faulted("freeze:0:0.3")[:30], np.tile(exact()[0], (30, 1)))


def test_readings_jitter_within_their_bound_and_replay() -> None:
    x, good = faulted("jitter:0.2:0.5:0.05"), exact()
    late = np.rint((good[20:70, 6] - x[20:70, 6]) / 0.12).astype(int)
    assert set(late) == set(range(6))
    np.testing.assert_array_equal(x[20:70], good[np.arange(20, 70) - late])
    np.testing.assert_array_equal(x, faulted("jitter:0.2:0.5:0.05"))


def test_the_plans_clock_drifts() -> None:
    plans = Source(lambda t: [t, t], 2)
    y = logged(plans, PlanFaults(2, [parse_fault("clock_drift:0.2:0.5:0.1")]))[0]
    t = PERIOD * np.arange(100)
    np.testing.assert_allclose(y[20:70, 0] - t[20:70], 0.1 * (t[20:70] - 0.2), atol=1e-12)
    np.testing.assert_array_equal(y[70:, 0], y[70:, 1])


def test_the_solver_gets_nothing_while_it_fails() -> None:
    x = logged(Source(reading, 7), SolverFaults([parse_fault("solver_failure:0.2:0.1")]))[0]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(x).all(axis=1)), np.arange(20, 30))


def test_a_saturated_actuator_has_a_share_of_its_range() -> None:
    car = VehicleParameters()
    commands = Source(lambda _: [car.steering_limit, car.torque_min], 2)
    u = logged(commands, ActuatorFaults([parse_fault("saturated:0.2:0.1:0.25")], car))[0]
    np.testing.assert_allclose(u[20:30], 0.25 * u[0] * np.ones((10, 1)))
    np.testing.assert_array_equal(u[30:], u[:1] * np.ones((70, 1)))


def test_actuators_stick_and_are_lost_in_their_time_alone() -> None:
    car = VehicleParameters()
    commands = Source(lambda t: [0.5 * t, 100.0 + 100.0 * t], 2)
    faults = ["steering_stuck:0.2:0.1", "torque_stuck:0.5:0.1", "torque_lost:0.8:0.1"]
    u = logged(commands, ActuatorFaults([parse_fault(text) for text in faults], car))[0]
    wanted = np.array([[0.5 * t, 100.0 + 100.0 * t] for t in PERIOD * np.arange(100)])
    wanted[20:30, 0], wanted[50:60, 1], wanted[80:90, 1] = wanted[19, 0], wanted[49, 1], 0.0
    np.testing.assert_allclose(u, wanted, atol=1e-12)


def test_a_channel_holds_its_value_with_its_noise_and_drifts() -> None:
    x, good = faulted("hold:0.2:0.3:0:v", "drift:0.6:0.2:0.5:beta"), exact()
    held = x[20:50, 1] - good[19, 1]
    assert 0.3 * NoiseLevels().v < held.std() < 3.0 * NoiseLevels().v
    assert np.abs(held).max() < 5.0 * NoiseLevels().v
    np.testing.assert_allclose(x[60:80, 2] - good[60:80, 2], 0.5 * PERIOD * np.arange(20), atol=1e-12)
    good[20:50, 1], good[60:80, 2] = x[20:50, 1], x[60:80, 2]
    np.testing.assert_array_equal(x, good)
    np.testing.assert_array_equal(x, faulted("hold:0.2:0.3:0:v", "drift:0.6:0.2:0.5:beta"))


def test_patches_change_the_friction_between_their_edges() -> None:
    faults = [parse_fault("friction_patch:1:2:-0.5"), parse_fault("friction_patch:2:2:-0.2")]
    assert [patch_friction(t, faults) for t in (0.0, 1.0, 2.5, 3.5, 4.0)] == pytest.approx([1.0, 0.5, 0.4, 0.8, 1.0])
    changes = with_patches(Change(2.5, Effects(friction_level=0.1)), Effects(), faults)
    assert [change.time for change in changes] == [1.0, 2.0, 2.5, 3.0, 4.0]
    levels = [change.effects.friction_level for change in changes]
    assert levels == pytest.approx([-0.5, -0.6, 0.4 * 1.1 - 1.0, 0.8 * 1.1 - 1.0, 0.1])


def test_plans_are_lost_and_late() -> None:
    plans = Source(lambda t: [t, t], 2)
    y = logged(plans, PlanFaults(2, [parse_fault("lost_plans:0.2:0.1"), parse_fault("late_plans:0.5:0.2:0.03")]))[0]
    t = PERIOD * np.arange(100)
    assert np.isnan(y[20:30]).all()
    np.testing.assert_allclose(y[50:70, 0], t[47:67])
    np.testing.assert_allclose(y[70:, 0], t[70:])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("dropout", "KIND:START:DURATION"),
        ("dropout:x:1", "KIND:START:DURATION"),
        ("fire:1:1", "fault 'fire' is unknown; give one of dropout"),
        ("spike:1:1:5:mass", "'mass' is no channel; give one of r, v"),
        ("dropout:-1:1", "a start of 0 s or more"),
        ("dropout:1:nan", "a duration above 0"),
        ("delay:1:1:1e9", "a delay above 0, up to 10 s"),
        ("bias:1:1:inf", "a finite size"),
        ("saturated:1:1:2", "the share of the command's range"),
        ("friction_patch:1:1:-1", "a change of friction of -0.95"),
        ("clock_drift:1:1:-1", "a share of -0.9"),
    ],
)
def test_a_fault_that_is_none_is_refused(text: str, says: str) -> None:
    with pytest.raises(InvalidOptionError, match=says):
        parse_fault(text)


def test_a_fault_is_written_in_short() -> None:
    assert parse_fault("spike:3:0.02") == Fault("spike", 3.0, 0.02, 1e6, "v")
    assert parse_fault("bias:1:2:0.05:beta") == Fault("bias", 1.0, 2.0, 0.05, "beta")


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({}, ReadingKind.GOOD),
        ({0: np.nan}, ReadingKind.MISSING),
        ({6: np.inf}, ReadingKind.MISSING),
        ({1: 0.0}, ReadingKind.STOPPED),
        ({1: -3.0}, ReadingKind.STOPPED),
        ({0: 1e6}, ReadingKind.JUMPED),
        ({4: 3.0}, ReadingKind.JUMPED),
        ({6: 900.0}, ReadingKind.GOOD),  # the path's start passed
    ],
)
def test_what_a_reading_is(change: dict[int, float], kind: ReadingKind) -> None:
    x = GOOD.copy()
    for channel, value in change.items():
        x[channel] = value
    assert reading_kind(x, spoilt_channels(x, GOOD, PERIOD), 0) == kind


def test_a_reading_is_no_jump_after_a_while_unless_it_is_no_car_s() -> None:
    x = GOOD + np.array([0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0])
    assert reading_kind(x, spoilt_channels(x, GOOD, 0.1), 0) == ReadingKind.JUMPED
    assert reading_kind(x, spoilt_channels(x, GOOD, 1.0), 0) == ReadingKind.GOOD
    assert reading_kind(1e6 * x, spoilt_channels(1e6 * x, GOOD, 1.0), 0) == ReadingKind.JUMPED
    assert reading_kind(x, spoilt_channels(x, np.full(7, np.nan), 0.0), 0) == ReadingKind.GOOD


def test_the_screen_hands_good_readings_on_and_counts_the_others() -> None:
    def spoilt(t: float) -> np.ndarray:
        k = round(t / PERIOD)
        if 20 <= k < 25:
            return np.full(7, np.nan)
        if k == 40:
            return reading(t) + 1e6
        return reading(0.6) if 60 <= k < 70 else reading(t)

    x, kinds, counts = logged(Source(spoilt, 7), Screen(), ("screened_state", "reading", "counts"))
    frozen = np.arange(60 + FROZEN, 70)
    bad = np.concatenate([np.arange(20, 25), [40], frozen])
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(x[:, 0])), bad)
    good = np.setdiff1d(np.arange(100), bad)
    np.testing.assert_array_equal(x[good], np.array([spoilt(PERIOD * k) for k in good]))
    assert [int(kinds[k, 0]) for k in (20, 40, 69, 70)] == [
        ReadingKind.MISSING,
        ReadingKind.JUMPED,
        ReadingKind.FROZEN,
        ReadingKind.GOOD,
    ]
    np.testing.assert_array_equal(counts[-1], [99 - len(bad), 5, 0, 1, len(frozen), 0])


def test_a_verdict_is_of_its_contexts_reading_whatever_was_judged_before() -> None:
    screen = Screen()
    contexts = [screen.CreateDefaultContext() for _ in range(2)]
    readings = [reading(0.3), np.full(7, np.nan)]
    for context, x in zip(contexts, readings, strict=True):
        screen.GetInputPort("measured_state").FixValue(context, x)
    for _ in range(2):
        for context, x in zip(contexts, readings, strict=True):
            context.SetTime(context.get_time() + PERIOD)  # asked anew
            np.testing.assert_array_equal(screen.GetOutputPort("screened_state").Eval(context), x)
