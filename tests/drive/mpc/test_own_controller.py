"""A controller of the user's own in the closed loop: its commands reach the car, its failures are counted."""

from typing import Any

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.loop.closed_loop import ClosedLoop, ClosedLoopRun, ControlConfig
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.loop.faults import Fault
from drift_drake.drive.mpc.controller import Controller, InvalidPlanError, commands_at
from drift_drake.drive.mpc.mpc import NoPlanError
from drift_drake.drive.mpc.plan import Plan
from drift_drake.drive.reference.trajectory import Reference, straight_line

PARAMETERS = VehicleParameters()
CONTROL = ControlConfig(delay=0.02)
SHORT = RunLimits(time_factor=0.1)


class Ramp:
    """A plan whose steering ramps in from the moment of asking, by 0.02 rad a second."""

    def evaluate(self, x: Any, s: float, t: float) -> Any:  # noqa: ARG002
        return Plan(0.0, np.array([[0.0, 100.0], [0.2, 100.0]]), dt=10.0)


class Failing:
    """A command that there is none for during half a second, three times over in other ways."""

    def evaluate(self, x: Any, s: float, t: float) -> Any:  # noqa: ARG002
        if 0.30 <= t < 0.395:
            raise NoPlanError("none from here")
        if 0.40 <= t < 0.495:
            raise ZeroDivisionError
        return (np.nan, 0.0) if 0.50 <= t < 0.595 else (0.01 * t, 50.0)


@pytest.fixture(scope="module")
def reference() -> Reference:
    return straight_line(14.0, 14.0, 20.0)


def driven(controller: Controller, reference: Reference, **options: Any) -> ClosedLoopRun:
    loop = ClosedLoop(PARAMETERS, reference, control=CONTROL, controller=controller, **options)
    return loop.run(loop.initial_context(seed=0), SHORT)


def test_a_plan_is_followed_from_the_delay_on(reference: Reference) -> None:
    table = driven(Ramp(), reference).table
    later = table["t"] > CONTROL.delay + 1e-9
    np.testing.assert_allclose(table["delta"][later], 0.02 * table["t"][later], atol=1e-12)


def test_what_fails_is_counted_and_the_last_command_goes_on(reference: Reference) -> None:
    run = driven(Failing(), reference)
    assert run.metrics().solver_failures == 30
    table = run.table.set_index(run.table["t"].round(2))
    assert table.loc[0.60, "delta"] == pytest.approx(0.01 * 0.29)
    assert table.loc[0.70, "delta"] == pytest.approx(0.01 * 0.68)
    assert np.isnan(run.metrics().sqp_iterations)


def test_a_run_replays_to_the_bit(reference: Reference) -> None:
    one, two = (driven(Failing(), reference).table.drop(columns="solve_seconds") for _ in range(2))
    assert one.equals(two)


def test_a_mistake_is_said_and_not_counted() -> None:
    with pytest.raises(InvalidPlanError, match=r"shape \(3,\); let evaluate return a Plan"):
        commands_at([0.0, 1.0, 2.0], np.zeros(1))


def test_one_thing_plans(reference: Reference) -> None:
    for planners in ({}, {"model": NominalStepModel(PARAMETERS), "controller": Ramp()}):
        with pytest.raises(ValueError, match="not both"):
            ClosedLoop(PARAMETERS, reference, **planners)
    with pytest.raises(ValueError, match="has none"):
        ClosedLoop(PARAMETERS, reference, controller=Ramp(), adapter=BayesianAdapter(load_model()))


def test_a_car_without_plans_is_stopped(reference: Reference) -> None:
    run = driven(Ramp(), reference, faults=[Fault("lost_plans", 0.1, 9.0, 1.0)])
    assert run.metrics().stopping_from == pytest.approx(0.6, abs=0.1)
