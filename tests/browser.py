"""A page in a headless browser: what it says on the console, what it has drawn, whether it is wider than its window."""

import re
import shutil
import subprocess
from typing import NamedTuple

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
WIDTH = "<script>document.title = document.documentElement.scrollWidth - innerWidth</script></body>"

needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine: apt install chromium")


class Opened(NamedTuple):
    """A page once its scripts have run."""

    dom: str
    console: list[str]
    too_wide: int  # [px]


def opened(path, width=500):
    """Opens a file; 500 pixels are the least that a headless window has."""
    page = path.with_name("measured.html")
    page.write_text(path.read_text(encoding="utf-8").replace("</body>", WIDTH), encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=8000", "--enable-logging=stderr"]
    done = subprocess.run(
        [BROWSER, *options, f"--window-size={width},900", "--dump-dom", page.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return Opened(done.stdout, console, int(re.search(r"<title>(-?\d+)</title>", done.stdout)[1]))


def check_charts(path):
    """Every chart of a page is drawn, nothing is on the console, nothing sticks out of a narrow window."""
    page = opened(path)
    assert page.console == []
    assert page.too_wide <= 0
    charts = page.dom.split('<div class="chart')[1:]
    assert charts
    for chart in charts:
        axes = len(set(re.findall(r'<g class="subplot (x\d*y\d*)"', chart)))
        drawn = len(re.findall(r'<g class="trace scatter|<image|class="hm"', chart))
        assert axes >= 1
        assert drawn >= axes
