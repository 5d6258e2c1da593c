"""The figure-8 experiment as a user calls it."""

import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_plant import CarWithOwnStates
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.car.path_plant import CurvedPath, PathPlant
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.executors import ExecutorConfig, NoClusterError, run_jobs
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.learnt.checkpoint import load_varied, paper_checkpoint
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.mpc.controller import MpcController
from drift_drake.drive.reference.trajectory import figure_8
from drift_drake.gap.choose import choice
from drift_drake.gap.choose.choice import Findings, usual_surprise
from drift_drake.gap.choose.identified import IdentifiedCar
from experiments.drifting import runs as drift_runs
from experiments.drifting.figure_8 import main
from experiments.drifting.runs import Learnt, ModelsConfig
from experiments.gathering import beliefs
from experiments.gathering.recipe import as_in_paper
from experiments.other_worlds import true_cars
from experiments.settings import OtherExperimentError

pytestmark = pytest.mark.usefixtures("undrawn")

FAST = ControlConfig(horizon=12, period=0.05, delay=0.05)
SHORT = GatheringConfig(steps=10, v_end=9.0, starts=1)


def config(out: Path, run_on: ExecutorConfig) -> ModelsConfig:
    models = ("once_info", "twice_online", "nominal")
    return ModelsConfig(
        vehicles=1,
        population="train",
        noise_seeds=1,
        models=models,
        control=FAST,
        gathering=SHORT,
        run_on=run_on,
        out=out,
    )


@pytest.fixture(autouse=True)
def short_course(monkeypatch: pytest.MonkeyPatch) -> None:
    course = dataclasses.replace(figure_8(VehicleParameters()), distance=12.0)
    monkeypatch.setattr(drift_runs, "reference", lambda _: course)


def test_every_vehicle_may_have_an_effect_besides() -> None:
    also = ModelsConfig(population="held_out", also={"steering_delay": 0.1})
    without = ModelsConfig(population="held_out")
    assert also.effects(2) == without.effects(2)._replace(steering_delay=0.1)
    with pytest.raises(InvalidOptionError, match="--also steering_dely: no such effect; did you mean steering_delay"):
        ModelsConfig(also={"steering_dely": 0.1}).effects(0)


def test_a_folder_of_an_older_version_is_reported(tmp_path: Path, here: ExecutorConfig) -> None:
    np.savez(tmp_path / "beliefs-000-0.npz", surprise=1.0, wanted=["once_info"])
    with pytest.raises(beliefs.OtherVersionError, match=r"beliefs-000-0\.npz: written by an older version"):
        main(config(tmp_path, here))


def test_runs_and_resumes(tmp_path: Path, here: ExecutorConfig, capsys: pytest.CaptureFixture[str]) -> None:
    main(config(tmp_path, here))
    report = capsys.readouterr().out
    assert "| Twice-Info, adapting |" in report
    assert "| median | 1.31 |" in report  # the paper's Once-Info
    assert set(json.loads((tmp_path / "numbers.json").read_text())) == {"once_info", "twice_online", "nominal"}
    made = {path.name for path in tmp_path.iterdir()}
    assert {"overhead.png", "time_series.png", "runs.csv", "config.json", "versions.json", "report.md"} <= made
    assert {"beliefs-000-0.npz", "once_info-000-0.csv", "twice_online-000-0.json"} <= made
    assert not any(name.endswith(".partial") for name in made)
    before = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*-000-*")}
    # More models join what is there; what is there stays.
    main(dataclasses.replace(config(tmp_path, here), models=("once_info", "twice_online", "nominal", "prior")))
    after = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*-000-*")}
    assert {name: after[name] for name in before} == before
    assert "prior-000-0.json" in after


