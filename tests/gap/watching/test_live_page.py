"""The monitor's page: what it shows, that it loads itself anew while a log grows, and that a browser draws it."""

import numpy as np
import pytest
from browser import check_looks, needs_browser

from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.cli.main import main
from drift_drake.gap.monitoring.events import nothing_seen
from drift_drake.gap.monitoring.watch import VerdictAt
from drift_drake.gap.watching.live_page import LEADING, bands, page, traces

SIGNALS_OF_A_DRIVE = np.arange(8.0).reshape(2, 4)


@pytest.fixture(scope="module")
def watched_page(tmp_path_factory, changed_run):
    folder = tmp_path_factory.mktemp("page")
    VehicleParameters().to_yaml(folder / "car.yaml")
    write_run(changed_run, folder / "run_0.csv")
    path = folder / "watch.html"
    arguments = ["watch", str(folder / "run_0.csv"), "--vehicle", str(folder / "car.yaml"), "--page", str(path)]
    assert main(arguments) == 0
    return path


def test_the_page_of_a_log_shows_what_was_reported(watched_page, changed_run):
    text = watched_page.read_text()
    assert "rear_stiffness_error" in text
    assert "the car has changed" in text
    assert "predicted by the" in text
    assert 'http-equiv="refresh"' not in text  # it is over
    assert len(text) < 100_000
    assert f"{changed_run.t[-1]:.1f} s</span>" in text


def test_a_page_of_a_log_that_grows_loads_itself_anew(monitor):
    p = np.zeros(len(monitor.labels))
    p[0] = 1.0
    seen = nothing_seen(1)._replace(signals=SIGNALS_OF_A_DRIVE)
    text = page("log", monitor.labels, [VerdictAt(0.1 * i, p, [], seen) for i in range(5000)], [], True)
    assert 'http-equiv="refresh"' in text
    assert "nothing has changed" in text
    assert 'id="clock"' in text
    assert text.count("<polyline") == 8  # four signals, measured and predicted
    assert 'http-equiv="refresh"' in page("log", monitor.labels, [], [], True)  # before the first verdict


def test_bands_fill_the_chart(monitor):
    p = np.random.default_rng(0).dirichlet(np.ones(len(monitor.labels)), 20)
    found = bands(monitor.labels, np.arange(20.0), p)
    assert [band.name for band in found[:1] + found[-2:]] == ["none", "others", "unknown"]
    assert len(found) == LEADING + 3
    assert sum(band.last for band in found) == pytest.approx(1.0)
    assert found[-1].points.split()[0] == "0.0,0.0"  # the top


@needs_browser
def test_a_browser_draws_it(watched_page, browser):
    check_looks(browser, watched_page)


def test_a_watch_that_is_silent_is_said_to_be(monitor, tmp_path, browser, monkeypatch):
    monkeypatch.setattr("time.time", lambda: 1.0)
    seen = nothing_seen(1)._replace(signals=SIGNALS_OF_A_DRIVE)
    rows = [VerdictAt(0.1 * i, np.full(len(monitor.labels), 0.1), [], seen) for i in range(50)]
    (tmp_path / "watch.html").write_text(page("log", monitor.labels, rows, [], True), encoding="utf-8")
    window = browser.new_page()
    window.goto((tmp_path / "watch.html").as_uri())
    assert "the watch writes nothing more" in window.locator("#age").inner_text()
    assert window.locator(".scale").nth(1).locator("span").all_inner_texts() == ["4", "2", "0"]  # of the yaw rate
    window.close()


def test_the_middle_of_an_axis_has_no_more_digits_than_its_ends_show():
    t = np.linspace(0.0, 1.0, 5)
    signals = np.zeros((5, 2, 4))
    signals[:, :, 0] = np.array([-0.628, 0.1, 0.2, 0.3, 0.62799506])[:, None]
    signals[:, :, 1] = np.array([10.3, 11.0, 12.0, 13.0, 15.1])[:, None]
    rate, speed, *_ = traces(t, signals)
    assert rate.middle == 0.0
    assert speed.middle == pytest.approx(12.7)
