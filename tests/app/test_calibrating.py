"""A calibration: closed or killed in the middle and opened again; which stretches it is judged by."""

import fcntl
import json
import signal
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from drift_drake.app import stages
from drift_drake.app.jobs import LOCK
from drift_drake.app.project import Project
from drift_drake.car.templates import TEMPLATES
from drift_drake.car.vehicle_file import write_vehicle
from tests.app.conftest import WAIT, Workbench

sys.path.append(str(Path(__file__).parents[1] / "gap" / "logs"))
from importing_bench import rows

CUT_OFF = "net::ERR_CONTENT_LENGTH_MISMATCH"
CHECKED = {"for_calibration": {"good_enough": True, "missing": [], "remarks": [], "outlook": {}}}


@pytest.fixture
def folder(tmp_path):
    """A day that may be calibrated on, and an earlier calibration."""
    project = Project(tmp_path / "car")
    for name in ("logs/monday", "check"):
        (project.folder / name).mkdir(parents=True)
    pd.DataFrame(rows(noise=0.3, seed=0)).to_csv(project.folder / "logs/monday/run_0.csv", index=False)
    (project.folder / "check" / "monday.json").write_text(json.dumps(CHECKED))
    write_vehicle(project.folder / "car.yaml", TEMPLATES["coupe"])
    for name in stages.calibrate(project, project.read()).outputs:
        (project.folder / name).write_text("{}")
    with project.changing() as data:
        stage = stages.check_day(project, "monday", data)
        data["steps"][stage.name] = {"ended": "done", "inputs": stage.digest()}
    return project.folder


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_what_is_lost_is_said_and_one_button_runs_it_again(folder, window, how):
    workbench = Workbench(folder)
    one = window(workbench)
    one.go("Calibrate")
    one.page.get_by_role("button", name="Calibrate", exact=True).click()
    one.page.get_by_text("%)").wait_for()  # it computes
    one.page.close()
    workbench.process.send_signal(how)
    workbench.close()
    if how == signal.SIGKILL:
        (folder / "calibrated.yaml").write_text("half")
    again = Workbench(folder)
    try:
        other = window(again)
        other.go("Calibrate")
        other.page.get_by_text("was cut off when the workbench ended").wait_for()
        assert gone(folder)
        assert [(folder / f"calibrated.{ending}").read_text() for ending in ("yaml", "json", "html")] == ["{}"] * 3
        other.page.get_by_role("button", name="Calibrate", exact=True).click()
        other.page.get_by_role("button", name="Cancel the calibration").click()
        other.page.get_by_text("was cancelled; files are as they were before").wait_for()
        other.page.close()
    finally:
        again.close()
    for window_ in (one, other):  # a file of the page may be cut off with its workbench
        window_.wrong = [what for what in window_.wrong if CUT_OFF not in what]


def test_stretches_for_validation_are_chosen_in_a_timeline_or_in_words(folder, window):
    workbench = Workbench(folder)
    try:
        one = window(workbench)
        page = one.page
        one.go("Calibrate")
        page.wait_for_load_state("networkidle")
        box = page.locator(".timeline").bounding_box()
        page.mouse.move(box["x"] + box["width"] / 4.0, box["y"] + 5.0)
        page.mouse.down()
        page.mouse.move(box["x"] + box["width"] / 2.0, box["y"] + 5.0, steps=4)
        page.mouse.up()
        page.locator(".timeline u").wait_for()
        (span,) = kept(folder)
        start, end = (float(q) for q in span.removeprefix("run_0:").split("-"))
        assert (start, end) == pytest.approx((6.0, 12.0), abs=0.2)
        page.locator("code", has_text=f"--validation run_0:{start}-{end}").wait_for()
        words = page.get_by_label("run_0, for validation [s]")
        assert words.input_value() == f"{start}-{end}"
        words.fill("2-5 8-9.5")
        page.keyboard.press("Enter")
        page.locator("code", has_text="--validation run_0:2-5 run_0:8-9.5").wait_for()
        words.fill("five")
        page.keyboard.press("Enter")
        page.get_by_text("'five' is neither 'all' nor stretches").wait_for()
        page.locator(".timeline").click()  # none of it
        page.locator(".timeline u").first.wait_for(state="detached")
        assert kept(folder) == []
        page.locator(".timeline").click()
        page.locator(".timeline u").wait_for()
        assert kept(folder) == ["run_0"]
        page.close()
    finally:
        workbench.close()


def kept(folder):
    """Stretches that the project file says are for validation."""
    return Project(folder).day("monday").get("validation", [])


def gone(folder):
    """Whether the command has ended with its workbench."""
    end = time.monotonic() + WAIT
    with (folder / LOCK).open("w") as lock:
        while time.monotonic() < end:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                time.sleep(0.1)
            else:
                return True
    return False
