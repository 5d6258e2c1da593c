"""The ladder from the paper's recipe to the shipped model."""

import dataclasses
import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.executors import ExecutorConfig
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.learnt.adapter import DEFAULT_THRESHOLD
from drift_drake.drive.learnt.checkpoint import load_model, paper_checkpoint
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.drive.reference.trajectory import figure_8
from experiments.drifting import improvements, runs
from experiments.drifting.improvements import (
    ImprovementsConfig,
    checkpoints,
    drive_ladder,
    ladder,
    markdown,
    medians_table,
    names_between,
    of_models,
    picture,
    steps_table,
    summarise_ladder,
)
from experiments.drifting.runs import EXTRAS, ModelsConfig, paper_control
from experiments.gathering.recipe import as_in_paper


def test_the_ladder_begins_as_in_the_paper_and_ends_as_shipped() -> None:
    rungs = ladder()
    first, last = ModelsConfig(as_in_paper=True).resolved(), ModelsConfig()
    assert (rungs[0].gathering, rungs[0].path_step) == (first.gathering, first.path_step)
    assert paper_control(ControlConfig(), DEFAULT_THRESHOLD, rungs[0].keep) == (first.control, first.gate)
    assert paper_control(ControlConfig(), DEFAULT_THRESHOLD, rungs[-1].keep) == (last.control, last.gate)
    assert (rungs[-1].gathering, rungs[-1].path_step) == (last.gathering, last.path_step)
    assert (rungs[0].learnt, rungs[-1].learnt) == ("paper", "shipped")


def test_each_rung_of_the_papers_model_adds_to_the_one_before() -> None:
    def switched(name: str) -> dict[str, Any]:
        rung = next(rung for rung in ladder() if rung.name == name)
        before, now = dataclasses.asdict(as_in_paper(GatheringConfig())), dataclasses.asdict(rung.gathering)
        return {key: value for key, value in now.items() if value != before[key]} | {
            "control": rung.path_step,
            "keep": rung.keep,
        }

    steps = [switched(rung.name) for rung in ladder() if rung.learnt == "paper"]
    added = [{key: now[key] for key in now if before.get(key) != now[key]} for before, now in pairwise(steps)]
    assert added == [
        {"qp": "stagewise", "keep": EXTRAS},
        {"bounded": True, "ends_straight": True, "alpha": 8.0, "only_converged": False},  # the bounds bear more weight
        {"fixed_alpha": False},
        {"objective_later": "drifts"},
        {"path_step": "trapezoid", "checks": True},
        {"control": "trapezoid"},
    ]


def test_the_papers_model_is_only_given_the_drifts_to_plan_for(tmp_path: Path) -> None:
    files = checkpoints(ImprovementsConfig(), tmp_path)
    assert files["shipped"] is None
    assert "between" not in files
    found, paper = load_model(files["paper"]), load_model(paper_checkpoint())
    assert found.content_hash() == paper.content_hash()
    np.testing.assert_array_equal(found.drifts, load_model().drifts)


def test_checkpoints_between_the_two_are_rungs_of_their_own(tmp_path: Path) -> None:
    files = (tmp_path / "actuators.npz", tmp_path / "tyres.npz")
    for file in files:
        shutil.copy(paper_checkpoint(), file)
    config = ImprovementsConfig(between=files, rungs=("actuators", "shipped"))
    (tmp_path / "out").mkdir()
    found = checkpoints(config, tmp_path / "out")
    assert load_model(found["tyres"]).content_hash() == load_model(paper_checkpoint()).content_hash()
    assert load_model(found["tyres"]).drifts is not None
    rungs = ladder(list(names_between(config)))
    assert [rung.name for rung in rungs][-5:] == ["actuators", "tyres", "model", "shipped", "lags"]
    assert (rungs[-5].gathering, rungs[-5].path_step) == (rungs[-2].gathering, rungs[-2].path_step)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"between": ("a/x.npz", "b/x.npz")}, "--between: x names two rungs"),
        ({"between": ("paper.npz",)}, "--between: paper names two rungs"),
        ({"rungs": ("x",)}, "--rungs x: give some of paper, extras, bounds"),
    ],
)
def test_rungs_have_names_of_their_own(options: dict[str, Any], message: str) -> None:
    options["between"] = tuple(Path(path) for path in options.get("between", ()))
    with pytest.raises(InvalidOptionError, match=message):
        names_between(ImprovementsConfig(**options))


