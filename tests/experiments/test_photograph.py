"""Pages photographed as a phone shows them: only the parts that are asked for, and no empty space at the end."""

import numpy as np
import pytest
from PIL import Image

from drift_drake.view.pages.policy import with_policy
from experiments.pictures.photograph import FINE, MARGIN, WIDTH, UnseenPageError, photograph, trimmed
from tests.browser import needs_browser

PAGE = """<!doctype html><html><head><meta charset="utf-8"></head><body style="margin: 0">
<div id="left_out" style="height: 200px; background: red"></div><main><p>text</p>
<div id="shown" style="height: 100px; width: 50%; background: #0000ff"></div></main></body></html>"""


@needs_browser
def test_only_the_parts_are_in_the_picture(tmp_path):
    (tmp_path / "page.html").write_text(with_policy(PAGE))
    photograph(tmp_path / "page.html", tmp_path / "page.png", ["#shown"], height=500)
    with Image.open(tmp_path / "page.png") as image:
        pixels = np.asarray(image.convert("RGB"))
    assert pixels.shape == (FINE * 100 + MARGIN, FINE * WIDTH, 3)
    assert (pixels[: FINE * 100, : FINE * WIDTH // 2] == (0, 0, 255)).all()
    assert (pixels[:, FINE * WIDTH // 2 + 1 :] == 255).all()


def test_a_machine_without_a_browser_is_named(tmp_path, monkeypatch):
    (tmp_path / "page.html").write_text(PAGE)
    monkeypatch.setitem(photograph.__globals__, "BROWSER", None)
    with pytest.raises(UnseenPageError, match="no Chromium on this machine"):
        photograph(tmp_path / "page.html", tmp_path / "page.png")


def test_an_image_of_one_colour_keeps_a_line():
    assert trimmed(Image.new("RGB", (8, 100))).size == (8, 1 + MARGIN)
