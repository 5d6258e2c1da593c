"""The closed loop with faults: no wrong number reaches the car, what is wrong is counted, the run goes on."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from faulted_loops import FAST, PARAMETERS, loop_with
from pydrake.systems.framework import Context

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import InvalidVehicleError
from drift_drake.car.path_plant import MotionError
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.single_track.motion import STATES
from drift_drake.cli.drive_run import ClosedLoopConfig, main
from drift_drake.common.errors import DriftDrakeError, InvalidOptionError
from drift_drake.drive.loop.actuation import LinearInterpolationActuator, PlanStatus
from drift_drake.drive.loop.car import Car
from drift_drake.drive.loop.faults import Change
from drift_drake.drive.mpc.sqp import LineSearchSqp
from drift_drake.drive.reference.trajectory import Reference


@pytest.fixture(scope="module")
def short(short: Reference) -> Reference:
    """The first 1.8 s, beyond the faults."""
    return dataclasses.replace(short, distance=22.0)


@pytest.mark.parametrize(
    ("fault", "counted", "number"),
    [
        ("dropout:1:0.2", "missing_readings", 10),
        ("nan:1:0.2:0:r", "missing_readings", 10),
        ("spike:1:0.2:1e6:r", "jumped_readings", 10),
        ("bias:1:0.2:-30:v", "stopped_readings", 10),
        ("freeze:1:0.2", "frozen_readings", 8),
        ("lost_plans:1:0.4", "late_plans", 16),
        ("lost_plans:0:0.5", "missing_plans", 20),
        ("late_plans:1:0.3:0.06", "refused_plans", 2),
        ("solver_failure:1:0.2", "solver_failures", 10),
    ],
)
def test_a_fault_is_counted_and_the_run_goes_on(short: Reference, fault: str, counted: str, number: int) -> None:
    loop = loop_with(short, fault)
    run = loop.run(loop.initial_context(0))
    metrics = run.metrics()
    assert metrics.outcome == "completed"
    assert getattr(metrics, counted) == number
    assert counted == "solver_failures" or f"{number} {counted.replace('_', ' ')}" in metrics.faults()
    assert np.isfinite(run.table[["delta", "tau", "e", "v"]].to_numpy()).all()


@pytest.mark.parametrize("fault", ["jitter:0.5:1:0.04", "saturated:0.5:0.3:0.5", "friction_patch:0.5:0.3:-0.3"])
def test_a_fault_that_no_screen_can_see_moves_the_car(short: Reference, fault: str) -> None:
    tables = []
    for faults in ([], [fault]):
        loop = loop_with(dataclasses.replace(short, distance=12.0), *faults)
        tables.append(loop.run(loop.initial_context(0)).table)
    before = tables[0]["t"] < 0.49
    states = list(STATES)
    np.testing.assert_allclose(tables[0][states][before], tables[1][states][before], rtol=1e-6, atol=1e-6)
    at = int((tables[0]["t"] < 0.8).sum())
    assert np.abs(tables[0][states].iloc[at] - tables[1][states].iloc[at]).max() > 0.01


def test_plans_of_a_clock_that_runs_ahead_end_in_a_stop(short: Reference) -> None:
    loop = loop_with(short, "clock_drift:0.2:99:1")
    metrics = loop.run(loop.initial_context(0)).metrics()
    assert metrics.outcome == "stopped safely"


def test_a_reading_that_is_frozen_from_the_first_is_counted(short: Reference) -> None:
    loop = loop_with(dataclasses.replace(short, distance=8.0), "freeze:0:99")
    metrics = loop.run(loop.initial_context(0)).metrics()
    assert metrics.frozen_readings > 0
    assert metrics.outcome != "completed"


@pytest.mark.parametrize(
    "effects", [Effects(friction_level=float("nan")), Effects(mass_error=-2.0), Effects(steering_lag=-0.1)]
)
def test_an_effect_that_no_car_has_is_refused(short: Reference, effects: Effects) -> None:
    with pytest.raises(InvalidVehicleError, match="the car: effects"):
        loop_with(short, effects=effects)
    with pytest.raises(InvalidVehicleError, match="the car: yaw_inertia is 1e-09"):
        Car(PARAMETERS.replace(yaw_inertia=1e-9))


@pytest.mark.parametrize("seed", [-1, 2**70, 1.5])
def test_a_seed_that_is_none_is_refused(short: Reference, seed: int) -> None:
    with pytest.raises(InvalidOptionError, match="give a whole number, 0 or more"):
        loop_with(short).initial_context(seed)


def test_nothing_is_counted_where_nothing_is_wrong(short: Reference) -> None:
    loop = loop_with(short)
    assert loop.run(loop.initial_context(0)).metrics().faults() == ""


def test_the_model_of_effects_survives_readings_that_are_none(short: Reference) -> None:
    effects = Effects(steering_lag=0.05)
    loop = loop_with(
        short, "dropout:0.5:0.2", "nan:0:0.1:0:r", effects=effects, model=EffectsStepModel(PARAMETERS, effects)
    )
    metrics = loop.run(loop.initial_context(0)).metrics()
    assert metrics.outcome == "completed"
    assert metrics.solver_failures == metrics.missing_readings == 15


@pytest.mark.parametrize(
    "error",
    [ValueError("workspace"), ZeroDivisionError(), np.linalg.LinAlgError("singular"), SystemExit("condition failed")],
)
def test_an_error_of_the_solver_is_a_failure(
    short: Reference, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    solve, calls = LineSearchSqp.solve, iter(range(10**6))

    def failing(self: LineSearchSqp, *args: object) -> object:
        if 20 <= next(calls) < 25:
            raise error
        return solve(self, *args)

    monkeypatch.setattr(LineSearchSqp, "solve", failing)
    loop = loop_with(short)
    metrics = loop.run(loop.initial_context(0)).metrics()
    assert metrics.outcome == "completed"
    assert metrics.solver_failures == 5


@pytest.mark.parametrize("error", [MotionError("no number"), RuntimeError("no step"), SystemExit("condition failed")])
def test_a_simulation_that_fails_is_a_named_outcome(
    short: Reference, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    command = LinearInterpolationActuator._command

    def failing(self: LinearInterpolationActuator, context: Context) -> list[float]:
        if context.get_time() > 0.5:
            raise error
        return command(self, context)

    monkeypatch.setattr(LinearInterpolationActuator, "_command", failing)
    loop = loop_with(short)
    run = loop.run(loop.initial_context(0))
    assert (run.outcome, run.error) == ("simulation failed", str(error))
    assert run.table["t"].iloc[-1] == pytest.approx(0.5)


@pytest.mark.parametrize(("at", "value", "name"), [(1, np.nan, "v"), (0, np.inf, "r"), (4, -np.inf, "e")])
def test_a_state_that_is_none_is_refused(short: Reference, at: int, value: float, name: str) -> None:
    error = np.zeros(6)
    error[at] = value
    with pytest.raises(DriftDrakeError, match=f"has {name} = .*; give finite numbers"):
        loop_with(short).initial_context(0, error)


def test_a_motion_without_numbers_ends(short: Reference) -> None:
    loop = loop_with(short)
    context = loop.initial_context(0)
    plant = loop.car.plant
    plant.GetMyMutableContextFromRoot(context).get_mutable_continuous_state_vector().SetAtIndex(1, np.nan)
    assert loop.run(context).outcome == "simulation failed"


def test_the_centre_of_the_path_is_off_the_lane(short: Reference) -> None:
    loop = loop_with(short)
    centre = 1.0 / float(short.path.curvature(0.0))
    assert loop.run(loop.initial_context(0, np.array([0.0, 0.0, 0.0, 0.0, centre, 0.0]))).outcome == "left the lane"
    read_there = loop_with(short, f"bias:1:0.1:{centre}:e")
    metrics = read_there.run(read_there.initial_context(0)).metrics()
    assert (metrics.outcome, metrics.jumped_readings) == ("completed", 5)


def test_what_the_actuator_does_is_logged(short: Reference) -> None:
    loop = loop_with(short, "lost_plans:1:0.4")
    table = loop.run(loop.initial_context(0)).table
    age, status = table["plan_age"].to_numpy(), table["plan_status"].to_numpy()
    assert status[0] == PlanStatus.MISSING
    assert np.isinf(age[0])
    late = (table["t"] >= 1.12) & (table["t"] < 1.39)
    assert (status[late] == PlanStatus.LATE).all()
    assert (np.diff(age[late]) > 0.0).all()
    assert (table["refused_plans"] == 0.0).all()


def test_places_that_are_none_have_no_row(short: Reference) -> None:
    for s in (np.nan, np.inf, -np.inf):
        assert np.isnan(short.state(s)[:4]).all()
        assert np.isnan(short.lane(s)).all()
        assert np.isnan(short.path.curvature(float(s)))
    assert np.isfinite(short.state(np.array([1.0, np.nan]))[0]).all()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (Change(float("nan"), Effects(aero_drag=1.0)), "a time of 0 s or more"),
        (Change(1.0, Effects(aero_drag=float("nan"))), "effects.aero_drag"),
        (Change(1.0, Effects(mass_error=-2.0)), "effects.mass_error"),
        (Change(1.0, Effects(steering_delay=0.1)), "steering_delay from 0 to 0.1 would do nothing"),
        (Change(1.0, Effects(gyro_bias=0.01)), "gyro_bias from 0 to 0.01 would do nothing"),
    ],
)
def test_a_change_that_is_none_is_refused(short: Reference, change: Change, says: str) -> None:
    loop = loop_with(short, effects=Effects(aero_drag=1.0))
    with pytest.raises(ValueError, match=says):
        loop.run(loop.initial_context(0), change=change)


def test_a_change_after_the_end_leaves_the_time_limit(short: Reference) -> None:
    loop = loop_with(dataclasses.replace(short, distance=8.0), effects=Effects(aero_drag=1.0))
    run = loop.run(loop.initial_context(0), change=Change(1000.0, Effects(aero_drag=1.0)))
    assert run.table["t"].iloc[-1] < 5.0


@pytest.mark.usefixtures("undrawn")
def test_main_takes_faults_and_tells_them(
    short: Reference, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drift_drake.cli.drive_run.figure_8", lambda *_, **__: short)
    main(ClosedLoopConfig(control=FAST, fault=("dropout:0.5:0.1", "lost_plans:1:0.2"), out=tmp_path))
    assert "faults: 5 missing readings" in capsys.readouterr().out
    assert json.loads((tmp_path / "numbers.json").read_text())["missing_readings"] == 5
