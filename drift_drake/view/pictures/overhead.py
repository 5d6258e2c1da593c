"""The map from above: lane, reference, driven path and the car's attitude along it."""

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.view.colours import INK, REFERENCE
from drift_drake.view.pictures.car_shape import CarShape, placed
from drift_drake.view.style import DEGREES, LANE, SIDES, check_runs, colours_of, new_figure, styled

COLUMNS = ("t", "x", "y", "psi", "v", "beta", "delta")
WIDTH = 7.5  # [in]
MOST_ABREAST = 5  # entries of the legend in a row of a picture of that width: a longer one would be wider
CLEARANCE = 1.6  # lengths of the car between the centres of two of a run
LINE_SPACING = 0.5  # [m] between points of the reference's lines


@styled
def overhead(
    runs: Mapping[str, pd.DataFrame],
    reference: Reference | None = None,
    parameters: VehicleParameters | None = None,
    car_every: float = 0.7,
    wide: float = WIDTH,
) -> Figure:
    """Draws runs from above: one in the colours of its sideslip, several in one colour each.

    Args:
        runs: tables with t, x, y, psi, v, beta, delta (SI) by name.
        reference: its path and lane are drawn beneath.
        parameters: the car whose outline is drawn; the default car without.
        car_every: [s] between the cars drawn, leaving out those too near another of their run; 0 draws none.
        wide: width of the picture [in]; its letters have a size of their own.

    Raises:
        ValueError: there is no run; a run lacks a column or has no row.
    """
    check_runs(runs, COLUMNS)
    shape = CarShape.of(parameters or VehicleParameters())
    low, high = extent(runs, reference, 0.6 * shape.length)
    width, height = high - low
    abreast = math.ceil(MOST_ABREAST * wide / WIDTH)
    rows = math.ceil((len(runs) + 2 * (reference is not None)) / abreast)  # of the legend
    tall = 1.0 + 0.17 * max(rows - 2, 0) + wide / WIDTH * 5.8 * height / width
    figure = new_figure(wide, float(np.clip(tall, 1.9, 8.5)))
    axes = figure.add_subplot(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect("equal")
    if reference is not None:
        draw_reference(axes, reference)
    mappable = _mappable(runs)
    for run, run_colour in zip(runs.values(), colours_of(runs), strict=True):
        _draw_path(axes, run, mappable, run_colour)
        if car_every > 0.0:
            draw_cars(axes, run, shape, car_every, INK if mappable else run_colour)
    first = next(iter(runs.values()))
    axes.plot(first["x"].iloc[0], first["y"].iloc[0], "o", color=INK, markersize=3.5, zorder=6)
    axes.annotate("start", (first["x"].iloc[0], first["y"].iloc[0]), (6, 6), textcoords="offset points", zorder=6)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    _legend(axes, runs, reference, abreast)
    if mappable is not None:
        bar = figure.colorbar(mappable, ax=axes, label="sideslip [deg]", shrink=0.7, aspect=30, pad=0.02)
        bar.outline.set_visible(False)
    return figure


def _lane_edges(reference: Reference) -> tuple[Array, Array, Array]:
    """(path positions [K], left and right edge of the lane, each [K, 2])."""
    beyond = LINE_SPACING if reference.path.closed else 0.0  # so that the lines of a closed path meet
    end = min(reference.distance, reference.path.length) + beyond
    s = np.arange(0.0, end + 0.5 * LINE_SPACING, LINE_SPACING)
    low, high = reference.lane(s)
    return s, np.stack(reference.path.to_world(s, high), -1), np.stack(reference.path.to_world(s, low), -1)


def extent(runs: Mapping[str, pd.DataFrame], reference: Reference | None, margin: float) -> tuple[Array, Array]:
    """Lower left and upper right corner [2] [m] of what is drawn."""
    drawn = [run[["x", "y"]].to_numpy(dtype=float) for run in runs.values()]
    if reference is not None:
        drawn += _lane_edges(reference)[1:]
    points = np.concatenate(drawn)
    return np.nanmin(points, axis=0) - margin, np.nanmax(points, axis=0) + margin


def draw_reference(axes: Axes, reference: Reference) -> None:
    """The lane as a light strip with its edges, and the path, dashed."""
    s, left, right = _lane_edges(reference)
    # A strip of quads: a single outline would leave a hole where the lane crosses itself.
    quads = np.stack([left[:-1], left[1:], right[1:], right[:-1]], axis=1)
    axes.add_collection(PolyCollection(list(quads), facecolors=LANE, edgecolors=LANE, linewidths=0.5, zorder=1))
    for bound in (left, right):
        axes.plot(bound[:, 0], bound[:, 1], color="#B8B8B4", linewidth=0.8, zorder=2)
    x, y, _ = reference.path.pose(s)
    axes.plot(x, y, color=REFERENCE, linewidth=0.9, linestyle=(0, (4, 3)), zorder=3)


def _mappable(runs: Mapping[str, pd.DataFrame]) -> ScalarMappable | None:
    if len(runs) > 1:
        return None
    size = max(*(float(run["beta"].abs().max()) * DEGREES for run in runs.values()), 1.0)
    return ScalarMappable(Normalize(-size, size), SIDES)


def _draw_path(axes: Axes, run: pd.DataFrame, mappable: ScalarMappable | None, plain: str) -> None:
    points = run[["x", "y"]].to_numpy(dtype=float)
    if mappable is None:
        axes.plot(points[:, 0], points[:, 1], color=plain, linewidth=1.6, zorder=4)
        return
    segments = np.stack([points[:-1], points[1:]], axis=1)
    lines = LineCollection(list(segments), cmap=mappable.cmap, norm=mappable.norm, linewidths=2.2, zorder=4)
    lines.set_array(run["beta"].to_numpy()[:-1] * DEGREES)
    lines.set_capstyle("round")
    axes.add_collection(lines)


def draw_cars(axes: Axes, run: pd.DataFrame, shape: CarShape, every: float, colour: str) -> None:
    """The car's outline along a run, `every` so many seconds (see `overhead`)."""
    t = run["t"].to_numpy(dtype=float)
    rows = np.unique(np.searchsorted(t, np.arange(t[0], t[-1] + 1e-9, every)))
    centres: list[tuple[float, float]] = []
    bodies, cabins, wheels = [], [], []
    for row in rows[rows < len(t)]:
        x, y, psi, delta = (float(run[name].iloc[row]) for name in ("x", "y", "psi", "delta"))
        if any(np.hypot(x - other_x, y - other_y) < CLEARANCE * shape.length for other_x, other_y in centres):
            continue
        centres.append((x, y))
        bodies.append(placed(shape.body(), x, y, psi))
        cabins.append(placed(shape.cabin(), x, y, psi))
        wheels += [placed(wheel, x, y, psi) for wheel in shape.wheels(delta)]
    axes.add_collection(PolyCollection(wheels, facecolors=INK, edgecolors="none", zorder=5.2))
    axes.add_collection(
        PolyCollection(bodies, facecolors=(1.0, 1.0, 1.0, 0.75), edgecolors=colour, linewidths=0.7, zorder=5.1)
    )
    axes.add_collection(PolyCollection(cabins, facecolors=colour, edgecolors="none", alpha=0.35, zorder=5.15))


def _legend(axes: Axes, runs: Mapping[str, pd.DataFrame], reference: Reference | None, abreast: int) -> None:
    handles = []
    if len(runs) > 1:
        handles += [
            Line2D([], [], color=paint, linewidth=1.6, label=name)
            for name, paint in zip(runs, colours_of(runs), strict=True)
        ]
    if reference is not None:
        handles.append(Line2D([], [], color=REFERENCE, linewidth=0.9, linestyle=(0, (4, 3)), label="reference"))
        handles.append(Line2D([], [], color="#B8B8B4", linewidth=0.8, label="lane"))
    if handles:
        columns = min(len(handles), abreast)
        axes.legend(handles=handles, loc="lower right", ncols=columns, bbox_to_anchor=(1.0, 1.0))
