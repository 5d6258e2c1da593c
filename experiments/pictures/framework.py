"""The paper's framework as one drawing: training, informative drives, the belief after each, and the drift."""

from typing import Any

from matplotlib.figure import Figure

from drift_drake.view.colours import INK
from experiments.pictures.look import BLUE, GREEN, ORANGE, PINK, SMALL, WIDTH, YELLOW, arrow, box, canvas, for_pages

CHAIN = (  # what is done, by what, what is handed on, the colour of the box
    ("meta-training, offline", "many cars' drives: features φ, prior of θ", "prior", INK),
    ("Info-OCP", "plans 4.5 s along a lane, most informative of θ", "plan", ORANGE),
    ("informative drive", "tracking controller on the true car", "log at 10 Hz", BLUE),
    ("Bayesian regression", "updates θ and its covariance", "Twice-Info", PINK),
    ("OCP, 100 times a second", "plans the drift with the mean of θ", "command", YELLOW),
    ("drift", "figure-8, loops, on the same car", "", GREEN),
)
HEIGHT, GAP, LEFT, EDGE = 0.56, 0.36, 0.3, 0.08  # [in]
RIGHT = 0.62  # [in] left free for the way back


def _named(axes: Any, top: float, name: str, does: str, colour: str) -> None:
    box(axes, LEFT, top - HEIGHT, WIDTH - LEFT - RIGHT, HEIGHT, colour)
    for text, below, weight in ((name, 0.17, "bold"), (does, 0.4, "normal")):
        axes.text(LEFT + 0.1, top - below, text, va="center", size=SMALL, weight=weight)


@for_pages
def draw() -> Figure:
    """From training to the drift, with the way back from the belief to the next plan."""
    total = len(CHAIN) * HEIGHT + (len(CHAIN) - 1) * GAP + 2 * EDGE
    figure, axes = canvas(total)
    top, middle, centres = total - EDGE, 0.5 * (WIDTH - RIGHT + LEFT), []
    for name, does, handed, colour in CHAIN:
        _named(axes, top, name, does, colour)
        centres.append(top - 0.5 * HEIGHT)
        top -= HEIGHT
        if handed:
            arrow(axes, (middle, top), (middle, top - GAP))
            axes.text(middle + 0.12, top - 0.5 * GAP, handed, va="center", size=SMALL, style="italic")
        top -= GAP
    edge, side = WIDTH - RIGHT, WIDTH - 0.34
    axes.plot([edge, side, side], [centres[3], centres[3], centres[1]], color=PINK, linewidth=2.2)
    arrow(axes, (side, centres[1]), (edge, centres[1]), PINK, 2.2)
    axes.text(side + 0.06, centres[2], "Once-Info: again", rotation=90.0, va="center", size=SMALL)
    return figure
