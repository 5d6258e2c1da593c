"""The look of pictures that are read on a narrow screen: 390 px wide, a letter is 11 px high or more.

The background is the picture's own, so that a dark page shows it as a light one does.
"""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec

import matplotlib
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from drift_drake.view.colours import INK, RUNS
from drift_drake.view.style import RC, new_figure

Arguments = ParamSpec("Arguments")

WIDTH = 5.0  # [in]
SMALL, PLAIN, HEAD = 10.0, 11.0, 12.5  # [pt]: 10.8 px and more where the picture is 390 px wide
MARGIN = 0.06  # [in]
BLUE, ORANGE, GREEN, PINK, SKY, YELLOW = RUNS[:6]
PALE = {
    BLUE: "#DCEAF5",
    ORANGE: "#FBE5D6",
    GREEN: "#D9F0E8",
    PINK: "#F6E6EF",
    YELLOW: "#FBF0D5",
    INK: "#EFEFEC",
    SKY: "#E4F2FB",
}
"""Of a colour, what a box of it is filled with."""
LARGE: dict[str, Any] = RC | {
    "font.size": PLAIN, "axes.titlesize": HEAD, "axes.labelsize": PLAIN, "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL, "legend.fontsize": SMALL, "lines.linewidth": 1.8, "axes.linewidth": 0.8,
    "figure.constrained_layout.w_pad": MARGIN, "figure.constrained_layout.h_pad": MARGIN,
}  # fmt: skip


def for_pages(draw: Callable[Arguments, Figure]) -> Callable[Arguments, Figure]:
    """Decorates a function that makes a figure: the look holds within it, matplotlib's own settings stay alone."""

    @wraps(draw)
    def wrapped(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Figure:
        with matplotlib.rc_context(LARGE):
            figure = draw(*args, **kwargs)
            figure.canvas.draw()  # ticks are made with the settings of this moment
        return figure

    return wrapped


def canvas(height: float) -> tuple[Figure, Any]:
    """A figure of the page's width and a height [in], and axes over all of it in inches, for a drawing."""
    figure = new_figure(WIDTH, height)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, WIDTH), ylim=(0.0, height), aspect="equal")
    axes.set_axis_off()
    return figure, axes


def box(axes: Any, x: float, y: float, width: float, height: float, colour: str) -> None:
    """A rounded box with its lower left corner at (x, y) [in], pale within, its edge of the colour."""
    patch = FancyBboxPatch((x, y), width, height, boxstyle="round,pad=0,rounding_size=0.08", facecolor=PALE[colour],
                           edgecolor=colour, linewidth=1.4)  # fmt: skip
    axes.add_patch(patch)


def arrow(axes: Any, start: tuple[float, float], end: tuple[float, float], colour: str = INK, width: float = 1.8,
          bend: float = 0.0) -> None:  # fmt: skip
    """An arrow between two points, bent to the right of its way by `bend`."""
    look = {"arrowstyle": "-|>,head_length=0.45,head_width=0.24", "color": colour, "linewidth": width,
            "shrinkA": 0.0, "shrinkB": 0.0, "connectionstyle": f"arc3,rad={bend}"}  # fmt: skip
    axes.annotate("", end, start, arrowprops=look)
