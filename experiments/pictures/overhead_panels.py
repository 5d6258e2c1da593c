"""Groups of runs from above, side by side."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.view.colours import INK, REFERENCE, RUNS
from drift_drake.view.pictures.car_shape import CarShape
from drift_drake.view.pictures.overhead import draw_cars, draw_reference, extent
from drift_drake.view.style import BOUND, new_figure, styled

ENDS = {"spin": "x", "left the lane": "s", "time is up": "o"}  # outcome and its marker


class OverheadPanel(NamedTuple):
    """One group of runs."""

    title: str
    runs: Sequence[pd.DataFrame]  # with x, y
    outcomes: Sequence[str]  # how each ended; "completed" leaves no mark
    picked: pd.DataFrame  # with t, x, y, psi, delta: drawn in colour, with the car


@styled
def overhead_panels(panels: Sequence[OverheadPanel], reference: Reference, parameters: VehicleParameters) -> Figure:
    """Draws groups of runs from above, two abreast where they are not too wide.

    Raises:
        ValueError: no panel.
    """
    return plain_panels(panels, reference, parameters)


def plain_panels(
    panels: Sequence[OverheadPanel], reference: Reference, parameters: VehicleParameters, wide: float = 7.5,
    most_abreast: int = 2,
) -> Figure:  # fmt: skip
    """The same in the settings of the caller, for a picture `wide` inches wide."""
    if not panels:
        raise ValueError("no runs to draw; give at least one group")
    shape = CarShape.of(parameters)
    low, high = extent({str(i): run for i, panel in enumerate(panels) for run in panel.runs}, reference, 2.0)
    width, height = high - low
    columns = 1 if width > 2.5 * height else min(most_abreast, len(panels))
    rows = math.ceil(len(panels) / columns)
    figure = new_figure(wide, 0.5 + rows * (0.25 + (wide - 0.3) / columns * height / width))
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, panel in zip(grid.ravel(), panels, strict=False):
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), title=panel.title, aspect="equal")
        draw_reference(axes, reference)
        for run, outcome in zip(panel.runs, panel.outcomes, strict=True):
            axes.plot(run["x"], run["y"], color=INK, linewidth=0.5, alpha=0.3, zorder=3.5)
            if outcome in ENDS:
                axes.plot(run["x"].iloc[-1], run["y"].iloc[-1], ENDS[outcome], color=BOUND, markersize=3.5,
                          markerfacecolor="none", markeredgewidth=0.9, zorder=6)  # fmt: skip
        axes.plot(panel.picked["x"], panel.picked["y"], color=RUNS[0], linewidth=1.4, zorder=4)
        draw_cars(axes, panel.picked, shape, 0.7, RUNS[0])
    for axes in grid.ravel()[len(panels) :]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel("x [m]")
    for axes in grid[:, 0]:
        axes.set_ylabel("y [m]")
    handles = [
        Line2D([], [], color=RUNS[0], linewidth=1.4, label="median run"),
        Line2D([], [], color=INK, linewidth=0.5, alpha=0.5, label="all runs"),
        Line2D([], [], color=REFERENCE, linewidth=0.9, linestyle=(0, (4, 3)), label="reference"),
    ]
    ended = {outcome for panel in panels for outcome in panel.outcomes}
    handles += [
        Line2D([], [], color=BOUND, marker=marker, markerfacecolor="none", markersize=3.5, linestyle="", label=outcome)
        for outcome, marker in ENDS.items()
        if outcome in ended
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=len(handles) if most_abreast > 1 else 3)
    return figure
