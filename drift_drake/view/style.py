"""The look that all pictures share: quiet, readable in print and by the colour-blind, units on every axis."""

import itertools
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from drift_drake.common.safe_files import write_figure
from drift_drake.view.colours import CARS, INK, RUNS

Arguments = ParamSpec("Arguments")

RESOLUTION = 200  # [dots per inch] of pixel pictures
DEGREES = 57.29577951308232  # [deg / rad]
KMH = 3.6  # [(km/h) / (m/s)]

BOUND = "#A03020"
LANE = "#ECECEA"
TRANSITION = "#E3E3E0"

SIDES = LinearSegmentedColormap.from_list("sides", ["#C44E00", "#E69F00", "#4D4D4D", "#56B4E9", "#005A8E"])
"""From right to left (sideslip): dark in the middle, so that it shows on a light lane."""
RC: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],  # comes with matplotlib: the same picture on every machine
    "font.size": 8.0,
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8.0,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#888888",
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.fonttype": "path",
    "svg.hashsalt": "drift_drake",  # the same picture gives the same file
}


def colours_of(names: Iterable[str]) -> list[str]:
    """A colour for each run: its car's, and for others the next one that none of these cars has."""
    names = list(names)
    taken = {CARS[name] for name in names if name in CARS}
    free = itertools.cycle([colour for colour in RUNS if colour not in taken])
    return [CARS[name] if name in CARS else next(free) for name in names]


def styled(draw: Callable[Arguments, Figure]) -> Callable[Arguments, Figure]:
    """Decorates a function that makes a figure: the look holds within it, matplotlib's own settings stay alone."""

    @wraps(draw)
    def wrapped(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Figure:
        with matplotlib.rc_context(RC):
            figure = draw(*args, **kwargs)
            # Ticks are made when they are first needed, with the settings of that moment; later ones are as the first.
            for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
                axis.get_major_ticks(1)
                axis.get_minor_ticks(1)
        return figure

    return wrapped


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of the given size [in], laid out without overlaps, with no display behind it."""
    return Figure(figsize=(width, height), dpi=RESOLUTION, layout="constrained")


def save(figure: Figure, path: str | Path) -> Path:
    """Writes a figure, in the format that the path's ending names; makes the folder."""
    path = Path(path)
    metadata = {"Date": None} if path.suffix == ".svg" else None
    with matplotlib.rc_context(RC):
        write_figure(figure, path, metadata=metadata)
    return path


def legend_above(axes: Axes, columns: int) -> None:
    """A legend in rows of that many columns above the axes, out of the way of the data."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.2, handlelength=1.6)


def check_runs(runs: Mapping[str, Any], columns: Iterable[str]) -> None:
    """Raises a ValueError where there is no run, or that names a run and what it lacks."""
    if not runs:
        raise ValueError("no runs to draw; give at least one")
    for name, run in runs.items():
        check_columns(run, columns, name)


def check_columns(run: Any, columns: Iterable[str], name: str) -> None:
    """Raises a ValueError that names the run and what it lacks."""
    missing = [column for column in columns if column not in run.columns]
    if missing:
        raise ValueError(f"run '{name}' lacks the column(s) {', '.join(missing)}; this picture needs them")
    if len(run) == 0:
        raise ValueError(f"run '{name}' is empty; a picture needs at least one row")
