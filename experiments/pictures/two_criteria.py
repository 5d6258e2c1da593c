"""The two criteria of a diagnosis and when which: a drawing of two columns."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from drift_drake.view.colours import INK
from experiments.pictures.look import BLUE, ORANGE, PLAIN, SMALL, WIDTH, arrow, box, canvas, for_pages

HEIGHT = 5.75  # [in]
EDGE, COLUMN, LEAP = 0.08, 2.36, 0.24  # [in] margin, width of a column, distance of two boxes
HEIGHTS = (1.22, 0.64, 1.72, 0.64)  # [in] of the boxes, from the top
SKETCH = 0.9  # [in] height
COLUMNS = (  # colour and the words of the boxes, from the top
    (BLUE, (
        "Likelihood",
        "for a car that follows\nthe equations: a\nsimulator",
        "needs a vehicle file\nwith tolerances",
        "judges innovations\nof an extended\nKalman filter",
        "compares with the\nsensors' noise",
    )),
    (ORANGE, (
        "Prediction",
        "for a real car, which\nfollows no equations\nexactly",
        "needs a baseline by\ndrift-drake identify",
        "judges errors of\npredictions half a\nsecond ahead",
        "compares with the\nbaseline's own errors",
    )),
)  # fmt: skip


def innovations(axes: Any, rng: np.random.Generator, colour: str) -> None:
    """One after the other, within their predicted deviations and then beyond."""
    values = rng.standard_normal(40)
    values[24:] += 2.2 * np.sin(np.arange(16) / 2.5)
    axes.axhspan(-2.0, 2.0, color="#B9B9B5", linewidth=0.0)
    axes.plot(values, "o-", color=colour, markersize=2.5, linewidth=0.9)
    axes.set(ylim=(-5.0, 5.0))


def distributions(axes: Any, _: np.random.Generator, colour: str) -> None:
    """Of errors: of the baseline, and of a day that changed from it."""
    at = np.linspace(-4.0, 6.0, 200)
    axes.fill_between(at, np.exp(-0.5 * at**2), color="#B9B9B5", linewidth=0.0)
    axes.plot(at, 0.8 * np.exp(-0.5 * ((at - 2.0) / 1.25) ** 2), color=colour)
    axes.set(ylim=(0.0, 1.1))


SKETCHES: tuple[Callable[[Any, np.random.Generator, str], None], ...] = (innovations, distributions)


@for_pages
def draw() -> Figure:
    """Two columns: for which car, what it needs, what is judged, against what; below them the verdicts of both."""
    figure, axes = canvas(HEIGHT)
    rng = np.random.default_rng(1)
    for i, ((colour, (name, car, needs, judged, against)), sketch) in enumerate(zip(COLUMNS, SKETCHES, strict=True)):
        left, top = EDGE + i * (WIDTH - 2 * EDGE - COLUMN), HEIGHT - EDGE
        for height, text in zip(HEIGHTS, (car, needs, judged, against), strict=True):
            box(axes, left, top - height, COLUMN, height, colour)
            below = top - 0.44 if text is car else top - 0.12
            axes.text(left + 0.12, below, text, va="top", size=PLAIN, linespacing=1.25)
            if text is car:
                axes.text(left + 0.12, top - 0.12, name, va="top", size=13.5, weight="bold")
            if text is judged:
                small = figure.add_axes(((left + 0.12) / WIDTH, (top - height + 0.08) / HEIGHT,
                                         (COLUMN - 0.24) / WIDTH, SKETCH / HEIGHT))  # fmt: skip
                sketch(small, rng, colour)
                small.set(xticks=[], yticks=[], facecolor="white")
            arrow(axes, (left + 0.5 * COLUMN, top - height), (left + 0.5 * COLUMN, top - height - LEAP))
            top -= height + LEAP
    height = HEIGHT - 2 * EDGE - sum(HEIGHTS) - len(HEIGHTS) * LEAP
    box(axes, EDGE, EDGE, WIDTH - 2 * EDGE, height, INK)
    axes.text(0.5 * WIDTH, EDGE + 0.5 * height, "effect, none or unknown", ha="center", va="center", weight="bold",
              size=SMALL + 1.5)  # fmt: skip
    return figure
