"""A Drake system of the user's own as the controller of the closed loop."""

from typing import Any

import numpy as np
import pytest
from pydrake.systems.framework import Context, LeafSystem

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.drive.loop.closed_loop import ClosedLoop, ClosedLoopRun, ControlConfig
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.loop.faults import parse_fault
from drift_drake.drive.mpc.controller import InvalidControllerError
from drift_drake.drive.reference.trajectory import Reference, straight_line

CAR = VehicleParameters()


class Integral(LeafSystem):
    """Feedback with an integral of the speed's error in the Context."""

    def __init__(self, inputs: int = 7, outputs: int = 2) -> None:
        super().__init__()
        self.measured = self.DeclareVectorInputPort("measured", inputs)
        self.sum = self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(0.02, 0.0, self.update)
        self.DeclareVectorOutputPort("command", outputs, self.calc)

    def update(self, context: Context, discrete: Any) -> None:
        error = 15.0 - self.measured.Eval(context)[1]
        discrete.set_value(self.sum, context.get_discrete_state(self.sum).value() + 0.02 * error)

    def calc(self, context: Context, output: Any) -> None:
        x = self.measured.Eval(context)
        integral = context.get_discrete_state(self.sum).value()[0]
        output.SetFromVector([-0.1 * x[4] - 0.5 * x[5] - 0.1 * x[0], 60.0 * (15.0 - x[1]) + 20.0 * integral])


@pytest.fixture(scope="module")
def lane() -> Reference:
    return straight_line(14.0, 15.0, 6.0)


def driven(lane: Reference, *faults: str, inputs: int = 7, **options: Any) -> ClosedLoopRun:
    control = ControlConfig(period=0.02, delay=0.02)
    given = [parse_fault(text) for text in faults]
    loop = ClosedLoop(CAR, lane, controller=Integral(inputs), control=control, faults=given, **options)
    return loop.run(loop.initial_context(0), RunLimits(time_factor=0.5))


@pytest.mark.parametrize("inputs", [7, 6])
def test_it_drives_and_replays_to_the_bit(lane: Reference, inputs: int) -> None:
    one, two = (driven(lane, inputs=inputs, effects={"aero_drag": 1.0}).table for _ in range(2))
    assert one["v"].iloc[-1] == pytest.approx(15.0, abs=0.3)
    assert one.drop(columns="solve_seconds").equals(two.drop(columns="solve_seconds"))


def test_missing_readings_are_failures_and_its_states_stay_numbers(lane: Reference) -> None:
    run = driven(lane, "dropout:1:0.2")
    assert run.metrics().solver_failures == 10
    assert np.isfinite(run.table[["delta", "tau"]].to_numpy()).all()


def test_effects_by_name_are_the_effects(lane: Reference) -> None:
    one, other = (driven(lane, effects=effects).table["v"] for effects in ({"aero_drag": 1.0}, Effects(aero_drag=1.0)))
    np.testing.assert_array_equal(one, other)
    with pytest.raises(InvalidVehicleError, match="unknown effect drag; the catalogue has"):
        driven(lane, effects={"drag": 1.0})
    with pytest.raises(InvalidVehicleError, match="list holds no effects; give magnitudes by name"):
        driven(lane, effects=[1.0])


@pytest.mark.parametrize(
    ("controller", "says"),
    [
        (object(), r"the controller is object; give an object with evaluate\(x, s, t\), or a Drake system"),
        (Integral, "the controller is the class Integral; give an object"),
        (Integral(3), r"inputs of \[3\] and outputs of \[2\] numbers; give it one input of 7"),
        (Integral(7, 3), r"outputs of \[3\] numbers"),
    ],
)
def test_what_is_no_controller_is_said(lane: Reference, controller: Any, says: str) -> None:
    with pytest.raises(InvalidControllerError, match=says):
        ClosedLoop(CAR, lane, controller=controller)
