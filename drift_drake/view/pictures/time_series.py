"""Signals of runs against the reference, inputs with their bounds, and tracking errors."""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.view.colours import INK, REFERENCE, RUNS
from drift_drake.view.style import (
    BOUND,
    DEGREES,
    KMH,
    TRANSITION,
    check_columns,
    check_runs,
    colours_of,
    legend_above,
    new_figure,
    styled,
)

# Above the runs, or a car that does what is wanted would hide it.
REFERENCE_LINE: dict[str, Any] = {"color": INK, "linewidth": 0.8, "linestyle": (0, (4, 3)), "zorder": 3.0}
MIN_SPEED_SPAN = 10.0  # [km/h] that the axis of a speed shows at least
LEGEND_COLUMNS = 3  # as many as fit over one column of axes
MIN_LATERAL_SPAN = 0.5  # [m] that the axis of the lateral error shows at least, to either side

PANELS = (  # row and column, label, quantity and the factor to the label's unit
    ((0, 0), "sideslip [deg]", "beta", DEGREES),
    ((1, 0), "yaw rate [deg/s]", "r", DEGREES),
    ((2, 0), "speed [km/h]", "v", KMH),
    ((3, 0), "rear rim speed [km/h]", "omega_r", KMH),
    ((0, 1), "steering angle [deg]", "delta", DEGREES),
    ((1, 1), "engine torque [N m]", "tau", 1.0),
    ((2, 1), "lateral error e [m]", "e", 1.0),
    ((3, 1), "sideslip error [deg]", "sideslip_error", DEGREES),
)
COLUMNS = ("t", "s", "r", "v", "beta", "omega_r", "e", "delta", "tau")
SOLVER_COLUMNS = ("t", "seconds", "iterations", "qp_iterations", "qp_fallbacks", "qp_unsolved", "failed")


@styled
def time_series(
    runs: Mapping[str, pd.DataFrame],
    reference: Reference,
    parameters: VehicleParameters,
    against: Literal["t", "s"] | None = None,
) -> Figure:
    """Draws states against the reference, inputs with their bounds, and tracking errors; transitions in grey.

    Args:
        runs: tables with t, s, r, v, beta, omega_r, e, delta, tau (SI) by name.
        reference: looked up at each run's path position.
        parameters: for the inputs' limits.
        against: time, or path position, which lines several runs up; by default time for one run, else position.

    Raises:
        ValueError: there is no run; a run lacks a column or has no row.
    """
    check_runs(runs, COLUMNS)
    against = against or ("t" if len(runs) == 1 else "s")
    figure = new_figure(7.5, 7.6)
    grid = figure.subplots(4, 2, sharex=True)
    drawn = _draw_transitions(grid.ravel(), runs, reference, against)
    drawn += _draw_faults(grid.ravel(), runs, against)
    longest = max(runs.values(), key=lambda run: float(run[against].iloc[-1]))
    lock = parameters.steering_limit * DEGREES
    _bounds(grid[0, 1], -lock, lock)
    _bounds(grid[1, 1], parameters.torque_min, parameters.torque_max)
    errors = {name: run.assign(sideslip_error=sideslip_error(run, reference)) for name, run in runs.items()}
    for (place, label, column, unit), wanted in zip(PANELS, _wanted(longest, reference), strict=True):
        if wanted is not None:
            grid[place].plot(longest[against], wanted * unit, **REFERENCE_LINE, label="reference")
        for (name, run), colour in zip(errors.items(), colours_of(runs), strict=True):
            grid[place].plot(run[against], run[column] * unit, color=colour, linewidth=1.1, label=name, zorder=2.5)
        grid[place].set_ylabel(label)
        grid[place].margins(x=0.0)
    for axes in grid[2:, 0]:
        _widen(axes, MIN_SPEED_SPAN)
    _draw_lane(grid[2, 1], runs, longest, reference, against)
    for axes in grid[2:, 1]:
        axes.axhline(0.0, color=REFERENCE, linewidth=0.8)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]" if against == "t" else "path position s [m]")
    legend_above(grid[0, 0], min(len(runs) + 1, LEGEND_COLUMNS))
    _legend_of_bounds(grid[0, 1], drawn)
    return figure


def _wanted(run: pd.DataFrame, reference: Reference) -> list[Array | None]:
    """What the reference says of the quantity of each of `PANELS` along a run; errors have none."""
    s = run["s"].to_numpy(dtype=float)
    states, inputs = reference.state(s), reference.input(s)
    return [states[:, 2], states[:, 0], states[:, 1], states[:, 3], inputs[:, 0], inputs[:, 1], None, None]


def sideslip_error(run: pd.DataFrame, reference: Reference) -> Array:
    """beta - beta_ref(s) [rad] of each row."""
    return run["beta"].to_numpy(dtype=float) - reference.state(run["s"].to_numpy(dtype=float))[:, 2]


