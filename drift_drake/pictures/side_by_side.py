"""Signals of a real car and of simulated ones over time, where they are told to start again every few seconds."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from drift_drake.pictures.style import DEGREES, KMH, check_runs, colours_of, legend_above, new_figure, styled

COLUMNS = ("t", "x", "y", "r", "v", "beta", "omega_r", "delta")
SMALLEST_REACH = 1.0  # of the axes: that a simulated car may leave the real one's range by, at least


@styled
def side_by_side(runs: Mapping[str, pd.DataFrame]) -> Figure:
    """Draws states, steering command and distance from the first run, which is the real car, row for row.

    Args:
        runs: tables with t, x, y, r, v, beta, omega_r, delta (SI) by name, all with the same rows; NaN breaks a line.

    Raises:
        ValueError: there is no run; a run lacks a column or has no row.
    """
    check_runs(runs, COLUMNS)
    real, colours = next(iter(runs.values())), colours_of(runs)
    figure = new_figure(7.5, 5.4)
    grid = figure.subplots(3, 2, sharex=True)
    lines = (
        ("sideslip [deg]", "beta", DEGREES),
        ("yaw rate [deg/s]", "r", DEGREES),
        ("speed [km/h]", "v", KMH),
        ("rear rim speed [km/h]", "omega_r", KMH),
    )
    for axes, (label, column, unit) in zip(grid.ravel(), lines, strict=False):
        for index, (name, run) in enumerate(runs.items()):
            # The real car is beneath, wide and pale: a car that does the same is seen on it.
            look = {"linewidth": 2.4, "alpha": 0.45} if index == 0 else {"linewidth": 1.0}
            axes.plot(run["t"], run[column] * unit, color=colours[index], label=name, **look)
        axes.set_ylabel(label)
        if real[column].notna().any():
            low, high = float(real[column].min()) * unit, float(real[column].max()) * unit
            reach = max(0.5 * (high - low), SMALLEST_REACH)
            bottom, top = axes.get_ylim()
            axes.set_ylim(max(bottom, low - reach), min(top, high + reach))
    steering, distance = grid[-1]
    steering.plot(real["t"], real["delta"] * DEGREES, color=colours[0])
    steering.set_ylabel("steering command [deg]")
    for index, run in enumerate(runs.values()):
        if index > 0:
            away = np.hypot(run["x"] - real["x"], run["y"] - real["y"])
            distance.plot(run["t"], away, color=colours[index], linewidth=1.0)
    distance.set_ylabel("distance from the real car [m]")
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    for axes in grid.ravel():
        axes.margins(x=0.0)
    legend_above(grid[0, 0], len(runs))
    return figure
