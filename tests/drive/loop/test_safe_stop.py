"""The safe ending: without valid plans the car comes to a stop on its lane, whatever the reason."""

import dataclasses

import numpy as np
import pytest
from faulted_loops import FAST, PARAMETERS, loop_with

from drift_drake.car.log.driving import slowest
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.drive.mpc.stopping import FASTEST, stopping_command, stopping_plan
from drift_drake.drive.reference.trajectory import Reference


@pytest.mark.parametrize(
    "fault", ["dropout:0.5:99", pytest.param("lost_plans:0.5:99", marks=pytest.mark.slow), "nan:0.5:99:0:e"]
)
def test_a_drifting_car_is_brought_to_a_stop_on_its_lane(short: Reference, fault: str) -> None:
    loop = loop_with(short, fault)
    run = loop.run(loop.initial_context(0))
    metrics = run.metrics()
    assert metrics.outcome == "stopped safely"
    assert metrics.stopping_from == pytest.approx(0.5 + FAST.delay + FAST.patience, abs=2 * FAST.period)
    assert "brought to a stop" in metrics.faults()
    assert abs(run.table["beta"].iloc[0]) > 0.5  # from a drift
    low, high = short.lane(run.table["s"].to_numpy())
    assert ((low <= run.table["e"]) & (run.table["e"] <= high)).all()
    most = PARAMETERS.friction * PARAMETERS.gravity * FAST.period  # that tyres brake by in a period
    assert run.table["v"].iloc[-1] < slowest(PARAMETERS) + most  # the last row is before the end


def test_a_short_fault_stops_nothing(short: Reference) -> None:
    loop = loop_with(short, "dropout:0.5:0.4")
    metrics = loop.run(loop.initial_context(0)).metrics()
    assert (metrics.outcome, metrics.stopping_from) == ("completed", None)


def test_a_stop_is_for_good_and_replays_to_the_bit(short: Reference) -> None:
    loop = loop_with(short, "lost_plans:0.2:0.8")
    first, second = (loop.run(loop.initial_context(3)).table.drop(columns="solve_seconds") for _ in range(2))
    stopping = first["stopping"].to_numpy()
    assert stopping[-1] == 1.0
    assert (np.diff(stopping) >= 0.0).all()
    assert first.equals(second)


def test_without_it_the_last_command_is_held(short: Reference) -> None:
    loop = loop_with(dataclasses.replace(short, distance=90.0), "lost_plans:0.5:99", patience=0.0)
    run = loop.run(loop.initial_context(0))
    assert run.outcome in ("spin", "left the lane")
    assert "stopping" not in run.table


def test_a_patience_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="patience is -1 s"):
        ControlConfig(patience=-1.0)


def test_the_law_has_no_side() -> None:
    x = np.array([0.5, 12.0, -0.4, 14.0, 1.0, -0.1])
    mirrored = x * [-1.0, 1.0, -1.0, 1.0, -1.0, -1.0]
    one, other = stopping_command(x, 0.05, PARAMETERS), stopping_command(mirrored, -0.05, PARAMETERS)
    np.testing.assert_allclose(one * [-1.0, 1.0], other)


def test_the_law_straightens_the_wheel_where_nothing_is_known() -> None:
    command = stopping_command(np.full(6, np.nan), 0.0, PARAMETERS)
    np.testing.assert_array_equal(command, [0.0, PARAMETERS.torque_min])


def test_the_command_changes_no_faster_than_it_may() -> None:
    plan = stopping_plan(1.0, np.array([0.3, 400.0]), np.array([-0.3, -50.0]), 5, 0.01)
    np.testing.assert_allclose(plan.u, np.tile(np.array([0.3, 400.0]) - 0.01 * FASTEST, (6, 1)))