def made_up(rungs: list[improvements.Rung]) -> pd.DataFrame:
    rows = [
        {"rung": rung.name, "model": model, "vehicle": vehicle, "completed": vehicle + k > 0, "rms_e": 0.5 + 0.1 * k}
        for k, rung in enumerate(rungs) for model in rung.models for vehicle in range(3)
    ]  # fmt: skip
    runs = pd.DataFrame(rows).assign(
        noise_seed=0, drifting=1.0, completion=1.0, rms_sideslip_error=0.1, solver_failures=0, solve_ms_median=1.0
    )
    return runs.assign(outcome=np.where(runs["completed"], "completed", "spin"))


def test_the_table_counts_failures_and_leaves_out_what_cannot_change() -> None:
    rungs = ladder()[:4]
    table = medians_table(rungs, summarise_ladder(made_up(rungs))).splitlines()
    assert table[2] == "| as in the paper |" + 5 * " 0.50, 2 of 3 |"
    assert table[5].endswith("|  |  |  | 0.80, 3 of 3 |  |")  # which changes a second round alone
    report = markdown(rungs, made_up(rungs), summarise_ladder(made_up(rungs)))
    assert "### as in the paper" in report
    assert "### Once-OCP: each less" in report
    alone = rungs[:1]
    assert "each less" not in markdown(alone, made_up(alone), summarise_ladder(made_up(alone)))


def test_each_rung_is_held_against_the_one_before_vehicle_by_vehicle() -> None:
    rungs = ladder()[:3]
    _, _, _, _, second, third = steps_table(rungs, made_up(rungs), "twice_info").splitlines()
    # Of three vehicles the first spins on the first rung; completed runs are 0.1 m farther off with each rung.
    label, completed, drifted, ahead = second.strip("| ").split(" | ")
    assert label == rungs[1].what
    assert completed == drifted
    assert completed.startswith("+33% (+0% to +")
    assert ahead == "1 of 3 vehicles"
    assert third.endswith("| +0% (+0% to +0%) | +0% (+0% to +0%) | 0 of 3 vehicles |")


def test_some_models_need_some_rungs_alone() -> None:
    assert [rung.name for rung in of_models(ladder(), ["prior", "online"])] == [
        "paper",
        "extras",
        "control",
        "model",
        "lags",
    ]
    assert of_models(ladder(), ["online"])[0].models == ("online",)


def test_the_picture_has_a_row_a_rung() -> None:
    rungs = ladder()
    axes = picture(rungs, made_up(rungs)).axes[0]
    assert [label.get_text() for label in axes.get_yticklabels()] == [rung.what for rung in rungs]
    axes = picture(rungs, made_up(rungs), "prior").axes[0]
    assert len(axes.get_yticklabels()) == 4  # of the ladder's rungs, those that change it


def test_a_rung_is_driven_and_gone_on_with(
    tmp_path: Path, here: ExecutorConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    course = dataclasses.replace(figure_8(VehicleParameters()), distance=10.0)
    monkeypatch.setattr(runs, "reference", lambda _: course)
    fast = ControlConfig(horizon=12, period=0.05, delay=0.05)
    monkeypatch.setattr(improvements, "paper_control", lambda *_: (fast, DEFAULT_THRESHOLD))
    short = dataclasses.replace(as_in_paper(GatheringConfig(steps=15, v_end=10.0, starts=1)))
    rungs = [rung._replace(models=("prior", "once_ocp"), gathering=short) for rung in ladder()[:1]]
    config = ImprovementsConfig(vehicles=2, population="train", run_on=here)
    found = drive_ladder(config, rungs, tmp_path)
    assert list(found["vehicle"]) == [0, 0, 1, 1]
    assert set(found["rung"]) == {"paper"}
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "paper").glob("*-00*")}
    assert len(before) == 2 * (1 + 2 * 2)  # beliefs, and two files a run
    pd.testing.assert_frame_equal(drive_ladder(config, rungs, tmp_path), found)
    assert {path: path.stat().st_mtime_ns for path in before} == before
