"""A page as a phone shows it: parts of it, photographed by a headless browser."""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from drift_drake.common.errors import DriftDrakeError, shown

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
WIDTH, TALLEST = 390, 3200  # [px] of a phone's page
FINE = 2  # pixels of the picture for one of the page, across and down
MARGIN = 24  # pixels of the picture below its last line
PATIENCE = 120.0  # [s]
OPTIONS = ("--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--hide-scrollbars",
           "--virtual-time-budget=8000", f"--force-device-scale-factor={FINE}")  # fmt: skip
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
# A part is shown with all that is in it; everything else takes no space.
ONLY = """<script>addEventListener("load", () => setTimeout(() => {
  const kept = PARTS.map(part => document.querySelector(part));
  for (const one of document.body.querySelectorAll("*"))
    if (!kept.some(part => part.contains(one) || one.contains(part))) one.style.display = "none";
}, 500));</script>"""
FRAME = (
    '<!doctype html><body style="margin: 0"><iframe style="border: 0" width="{}" height="{}" src="page.html"></iframe>'
)


class UnseenPageError(DriftDrakeError):
    """A page that no browser on this machine photographs; the message says why."""


def photograph(page: Path, out: Path, parts: Sequence[str] = (), script: str = "", height: int = TALLEST) -> None:
    """Writes a PNG of a page, 780 px wide, without the empty space at its end.

    Args:
        parts: CSS selectors of what is shown, the first match of each; all without.
        script: that runs in the page once it is loaded.
        height: [px] of the phone's window.

    Raises:
        UnseenPageError: there is no Chromium, or it fails.
    """
    if BROWSER is None:
        raise UnseenPageError("no Chromium on this machine to photograph a page; install it (apt install chromium)")
    text = POLICY.sub("", page.read_text(encoding="utf-8"))  # which allows no other scripts than the page's own
    if parts:
        script += ONLY.replace("PARTS", str(list(parts)))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "page.html").write_text(text.replace("</body>", f"{script}</body>"), encoding="utf-8")
        # In a frame: a headless window has 500 px at least.
        (folder / "frame.html").write_text(FRAME.format(WIDTH, height), encoding="utf-8")
        taken = folder / "taken.png"
        command = [BROWSER, *OPTIONS, f"--window-size={WIDTH + 100},{height + 200}", f"--screenshot={taken}",
                   (folder / "frame.html").as_uri()]  # fmt: skip
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        except subprocess.TimeoutExpired:
            raise UnseenPageError(f"{page}: the browser takes more than {PATIENCE:g} s") from None
        if done.returncode != 0 or not taken.exists():
            raise UnseenPageError(f"{page}: the browser fails: {shown(done.stderr.strip().splitlines()[-1:])}")
        with Image.open(taken) as image:
            part = trimmed(image.convert("RGB").crop((0, 0, FINE * WIDTH, FINE * height)))
            part.save(out, optimize=True)


def trimmed(image: Image.Image) -> Image.Image:
    """An image without the rows of one colour at its end, but for a margin."""
    pixels = np.asarray(image)
    varied = np.flatnonzero((pixels != pixels[:, :1]).any(axis=(1, 2)))
    last = int(varied[-1]) + 1 if varied.size else 1
    return image.crop((0, 0, image.width, min(last + MARGIN, image.height)))
