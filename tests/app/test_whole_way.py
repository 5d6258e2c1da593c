"""The whole way in a browser: from a dropped `.mat` of a car made here to its corrected simulator, without a terminal.

All files are those of the commands that the pages show, but for when they were computed. With PICTURE=check.png the
check's page is photographed (`make workbench-picture`). A person's time by a model is printed (`effort.py`).
"""

import os
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
import yaml

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle
from drift_drake.cli.main import main
from tests.app.conftest import Window, Workbench
from tests.app.effort import Effort

pytestmark = pytest.mark.slow
CAR = VehicleParameters(mass=1480.0, yaw_inertia=2100.0, front_axle_distance=1.15, rear_axle_distance=1.45)
LAG = 0.09  # [s] of Tuesday's steering
DAY = "day (empty: not used) of "
PATIENCE = 1.2e6  # [ms] of a calibration
TIMES = re.compile(rb'\d{4}-\d\d-\d\d[ T]\d\d:\d\d(:\d\d)?([+-]\d\d:\d\d)?|"seconds": [\d.]+,')


def drive(folder: Path, name: str, lag: float, seed: int) -> None:
    """A lively drive of the car, as a recorder that is not ours writes it: degrees, km/h, the steering wheel."""
    write_vehicle(folder / "real.yaml", CAR, make_effects({"steering_lag": lag} if lag else {}))
    random, t = np.random.default_rng(seed), np.arange(0.0, 26.0, 0.01)
    waves = [(random.uniform(0.1, 1.6), random.uniform(0.3, 1.0), random.uniform(0.0, 6.3)) for _ in range(9)]
    steer = sum(size / (1.0 + f) * np.sin(2.0 * np.pi * f * t + at) for f, size, at in waves)
    steer = 0.05 * steer / np.max(np.abs(steer)) + 0.02 * np.sin(0.1 * np.pi * t)
    torque = np.clip(14.0 + 60.0 * np.sign(np.sin(0.82 * t + seed)), -45.0, 150.0)
    pd.DataFrame({"t": t, "delta_cmd": steer, "tau_cmd": torque}).to_csv(folder / "commands.csv", index=False)
    run = folder / "run.csv"
    words = ["--vehicle", str(folder / "real.yaml"), "--out", str(run), "--seed", str(seed), "--speed", "16"]
    assert main(["simulate", str(folder / "commands.csv"), *words]) == 0
    log, deg = pd.read_csv(run), 180.0 / np.pi
    columns = {
        "Time": log.t + 31.4, "YawRate": log.r * deg, "VehSpd": log.v * 3.6, "SteerAngle": log.delta_cmd * deg * 15.2,
        "EngTrq": log.tau_cmd, "SideSlip": log.beta * deg, "AccLong": log.ax, "AccLat": log.ay,
        "WheelSpd_RL": log.omega_r * 3.6, "Yaw": log.psi * deg,
    }  # fmt: skip
    scipy.io.savemat(folder / f"{name}.mat", {key: values.to_numpy() for key, values in columns.items()})


def test_from_a_dropped_file_to_a_corrected_simulator(window, tmp_path, monkeypatch):
    made, folder = tmp_path / "made", tmp_path / "car"
    made.mkdir(), folder.mkdir()
    for name, lag, seed in (("first", 0.0, 1), ("second", 0.0, 2), ("tuesday", LAG, 3)):
        drive(made, name, lag, seed)
    workbench = Workbench(folder)
    try:
        one = window(workbench)
        page = one.page
        page.set_default_timeout(PATIENCE)
        effort = Effort(page, monkeypatch)
        page.get_by_label("Choose recordings").set_input_files(sorted(made.glob("*.mat")))
        page.get_by_text("tuesday.mat: 10 columns").wait_for()
        page.wait_for_timeout(2000)  # until all that came with the files is drawn: nobody types so fast
        page.get_by_label(f"{DAY}tuesday.mat").fill("tuesday")
        page.keyboard.press("Enter")
        page.get_by_role("heading", name="tuesday", exact=True).wait_for()
        columns(one)
        car(one)
        calibrate(one)
        one.go("Diagnose")
        page.get_by_role("button", name="Diagnose tuesday").click()
        page.locator(".verdict", has_text="steering_lag").wait_for()
        one.go("Apply")
        page.get_by_role("button", name="Apply tuesday").click()
        page.locator(".diff .plus", has_text="steering_lag").wait_for()
        with page.expect_download() as saved:
            page.get_by_role("link", name="Save corrected/tuesday.yaml").click()
        saved.value.save_as(tmp_path / "saved.yaml")
        print(f"\n{effort.table()}")  # shown by `pytest -s`
    finally:
        workbench.close()
    pages = folder.rename(tmp_path / "pages")
    _, effects = read_vehicle(pages / "corrected" / "tuesday.yaml")
    assert abs(effects.steering_lag - LAG) < 0.005
    assert (pages / "corrected" / "tuesday.yaml").read_bytes() == (tmp_path / "saved.yaml").read_bytes()
    in_a_terminal(pages, folder, monkeypatch)


