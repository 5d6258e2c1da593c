"""Signals of runs against the reference, inputs with their bounds, and tracking errors."""

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from drift_drake.pictures.style import (
    BOUND,
    DEGREES,
    INK,
    KMH,
    REFERENCE,
    TRANSITION,
    check_runs,
    colours_of,
    legend_above,
    new_figure,
    styled,
)
from drift_drake.reference.trajectory import Reference
from drift_drake.vehicle.parameters import VehicleParameters

Array = NDArray[np.float64]

# Above the runs, or a car that does what is wanted would hide it.
REFERENCE_LINE: dict[str, Any] = {"color": INK, "linewidth": 0.8, "linestyle": (0, (4, 3)), "zorder": 3.0}
MIN_SPEED_SPAN = 10.0  # [km/h] that the axis of a speed shows at least
LEGEND_COLUMNS = 3  # as many as fit over one column of axes
MIN_LATERAL_SPAN = 0.5  # [m] that the axis of the lateral error shows at least, to either side

COLUMNS = ("t", "s", "r", "v", "beta", "omega_r", "e", "delta", "tau")


@styled
def time_series(
    runs: Mapping[str, pd.DataFrame],
    reference: Reference,
    parameters: VehicleParameters,
    against: Literal["t", "s"] | None = None,
    title: str = "",
) -> Figure:
    """Draws states against the reference, inputs with their bounds, and tracking errors; transitions in grey.

    Args:
        runs: tables with t, s, r, v, beta, omega_r, e, delta, tau (SI) by name.
        reference: looked up at each run's path position.
        parameters: for the inputs' limits.
        against: time, or path position, which lines several runs up; by default time for one run, else position.
        title: of the picture.

    Raises:
        ValueError: there is no run; a run lacks a column or has no row.
    """
    check_runs(runs, COLUMNS)
    against = against or ("t" if len(runs) == 1 else "s")
    figure = new_figure(7.5, 7.6)
    grid = figure.subplots(4, 2, sharex=True)
    _draw_transitions(grid.ravel(), runs, reference, against)
    faults = _draw_faults(grid.ravel(), runs, against)
    _draw_states(grid[:, 0], runs, reference, against)
    _draw_inputs(grid[:2, 1], runs, reference, parameters, against)
    _draw_tracking(grid[2:, 1], runs, reference, against)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]" if against == "t" else "path position s [m]")
    for axes in grid.ravel():
        axes.margins(x=0.0)
    legend_above(grid[0, 0], min(len(runs) + 1, LEGEND_COLUMNS))
    _legend_of_bounds(grid[0, 1], faults)
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=9.0, fontweight="bold")
    return figure


def sideslip_error(run: pd.DataFrame, reference: Reference) -> Array:
    """beta - beta_ref(s) [rad] of each row."""
    return run["beta"].to_numpy(dtype=float) - reference.state(run["s"].to_numpy(dtype=float))[:, 2]


def _longest(runs: Mapping[str, pd.DataFrame], against: str) -> pd.DataFrame:
    return max(runs.values(), key=lambda run: float(run[against].iloc[-1]))


def _draw_states(
    column: NDArray[np.object_], runs: Mapping[str, pd.DataFrame], reference: Reference, against: str
) -> None:
    lines = (
        (column[0], "sideslip [deg]", 2, "beta", DEGREES),
        (column[1], "yaw rate [deg/s]", 0, "r", DEGREES),
        (column[2], "speed [km/h]", 1, "v", KMH),
        (column[3], "rear rim speed [km/h]", 3, "omega_r", KMH),
    )
    longest = _longest(runs, against)
    for axes, label, index, _, unit in lines:
        wanted = reference.state(longest["s"].to_numpy(dtype=float))[:, index] * unit
        axes.plot(longest[against], wanted, **REFERENCE_LINE, label="reference")
        axes.set_ylabel(label)
    for axes, _, _, name, unit in lines:
        _draw(axes, runs, against, _column(name, unit))
    for axes in column[2:]:
        _widen(axes, MIN_SPEED_SPAN)


def _draw_inputs(
    column: NDArray[np.object_], runs: Mapping[str, pd.DataFrame], reference: Reference,
    parameters: VehicleParameters, against: str,
) -> None:  # fmt: skip
    lock = parameters.steering_limit * DEGREES
    lines = (
        (column[0], "steering angle [deg]", "delta", DEGREES, (-lock, lock)),
        (column[1], "engine torque [N m]", "tau", 1.0, (parameters.torque_min, parameters.torque_max)),
    )
    longest = _longest(runs, against)
    inputs = reference.input(longest["s"].to_numpy(dtype=float))
    for index, (axes, label, name, unit, bounds) in enumerate(lines):
        _bounds(axes, *bounds)
        _draw(axes, runs, against, _column(name, unit))
        axes.plot(longest[against], inputs[:, index] * unit, **REFERENCE_LINE)
        axes.set_ylabel(label)


