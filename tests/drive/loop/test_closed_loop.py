"""The closed loop, end to end."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.single_track.plant import VehiclePlant
from drift_drake.car.step_model import NominalStepModel
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli import drive_run as drive_command
from drift_drake.cli.drive_run import ClosedLoopConfig, build, main, run_closed_loop
from drift_drake.drive.loop import runner
from drift_drake.drive.loop.closed_loop import ClosedLoop, ClosedLoopRun, ControlConfig
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.mpc.controller import MpcController
from drift_drake.drive.mpc.mpc import Mpc, MpcSolution
from drift_drake.drive.reference.trajectory import Reference, figure_8

PARAMETERS = VehicleParameters()
FAST = ControlConfig(horizon=15, period=0.02, delay=0.02)
SLOW = dataclasses.replace(FAST, period=0.04, delay=0.04)


@pytest.fixture(scope="module")
def reference() -> Reference:
    return figure_8(PARAMETERS)


@pytest.fixture(scope="module")
def short(reference: Reference) -> Reference:
    """The first 4 s of the figure-8: into the first transition."""
    return dataclasses.replace(reference, distance=50.0)


@pytest.fixture(scope="module")
def loop(reference: Reference) -> ClosedLoop:
    """Over the first 1.5 s."""
    brief = dataclasses.replace(reference, distance=18.0)
    return ClosedLoop(PARAMETERS, brief, NominalStepModel(PARAMETERS), control=FAST)


@pytest.fixture(scope="module", params=[75.0, pytest.param(None, marks=pytest.mark.slow)], ids=["transition", "whole"])
def figure_8_run(request: pytest.FixtureRequest) -> ClosedLoopRun:
    """Through the first transition, and all of it."""
    course = figure_8(PARAMETERS)
    course = dataclasses.replace(course, distance=request.param or course.distance)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drive_command, "figure_8", lambda *_, **__: course)
        return run_closed_loop(ClosedLoopConfig())


def test_drifts_the_figure_8(figure_8_run: ClosedLoopRun) -> None:
    """From 0.5 m and 0.1 rad off, with noise, at 100 Hz; as good as the issue's prototype (0.16 m, 0.08 rad)."""
    metrics = figure_8_run.metrics()
    assert metrics.outcome == "completed"
    assert metrics.completion == pytest.approx(1.0)
    assert metrics.solver_failures == 0
    assert metrics.rms_e < 0.16
    assert metrics.rms_sideslip_error < 0.08
    table = figure_8_run.table
    np.testing.assert_allclose(np.diff(table["t"]), 0.01, atol=1e-9)
    assert table["e"].iloc[0] == pytest.approx(0.5)
    assert (table["delta"].abs() <= PARAMETERS.steering_limit).all()
    # Sideslip of both signs, drifting: the rear rim turns faster than the car moves.
    assert table["beta"].min() < -0.5
    assert table["beta"].max() > 0.5
    assert (table["omega_r"] > table["v"]).mean() > 0.9


def test_world_pose_and_path_coordinates_agree(figure_8_run: ClosedLoopRun) -> None:
    table, path = figure_8_run.table, figure_8_run.reference.path
    x, y = path.to_world(table["s"].to_numpy(), table["e"].to_numpy())
    np.testing.assert_allclose(np.stack([x, y]), table[["x", "y"]].to_numpy().T, atol=0.02)


def drive(loop: ClosedLoop, seed: int) -> pd.DataFrame:
    table = loop.run(loop.initial_context(seed, np.array([0.0, 0.0, 0.1, 0.0, 0.5, 0.0]))).table
    return table.drop(columns="solve_seconds")


def test_replays_to_the_bit_from_its_seed(loop: ClosedLoop) -> None:
    first, other, again = (drive(loop, seed) for seed in (3, 4, 3))
    pd.testing.assert_frame_equal(first, again, check_exact=True)
    assert not first["measured_v"].equals(other["measured_v"])


def test_a_clone_of_a_context_goes_on_as_the_original_does(loop: ClosedLoop) -> None:
    context = loop.initial_context(0, np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.0]))
    clone = context.Clone()
    first, second = (loop.run(c).table.drop(columns="solve_seconds") for c in (context, clone))
    pd.testing.assert_frame_equal(first, second, check_exact=True)


