"""From a recording in the folder to a corrected car and its replay by keys alone: no pointer is ever used."""

import sys
from pathlib import Path

import pandas as pd
import pytest

from drift_drake.car.templates import TEMPLATES
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle
from tests.app.conftest import Workbench
from tests.app.test_pages import WHEELBASE, recording

sys.path.append(str(Path(__file__).parents[1] / "gap" / "logs"))
from importing_bench import rows

pytestmark = pytest.mark.slow
MOST = 400  # elements that have the focus before the one that is looked for
LATE = 8  # rows of Monday's steering
# What has the focus: its name, and whether one sees that it has it.
FOCUS = """() => { const one = document.activeElement, style = getComputedStyle(one), box = one.getBoundingClientRect();
  const name = one.getAttribute("aria-label") ?? (one.labels?.length ? one.labels[0].textContent : one.textContent);
  return [one.tagName, (one.title || name).trim(), style.outlineStyle !== "none" && box.width > 0]; }"""


class Hands:
    """A keyboard, and eyes that read names."""

    def __init__(self, page) -> None:
        self.page = page

    def on(self, name: str, key: str = "") -> None:
        """Goes on by Tab until what is called so has the focus, and presses a key there; all on the way is seen."""
        for _ in range(MOST):
            self.page.keyboard.press("Tab")
            if self.at() == name:
                break
        else:
            raise AssertionError(f"Tab does not lead to {name!r}")
        if key:
            self.page.keyboard.press(key)

    def at(self) -> str:
        """What has the focus, in the page or in a report within it: it has a name, and one sees that it has it."""
        for frame in self.page.frames:  # the page's own first
            tag, found, seen = frame.evaluate(FOCUS)
            if tag != "IFRAME" and frame.evaluate("document.hasFocus()"):
                break
        assert tag in ("BODY", "HTML") or (found and seen), (tag, found)
        return found if tag not in ("BODY", "HTML") else ""

    def type(self, name: str, words: str) -> None:
        """Writes over a field."""
        self.on(name)
        self.page.keyboard.press("Control+A")
        self.page.keyboard.type(words)
        self.page.keyboard.press("Enter")

    def sees(self, words: str) -> None:
        self.page.get_by_text(words).first.wait_for()
        self.page.wait_for_timeout(1500)  # until all is drawn: what is gone has lost the focus


def test_a_day_is_made_mapped_imported_and_checked(window, tmp_path):
    folder = tmp_path / "car"
    folder.mkdir()
    recording(folder / "lap.csv", 0)
    workbench = Workbench(folder)
    try:
        one = window(workbench)
        hands = Hands(one.page)
        hands.sees("8 channels")
        hands.type("day (empty: not used) of lap.csv", "monday")
        hands.sees("calibrate on monday")
        hands.on("Next: Columns", "Enter")
        hands.sees("Guess it")
        hands.on("Guess it", "Enter")
        hands.sees("nothing looks wrong")
        hands.type("wheelbase [m]", f"{WHEELBASE:.4g}")
        hands.sees("delta_cmd against r L / v")
        hands.on("unit of r")
        one.page.keyboard.type("rad/s")
        hands.sees("The import would be refused")
        hands.on("Read r in deg/s", "Space")
        hands.sees("nothing looks wrong")
        hands.on("Import monday", "Enter")
        one.page.locator(".state.done").wait_for()
        hands.on("Next: Car", "Enter")
        hands.sees("Begin with")
        hands.on("Coupe", "Enter")
        hands.sees("wheel_radius")
        hands.on("Next: Check", "Enter")
        hands.sees("good enough to calibrate on?")
        hands.on("Check monday", "Enter")
        one.page.locator(".verdict").wait_for()
        one.page.close()
    finally:
        workbench.close()
    assert (folder / "check" / "monday.json").exists()


@pytest.fixture
def folder(tmp_path):
    """A day whose steering is late, and a vehicle file."""
    folder = tmp_path / "car"
    (folder / "logs" / "monday").mkdir(parents=True)
    table = pd.DataFrame(rows(noise=0.3, seed=0))
    table["delta_cmd"] = table["delta_cmd"].shift(-LATE)
    table.iloc[:-LATE].to_csv(folder / "logs" / "monday" / "run_0.csv", index=False)
    write_vehicle(folder / "own.yaml", TEMPLATES["coupe"])
    return folder


def test_a_calibration_is_cancelled_a_day_diagnosed_and_the_car_corrected(folder, window):
    workbench = Workbench(folder)
    try:
        one = window(workbench)
        hands, page = Hands(one.page), one.page
        hands.sees("Add recordings")
        hands.on("Car: not run yet", "Enter")
        hands.sees("Begin with")
        hands.on("First guess")
        page.keyboard.type("own")
        page.get_by_text("Begin with").wait_for(state="detached")
        hands.on("Next: Check", "Enter")
        hands.sees("good enough to calibrate on?")
        hands.on("Check monday", "Enter")
        page.locator(".verdict").wait_for()
        hands.on("Calibrate on monday nevertheless", "Enter")
        hands.sees("Taken nevertheless")
        hands.on("Next: Calibrate", "Enter")
        hands.sees("It takes minutes")
        hands.on("Calibrate", "Enter")
        hands.on("Cancel the calibration", "Space")
        page.locator(".state.cancelled").wait_for()
        hands.on("Diagnose: not run yet", "Enter")
        hands.sees("No day has been diagnosed yet.")
        diagnosed(hands)
        applied(hands)
        page.close()
    finally:
        workbench.close()
    _, effects = read_vehicle(folder / "corrected" / "monday.yaml")
    assert effects.steering_delay == pytest.approx(0.01 * LATE, abs=0.005)
    assert list((folder / "foxglove" / "monday").glob("*.mcap"))


def diagnosed(hands):
    """Relative to the first guess, of two effects; a rival is laid over and its size moved."""
    hands.on("relative to own.yaml as it is, in place of calibrated.yaml", "Space")
    hands.sees("diagnose logs/monday --vehicle own.yaml")
    hands.on("Effects that are considered: all", "Enter")
    hands.on("steering_lag", "Space")
    hands.sees("--effects steering_lag")
    assert hands.at() == "steering_lag"  # although all was drawn anew
    hands.on("steering_delay", "Space")
    hands.sees("--effects steering_lag steering_delay")
    hands.on("Diagnose monday", "Enter")
    hands.page.locator(".verdict").wait_for()
    report = hands.page.frame_locator("iframe")
    report.locator("#rivals button").first.wait_for()
    hands.on(report.locator("#rivals button").first.text_content(), "Enter")
    said = report.locator("#said").text_content()
    assert "steering_delay" in report.locator("#tried").input_value()
    assert "squared errors" in said
    hands.on("size", "Home")
    assert report.locator("#said").text_content() != said


def applied(hands):
    """Written, saved, replayed, exported."""
    hands.on("Next: Apply", "Enter")
    hands.sees("Corrected by monday")
    hands.on("Apply monday", "Enter")
    hands.page.locator(".diff .plus", has_text="steering_delay").wait_for()
    hands.on("Replay run_0", "Enter")
    replay = hands.page.frame_locator("iframe[title='Replay of run_0.csv']")
    replay.get_by_role("button", name="pause").wait_for()
    hands.on("pause", "Space")
    replay.get_by_role("button", name="play").wait_for()
    hands.on("Export monday for Foxglove", "Enter")
    hands.page.locator(".state.done").nth(2).wait_for()