def in_a_terminal(pages, folder, monkeypatch):
    """The commands that the pages show, in a folder with the same inputs, write the same, but for when they ran."""
    steps = yaml.safe_load((pages / "project.yaml").read_text())["steps"]
    shutil.copytree(pages / "recordings", folder / "recordings")
    for name in ("car.yaml", "mapping.yaml"):
        shutil.copy(pages / name, folder / name)
    for name in ("check", "answers", "corrected"):
        (folder / name).mkdir()
    monkeypatch.chdir(folder)
    for name in ("import day 1", "import tuesday", "check day 1", "calibrate", "diagnose tuesday", "apply tuesday"):
        assert main(shlex.split(steps[name]["command"])[1:]) == 0
    written = [path.relative_to(folder) for path in folder.rglob("*") if path.is_file()]
    assert len(written) >= 14
    for path in written:
        assert timeless(folder / path) == timeless(pages / path), path


def timeless(path):
    """A file's bytes without when, and for how long, it was computed."""
    return TIMES.sub(b"", path.read_bytes())


def columns(one):
    """Wrong units are put in, and corrected by what the page offers."""
    page = one.page
    one.go("Columns")
    page.get_by_role("button", name="Guess it").click()
    page.get_by_label("unit of r", exact=True).select_option("rad/s")
    page.get_by_text("The import would be refused").wait_for()
    page.get_by_role("button", name="Read r in deg/s").first.click()
    page.wait_for_function("document.querySelector('[aria-label=\"unit of r\"]')?.value == 'deg/s'")
    for label, value in (("wheelbase", "2.6"), ("steering ratio of delta_cmd", "15.2")):
        page.get_by_label(label).click()  # which waits until rows are drawn: nobody types into one that is going
        page.get_by_label(label).fill(value)
        page.keyboard.press("Enter")
        page.wait_for_timeout(500)
    page.get_by_role("button", name="Read beta in deg").first.click()
    page.get_by_text("nothing looks wrong").wait_for()
    for k, day in enumerate(("day 1", "tuesday")):
        page.get_by_role("button", name=f"Import {day}").click()
        page.wait_for_function(f"document.querySelectorAll('.state.done').length == {k + 1}")
        page.get_by_role("button", name="Cancel").wait_for(state="detached")


def car(one):
    """A template, with what is known of the car."""
    page = one.page
    one.go("Car")
    page.get_by_role("button", name="Saloon").click()
    for name, value in (("mass [kg]", "1485"), ("front_axle_distance [m]", "1.15"), ("wheel_radius [m]", "0.337")):
        page.get_by_label(name, exact=True).fill(value)
        page.keyboard.press("Enter")
        page.wait_for_timeout(1500)
    one.go("Check")
    page.get_by_role("button", name="Check day 1").click()
    page.get_by_text("day 1 is good enough to calibrate a car on").wait_for()
    page.locator(".clouds .js-plotly-plot .scatterlayer").nth(1).wait_for()
    if picture := os.environ.get("PICTURE"):
        photograph(one, Path(picture))


def photograph(one, path):
    """The check's page as a phone shows it, in few colours."""
    from PIL import Image

    narrow = Window(one.context.browser, one.workbench, width=390, scale=2.0, height=1385)
    narrow.go("Check")
    narrow.page.locator(".clouds .js-plotly-plot .scatterlayer").nth(1).wait_for()
    narrow.page.wait_for_timeout(3000)
    left_out = ".command, details, .fields, .bars > div:nth-child(n + 5)"
    narrow.page.evaluate(f"for (const one of document.querySelectorAll('{left_out}')) one.remove()")
    narrow.page.evaluate("document.querySelector('h1').scrollIntoView()")
    narrow.page.screenshot(path=path)
    narrow.context.close()
    Image.open(path).convert("RGB").quantize(48).save(path, optimize=True)


def calibrate(one):
    """Cancelled once, and then to its end."""
    page = one.page
    one.go("Calibrate")
    page.get_by_label("kind of car").select_option("single-track")
    page.get_by_text("--car single-track").wait_for()
    page.get_by_role("button", name="Calibrate", exact=True).click()
    page.get_by_role("button", name="Cancel").click()
    page.locator(".state.cancelled").wait_for()
    assert not (Path(one.folder) / "calibrated.json").exists()
    page.get_by_role("button", name="Calibrate", exact=True).click()
    page.get_by_role("table", name="Estimates and the first guess").wait_for()
    page.get_by_role("button", name="Show logs/day 1/run_1.csv").click()
    page.locator("main .js-plotly-plot .scatterlayer .trace").nth(5).wait_for()
