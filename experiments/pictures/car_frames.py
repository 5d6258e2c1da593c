"""The car and its frames: what each symbol is measured between, every quantity drawn positive (ISO 8855)."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Polygon
from matplotlib.patheffects import withStroke

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.view.colours import INK, REFERENCE
from drift_drake.view.pictures.car_shape import CarShape, placed, turned
from drift_drake.view.style import LANE
from experiments.pictures.look import BLUE, GREEN, HEAD, ORANGE, PINK, PLAIN, SMALL, WIDTH, arrow, canvas, for_pages

HEIGHT = 6.7  # [in]
SCALE = 0.62  # [in/m]
PATH_ANGLE, HEADING, SIDESLIP, STEERING = np.deg2rad((55.0, 70.0, 30.0, 24.0))  # of the drawn moment
LATERAL_ERROR = 1.75  # [m]
POINT = np.array([3.25, 3.95])  # [in] on the path, nearest to the car
CURVATURE = 0.1  # of the path [1/in]
AXES, SPEED = (1.5, 0.95), 1.75  # [in] lengths of the body's axes and of the velocity
DARK = {BLUE: "#005A8E", ORANGE: "#A84300", GREEN: "#00694C", PINK: "#8E4670"}  # of letters, on white
SYMBOLS = (  # below the drawing: symbol, what it is
    (r"$x,\ y,\ \psi$", "position and heading in the fixed frame", INK),
    (r"$v,\ \beta$", "speed; sideslip from the body's x to it", BLUE),
    (r"$r$", "yaw rate, counter-clockwise", INK),
    (r"$\delta$", "angle of the front (road) wheels", ORANGE),
    (r"$\omega_r$", r"rear rim speed in m/s: radius $\times$ wheel's rad/s", GREEN),
    (r"$s,\ e$", "distance along the path; offset to its left", PINK),
    (r"$\Delta\varphi$", r"course error dphi: $\psi + \beta -$ path's angle", PINK),
)


def unit(angle: float) -> Array:
    """A vector of length one [2]."""
    return np.array([np.cos(angle), np.sin(angle)])


def angle_mark(axes: Any, at: Array, radius: float, start: float, end: float, colour: str, label: str,
               share: float = 0.5, further: float = 0.18) -> None:  # fmt: skip
    """An arc [in] counter-clockwise from one angle to another [rad], with an arrow's head and a label beyond it.

    Args:
        share: of the way from start to end where the label is; further: than the radius, where it is [in].
    """
    axes.add_patch(Arc(tuple(at), 2 * radius, 2 * radius, theta1=np.rad2deg(start), theta2=np.rad2deg(end),
                       color=colour, linewidth=1.8, zorder=6))  # fmt: skip
    near = end - 0.12 / radius
    arrow(axes, tuple(at + radius * unit(near)), tuple(at + radius * unit(end)), colour, 1.4)
    beyond = at + (radius + further) * unit(start + share * (end - start))
    axes.text(*beyond, label, color=DARK.get(colour, INK), size=HEAD, ha="center", va="center", zorder=7,
              path_effects=[withStroke(linewidth=3.5, foreground="#F7F7F5")])  # fmt: skip


def labelled(axes: Any, at: Array, text: str, colour: str = INK, **look: Any) -> None:
    """A word or symbol centred at a point [in]."""
    axes.text(*at, text, color=DARK.get(colour, colour), ha="center", va="center", **{"size": HEAD} | look)


def draw_path(axes: Any) -> Array:
    """The path through `POINT`, its tangent and s; returns the normal to its left [2]."""
    along = np.linspace(-2.7, 2.6, 80)
    angles = PATH_ANGLE + CURVATURE * along
    steps = np.diff(along, prepend=along[0])
    curve = np.cumsum(steps[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1), axis=0)
    curve += POINT - curve[np.argmin(np.abs(along))]
    axes.plot(*curve.T, color=LANE, linewidth=34.0, zorder=0, solid_capstyle="butt")
    axes.plot(*curve.T, color=PINK, linewidth=1.6, linestyle=(0, (5, 3)), zorder=1)
    axes.plot(*POINT, "o", color=PINK, markersize=6)
    labelled(axes, POINT + np.array([0.28, -0.1]), "$s$", PINK)
    labelled(axes, curve[10] + np.array([0.62, 0.0]), "path", PINK, size=PLAIN)
    return unit(PATH_ANGLE + 0.5 * np.pi)


def draw_car(axes: Any, at: Array, shape: CarShape) -> None:
    """Body and wheels from above."""
    for outline, colour, order in ((shape.body(), "#F7F7F5", 2), (shape.cabin(), "#E4E6E8", 3)):
        axes.add_patch(Polygon(placed(outline * SCALE, at[0], at[1], HEADING), facecolor=colour, edgecolor=REFERENCE,
                               linewidth=1.2, zorder=order))  # fmt: skip
    for i, wheel in enumerate(shape.wheels(STEERING)):
        axes.add_patch(Polygon(placed(wheel * SCALE, at[0], at[1], HEADING), facecolor=ORANGE if i < 2 else GREEN,
                               edgecolor=INK, linewidth=0.8, zorder=4))  # fmt: skip


def draw_fixed_frame(axes: Any, at: Array) -> None:
    """The fixed frame's axes at the lower left."""
    for angle, name in ((0.0, "X"), (0.5 * np.pi, "Y")):
        arrow(axes, tuple(at), tuple(at + 0.62 * unit(angle)), INK)
        labelled(axes, at + 0.76 * unit(angle), name, size=PLAIN)


