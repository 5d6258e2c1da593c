"""What a recording that is dropped, looked at and imported in the browser takes in memory, by its size."""

import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from tests.app.conftest import Workbench

sys.path.append(str(Path(__file__).parents[1] / "gap" / "logs"))
from importing_bench import rows

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from Linux's /proc"),
]
TIMES = 10.0  # the file's bytes that the workbench and its command may take together, beyond a short file's
SHORT, LONG = 8, 80  # times a drive of 24 s


class Peak(threading.Thread):
    """The most that a process and all that it has started take together [bytes], by the most of each so far."""

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.pid, self.most, self.over = pid, 0, threading.Event()
        self.start()

    def run(self) -> None:
        while not self.over.wait(0.05):
            self.most = max(self.most, sum(map(highest, family(self.pid))))


def family(pid: int) -> list[int]:
    """A process and its descendants."""
    found = [pid]
    for one in found:
        for task in Path(f"/proc/{one}/task").glob("*/children"):
            try:
                found += map(int, task.read_text().split())
            except OSError:
                continue  # it has ended
    return found


def highest(pid: int) -> int:
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM")), 0)


def recording(path: Path, times: int) -> int:
    """A drive over and over with 20 columns as a `.mat`; its size [bytes]."""
    table = {name: np.concatenate([values[:-1]] * times) for name, values in rows(noise=0.3, seed=0).items()}
    table["t"] = 0.01 * np.arange(len(table["t"]))
    names = {"Time": "t", "YawRate": "r", "VehSpd": "v", "SteerAngle": "delta_cmd", "AccLat": "ay", "AccLong": "ax"}
    columns = {name: table[of] for name, of in names.items()}
    columns |= {f"Aux{k:02d}": table["ax"] + k for k in range(20 - len(columns))}
    scipy.io.savemat(path, columns)
    return os.path.getsize(path)


def taken(window, folder: Path, file: Path) -> int:
    """The peak [bytes] of dropping, looking, zooming, guessing and importing."""
    folder.mkdir()
    workbench = Workbench(folder)
    peak = Peak(workbench.process.pid)
    try:
        one = window(workbench)
        page = one.page
        page.get_by_label("Choose recordings").set_input_files(file)
        card = page.get_by_role("article", name=f"recordings/{file.name}")
        card.get_by_text("channels").first.click()
        card.get_by_role("button", name="YawRate").click()
        chart = card.get_by_role("application")
        chart.locator(".scatterlayer .trace").wait_for()
        chart.press("+")
        one.go("Columns")
        page.get_by_role("button", name="Guess it").click()
        page.get_by_label("unit of r", exact=True).select_option("rad/s")
        page.get_by_label("unit of v", exact=True).select_option("m/s")
        page.get_by_label("unit of delta_cmd", exact=True).select_option("rad")
        page.locator("[aria-busy=false] .js-plotly-plot").wait_for()
        page.get_by_role("button", name="Import day 1").click()
        page.locator(".state.done").wait_for()
        one.page.close()
    finally:
        peak.over.set()
        peak.join()
        workbench.close()
    return peak.most


def test_memory_grows_with_the_file_by_a_bounded_factor(window, tmp_path):
    sizes = [recording(tmp_path / f"{times}.mat", times) for times in (SHORT, LONG)]
    peaks = [taken(window, tmp_path / str(times), tmp_path / f"{times}.mat") for times in (SHORT, LONG)]
    assert peaks[1] - peaks[0] < TIMES * (sizes[1] - sizes[0])
