"""`drift-drake import`: what it writes, prints and refuses."""

import json

import numpy as np
import pytest
import yaml
from browser import check_charts, check_looks, needs_browser
from test_importing_importer import PLAIN, plain_table

from drift_drake.car.log.table import read_case
from drift_drake.cli.main import main


@pytest.fixture
def files(tmp_path):
    plain_table().to_csv(tmp_path / "lap.csv", index=False)
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(PLAIN))
    return tmp_path


def arguments(files, *more):
    return ["import", str(files / "lap.csv"), "--mapping", str(files / "mine.yaml"), "--out", str(files / "out"), *more]


def test_a_case_is_written(files, capsys):
    assert main(arguments(files)) == 0
    (run,) = read_case(files / "out")
    assert len(run) == 2401
    said = capsys.readouterr().out
    assert "run_0: lap, 0.00 to 24.00 s, 2401 rows" in said
    assert "no other column tells whether v and omega_r are exchanged (they differ by 0.95 % at most)" in said
    report = json.loads((files / "out" / "import.json").read_text())
    assert report["runs"][0]["recording"] == "lap"
    assert report["mapping"]["signals"]["vx"]["unit"] == "km/h"


def test_the_report_as_json(files, capsys):
    assert main(arguments(files, "--json", "-")) == 0
    assert json.loads(capsys.readouterr().out)["remarks"] == []


@needs_browser
def test_a_report_shows_signals_and_what_columns_say_of_each_other(files, tmp_path, browser):
    page = tmp_path / "import.html"
    assert main(arguments(files, "--report", str(page))) == 0
    text = page.read_text(encoding="utf-8")
    assert text.count('class="chart"') == 4  # overlays, two of the driving, one run's signals
    assert "24.0 of 24.0 s are used" in text
    check_charts(page)
    check_looks(browser, page)
    check_keys(browser, page)


RANGES = "one => ['xaxis', 'yaxis'].flatMap(name => one._fullLayout[name].range)"


def check_keys(browser, path):
    """Keys zoom a chart over time in time alone, and a cloud of points in both."""
    page = browser.new_page()
    page.goto(path.as_uri())
    for chart, both in ((page.locator(".chart").first, False), (page.locator(".clouds .chart").first, True)):
        whole = np.array(chart.evaluate(RANGES)).reshape(2, 2)
        chart.press("+")
        middle, half = whole.mean(axis=1), np.diff(whole)[:, 0] / 2.0
        size = np.array([0.5, 0.5 if both else 1.0])
        zoomed = np.array(chart.evaluate(RANGES)).reshape(2, 2)
        np.testing.assert_allclose(zoomed, np.column_stack([middle - size * half, middle + size * half]), rtol=1e-9)
        chart.press("ArrowUp")
        moved = np.array(chart.evaluate(RANGES)).reshape(2, 2)
        np.testing.assert_allclose(moved[1] - zoomed[1], 0.25 * half[1] if both else 0.0, rtol=1e-9)
        chart.press("Home")
        np.testing.assert_allclose(np.array(chart.evaluate(RANGES)).reshape(2, 2), whole)
    page.close()


def test_bad_input_is_one_sentence_and_exit_code_2(files, capsys):
    assert main([*arguments(files)[:2], "--mapping", "nothing.yaml", "--out", str(files / "out")]) == 2
    assert "nothing.yaml: cannot be read" in capsys.readouterr().err
    assert main(arguments(files)) == 0
    assert main(arguments(files)) == 2
    error = capsys.readouterr().err
    assert "holds runs already; give a new folder" in error
    assert error.count("\n") == 1