def _legend_of_bounds(axes: Axes, drawn: list[str]) -> None:
    """Bounds, transitions and what was wrong in the loop, above these axes."""
    axes.plot([], [], color=BOUND, linewidth=0.8, label="bound")
    axes.fill_between([], [], color=TRANSITION, label="transition")
    handles, labels = axes.get_legend_handles_labels()
    named = ("bound", *drawn)
    shown = [(h, lab) for h, lab in zip(handles, labels, strict=True) if lab in named]
    axes.legend(*zip(*shown, strict=True), loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)


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
                      against: str) -> list[str]:  # fmt: skip
    """Grey bands where the reference is in a transition; over time, the first run's. The legend's word for them."""
    longest = max(runs.values(), key=lambda run: float(run["s"].iloc[-1]))
    run = next(iter(runs.values())) if against == "t" else longest
    inside = np.concatenate([[False], reference.transition(run["s"].to_numpy(dtype=float)), [False]])
    position = run[against].to_numpy(dtype=float)
    edges = np.flatnonzero(inside[1:] != inside[:-1])
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        for axes in grid:
            axes.axvspan(position[begin], position[min(end, len(position) - 1)], color=TRANSITION, linewidth=0.0,
                         zorder=0.5)  # fmt: skip
    return ["transition"] if len(edges) else []


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


@styled
def solver_work(statistics: pd.DataFrame, period: float) -> Figure:
    """Draws the solver's time and iterations over a run, and how solve times are spread; counts are in the legends.

    Args:
        statistics: a table with t [s], seconds, iterations (of the SQP), qp_iterations, qp_fallbacks and
            qp_unsolved (QPs that took a second attempt, that none solved) and failed (0 or 1), a row
            each solve; rows of no seconds (before the first solve) are left out.
        period: [s] between solves: the time that a solve must stay below; longer ones are late.

    Raises:
        ValueError: the table lacks a column or has no row.
    """
    check_columns(statistics, SOLVER_COLUMNS, "solver statistics")
    statistics = statistics[statistics["seconds"] > 0.0]
    check_columns(statistics, (), "solver statistics")
    t, milliseconds = statistics["t"].to_numpy(dtype=float), 1e3 * statistics["seconds"].to_numpy(dtype=float)
    figure = new_figure(7.5, 3.6)
    grid = figure.add_gridspec(2, 2, width_ratios=(2.4, 1.0))
    time = figure.add_subplot(grid[0, 0])
    iterations = figure.add_subplot(grid[1, 0], sharex=time)
    _draw_iterations(iterations, statistics)
    spread = figure.add_subplot(grid[:, 1])
    time.plot(t, milliseconds, ".", markersize=1.8, color=RUNS[0], label="solve", rasterized=True)
    time.axhline(1e3 * period, color=BOUND, linewidth=0.8, label="period")
    late, failed = milliseconds > 1e3 * period, statistics["failed"].to_numpy(dtype=float) > 0.0
    if late.any():
        time.plot(t[late], milliseconds[late], "o", color=BOUND, markersize=2.5, label=f"late ({late.sum()})")
    if failed.any():
        time.plot(t[failed], milliseconds[failed], "x", color=BOUND, markersize=4.0, label=f"failed ({failed.sum()})")
    time.set(ylabel="solve time [ms]", yscale="log")
    time.xaxis.set_tick_params(labelbottom=False)
    legend_above(time, 4)
    ordered = np.sort(milliseconds)
    spread.plot(100.0 * np.arange(1, len(ordered) + 1) / len(ordered), ordered, color=RUNS[0])
    spread.axhline(1e3 * period, color=BOUND, linewidth=0.8)
    for share, below in ((50.0, 5.0), (99.0, -9.0)):
        value = float(np.percentile(milliseconds, share))
        spread.plot(share, value, "o", markersize=3.0, color=INK)
        spread.annotate(
            f"{share:.0f} %: {value:.2g} ms", (share, value), (-5.0, below), textcoords="offset points", ha="right"
        )
    spread.set(xlabel="share of solves [%]", ylabel="solve time below [ms]", yscale="log", xlim=(0.0, 104.0))
    for axes in (time, spread):
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    return figure


def _draw_iterations(axes: Axes, statistics: pd.DataFrame) -> None:
    """Iterations of the SQP over the run; colours tell how their QPs were solved."""
    t, count, fallbacks, unsolved = (
        statistics[name].to_numpy(dtype=float) for name in ("t", "iterations", "qp_fallbacks", "qp_unsolved")
    )
    for label, chosen, color in (
        ("QPs solved", (fallbacks == 0.0) & (unsolved == 0.0), RUNS[2]),
        ("second attempt", (fallbacks > 0.0) & (unsolved == 0.0), RUNS[1]),
        ("unsolved", unsolved > 0.0, BOUND),
    ):
        if chosen.any():
            marker = "x" if label == "unsolved" else "|"
            axes.plot(t[chosen], count[chosen], marker, markersize=4.0, color=color, rasterized=True,
                      label=f"{label} ({chosen.sum()})")  # fmt: skip
    axes.set(xlabel="time [s]", ylabel="SQP iterations", ylim=(0.0, 1.1 * max(1.0, count.max())))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    legend_above(axes, 3)
