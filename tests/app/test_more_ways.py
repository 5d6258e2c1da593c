"""Further ways through the workbench: an MCAP file, a simulator as the car, estimates, dragging, a trend of days."""

import json
import shutil
import sys
from pathlib import Path

import pytest
import yaml
from mcap.writer import Writer

from drift_drake.car.log.table import read_case
from drift_drake.car.templates import TEMPLATES
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.main import main
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.estimation.prior import Interval
from drift_drake.gap.logs.screening.gains import Bounds
from drift_drake.gap.logs.screening.overlays import Estimates
from tests.app.conftest import Workbench

sys.path.append(str(Path(__file__).parents[1] / "gap" / "logs"))
from importing_bench import WHEELBASE, rows

RATIO = 15.0  # of the steering wheel
SIMULATORS = Path(__file__).parents[2] / "examples" / "simulators"
DAY = "day (empty: not used) of "


def write_mcap(path: Path) -> None:
    """A drive as JSON messages, the steering as the wheel's angle."""
    table = rows(noise=0.3, seed=1)
    names = {"yaw_rate": "r", "speed": "v", "steering_wheel_angle": "delta_cmd", "lateral_acceleration": "ay",
             "heading": "psi", "engine_torque": "tau_cmd"}  # fmt: skip
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(name="car", encoding="jsonschema", data=b'{"type": "object"}')
        channel = writer.register_channel(topic="/car", message_encoding="json", schema_id=schema)
        for k, t in enumerate(table["t"]):
            message = {name: float(table[column][k]) for name, column in names.items()}
            message["steering_wheel_angle"] *= RATIO
            stamp = round(1e9 * (1.7e9 + t))
            writer.add_message(channel, log_time=stamp, publish_time=stamp, data=json.dumps(message).encode())
        writer.finish()


def answer(verdict: str, **magnitudes: Interval) -> Answer:
    """Of a day on which these were found, and a steering lag of 0.02 s would have been."""
    nothing, name = Interval(0.0, 0.0, 0.0), "+".join(magnitudes) or verdict
    return Answer(
        case="day", verdict=verdict, causes=list(magnitudes), posterior={name: 1.0}, ambiguity=[name],
        magnitudes=magnitudes, where={"states": {}, "runs": {}, "onset": {}, "regions": []}, reduction=nothing,
        seconds=1.0, tolerances={}, details={"detection": {"steering_lag": {"least": 0.02}}}, warnings=[],
    )  # fmt: skip


@pytest.fixture(scope="module")
def workbench(request, tmp_path_factory):
    request.getfixturevalue("browser")
    folder = tmp_path_factory.mktemp("ways") / "car"
    folder.mkdir()
    write_vehicle(folder / "car.yaml", TEMPLATES["coupe"])
    shutil.copy(SIMULATORS / "four_wheels.py", folder)
    shutil.copy(SIMULATORS / "four_wheels.yaml", folder / "simulator.yaml")
    found = Workbench(folder)
    yield found
    found.close()


def test_an_mcap_file_is_dropped_and_imported(workbench, window, tmp_path):
    write_mcap(tmp_path / "lap 1.mcap")
    one = window(workbench)
    page = one.page
    page.get_by_label("Choose recordings").set_input_files(tmp_path / "lap 1.mcap")
    page.locator("#uploads", has_text="lap 1.mcap: ").wait_for()
    one.go("Columns")
    page.get_by_role("button", name="Guess it").click()
    page.get_by_label("wheelbase").fill(f"{WHEELBASE:.4g}")
    page.keyboard.press("Enter")
    page.get_by_text("understeer aside): divide it by the steering ratio").wait_for()
    assert page.get_by_role("button", name="Take steering ratio").count() == 0  # one estimate, not two
    page.get_by_role("button", name="Divide delta_cmd by").click()
    page.get_by_text("steering ratio, from gentle driving").wait_for()
    page.get_by_text("nothing looks wrong").wait_for()
    mapping = yaml.safe_load((workbench.folder / "mapping.yaml").read_text())
    assert 1.0 / mapping["signals"]["delta_cmd"]["scale"] == pytest.approx(RATIO, rel=0.05)
    page.get_by_role("button", name="Import day 1").click()
    page.locator(".state.done").wait_for()
    (run,) = read_case(workbench.folder / "logs" / "day 1")
    assert run.t[-1] == pytest.approx(24.0, abs=0.1)


def test_what_is_being_typed_stays_while_a_command_runs(workbench, window):
    one, other = window(workbench), window(workbench)
    one.go("Columns")
    other.go("Columns")
    one.page.get_by_label("wheelbase").press_sequentially("9")
    typed = one.page.get_by_label("wheelbase").input_value()
    other.page.get_by_role("button", name="Import day 1").click()
    one.page.get_by_label("Progress").wait_for()
    one.page.get_by_label("Progress").wait_for(state="detached")
    assert one.page.get_by_label("wheelbase").input_value() == typed != f"{WHEELBASE:.4g}"


