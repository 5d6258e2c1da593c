"""The workbench in a real browser: its pages, wrong units put right by a click, refusals, two windows, the keyboard."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drift_drake.app.pages.diagnose import left_over_text
from drift_drake.app.pages.frame import STEPS
from drift_drake.car.templates import TEMPLATES
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.main import main
from drift_drake.view.pages.charts import KEYS
from tests.app.conftest import Workbench

sys.path.append(str(Path(__file__).parents[1] / "gap" / "logs"))
from importing_bench import WHEELBASE, rows

HOSTILE = '<img src=x onerror="document.title=1">.csv'
DAY = "day (empty: not used) of "
# Start and end of the time that a chart shows, and the last time that it has.
SHOWN = """() => {
  const chart = document.querySelector(".chart");
  return [...chart._fullLayout.xaxis.range, Math.max(...chart.data[0].x)];
}"""


def recording(path: Path, seed: int) -> None:
    """A drive as a foreign recorder has it: other names, units and a steering wheel."""
    table = pd.DataFrame(rows(noise=0.3, seed=seed))
    deg = 180.0 / np.pi
    pd.DataFrame({
        "Time": table["t"] + 30.0, "YawRate": table["r"] * deg, "VehSpd": table["v"] * 3.6,
        "SteerAngle": table["delta_cmd"] * deg, "AccLat": table["ay"], "AccLong": table["ax"],
        "WheelSpd": table["omega_r"] * 3.6, "Yaw": table["psi"] * deg, "EngTrq": table["tau_cmd"],
    }).to_csv(path, index=False)  # fmt: skip


@pytest.fixture(scope="module")
def workbench(request, tmp_path_factory):
    request.getfixturevalue("browser")  # which skips where there is none
    folder = tmp_path_factory.mktemp("app") / "my car"
    folder.mkdir()
    recording(folder / "lap.csv", 0)
    (folder / HOSTILE).write_text((folder / "lap.csv").read_text())
    write_vehicle(folder / "car.yaml", TEMPLATES["coupe"])
    (folder / "project.yaml").write_text("recordings: {lap.csv: monday}\n")
    found = Workbench(folder)
    yield found
    found.close()


def test_wrong_units_are_put_right_by_what_the_page_offers(workbench, window):
    one = window(workbench)
    page = one.page
    one.go("Columns")
    page.get_by_role("button", name="Guess it").click()
    page.get_by_label("wheelbase").fill(f"{WHEELBASE:.4g}")
    page.keyboard.press("Enter")
    page.get_by_text("nothing looks wrong").wait_for()
    page.get_by_label("unit of r", exact=True).select_option("rad/s")
    page.get_by_text("The import would be refused").wait_for()
    page.get_by_role("button", name="Read r in deg/s").first.click()
    page.get_by_text("nothing looks wrong").wait_for()
    page.get_by_label("sign of ay").select_option("-1")
    page.get_by_role("button", name="Turn the sign of ay").click()
    page.get_by_text("nothing looks wrong").wait_for()
    page.locator(".aside .js-plotly-plot .scatterlayer").first.wait_for()


def test_an_import_is_that_of_the_command_to_the_byte(workbench, window, tmp_path, monkeypatch):
    one = window(workbench)
    one.go("Columns")
    one.page.get_by_role("button", name="Import monday").click()
    one.page.locator(".state.done").wait_for()
    monkeypatch.chdir(workbench.folder)
    assert main(["import", "lap.csv", "--mapping", "mapping.yaml", "--out", str(tmp_path / "monday")]) == 0
    for name in ("run_0.csv", "import.json"):
        assert (tmp_path / "monday" / name).read_bytes() == Path("logs/monday", name).read_bytes()


def test_a_command_can_be_cancelled_and_leaves_no_trace(workbench, window):
    one = window(workbench)
    one.go("Check")
    one.page.get_by_role("button", name="Check monday").click()
    one.page.get_by_role("button", name="Cancel the check of monday").click()
    one.page.locator(".state.cancelled").wait_for()
    one.page.get_by_text("was cancelled; files are as they were before").wait_for()
    assert not (workbench.folder / "check" / "monday.json").exists()
    one.go("Calibrate")
    one.page.get_by_text("Not yet: check first whether monday can be calibrated on.").wait_for()
    assert one.page.get_by_role("button", name="Calibrate", exact=True).is_disabled()


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_every_page_fits_both_windows(workbench, window, width, scheme):
    one = window(workbench, width=width, scheme=scheme)
    for step in STEPS:
        one.go(step.name)
        one.page.wait_for_timeout(1000)
        assert one.flaws() == [], step.name


def test_a_file_that_cannot_be_read_is_refused_and_not_kept(workbench, window, tmp_path):
    (tmp_path / "bad.mat").write_bytes(b"no matlab file at all")
    one = window(workbench)
    one.page.get_by_label("Choose recordings").set_input_files(tmp_path / "bad.mat")
    one.page.locator("#uploads .refusal", has_text="bad.mat: cannot be read").wait_for()
    assert not (workbench.folder / "recordings" / "bad.mat").exists()


def test_signals_are_looked_at_as_finely_as_one_zooms(workbench, window):
    page = window(workbench).page
    card = page.get_by_role("article", name="lap.csv")
    card.get_by_text("8 channels").click()
    card.get_by_role("button", name="YawRate").click()
    card.get_by_role("button", name="VehSpd").click()
    card.locator(".js-plotly-plot .xy, .js-plotly-plot .xy2").nth(1).wait_for()
    card.get_by_role("button", name="YawRate").click()
    page.wait_for_function("document.querySelectorAll('.js-plotly-plot .scatterlayer .trace').length == 1")


def test_a_chart_is_zoomed_and_moved_by_keys_alone(workbench, window):
    page = window(workbench).page
    card = page.get_by_role("article", name="lap.csv")
    card.get_by_text("8 channels").click()
    card.get_by_role("button", name="YawRate").press("Enter")
    chart = card.get_by_role("application", name="Signals of lap.csv")
    chart.locator(".scatterlayer .trace").wait_for()
    whole = page.evaluate(SHOWN)
    for _ in range(30):
        page.keyboard.press("Tab")
        if chart.evaluate("one => one === document.activeElement"):
            break
    assert chart.evaluate("one => getComputedStyle(one, '::after').content") == f'"{KEYS}"'  # shown, and read out
    page.keyboard.type("++")
    shows(page, 0.375 * whole[1], 0.625 * whole[1])
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft", "-"):
        page.keyboard.press(key)
    shows(page, 0.3125 * whole[1], 0.8125 * whole[1])
    page.wait_for_function(f"({SHOWN})()[2] < {whole[2]}")  # the part that is shown has come from the server
    page.keyboard.press("0")
    shows(page, *whole[:2])


def shows(page, start, end):
    """Waits until the chart shows this part, and goes on to show it."""
    for _ in range(2):
        page.wait_for_function(f"(([a, b]) => Math.hypot(a - {start}, b - {end}) < 0.02)(({SHOWN})())")
        page.wait_for_timeout(500)


def test_names_of_files_are_texts(workbench, window):
    one = window(workbench)
    one.page.get_by_role("heading", name=HOSTILE).wait_for()
    assert one.page.locator("img").count() == 0
    assert one.page.title() != "1"


def test_two_windows_keep_each_others_edits_and_see_them(workbench, window):
    one, other = window(workbench), window(workbench)
    one.page.get_by_label(f"{DAY}{HOSTILE}").fill("tuesday")
    one.page.keyboard.press("Enter")
    other.page.get_by_role("heading", name="tuesday", exact=True).wait_for()
    other.page.get_by_label("calibrate on tuesday").check()
    one.page.locator("input[aria-label='calibrate on tuesday']:checked").wait_for()
    other.page.wait_for_timeout(2000)  # until it is drawn anew too: nobody types so fast
    other.page.get_by_label(f"{DAY}{HOSTILE}").fill("")
    other.page.keyboard.press("Enter")
    one.page.get_by_role("heading", name="tuesday", exact=True).wait_for(state="detached")


def test_the_keyboard_alone_suffices(workbench, window):
    one = window(workbench)
    keys = one.page.keyboard
    for _ in range(4):
        keys.press("Tab")
    assert one.page.evaluate("document.activeElement.textContent") == "Car"
    keys.press("Enter")
    one.page.get_by_label("mass [kg]", exact=True).focus()
    keys.press("Control+A")
    keys.type("-3")
    keys.press("Tab")
    one.page.locator("[role=alert]", has_text="Not taken: ").wait_for()
    assert one.page.evaluate("document.activeElement.getAttribute('aria-label')").startswith("yaw_inertia")


def test_a_command_is_started_and_cancelled_by_keys(workbench, window):
    one = window(workbench)
    one.go("Check")
    for name, key in (("Check monday", "Enter"), ("Cancel the check of monday", "Space")):
        button = one.page.get_by_role("button", name=name, exact=True)
        button.wait_for()
        for _ in range(60):
            one.page.keyboard.press("Tab")
            if button.evaluate("one => one === document.activeElement"):
                break
        one.page.keyboard.press(key)
    one.page.locator(".state.cancelled").wait_for()


def test_files_of_the_folder_alone_are_served_to_who_has_the_token(workbench, window, browser):
    one = window(workbench)
    assert one.context.request.get(f"{workbench.site}/files/car.yaml").ok
    for name in ("..%2Fmy%20car.json", "%2Fetc%2Fpasswd"):
        assert one.context.request.get(f"{workbench.site}/files/{name}").status == 404
    stranger = browser.new_context()
    assert stranger.request.get(workbench.site).status == 403
    stranger.close()


def test_what_may_be_left_over_is_not_said_to_be():
    what = "something that no effect of the catalogue explains"
    assert left_over_text({"probability": 0.35}) == f"Perhaps left over (0.35): {what}."
    assert left_over_text({"probability": 0.8, "like": "clock rate"}) == f"Left over: {what}; it acts like clock rate."
    assert left_over_text({}) == f"Left over: {what}."