@for_pages
def draw() -> Figure:
    """The drawing, and below it what each symbol is."""
    figure, axes = canvas(HEIGHT)
    car, normal = VehicleParameters(), draw_path(axes)
    shape, course = CarShape.of(car), HEADING + SIDESLIP
    at = POINT + SCALE * LATERAL_ERROR * normal
    draw_car(axes, at, shape)
    axes.plot(*np.stack([POINT, at]).T, color=PINK, linewidth=1.8, zorder=3)
    labelled(axes, POINT + 0.42 * (at - POINT) + 0.16 * unit(PATH_ANGLE), "$e$", PINK)
    for angle, name, length in ((HEADING, "x", AXES[0]), (HEADING + 0.5 * np.pi, "y", AXES[1])):
        arrow(axes, tuple(at), tuple(at + length * unit(angle)), INK)
        labelled(axes, at + (length + 0.13) * unit(angle - 0.06), name, size=PLAIN)
    arrow(axes, tuple(at), tuple(at + SPEED * unit(course)), BLUE, 2.6)
    labelled(axes, at + (SPEED + 0.14) * unit(course), "$v$", BLUE)
    angle_mark(axes, at, 0.62, HEADING, course, BLUE, r"$\beta$")
    tangent = at + 1.25 * unit(PATH_ANGLE)
    axes.plot(*np.stack([at, tangent]).T, color=PINK, linewidth=1.2, linestyle=(0, (2, 2)), zorder=3)
    angle_mark(axes, at, 1.12, PATH_ANGLE, course, PINK, r"$\Delta\varphi$", 0.68, 0.2)
    axes.plot(*np.stack([at, at + 1.0 * unit(0.0)]).T, color=REFERENCE, linewidth=1.2, linestyle=(0, (2, 2)), zorder=3)
    angle_mark(axes, at, 0.7, 0.0, HEADING, INK, r"$\psi$", 0.22)
    angle_mark(axes, at, 0.42, HEADING + 2.2, HEADING + 4.0, INK, "$r$")
    front = at + turned(SCALE * np.array([[shape.front_axle, -0.5 * shape.track]]), HEADING)[0]
    for angle, colour in ((HEADING, REFERENCE), (HEADING + STEERING, ORANGE)):
        axes.plot(*np.stack([front, front + 0.66 * unit(angle)]).T, color=colour, linewidth=1.4, zorder=5)
    angle_mark(axes, front, 0.56, HEADING, HEADING + STEERING, ORANGE, r"$\delta$", 0.3)
    rear = at + turned(SCALE * np.array([[-shape.rear_axle, -0.5 * shape.track]]), HEADING)[0]
    labelled(axes, rear + 0.3 * unit(HEADING - 0.5 * np.pi), r"$\omega_r$", GREEN)
    draw_fixed_frame(axes, np.array([0.3, 2.2]))
    for i, (symbol, words, colour) in enumerate(SYMBOLS):
        y = 1.66 - 0.235 * i
        axes.text(0.16, y, symbol, color=DARK.get(colour, colour), size=PLAIN, va="center")
        axes.text(1.05, y, words, size=SMALL, va="center")
    axes.set(xlim=(0.0, WIDTH))
    return figure