def _draw_tracking(
    column: NDArray[np.object_], runs: Mapping[str, pd.DataFrame], reference: Reference, against: str
) -> None:
    lateral, sideslip = column
    _draw(lateral, runs, against, _column("e", 1.0))
    _draw(sideslip, runs, against, lambda run: sideslip_error(run, reference) * DEGREES)
    _draw_lane(lateral, runs, _longest(runs, against), reference, against)
    lateral.set_ylabel("lateral error e [m]")
    sideslip.set_ylabel("sideslip error [deg]")
    for axes in column:
        axes.axhline(0.0, color=REFERENCE, linewidth=0.8)


def _legend_of_bounds(axes: Axes, faults: list[str]) -> None:
    """Bounds, transitions and what was wrong in the loop, above these axes."""
    axes.plot([], [], color=BOUND, linewidth=0.8, label="bound")
    axes.fill_between([], [], color=TRANSITION, label="transition")
    handles, labels = axes.get_legend_handles_labels()
    named = ("bound", "transition", *faults)
    shown = [(h, lab) for h, lab in zip(handles, labels, strict=True) if lab in named]
    axes.legend(*zip(*shown, strict=True), loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)


def _column(name: str, unit: float) -> Callable[[pd.DataFrame], Array]:
    return lambda run: run[name].to_numpy(dtype=float) * unit


def _draw(
    axes: Axes, runs: Mapping[str, pd.DataFrame], against: str, quantity: Callable[[pd.DataFrame], Array]
) -> None:
    for (name, run), colour in zip(runs.items(), colours_of(runs), strict=True):
        axes.plot(run[against], quantity(run), color=colour, linewidth=1.1, label=name, zorder=2.5)


def _widen(axes: Axes, span: float) -> None:
    """Shows at least `span`, so that noise does not look like a swing."""
    low, high = axes.get_ylim()
    missing = max(0.0, span - (high - low))
    axes.set_ylim(low - 0.5 * missing, high + 0.5 * missing)


def _draw_lane(axes: Axes, runs: Mapping[str, pd.DataFrame], longest: pd.DataFrame, reference: Reference,
               against: str) -> None:  # fmt: skip
    """The lane's bounds if the runs come near them; else a note, and a scale that shows the error."""
    low, high = reference.lane(longest["s"].to_numpy(dtype=float))
    size = max(MIN_LATERAL_SPAN, *(1.15 * float(run["e"].abs().max()) for run in runs.values()))
    if min(float(high.min()), float(-low.max())) > 2.0 * size:
        axes.set_ylim(-size, size)
        note = f"lane: {low.max():.3g} to {high.min():.3g} m"
        axes.annotate(note, (1.0, 1.0), (-3, -3), "axes fraction", "offset points", ha="right", va="top", color=BOUND)
        return
    for bound in (low, high):
        axes.plot(longest[against], bound, color=BOUND, linewidth=0.8)


def _bounds(axes: Axes, low: float, high: float) -> None:
    for bound in (low, high):
        axes.axhline(bound, color=BOUND, linewidth=0.8)


def _draw_transitions(grid: NDArray[np.object_], runs: Mapping[str, pd.DataFrame], reference: Reference,
                      against: str) -> None:  # fmt: skip
    """Grey bands where the reference is in a transition; over time, those of the first run."""
    longest = max(runs.values(), key=lambda run: float(run["s"].iloc[-1]))
    run = next(iter(runs.values())) if against == "t" else longest
    inside = np.concatenate([[False], reference.transition(run["s"].to_numpy(dtype=float)), [False]])
    position = run[against].to_numpy(dtype=float)
    edges = np.flatnonzero(inside[1:] != inside[:-1])
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        for axes in grid:
            axes.axvspan(position[begin], position[min(end, len(position) - 1)], color=TRANSITION, linewidth=0.0,
                         zorder=0.5)  # fmt: skip


def _draw_faults(grid: NDArray[np.object_], runs: Mapping[str, pd.DataFrame], against: str) -> list[str]:
    """Where one run's readings were screened out, and where the car was being stopped; the legend's words for them."""
    run = next(iter(runs.values()))
    if len(runs) > 1:
        return []
    drawn = []
    position = run[against].to_numpy(dtype=float)
    if "stopping" in run and (run["stopping"] > 0.0).any():
        for axes in grid:
            axes.axvspan(position[run["stopping"] > 0.0][0], position[-1], color=BOUND, alpha=0.12, linewidth=0.0)
        grid[1].fill_between([], [], color=BOUND, alpha=0.12, label="being stopped")
        drawn.append("being stopped")
    if "reading" in run and (run["reading"] > 0.0).any():
        refused = position[run["reading"] > 0.0]
        for axes in grid:
            axes.plot(refused, np.full(len(refused), 0.02), "|", color=BOUND, markersize=4.0,
                      transform=axes.get_xaxis_transform())  # fmt: skip
        grid[1].plot([], [], "|", color=BOUND, label="reading screened out")
        drawn.append("reading screened out")
    return drawn