def test_gentle_driving_offers_only_what_contradicts_the_mapping():
    compared = pytest.importorskip("drift_drake.app.pages.compared", reason="needs the extra `app`")
    mapping = {"signals": {"delta_cmd": {"scale": 1.0 / 15.0}}, "measured_point": [0.4, 0.0]}
    gentle = Estimates(Bounds(0.95, 0.98, 1.02), Bounds(0.2, 0.3, 0.4), Bounds(-0.1, 0.05, 0.1))
    ratio, ahead, left = compared.from_gentle_driving(mapping, gentle)
    assert (ratio.low, ratio.used, ratio.agrees) == (pytest.approx(14.25), pytest.approx(15.0), True)
    assert (ahead.low, ahead.used, ahead.agrees) == (pytest.approx(0.6), 0.4, False)
    assert (left.used, left.agrees) == (0.0, True)
    ahead.take(mapping)
    assert mapping["measured_point"] == [0.7, 0.0]


def test_a_simulator_is_the_car_and_a_recordings_end_is_dragged(workbench, window):
    one = window(workbench)
    page = one.page
    one.go("Car")
    page.get_by_label("First guess").select_option("simulator.yaml")
    one.go("Check")
    page.get_by_text("--vehicle simulator.yaml").wait_for()
    page.locator(".timelines", has_text="lap 1").wait_for()
    page.locator(".clouds .scatterlayer").nth(1).wait_for()
    page.wait_for_load_state("networkidle")
    box = page.locator(".timeline").bounding_box()
    page.locator(".handle[data-key=start]").hover()
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 4.0, box["y"] + 5.0, steps=4)
    page.mouse.up()
    page.wait_for_function("""document.querySelector('[aria-label="start [s] of day 1"]')?.value > 0""")
    start = yaml.safe_load((workbench.folder / "project.yaml").read_text())["days"]["day 1"]["start"]
    assert start == pytest.approx(6.0, abs=0.2)
    one.go("Columns")
    page.locator("code", has_text=f"--start {start:g}").wait_for()
    page.locator(".state.stale").wait_for()


def test_a_recording_is_dragged_onto_a_day_which_may_have_its_own_mapping(workbench, window):
    shutil.copy(workbench.folder / "recordings" / "lap 1.mcap", workbench.folder / "lap 2.mcap")
    one = window(workbench)
    page = one.page
    page.reload()
    card = page.get_by_role("article", name="lap 2.mcap")
    card.get_by_text("6 channels").wait_for()
    page.set_viewport_size({"width": 1280, "height": 2200})  # both are seen
    page.wait_for_timeout(500)
    card.get_by_role("heading").hover()
    page.mouse.down()
    page.get_by_role("article", name="day day 1").get_by_role("heading").hover()
    page.get_by_role("article", name="day day 1").get_by_text("lap 1.mcap").hover()
    page.mouse.up()
    page.wait_for_function(f"""document.querySelector('[aria-label="{DAY}lap 2.mcap"]')?.value === "day 1" """)
    page.wait_for_timeout(1000)
    card.get_by_text("6 channels").wait_for()
    card.get_by_role("heading").hover()
    page.mouse.down()
    page.get_by_role("article", name="day day 1").get_by_role("heading").hover()
    page.get_by_role("article", name="new day").get_by_text("for day 2").hover()
    page.mouse.up()
    page.get_by_role("heading", name="day 2", exact=True).wait_for()
    one.go("Columns")
    page.locator(".aside .js-plotly-plot").wait_for()
    page.get_by_label("Recording that is shown").select_option("lap 2.mcap")
    page.locator("[aria-busy=false] .js-plotly-plot").wait_for()
    page.get_by_label("day 2 has a mapping of its own").check()
    page.locator("code", has_text="--mapping 'mapping day 2.yaml' --out 'logs/day 2'").wait_for()
    shared, own = (workbench.folder / name for name in ("mapping.yaml", "mapping day 2.yaml"))
    assert own.read_bytes() == shared.read_bytes()


def test_runs_are_exported_as_by_the_command(workbench, window, tmp_path, monkeypatch):
    one = window(workbench)
    one.go("Columns")  # its start was changed
    one.page.get_by_role("button", name="Import day 1").click()
    one.page.locator(".state.done").wait_for()
    one.go("Apply")
    one.page.get_by_role("button", name="Export day 1 for Foxglove").click()
    one.page.locator(".state.done").wait_for()
    monkeypatch.chdir(workbench.folder)
    assert main(["export", "logs/day 1", "--format", "mcap", "--out", str(tmp_path / "again")]) == 0
    (made,) = Path("foxglove/day 1").glob("*.mcap")
    assert made.read_bytes() == (tmp_path / "again" / made.name).read_bytes()


def test_days_have_a_trend(workbench, window):
    folder = workbench.folder / "answers"
    folder.mkdir()
    shutil.copytree(workbench.folder / "logs" / "day 1", workbench.folder / "logs" / "day 3")
    (folder / "day 1.json").write_text(answer("none").to_json())
    found = answer("effect", steering_lag=Interval(0.09, 0.08, 0.1))
    (folder / "day 3.json").write_text(found.to_json())
    one = window(workbench)
    one.go("Diagnose")
    page = one.page
    page.get_by_role("table", name="What was found on each day").get_by_text("0.09 (0.08 to 0.1)").wait_for()
    page.locator("[aria-label^='steering_lag by day'] .scatterlayer .trace").nth(1).wait_for()
    assert page.locator("[aria-label^='steering_lag by day'] .errorbars").count() == 2


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_what_was_made_fits_a_phone_too(workbench, window, scheme):
    one = window(workbench, width=390, scheme=scheme)
    for step in ("Columns", "Check", "Diagnose", "Apply"):
        one.go(step)
        one.page.wait_for_timeout(2500)
        assert one.flaws() == [], step
