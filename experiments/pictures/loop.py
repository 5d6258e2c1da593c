"""The closed loop as one drawing: its systems, what each does, and the ports that connect them."""

from typing import Any

from matplotlib.figure import Figure

from drift_drake.view.colours import INK
from experiments.pictures.look import BLUE, GREEN, ORANGE, PINK, SMALL, WIDTH, YELLOW, arrow, box, canvas, for_pages

CHAIN = (  # system, what it does, the port to the next, the colour of the box
    ("controller", "plans 2.5 s ahead, 100 times a second", "plan", INK),
    ("safe_stop", "passes the plan on, or stops the car", "plan", YELLOW),
    ("actuator", "interpolates the plan, within its limits", "command", ORANGE),
    ("car: plant", "moves by the equations, with effects", "state", BLUE),
    ("car: sensors", "read with noise, and late", "measured_state", GREEN),
    ("screen", "rejects impossible readings", "measured_state", GREEN),
)
LEARNERS = (
    ("adapter", "updates the learnt model", PINK),
    ("monitor", "reports a change", PINK),
)  # side by side
LOG = ("logs", "rows of what was measured, commanded, estimated", INK)
HEIGHT, GAP, LEFT, EDGE = 0.5, 0.34, 0.46, 0.08  # [in]


def _named(axes: Any, x: float, top: float, width: float, name: str, does: str, colour: str) -> None:
    box(axes, x, top - HEIGHT, width, HEIGHT, colour)
    for text, below, weight in ((name, 0.15, "bold"), (does, 0.35, "normal")):
        axes.text(x + 0.1, top - below, text, va="center", size=SMALL, weight=weight)


@for_pages
def draw() -> Figure:
    """The loop from the controller down to the sensors, and back."""
    count = len(CHAIN) + 2
    total = count * HEIGHT + (count - 1) * GAP + 2 * EDGE
    figure, axes = canvas(total)
    right = WIDTH - LEFT
    top, middle = total - EDGE, 0.5 * WIDTH
    for name, does, port, colour in CHAIN:
        _named(axes, LEFT, top, right - LEFT, name, does, colour)
        top -= HEIGHT
        arrow(axes, (middle, top), (middle, top - GAP))
        axes.text(middle + 0.12, top - 0.5 * GAP, port, va="center", size=SMALL, style="italic")
        top -= GAP
    screened, width = top + GAP + 0.5 * HEIGHT, 0.5 * (right - LEFT - 0.1)
    for i, (name, does, colour) in enumerate(LEARNERS):
        _named(axes, LEFT + i * (width + 0.1), top, width, name, does, colour)
    learnt = top - 0.5 * HEIGHT
    top -= HEIGHT
    arrow(axes, (middle, top), (middle, top - GAP))
    _named(axes, LEFT, top - GAP, right - LEFT, *LOG)
    planned = total - EDGE - 0.5 * HEIGHT
    for edge, side, start, shift, words in (
        (LEFT, LEFT - 0.18, learnt, -0.06, "the learnt model's parameters"),
        (right, right + 0.18, screened, 0.06, "measured_state"),
    ):
        axes.plot([edge, side, side], [start, start, planned], color=PINK, linewidth=2.2)
        arrow(axes, (side, planned), (edge, planned), PINK, 2.2)
        axes.text(side + shift, 0.5 * (start + planned), words, rotation=90.0, va="center", size=SMALL,
                  ha="right" if shift < 0.0 else "left")  # fmt: skip
    return figure
