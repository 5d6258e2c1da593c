"""The documentation's pictures: one command draws all, they fit their frame, and are readable at 390 px."""

import importlib
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from drift_drake.car.effects.catalogue import CATALOGUE
from experiments.pictures import Name, effects_map, gap, predictions
from experiments.pictures.look import WIDTH

ROOT = Path(__file__).parents[2]
NAMES = get_args(Name)
HELPERS = {"look", "overhead_panels", "photograph", "rendered"}  # modules that draw no picture of their own
SMALLEST = 10.5  # [px] height of a letter's line on a page of 390 px


def test_all_of_them_are_drawn_by_make_and_kept() -> None:
    made = next(line for line in (ROOT / "Makefile").read_text().splitlines() if line.startswith("PICTURES := "))
    modules = {path.stem for path in (ROOT / "experiments" / "pictures").glob("[a-z]*.py")} - HELPERS
    assert {*made.split()[2:], "figure_8"} == set(NAMES) == modules  # figure_8's drives take half an hour
    assert all((ROOT / "docs" / f"{name}.png").is_file() for name in NAMES)
    assert (ROOT / "docs" / "diagnosis.gif").is_file()


@pytest.mark.parametrize("name", ["car_frames", "effects_map", "layers", "loop", "two_criteria"])
def test_texts_of_a_drawing_fit_and_are_readable(name: str) -> None:
    figure = importlib.import_module(f"experiments.pictures.{name}").draw()
    FigureCanvasAgg(figure).draw()
    box = figure.bbox
    texts = [text for text in figure.findobj(Text) if text.get_text().strip() and text.get_visible()]
    assert len(texts) > 5
    for text in texts:
        extent = text.get_window_extent()
        inside = extent.x0 >= box.x0 and extent.x1 <= box.x1 and extent.y0 >= box.y0 and extent.y1 <= box.y1
        assert inside, text.get_text()
        assert text.get_fontsize() / 72.0 / WIDTH * 390.0 >= SMALLEST, text.get_text()


def test_every_effect_is_once_on_the_map_and_where_it_acts() -> None:
    shown = [text.get_text() for text in effects_map.draw().findobj(Text)]
    assert sorted(text for text in shown if text in CATALOGUE) == sorted(CATALOGUE)
    places = {"steering_delay": "command", "steering_lag": "actuator", "torque_gain_error": "drivetrain",
              "tyre_relaxation": "tyre", "mass_error": "body", "aero_drag": "force", "gyro_bias": "sensor"}  # fmt: skip
    assert {name: effects_map.place(name) for name in places} == places


def test_the_cause_removes_the_gap_and_the_other_candidate_does_not() -> None:
    _, before, (other, cause) = gap.compared()
    assert cause.magnitude == pytest.approx(gap.TRUTH["steering_lag"], rel=0.05)
    assert cause.removed > 0.99
    assert other.removed < 0.5
    assert np.std(cause.errors) < 0.1 * np.std(before)


def test_predictions_are_better_after_learning() -> None:
    found = predictions.predictions()
    assert (found.rms(found.after) < found.rms(found.before)).all()
