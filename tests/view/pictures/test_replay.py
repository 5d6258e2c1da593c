"""The replay is one HTML file that needs nothing else, with all cars in it."""

import contextlib
import itertools
import os
import re
import socket
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import BROWSER, NAMELESS, check_looks, needs_browser
from pydrake.geometry import Meshcat

from drift_drake.car.parameters import VehicleParameters
from drift_drake.view.pictures.replay import read_outs, replay


def test_the_replay_is_one_file_that_loads_nothing_else(eight, perfect_run, tmp_path):
    path = replay({"driven": perfect_run, "ghost": perfect_run.iloc[:200]}, tmp_path / "folder" / "replay.html", eight)
    page = path.read_text()
    assert len(page) > 500_000
    assert not re.search(r"<script[^>]*\ssrc=", page)
    assert not re.search(r"<link[^>]*\shref=[\"']?https?:", page)
    assert not re.search(r"(@import|url\()\s*[\"']?https?:", page)


def test_more_cars_and_longer_runs_make_more_of_it(perfect_run, tmp_path):
    sizes = [
        replay(runs, tmp_path / f"{k}.html").stat().st_size
        for k, runs in enumerate(
            ({"a": perfect_run.iloc[:50]}, {"a": perfect_run}, {"a": perfect_run, "b": perfect_run})
        )
    ]
    assert sizes[0] < sizes[1] < sizes[2]


def test_a_run_without_a_column_is_named(perfect_run, tmp_path):
    with pytest.raises(ValueError, match=r"run 'a' lacks the column\(s\) psi"):
        replay({"a": perfect_run.drop(columns="psi")}, tmp_path / "replay.html")


def test_a_model_cars_scene_is_magnified(perfect_run, tmp_path):
    p = VehicleParameters()
    model = p.replace(front_axle_distance=0.1 * p.front_axle_distance, rear_axle_distance=0.1 * p.rear_axle_distance)
    assert (
        "Drawn 10 times as large." in replay({"a": perfect_run}, tmp_path / "model.html", parameters=model).read_text()
    )
    assert "times as large" not in replay({"a": perfect_run}, tmp_path / "car.html").read_text()


def test_the_panel_names_the_cars_and_a_gap_in_a_run_is_no_error(perfect_run, tmp_path):
    gap = perfect_run.copy()
    gap.loc[gap.index[:20], ["x", "y", "psi"]] = float("nan")
    gap.loc[gap.index[150:170], ["x", "y", "psi"]] = float("nan")
    page = replay({"real": perfect_run, "<ghost>": gap}, tmp_path / "r.html", title="lap", camera="follow").read_text()
    assert "<h1>lap</h1>" in page
    assert page.count("&lt;ghost&gt;") == 2
    assert "let following = true" in page


def test_the_panel_reads_out_what_all_runs_have_in_a_drivers_units(perfect_run, tmp_path):
    gap = perfect_run.copy()
    gap.loc[gap.index[:20], "v"] = float("nan")
    slip, speed, yaw = read_outs({"real": perfect_run, "nominal": gap})
    assert [signal["name"] for signal in (slip, speed, yaw)] == ["sideslip", "speed", "yaw rate"]
    assert speed["cars"][0][0] == pytest.approx(3.6 * perfect_run["v"].iloc[0], abs=0.01)
    assert speed["cars"][1][0] is None
    assert speed["step"] * (len(speed["cars"][0]) - 1) == pytest.approx(np.ptp(perfect_run["t"]), abs=speed["step"])
    assert read_outs({"real": perfect_run.drop(columns=["v", "beta", "r"])}) == []
    page = replay({"real": perfect_run}, tmp_path / "r.html", title="<lap>").read_text(encoding="utf-8")
    assert "<title>&lt;lap&gt;</title>" in page


@pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="looks sockets up in /proc")
def test_only_this_machine_could_reach_the_scene_while_it_is_written(perfect_run, tmp_path, monkeypatch):
    listening = []
    html = Meshcat.StaticHtml

    def looked_at(meshcat):
        listening.append(sockets_of_this_process())
        return html(meshcat)

    monkeypatch.setattr(Meshcat, "StaticHtml", looked_at)
    page = replay({"a": perfect_run.iloc[:20]}, tmp_path / "r.html").read_text(encoding="utf-8")
    assert listening[0]
    assert listening[0] <= {"127.0.0.1", "::1"}
    assert "Content-Security-Policy" in page