def test_the_oracle_holds_a_car_that_the_nominal_model_throws_about(reference: Reference) -> None:
    effects = make_effects({"friction_level": -0.15, "steering_lag": 0.1, "torque_lag": 0.2})
    part = dataclasses.replace(reference, distance=55.0)
    outcomes = {}
    for name, model in (
        ("nominal", NominalStepModel(PARAMETERS)),
        ("oracle", EffectsStepModel(PARAMETERS, effects)),
    ):
        loop = ClosedLoop(PARAMETERS, part, model, effects=effects, control=SLOW)
        outcomes[name] = loop.run(loop.initial_context(0)).metrics()
    assert outcomes["oracle"].completed
    assert outcomes["oracle"].rms_e < 0.3
    assert outcomes["nominal"].rms_e > 3.0 * outcomes["oracle"].rms_e


@pytest.mark.parametrize(
    ("error", "limits", "outcome"),
    [
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], RunLimits(sideslip=0.3), "spin"),
        ([0.0, 0.0, 0.0, 0.0, 2.5, 0.0], RunLimits(lane_margin=-1.0), "left the lane"),
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], RunLimits(time_factor=0.001), "time is up"),
    ],
)
def test_a_run_ends_with_a_reason(loop: ClosedLoop, error: list[float], limits: RunLimits, outcome: str) -> None:
    assert loop.run(loop.initial_context(0, np.array(error)), limits).outcome == outcome


