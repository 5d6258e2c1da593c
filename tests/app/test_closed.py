"""A workbench that is closed, or killed, in the middle of a calibration, and opened again."""

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
