"""A car that is not what the simulator believes is slowed down, and drives on once it is again."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import COUNT, Effects, make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.faults import Change
from drift_drake.drive.mpc.plan import plan_size
from drift_drake.drive.reference.trajectory import Reference, figure_8
from drift_drake.drive.screening.screen import ReadingKind
from drift_drake.gap.monitoring.correction import SlowDown, safe_pace, slowed
from drift_drake.gap.monitoring.in_loop import GapWatch
from drift_drake.gap.monitoring.monitor import make_monitor
from drift_drake.gap.monitoring.watch import WATCHED

VEHICLE = VehicleParameters()
STEPS = 5


@pytest.fixture(scope="module")
def short() -> Reference:
    return dataclasses.replace(figure_8(VEHICLE), distance=24.0)


def test_an_alarm_slows_down_until_the_simulator_is_believed_or_corrected():
    assert not slowed(False, 0.3, sensor=False, corrected=False)  # in doubt, as it was
    assert slowed(False, 0.01, sensor=False, corrected=False)
    assert slowed(True, 0.3, sensor=False, corrected=False)
    assert not slowed(True, 0.6, sensor=False, corrected=False)
    assert not slowed(True, 0.01, sensor=False, corrected=True)
    assert not slowed(True, 0.01, sensor=True, corrected=False)  # by readings that are wrong


def test_the_pace_asks_little_of_the_tyres(short):
    pace = safe_pace(short, VEHICLE)
    assert 0.5 * short.v.min() < pace < 0.7 * short.v.min()
    slippery = dataclasses.replace(VEHICLE, friction=0.25 * VEHICLE.friction)
    assert safe_pace(short, slippery) == pytest.approx(0.5 * pace)


@pytest.fixture
def system(short):
    return SlowDown(VEHICLE, short, ("none", "gyro_bias", "unknown"), STEPS)


def output_after(system: SlowDown, none: float, state: np.ndarray, correction: np.ndarray | None = None) -> np.ndarray:
    context = system.CreateDefaultContext()
    ports = {"plan": np.arange(plan_size(STEPS)), "command": [0.1, 50.0], "state": state,
             "posterior": [none, 0.0, 1.0 - none]}  # fmt: skip
    for name, value in ports.items() if correction is None else {**ports, "correction": correction}.items():
        system.GetInputPort(name).FixValue(context, value)
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    return system.GetOutputPort("paced_plan").Eval(context)


def test_plans_are_handed_on_where_they_are_to_be_followed(system):
    drifting, plan = np.array([0.7, 12.0, -0.6, 15.0, 0.0, 0.0, 5.0]), np.arange(plan_size(STEPS))
    np.testing.assert_array_equal(output_after(system, 1.0, drifting), plan)
    assert (output_after(system, 0.0, drifting) != plan).any()
    np.testing.assert_array_equal(output_after(system, 0.0, np.full(7, np.nan)), plan)  # the safe stop's to answer
    correction = np.array(make_effects({"friction_level": -0.2}))
    assert correction.shape == (COUNT,)
    np.testing.assert_array_equal(output_after(system, 0.0, drifting, correction), plan)


def slow_after(
    system: SlowDown, rows: list[tuple[float, list[float], ReadingKind]], correcting: bool = False, harder: float = 0.0
) -> bool:
    """Whether the car is slow after rows of (time, posterior, reading)."""
    context = system.CreateDefaultContext()
    drifting = np.array([0.7, 12.0, -0.6, 15.0, 0.0, 0.0, 5.0])
    ports = {
        "plan": np.arange(plan_size(STEPS)),
        "command": [0.1, 50.0],
        "state": drifting,
        "not_judged": [harder, 1.0],
    }
    for name, value in ports.items() if not correcting else {**ports, "correction": np.zeros(COUNT)}.items():
        system.GetInputPort(name).FixValue(context, value)
    for t, posterior, reading in rows:
        context.SetTime(t)
        system.GetInputPort("posterior").FixValue(context, posterior)
        system.GetInputPort("reading").FixValue(context, [float(reading)])
        context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    return bool(system.GetOutputPort("slow").Eval(context)[0])


GOOD, REFUSED = ReadingKind.GOOD, ReadingKind.DISAGREEING
NORMAL, UNKNOWN = [1.0, 0.0, 0.0], [0.0, 0.4, 0.6]  # none, gyro_bias, unknown


def test_a_cause_that_is_about_to_be_taken_slows_nothing(system):
    assert slow_after(system, [(0.0, UNKNOWN, GOOD)], correcting=True)
    assert not slow_after(system, [(0.0, [0.0, 0.6, 0.4], GOOD)], correcting=True)


def test_readings_that_were_refused_slow_nothing_until_the_simulator_is_believed_again(system):
    unknown_later = [(0.5, UNKNOWN, GOOD), (1.4, UNKNOWN, GOOD), (2.3, UNKNOWN, GOOD)]
    assert slow_after(system, [(0.0, NORMAL, GOOD), *unknown_later])
    assert not slow_after(system, [(0.0, NORMAL, REFUSED), *unknown_later])
    assert slow_after(system, [(0.0, NORMAL, REFUSED), (1.1, NORMAL, GOOD), (1.2, UNKNOWN, GOOD)])


@pytest.mark.parametrize(
    ("seconds", "correction", "slow"), [(0.2, 0.0, 0), (0.4, 0.0, 1), (5.0, 0.0, 1), (5.0, 0.1, 0)]
)
def test_driving_that_the_calibration_had_not_slows_down_what_is_not_corrected(system, seconds, correction, slow):
    context = system.CreateDefaultContext()
    for name, value in {"posterior": NORMAL, "not_judged": [seconds, 1.0], "correction": [correction] * COUNT}.items():
        system.GetInputPort(name).FixValue(context, value)
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    assert system.GetOutputPort("slow").Eval(context)[0] == slow


def test_driving_that_follows_readings_that_were_refused_slows_nothing(system):
    rows = [(0.0, NORMAL, REFUSED), (0.5, NORMAL, GOOD), (1.4, NORMAL, GOOD)]
    assert slow_after(system, [(0.0, NORMAL, GOOD), *rows[1:]], harder=0.5)
    assert not slow_after(system, rows, harder=0.5)
    assert not slow_after(system, rows, harder=0.0)


def test_a_car_on_a_slippery_road_is_slowed_down_on_its_lane_and_replays(short):
    loop = ClosedLoop(VEHICLE, short, NominalStepModel(VEHICLE), Effects(aero_drag=1e-9),
                      control=ControlConfig(horizon=8, period=0.02, delay=0.02),
                      watch=GapWatch(make_monitor(VEHICLE, used=WATCHED, period=0.02), "slow"))  # fmt: skip
    change = Change(0.5, make_effects({"friction_level": -0.25}))
    first, second = (loop.run(loop.initial_context(0), change=change) for _ in range(2))
    assert first.outcome == "completed"
    slow = first.table["slow"].to_numpy()
    assert 0.5 < first.table["t"][slow > 0.0].iloc[0] < 1.5
    assert slow[-1] == 1.0
    assert first.table["v"].iloc[-1] < 0.9 * short.v.min()
    assert first.table.drop(columns="solve_seconds").equals(second.table.drop(columns="solve_seconds"))