def test_what_is_compiled_first_is_not_the_first_plan_s_time(loop: ClosedLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    solve, calls = Mpc.solve, []

    def slow_at_first(self: Mpc, *args: Any) -> MpcSolution:
        calls.append(args)
        solution = solve(self, *args)
        seconds = 13.0 if len(calls) == 1 else solution.statistics.seconds
        return solution._replace(statistics=solution.statistics._replace(seconds=seconds))

    monkeypatch.setattr(Mpc, "solve", slow_at_first)
    run = loop.run(loop.initial_context(0), RunLimits(time_factor=0.02))
    assert 13.0 not in run.table["solve_seconds"].to_numpy()
    assert run.table["solve_seconds"].iloc[1] > 0.0


def test_main_writes_a_run_folder(
    short: Reference, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(drive_command, "figure_8", lambda *_, **__: short)
    main(ClosedLoopConfig(control=dataclasses.replace(FAST, horizon=20), out=tmp_path))
    assert "completed after" in capsys.readouterr().out
    names = {"config.json", "numbers.json", "versions.json", "run.csv", "overhead.png", "time_series.png", "solver.png",
             "replay.html"}  # fmt: skip
    assert names <= {path.name for path in tmp_path.iterdir()}
    assert json.loads((tmp_path / "numbers.json").read_text())["completed"] is True
    assert json.loads((tmp_path / "config.json").read_text())["seed"] == 0


def test_main_draws_the_graph(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(ClosedLoopConfig(out=tmp_path, model="online", graph=True))
    svg = (tmp_path / "closed_loop.svg").read_text()
    for name in (
        "adapter",
        "posterior_mean",
        "theta",
        "controller",
        "actuator",
        "plant",
        "sampler",
        "measured_state",
        "plan",
        "command",
    ):
        assert name in svg
    assert (tmp_path / "closed_loop.png").stat().st_size > 10_000
    assert "closed_loop.svg" in capsys.readouterr().out


@pytest.mark.parametrize("seed", [1, 13, 21])
def test_the_start_off_the_reference_is_left_behind(
    seed: int, short: Reference, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seeds that spun within 2 s while real-time steps were shortened to a tenth at once."""
    monkeypatch.setattr(drive_command, "figure_8", lambda *_, **__: short)
    run = run_closed_loop(ClosedLoopConfig(seed=seed, model="online"))
    assert run.outcome == "completed"
    assert run.table["e"][run.table["t"] > 2.0].abs().max() < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 5, 6, 7, 13, 19])
def test_the_nominal_car_stays_on_its_lane_while_the_belief_moves(seed: int) -> None:
    """Seeds that were lost while the line search's merit function was not exact."""
    run = run_closed_loop(ClosedLoopConfig(seed=seed, model="online"))
    assert run.outcome == "completed"
    assert run.table["e"][run.table["t"] > 2.0].abs().max() < 0.5
    assert run.metrics().unsolved_qps == 0


def test_a_delay_after_which_no_plan_would_come_into_force_is_refused() -> None:
    with pytest.raises(ValueError, match="at most two periods"):
        ControlConfig(period=0.01, delay=0.03)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan, np.inf])
def test_a_tolerance_that_no_plan_reaches_is_refused(tolerance: float) -> None:
    with pytest.raises(ValueError, match="give a number above 0, or leave it out"):
        ControlConfig(tolerance=tolerance)


def test_the_true_car_may_be_a_double_track_one(short: Reference) -> None:
    """Believing in the nearest single-track car, the controller drives it, less well than that car."""
    car = CARS["coupe"]
    belief = car.single_track()
    part = dataclasses.replace(figure_8(belief), distance=short.distance)
    runs = []
    for plant in (None, EquationsPlant(car, path=part.path)):
        loop = ClosedLoop(belief, part, NominalStepModel(belief), control=SLOW, plant=plant)
        runs.append(loop.run(loop.initial_context(0)))
    assert [run.outcome for run in runs] == ["completed", "completed"]
    assert runs[0].metrics().rms_sideslip_error < runs[1].metrics().rms_sideslip_error


def test_the_config_names_the_plant() -> None:
    loop = build(ClosedLoopConfig(plant="double_track"))
    assert isinstance(loop.car.plant, EquationsPlant)
    assert loop.parameters == CARS["coupe"].single_track()
    assert isinstance(build(ClosedLoopConfig()).car.plant, VehiclePlant)


def test_a_run_that_is_logged_to_a_file_is_the_run(
    loop: ClosedLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "ROWS", 20)
    in_memory = loop.run(loop.initial_context(3))
    in_file = loop.run(loop.initial_context(3), log_to=tmp_path / "run.csv")
    assert in_file.log == tmp_path / "run.csv"
    assert in_file.outcome == in_memory.outcome
    tables = [run.table.drop(columns="solve_seconds") for run in (in_memory, in_file)]
    pd.testing.assert_frame_equal(*tables, check_exact=True)


def test_a_car_that_is_known_is_driven_with_what_it_has(tmp_path: Path) -> None:
    """Its effects in the model, a delay as a lag, and its sensors' errors off the readings."""
    parameters, effects = VehicleParameters(), make_effects({"steering_delay": 0.05, "sideslip_bias": 0.03})
    write_vehicle(tmp_path / "known.yaml", parameters, effects)
    loop = build(ClosedLoopConfig(vehicle=tmp_path / "known.yaml", model="known"))
    assert isinstance(loop.controller, MpcController)
    model = loop.controller.mpc.model
    x, u, curvature = np.array([[0.5, 11.0, -0.5, 16.0, 0.1, 0.02]]), np.array([[-0.1, 150.0]]), np.zeros(1)
    expected = EffectsStepModel(parameters, make_effects({"steering_lag": 0.05}))
    x = np.hstack([x, expected.settled(x[0, :4], u[0])[None]])
    np.testing.assert_array_equal(model.step(x, u, 1.1 * u, curvature), expected.step(x, u, 1.1 * u, curvature))
    assert loop.diagram.HasSubsystemNamed("sensor_correction")
    assert not build(ClosedLoopConfig()).diagram.HasSubsystemNamed("sensor_correction")


def test_a_double_track_car_that_is_known_is_driven_as_one(tmp_path: Path) -> None:
    """What a file of such a car says is the plant, and what the controller plans with."""
    car, effects = CARS["roadster"].replace(differential_share=0.2), make_effects({"steering_lag": 0.05})
    write_vehicle(tmp_path / "known.yaml", car, effects)
    loop = build(ClosedLoopConfig(vehicle=tmp_path / "known.yaml", model="known"))
    assert isinstance(loop.car.plant, EquationsPlant)
    assert (loop.car.plant.parameters, loop.car.plant.effects) == (car, effects)
    assert loop.parameters == car.single_track()
    assert isinstance(loop.controller, MpcController)
    model = loop.controller.mpc.model
    assert isinstance(model, EquationsStepModel)
    assert (model.parameters, model.effects) == (car, effects)
    blind = build(ClosedLoopConfig(vehicle=tmp_path / "known.yaml"))
    assert isinstance(blind.car.plant, EquationsPlant)
    assert isinstance(blind.controller, MpcController)
    assert isinstance(blind.controller.mpc.model, NominalStepModel)
