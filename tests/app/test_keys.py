"""From a recording in the folder to the check of its day by keys alone: no pointer is ever used."""

import pytest

from tests.app.conftest import Workbench
from tests.app.test_pages import WHEELBASE, recording

pytestmark = pytest.mark.slow
MOST = 400  # elements that have the focus before the one that is looked for
NAMED = """name => { const one = document.activeElement;
  return (one.getAttribute("aria-label") ?? one.textContent.trim()) === name; }"""


class Hands:
    """A keyboard, and eyes that read names."""

    def __init__(self, page) -> None:
        self.page = page

    def on(self, name: str, key: str = "") -> None:
        """Goes on by Tab until what is called so has the focus, and presses a key there."""
        for _ in range(MOST):
            self.page.keyboard.press("Tab")
            if self.page.evaluate(NAMED, name):
                break
        else:
            raise AssertionError(f"Tab does not lead to {name!r}")
        if key:
            self.page.keyboard.press(key)

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
