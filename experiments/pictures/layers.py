"""The package's layers as one drawing: each imports from itself and from those below it; folders with their modules."""

from pathlib import Path

from matplotlib.figure import Figure

import drift_drake
from drift_drake.view.colours import INK
from experiments.pictures.effects_map import columns
from experiments.pictures.look import (
    BLUE,
    GREEN,
    ORANGE,
    PINK,
    SKY,
    SMALL,
    WIDTH,
    YELLOW,
    arrow,
    box,
    canvas,
    for_pages,
)

PACKAGE = Path(drift_drake.__file__).parent
LAYERS = {  # from the top: what is in it, and the colour of the box
    "cli": ("the command line: a file a command", INK),
    "app": ("the workbench: pages that run commands", SKY),
    "gap": ("a car understood: logs, calibration, diagnosis", PINK),
    "view": ("pictures, reports, replays, exports", YELLOW),
    "drive": ("a car driven: control, learning, references", BLUE),
    "car": ("what a car is: equations, tyres, effects", ORANGE),
    "common": ("files, processes, errors", GREEN),
}
ROW, TITLE, GAP, EDGE, PAD = 0.19, 0.27, 0.24, 0.08, 0.07  # [in]
COLUMN = 2.4  # [in] from one column of names to the next


def modules(folder: Path) -> int:
    """In a folder and below it."""
    return len(list(folder.rglob("*.py")))


def folders(layer: str) -> list[str]:
    """Those of a layer, with their numbers of modules."""
    found = [path for path in (PACKAGE / layer).iterdir() if path.is_dir() and (path / "__init__.py").is_file()]
    return [f"{path.name}: {modules(path)}" for path in found]


@for_pages
def draw() -> Figure:
    """Boxes from the command line down to what everything rests on."""
    rows = {layer: columns(folders(layer)) for layer in LAYERS}
    heights = {layer: TITLE + ROW * (1 + len(rows[layer])) + PAD for layer in LAYERS}
    total = sum(heights.values()) + GAP * (len(LAYERS) - 1) + 2 * EDGE
    figure, axes = canvas(total)
    top = total - EDGE
    for layer, (words, colour) in LAYERS.items():
        box(axes, EDGE, top - heights[layer], WIDTH - 2 * EDGE, heights[layer], colour)
        axes.text(EDGE + 0.1, top - 0.5 * TITLE, f"{layer}: {modules(PACKAGE / layer)} modules", va="center",
                  weight="bold", size=SMALL)  # fmt: skip
        for i, row in enumerate([(words,), *rows[layer]]):
            for j, text in enumerate(row):
                axes.text(EDGE + 0.1 + j * COLUMN, top - TITLE - (i + 0.45) * ROW, text, va="center", size=SMALL,
                          style="italic" if i == 0 else "normal")  # fmt: skip
        top -= heights[layer]
        if layer != "common":
            arrow(axes, (0.5 * WIDTH, top), (0.5 * WIDTH, top - GAP))
            top -= GAP
    return figure