def sockets_of_this_process():
    """Addresses that this process listens at."""
    own = set()
    for entry in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            own.add(os.readlink(entry))
    found = set()
    for family, name in ((socket.AF_INET, "tcp"), (socket.AF_INET6, "tcp6")):
        file = Path(f"/proc/self/net/{name}")
        for line in file.read_text().splitlines()[1:] if file.exists() else []:
            words = line.split()
            if words[3] == "0A" and f"socket:[{words[9]}]" in own:
                digits = bytes.fromhex(words[1].split(":")[0])
                octets = b"".join(digits[k : k + 4][::-1] for k in range(0, len(digits), 4))
                found.add(socket.inet_ntop(family, octets))
    return found


@needs_browser
def test_a_browser_plays_it_under_its_policy(perfect_run, tmp_path):
    path = replay({"a": perfect_run.iloc[:50], "b": perfect_run.iloc[:50]}, tmp_path / "r.html", title="lap")
    options = ["--headless", "--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader",
               "--virtual-time-budget=4000", "--enable-logging=stderr", "--dump-dom"]  # fmt: skip
    done = subprocess.run([BROWSER, *options, path.as_uri()], capture_output=True, text=True, timeout=120, check=True)
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert not [line for line in console if "Content Security" in line or "Error" in line]
    assert re.search(r'id="clock">[^<]*\d', done.stdout)  # its own script runs


def test_it_is_readable_in_the_dark_and_its_hidden_controls_are_out_of_the_way(perfect_run, tmp_path, browser):
    path = replay({"real": perfect_run.iloc[:50], "b": perfect_run.iloc[:50]}, tmp_path / "r.html", title="lap")
    check_looks(browser, path, wait=4000)
    page = browser.new_page()
    page.goto(path.as_uri())
    page.locator(".dg.main > ul[inert]").wait_for(state="attached")
    page.locator(".dg.main > .close-button").focus()
    page.keyboard.press("Enter")
    page.locator(".dg.main > ul:not([inert])").wait_for(state="attached")
    assert page.evaluate(NAMELESS) == []
    page.close()


# Evaluated once, it waits by itself: the page's policy forbids what Playwright's own waiting evaluates at each frame.
PLAYING = """() => new Promise(done => {
  const wait = () => viewer.animator.playing && viewer.animator.time > 0.2 ? done() : requestAnimationFrame(wait);
  wait();
})"""

# How far a car's name is from where the car is drawn [px across], in the frame that is drawn next.
OFF = """() => new Promise(done => {
  const draw = viewer.render.bind(viewer);
  viewer.render = () => {
    draw();
    const x = (0.5 + 0.5 * place(0).add(head).project(viewer.camera).x) * innerWidth;
    if (viewer.animator.playing) done(Math.abs(parseFloat(labels[0].style.left) - x));
  };
})"""


def test_names_go_with_the_cars_however_slowly_frames_are_drawn(perfect_run, tmp_path, browser):
    path = replay({"real": perfect_run.iloc[:200]}, tmp_path / "r.html", camera="overview")
    page = browser.new_page()
    page.goto(path.as_uri())
    page.evaluate(PLAYING)
    assert page.evaluate(OFF) < 0.1
    page.close()


PLACES = """<script>setTimeout(() => {
  const height = i => (0.5 - 0.5 * place(i).project(viewer.camera).y) * innerHeight;
  parent.postMessage([element("panel").getBoundingClientRect().top, ...cars.map((_, i) => height(i))], "*");
}, 4000)</script></body>"""
APART = '<script>setTimeout(() => element("apart").click(), 100)</script>'
FRAME = """<!doctype html><script>addEventListener("message", event => document.title = event.data.join(" "));</script>
<iframe width="390" height="700" src="page.html"></iframe>"""


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize(("names", "script"), [("a", ""), ("abc", APART)])
def test_on_a_phone_the_cars_are_in_the_middle_above_the_panel(perfect_run, tmp_path, names, script):
    page = replay(dict.fromkeys(names, perfect_run.iloc[:200]), tmp_path / "page.html", camera="follow")
    text = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page.read_text(encoding="utf-8"))
    page.write_text(text.replace("</body>", script + PLACES), encoding="utf-8")
    (tmp_path / "frame.html").write_text(FRAME, encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader", "--virtual-time-budget=8000", "--dump-dom"]
    done = subprocess.run([BROWSER, *options, (tmp_path / "frame.html").as_uri()], capture_output=True, text=True,
                          timeout=300, check=True)  # fmt: skip
    panel, *cars = map(float, re.search(r"<title>(.*?)</title>", done.stdout)[1].split())
    assert 300.0 < panel < 690.0
    assert cars[len(cars) // 2] == pytest.approx(0.5 * panel, abs=10.0)
    assert all(40.0 < below - above < 0.3 * panel for above, below in itertools.pairwise(cars))
