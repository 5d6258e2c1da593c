"""Projects of unusual size: an empty folder; long names and texts, German columns, many days, an unreadable file."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drift_drake.app import stages
from drift_drake.app.pages.frame import STEPS
from drift_drake.app.project import Project
from drift_drake.car.templates import TEMPLATES
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.gap.estimation.prior import Interval
from tests.app.conftest import Workbench
from tests.app.test_more_ways import answer

sys.path.append(str(Path(__file__).parents[1] / "gap" / "logs"))
from importing_bench import rows

WINDOWS = pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
RECORDING = f"Messfahrt_Hockenheimring_{'mit_neuen_Reifen_und_leerem_Tank_' * 3}UebungOhneUmbruch.csv"
SAID = f"logs/Montag/run_0.csv: {'what is wrong with this log takes many words to say, ' * 9}give another"
DAYS = 12


@pytest.fixture(scope="module")
def full(request, tmp_path_factory):
    request.getfixturevalue("browser")
    project = Project(tmp_path_factory.mktemp("states") / "Fahrzeug mit einem langen Namen für die Erprobung")
    for name in ("recordings", "answers"):
        (project.folder / name).mkdir(parents=True)
    table, deg = pd.DataFrame(rows(noise=0.3, seed=0)), 180.0 / np.pi
    columns = {"Zeit [s]": table.t, "Gierrate [°/s]": table.r * deg, "Geschwindigkeit über Grund [km/h]": table.v * 3.6,
               "Lenkradwinkel": table.delta_cmd * deg, "Querbeschleunigung": table.ay}  # fmt: skip
    columns |= {f"Kanal_{k:02d}_mit_dem_sehr_langen_Namen_eines_Steuergeräts": table.ax + k for k in range(36)}
    pd.DataFrame(columns).to_csv(project.folder / "recordings" / RECORDING, index=False)
    (project.folder / "kaputt.mat").write_bytes(b"no matlab file at all")
    write_vehicle(project.folder / "car.yaml", TEMPLATES["coupe"])
    for k in range(DAYS):
        day = f"Fahrtag {k:02d} mit einem Namen bis vierzig."
        (project.folder / "logs" / day).mkdir(parents=True)
        table.iloc[:800].to_csv(project.folder / "logs" / day / "run_0.csv", index=False)
        found = answer("effect", steering_lag=Interval(0.09, 0.08, 0.1)) if k % 3 else answer("none")
        found = dataclasses.replace(found, warnings=[SAID] * (k == 1))
        (project.folder / "answers" / f"{day}.json").write_text(found.to_json())
    with project.changing() as data:
        data["recordings"] = {f"recordings/{RECORDING}": "Montag"}
        stage = stages.calibrate(project, data)
        data["steps"][stage.name] = {"ended": "refused", "inputs": stage.digest(), "said": SAID}
    found = Workbench(project.folder)
    yield found
    found.close()


@pytest.mark.parametrize(("width", "scheme"), [(1280, "dark"), (390, "light")])
def test_an_empty_folder_says_on_every_page_what_comes_first(window, tmp_path, width, scheme):
    workbench = Workbench(tmp_path)
    try:
        one = window(workbench, width=width, scheme=scheme)
        if (loaded := Path(f"/proc/{workbench.process.pid}/maps")).exists():  # it opens before what is slow to import
            assert not [name for name in ("llvmlite", "pydrake", "pandas") if f"/{name}/" in loaded.read_text()]
        for step in STEPS:
            one.go(step.name)
            assert one.flaws() == [], step.name
        one.go("Calibrate")
        assert one.page.get_by_role("button", name="Calibrate", exact=True).is_disabled()
        one.go("Check")
        one.page.locator("#main").get_by_role("link", name="Columns").click()
        one.page.locator("#main").get_by_role("link", name="Logs").click()
        one.page.get_by_role("link", name="Next: Columns").wait_for()
        one.page.close()
    finally:
        workbench.close()


@WINDOWS
def test_long_names_and_texts_and_many_days_fit(full, window, width, scheme):
    one = window(full, width=width, scheme=scheme)
    page = one.page
    card = page.get_by_role("article", name=RECORDING)
    card.get_by_text("40 channels").click()
    card.get_by_role("button", name="Gierrate").click()
    card.locator(".js-plotly-plot .scatterlayer").wait_for()
    assert one.flaws() == []
    one.go("Columns")
    if (guess := page.get_by_role("button", name="Guess it")).count():
        guess.click()
    page.get_by_label("column of r", exact=True).wait_for()
    page.locator("section.aside p").nth(1).wait_for()
    assert one.flaws() == []
    one.go("Calibrate")
    page.locator(".refusal", has_text="give another").wait_for()
    assert one.flaws() == []
    one.go("Diagnose")
    page.locator("[aria-label^='steering_lag by day'] .xtick text").nth(DAYS - 1).wait_for()
    assert one.flaws() == []
    one.go("Check")
    page.get_by_text("Fahrtag 00 mit einem Namen bis vierzig.: what is used").click()
    page.locator(".clouds .js-plotly-plot .scatterlayer").nth(1).wait_for()
    assert page.locator(".clouds").count() == 1  # the other days stay folded
    assert one.flaws() == []
