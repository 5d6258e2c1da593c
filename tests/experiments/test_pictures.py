"""The documentation's pictures: one command draws all, they fit their frame, and are readable at 390 px."""

import importlib
from pathlib import Path
from typing import get_args

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from drift_drake.car.effects.catalogue import CATALOGUE
from experiments.pictures.__main__ import Name
from experiments.pictures.effects_map import PLACES, place
from experiments.pictures.look import WIDTH

ROOT = Path(__file__).parents[2]
NAMES = get_args(Name)
SMALLEST = 10.5  # [px] height of a letter's line on a page of 390 px


def test_all_of_them_are_drawn_by_make_and_kept() -> None:
    made = next(line for line in (ROOT / "Makefile").read_text().splitlines() if line.startswith("PICTURES := "))
    modules = {path.stem for path in (ROOT / "experiments" / "pictures").glob("[a-z]*.py")} - {"look"}
    assert set(made.split()[2:]) == set(NAMES) == modules
    assert all((ROOT / "docs" / f"{name}.png").is_file() for name in NAMES)
    assert (ROOT / "docs" / "diagnosis.gif").is_file()


@pytest.mark.parametrize("name", ["car_frames", "effects_map", "two_criteria"])
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


def test_every_effect_has_a_place_in_the_map() -> None:
    assert {place(name) for name in CATALOGUE} <= set(PLACES)
