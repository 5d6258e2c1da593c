"""The closed loop as one drawing, with every effect of the catalogue written where it acts.

A new effect appears by itself: at its stage, and among those of the motion in its family's box.
"""

from collections.abc import Iterable

from matplotlib.figure import Figure

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.catalogue.actuators import ACTUATORS
from drift_drake.car.effects.catalogue.body import BODY
from drift_drake.car.effects.catalogue.tyres import TYRES
from drift_drake.view.colours import INK
from experiments.pictures.look import BLUE, GREEN, ORANGE, PINK, SMALL, WIDTH, YELLOW, arrow, box, canvas, for_pages

PLACES = {  # in the loop's order: title, and the colour of the box
    "controller": ("Controller: MPC with a model of the car", INK),
    "command": ("Commands: steering, engine torque", YELLOW),
    "actuator": ("Actuators", ORANGE),
    "drivetrain": ("Drivetrain", ORANGE),
    "tyre": ("Tyres", BLUE),
    "force": ("Further forces: air, road, axle", BLUE),
    "body": ("Body: mass, loads", BLUE),
    "sensor": ("Sensors", GREEN),
    "log": ("Log", INK),
}
OF_FAMILY = ((TYRES, "tyre"), (BODY, "body"), (ACTUATORS, "drivetrain"))  # among effects on the motion
ROW, TITLE, GAP, EDGE, PAD = 0.19, 0.27, 0.2, 0.08, 0.07  # [in]
LEFT, COLUMN = 0.46, 2.3  # [in] of the boxes' edge, and from one column of names to the next


def place(name: str) -> str:
    """The key of `PLACES` that an effect of the catalogue acts at."""
    effect = CATALOGUE[name]
    if effect.stage != "motion":
        return effect.stage
    return next((where for family, where in OF_FAMILY if name in family), "force")


def columns(names: Iterable[str]) -> list[tuple[str, ...]]:
    """Names in rows of two, long ones next to short ones."""
    ordered = sorted(names, key=lambda name: (-len(name), name))
    half = (len(ordered) + 1) // 2
    left, right = ordered[:half], ordered[half:]
    return [tuple(row) for row in zip(left, [*right, ""][:half], strict=True)]


@for_pages
def draw() -> Figure:
    """The loop from top to bottom, and back."""
    rows = {key: columns(name for name in CATALOGUE if place(name) == key) for key in PLACES}
    heights = {key: TITLE + len(found) * ROW + (PAD if found else 0.0) for key, found in rows.items()}
    total = sum(heights.values()) + GAP * (len(heights) - 1) + 2 * EDGE
    figure, axes = canvas(total)
    top, middle = total - EDGE, 0.5 * (LEFT + WIDTH - EDGE)
    measured = 0.0
    for key, (title, colour) in PLACES.items():
        height = heights[key]
        box(axes, LEFT, top - height, WIDTH - EDGE - LEFT, height, colour)
        axes.text(LEFT + 0.1, top - 0.5 * TITLE, title, va="center", weight="bold", size=SMALL)
        for i, row in enumerate(rows[key]):
            for j, name in enumerate(row):
                axes.text(LEFT + 0.1 + j * COLUMN, top - TITLE - (i + 0.45) * ROW, name, va="center", size=SMALL)
        measured = top - 0.5 * height if key == "sensor" else measured
        top -= height
        if key != "log":
            arrow(axes, (middle, top), (middle, top - GAP))
            top -= GAP
    back, controller = LEFT - 0.18, total - EDGE - 0.5 * TITLE
    axes.plot([LEFT, back, back], [measured, measured, controller], color=PINK, linewidth=2.2)
    arrow(axes, (back, controller), (LEFT, controller), PINK, 2.2)
    axes.text(back - 0.06, 0.5 * (measured + controller), "measured state", rotation=90.0, ha="right", va="center",
              size=SMALL)  # fmt: skip
    return figure
