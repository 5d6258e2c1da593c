"""The demo's page as a phone shows it: what it found, and the seven models' drifts."""

import tempfile
from pathlib import Path

from experiments import demo
from experiments.pictures.photograph import photograph

DRIFT = "section:nth-of-type(4)"
PARTS = ("header", f"{DRIFT} h2", f"{DRIFT} p", "figure.map")


def take(out: Path, source: Path | None = None) -> None:
    """Writes the picture.

    Args:
        source: the folder of a demo that was made before; one is made without.
    """
    if source is not None:
        photograph(source / "index.html", out, PARTS)
        return
    with tempfile.TemporaryDirectory() as folder:
        demo.main(demo.DemoConfig(out=Path(folder)))
        photograph(Path(folder) / "index.html", out, PARTS)