def test_a_double_track_car_is_gathered_from_and_drifts(
    tmp_path: Path, here: ExecutorConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    plants: list[bool] = []

    def noted(car: true_cars.TrueCar, effects: Effects, path: CurvedPath) -> PathPlant | None:
        assert effects.lateral_load_transfer == 0.0  # it has its own
        assert effects.mass_error != 0.0
        found = true_cars.true_plant(car, effects, path)
        plants.append(isinstance(found, CarWithOwnStates))
        return found

    for module in (drift_runs, beliefs):
        monkeypatch.setattr(module, "true_plant", noted)
    double = dataclasses.replace(config(tmp_path, here), plant="double_track", models=("once_info", "oracle"))
    main(double)
    for model in ("once_info", "oracle"):
        assert json.loads((tmp_path / f"{model}-000-0.json").read_text())["outcome"] == "completed"
    assert plants == [True, True, True, True]  # for the steering's check, along the lane, and in both drifts
    loop = drift_runs.closed_loop(
        drift_runs.DriveJob("", {}, "figure_8", double.effects(0), 0, "oracle", FAST, "double_track")
    )
    assert isinstance(loop.controller, MpcController)
    assert isinstance(loop.controller.mpc.model, EquationsStepModel)


def test_the_drives_choose_the_model(tmp_path: Path, here: ExecutorConfig, capsys: pytest.CaptureFixture[str]) -> None:
    """The car that they identify where that predicts them; else the prior, adapting."""
    both = dataclasses.replace(config(tmp_path, here), models=("identified", "chosen", "chosen_once"))
    main(both)  # of drives of 1.5 s no car is identified
    kept = json.loads((tmp_path / "chosen-000-0.json").read_text())
    assert kept["identified_error"] is None  # infinite
    assert kept["believed"] == "adapting"
    said = capsys.readouterr().out
    assert (
        "Chosen by the drives: adapting 1; identified with an additional fault: none; as a double-track car: 0." in said
    )
    learnt = drift_runs.load_model(None)
    taught = beliefs.gather_all([(0, 0)], both.effects, frozenset({"identified"}), learnt, SHORT, tmp_path, here)[0, 0]
    car = IdentifiedCar(VehicleParameters().replace(mass=1700.0), Effects()._replace(torque_lag=0.1))
    believing = drift_runs.Believing(learnt, "trapezoid", usual_surprise(learnt))
    for error, found in ((0.007, "identified"), (0.1, "adapting")):
        reported = dataclasses.replace(taught, findings={"identified": Findings(car, error)})
        labels, believes = believing("chosen", reported)
        assert (labels["believed"], labels["refused"]) == (found, found == "adapting")
        if found == "identified":
            assert believes == car
        else:
            assert isinstance(believes, Learnt)
            assert (believes.adapting, believes.lags) == (True, True)
            assert believes.model.content_hash() == load_varied().content_hash()
        assert believing("identified", reported)[1] == car
        assert believing("chosen_once", reported)[0]["believed"] == "adapting"  # which asks the first drive alone


def test_a_brush_car_is_another_for_each_vehicle_and_known_to_its_oracle(tmp_path: Path, here: ExecutorConfig) -> None:
    brush = dataclasses.replace(config(tmp_path, here), plant="brush", models=("online",), vehicles=2)
    assert brush.car(0) != brush.car(1)
    assert brush.car(1) == dataclasses.replace(brush, noise_seeds=3).car(1)
    main(brush)
    runs = [json.loads((tmp_path / f"online-00{i}-0.json").read_text()) for i in range(2)]
    assert runs[0]["rms_e"] != runs[1]["rms_e"]
    loop = drift_runs.closed_loop(
        drift_runs.DriveJob("", {}, "figure_8", brush.effects(1), 0, "oracle", FAST, brush.car(1))
    )
    assert isinstance(loop.controller, MpcController)
    assert isinstance(loop.controller.mpc.model, EquationsStepModel)
    assert loop.controller.mpc.model.parameters == brush.car(1)


@pytest.mark.parametrize("vehicle", [VehicleParameters().replace(mass=1700.0), CARS["saloon"]])
def test_an_identified_car_is_kept_with_what_was_taught(
    tmp_path: Path, here: ExecutorConfig, monkeypatch: pytest.MonkeyPatch, vehicle: CarParameters
) -> None:
    car = IdentifiedCar(vehicle, Effects()._replace(torque_lag=0.1))
    monkeypatch.setattr(choice, "identified", lambda *_, **__: car)
    settings = dataclasses.replace(config(tmp_path, here), models=("identified",))
    main(settings)
    taught = beliefs.gather_all([(0, 0)], settings.effects, frozenset({"identified"}), drift_runs.load_model(None),
                                SHORT, tmp_path, here)[0, 0]  # fmt: skip
    found = taught.findings["identified"]
    assert found.car == car
    assert np.isfinite([found.error, found.as_it_is]).all()
    assert "too gentle" in found.doubts[-1]


def test_a_folder_of_another_experiment_is_refused(tmp_path: Path, here: ExecutorConfig) -> None:
    drift_runs.opened("figure_8", config(tmp_path, here))
    other = dataclasses.replace(config(tmp_path, here), population="wide")
    with pytest.raises(OtherExperimentError, match="another population; give another folder"):
        drift_runs.opened("figure_8", other)


def test_the_shared_gathering_is_that_of_one_seed(here: ExecutorConfig, tmp_path: Path) -> None:
    """Once-Info's belief is the one that Twice-Info goes on from, whichever models are asked for."""
    first = config(tmp_path, here)
    learnt = drift_runs.load_model(None)
    both = first.gathered(frozenset({"once_info", "twice_info"}), learnt, tmp_path)[0, 0]
    assert set(both.beliefs) == {"once_info", "twice_info"}
    (tmp_path / "one").mkdir()
    alone = first.gathered(frozenset({"once_info"}), learnt, tmp_path / "one")[0, 0]
    assert set(alone.beliefs) == {"once_info"}
    assert (alone.beliefs["once_info"].mean == both.beliefs["once_info"].mean).all()
    assert alone.surprise == both.surprise is not None


def test_a_missing_engine_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(NoClusterError, match="pip install"):
        run_jobs(ExecutorConfig(executor="dask"), abs, [1], lambda _job, _result: None, "job")


def test_as_in_the_paper_is_the_papers_model_and_gathering() -> None:
    found = ModelsConfig(as_in_paper=True, gathering=SHORT).resolved()
    assert found.checkpoint == paper_checkpoint()
    assert found.path_step == "euler"
    assert found.gathering == as_in_paper(SHORT)
    assert ModelsConfig().resolved() == ModelsConfig()


def test_as_in_the_paper_is_without_what_the_paper_has_not() -> None:
    found, control = ModelsConfig(as_in_paper=True).resolved(), ControlConfig()
    off = {
        "screening": False,
        "fresh_guesses": False,
        "delay": 0.0,
        "patience": 0.0,
        "qp": "osqp",
        "osqp_iterations": 200,
    }
    assert found.control == dataclasses.replace(control, **off)
    assert (found.gate, found.gathering.qp) == (np.inf, "osqp")
    kept = ModelsConfig(as_in_paper=True, keep=drift_runs.EXTRAS).resolved()
    assert (kept.control, kept.gate, kept.gathering.qp) == (control, ModelsConfig.gate, "stagewise")
    one = ModelsConfig(as_in_paper=True, keep=("delay",)).resolved()
    assert one.control == dataclasses.replace(found.control, delay=control.delay)
    with pytest.raises(InvalidOptionError, match="--keep delay: give --as-in-paper too"):
        ModelsConfig(keep=("delay",)).resolved()


def test_a_car_is_driven_without_what_the_paper_has_not() -> None:
    control, gate = drift_runs.paper_control(FAST, ModelsConfig.gate, ())
    learnt = drift_runs.load_model(paper_checkpoint())
    believes = drift_runs.Learnt(learnt, learnt.prior(), adapting=True, path_step="euler", gate=gate)
    loop = drift_runs.closed_loop(drift_runs.DriveJob("", {}, "figure_8", Effects(), 0, believes, control))
    assert loop.screen is None
    assert loop.safe_stop is None
    run = loop.run(loop.initial_context(seed=0), RunLimits(time_factor=0.08))
    assert run.outcome == "time is up"
    assert run.metrics().qp_fallbacks == run.metrics().restarts == 0
    assert not (run.table["solve_restart"] > 0.0).any()
    assert loop.adapter is not None
