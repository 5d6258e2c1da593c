"""What follows an answer, in the browser as by the command: the corrected car and its replay, the next drive."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from drift_drake.app import stages
from drift_drake.app.project import Project
from drift_drake.car.templates import TEMPLATES
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.main import main
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.prior import Interval
from drift_drake.gap.estimation.problem import NUISANCES, PROCESS_NOISE
from experiments.benchmarks.compiled_cases import NOISE
from tests.app.conftest import Workbench
from tests.app.test_more_ways import answer

PATIENCE = 1.2e6  # [ms] of a plan
RUN = "t,r,v,delta_cmd\n" + "".join(f"{0.01 * k:.2f},0,10,0\n" for k in range(60))


def belief(**effects):
    """A rival as an answer holds it, of a probability of a half."""
    count = len(NUISANCES)
    theta, root = [0.0] * count + list(effects.values()), np.diag([0.3] * count + [0.02] * len(effects))
    return {"probability": 0.5, "theta": theta, "root": root.tolist()}


@pytest.fixture
def folder(tmp_path):
    """A day whose answer leaves a lag and a delay open."""
    project = Project(tmp_path / "car")
    for name in ("logs/monday", "answers"):
        (project.folder / name).mkdir(parents=True)
    (project.folder / "logs/monday/run_0.csv").write_text(RUN)
    write_vehicle(project.folder / "car.yaml", TEMPLATES["coupe"])
    found = answer("effect", steering_lag=Interval(0.08, 0.07, 0.09))
    rivals = {"steering_lag": belief(steering_lag=0.08), "steering_delay": belief(steering_delay=0.07)}
    beliefs = {"noise": [NOISE[name] for name in CHANNELS], "used": [True] * len(CHANNELS), "own": {}, "tempering": 1.0,
               "process": (PROCESS_NOISE**2).tolist(), "hypotheses": rivals}  # fmt: skip
    found = dataclasses.replace(found, ambiguity=list(rivals), details=found.details | {"beliefs": beliefs})
    (project.folder / "answers" / "monday.json").write_text(found.to_json())
    (project.folder / "answers" / "monday.html").write_text("")
    project.set_option("as_it_is", True)
    with project.changing() as data:
        stage = stages.diagnose(project, "monday", data)
        data["steps"][stage.name] = {"ended": "done", "inputs": stage.digest()}
    return project.folder


def test_a_correction_is_replayed_as_by_the_command(folder, window, tmp_path, monkeypatch):
    workbench = Workbench(folder)
    try:
        one = window(workbench, width=390, scheme="dark")
        one.go("Apply")
        one.page.get_by_role("button", name="Apply monday").click()
        one.page.locator(".diff .plus", has_text="steering_lag").wait_for()
        one.page.get_by_role("button", name="Replay run_0").click()
        shown = one.page.frame_locator("iframe[title='Replay of run_0.csv']")
        shown.get_by_text("corrected").first.wait_for()
        shown.get_by_role("button", name="pause").click()
        shown.get_by_role("button", name="play").wait_for()
        assert one.flaws() == []
        one.page.close()
    finally:
        workbench.close()
    monkeypatch.chdir(folder)
    fixed, again = tmp_path / "fixed.yaml", tmp_path / "again.html"
    assert main(["apply", "answers/monday.json", "--vehicle", "car.yaml", "--out", str(fixed)]) == 0
    assert fixed.read_bytes() == Path("corrected/monday.yaml").read_bytes()
    words = ["--vehicle", "car.yaml", "--corrected", "corrected/monday.yaml", "--html", str(again)]
    assert main(["replay", "logs/monday/run_0.csv", *words]) == 0
    assert again.read_bytes() == Path("replays/monday run_0.html").read_bytes()


@pytest.mark.slow
def test_the_next_drive_is_planned(folder, window, tmp_path, monkeypatch):
    workbench = Workbench(folder)
    try:
        one = window(workbench)
        one.go("Apply")
        part = one.page.get_by_role("region", name="The next drive after monday")
        part.get_by_role("button", name="Plan after monday").click()
        part.locator(".state.done").wait_for(timeout=PATIENCE)
        part.get_by_text("What the drive is expected to bring").click()
        part.get_by_text("is expected to fall behind").wait_for()
        part.locator(".chart .scatterlayer .trace").nth(4).wait_for()
        with one.page.expect_download() as saved:
            part.get_by_role("link", name="Save plans/monday.csv").click()
        saved.value.save_as(tmp_path / "saved.csv")
        one.page.close()
    finally:
        workbench.close()
    monkeypatch.chdir(folder)
    again = tmp_path / "plan.csv"
    assert main(["plan-next", "answers/monday.json", "--vehicle", "car.yaml", "--out", str(again)]) == 0
    assert again.read_bytes() == Path("plans/monday.csv").read_bytes() == (tmp_path / "saved.csv").read_bytes()
