"""The solver's work over a run: times, iterations, and the plans that were late, failed or left unsolved."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from drift_drake.pictures.style import BOUND, INK, RUNS, check_columns, legend_above, new_figure, styled

COLUMNS = ("t", "seconds", "iterations", "qp_iterations", "qp_fallbacks", "qp_unsolved", "failed")


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
    check_columns(statistics, COLUMNS, "solver statistics")
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
