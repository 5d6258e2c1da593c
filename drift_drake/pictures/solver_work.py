"""The solver's work over a run: times and iterations."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from drift_drake.pictures.style import BOUND, INK, RUNS, check_columns, legend_above, new_figure, styled


@styled
def solver_work(statistics: pd.DataFrame, period: float, title: str = "") -> Figure:
    """Draws the solver's time and iterations over a run, and how solve times are spread.

    Args:
        statistics: a table with t [s], seconds, qp_iterations and failed (0 or 1), a row each solve; rows of no
            seconds (before the first solve) are left out.
        period: [s] between solves: the time that a solve must stay below.
        title: of the picture.

    Raises:
        ValueError: the table lacks a column or has no row.
    """
    check_columns(statistics, ("t", "seconds", "qp_iterations", "failed"), "solver statistics")
    statistics = statistics[statistics["seconds"] > 0.0]
    check_columns(statistics, (), "solver statistics")
    t, milliseconds = statistics["t"].to_numpy(dtype=float), 1e3 * statistics["seconds"].to_numpy(dtype=float)
    figure = new_figure(7.5, 3.6)
    grid = figure.add_gridspec(2, 2, width_ratios=(2.4, 1.0))
    time = figure.add_subplot(grid[0, 0])
    iterations = figure.add_subplot(grid[1, 0], sharex=time)
    spread = figure.add_subplot(grid[:, 1])
    time.plot(t, milliseconds, ".", markersize=1.8, color=RUNS[0], label="solve", rasterized=True)
    time.axhline(1e3 * period, color=BOUND, linewidth=0.8, label="period")
    failed = statistics["failed"].to_numpy(dtype=float) > 0.0
    if failed.any():
        time.plot(t[failed], milliseconds[failed], "x", color=BOUND, markersize=4.0, label="failed")
    time.set(ylabel="solve time [ms]", yscale="log")
    time.xaxis.set_tick_params(labelbottom=False)
    legend_above(time, 3)
    count = statistics["qp_iterations"].to_numpy(dtype=float)
    iterations.plot(t, count, ".", markersize=1.8, color=RUNS[2], rasterized=True)
    iterations.set(xlabel="time [s]", ylabel="QP iterations", ylim=(0.0, 1.1 * max(1.0, count.max())))
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
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=9.0, fontweight="bold")
    return figure
