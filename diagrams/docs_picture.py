"""Draws the documentation's picture of the closed loop, with the adapter: docs/closed_loop.png (`make pictures`).

python -m diagrams.docs_picture
"""

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from diagrams.command import run_command
from drift_drake.cli.drive_run import ClosedLoopConfig, build
from drift_drake.view.pictures.graph import draw_graph

PICTURE = Path(__file__).parents[1] / "docs" / "closed_loop.png"
DEPTH = 1  # the car is opened, its sensors are a block: wider pictures are not legible on a page


def main(out: Path = PICTURE) -> None:
    """Draws the closed loop in which the learnt model adapts."""
    with TemporaryDirectory() as folder:
        diagram = build(ClosedLoopConfig(model="online")).diagram
        _, png = draw_graph(diagram, Path(folder) / "closed_loop", DEPTH)
        shutil.copyfile(png, out)
    print(out)


if __name__ == "__main__":
    run_command(main)
