"""Charts of another day's report."""

from collections.abc import Mapping

import numpy as np
from markupsafe import Markup

from drift_drake.diagnosis.another_day.gap import STATES, squares
from drift_drake.diagnosis.reports.report_figures import UNITS, reach_of
from drift_drake.estimation.normal import LOST, Normal
from drift_drake.estimation.robust_fit import MAD
from drift_drake.estimation.scores import Day
from drift_drake.estimation.windows import HORIZONS, WindowedRun
from drift_drake.pages.charts import LOW, NORMAL, Line, Panel, beside, stacked

Cars = Mapping[str, np.ndarray]  # errors [windows, HORIZONS, channels] by the name of the car


def ends(run: WindowedRun) -> np.ndarray:
    """Rows [windows] that are predicted, at the longest horizon."""
    return np.asarray(run.starts + HORIZONS * run.stride_rows)


def judged_states(day: Day) -> list[tuple[int, str]]:
    """Indices and names of the states that every run measures and the car itself predicts."""
    return [(i, state) for i, state in enumerate(STATES) if all(run.used[i] for run in day.runs)]


def overlay(day: Day, normal: Normal, index: int, cars: Cars, onset: Mapping[str, float]) -> Markup:
    """One run as measured and as predicted at the longest horizon, and below each state what is left over."""
    run = day.runs[index]
    t, at = np.arange(len(run.y)) * run.period, ends(run)
    panels = []
    for i, state in judged_states(day):
        left = {name: errors[day.run == index][:, -1, i] for name, errors in cars.items()}
        predicted = [Line(name, at * run.period, run.y[at, i] - e, dots=True) for name, e in left.items()]
        measured = Line("measured", t, run.y[:, i])
        reach = reach_of(run.y[:, i], [line.y for line in predicted])
        panels.append(Panel(f"{state} [{UNITS[state]}]", [measured, *predicted], reach=reach))
        misses = [Line(name, at * run.period, e, dots=True) for name, e in left.items()]
        title = f"measured less predicted [{UNITS[state]}]"
        panels.append(Panel(title, misses, LOW, normal=2.0 * float(normal.scales[-1, i])))
    return stacked(panels, {"gap sets in": onset[run.name]} if run.name in onset else {})


def by_horizon(day: Day, normal: Normal, cars: Cars) -> Markup:
    """Median absolute errors of each state against the horizon, beside those of the day of calibration."""
    at, panels = np.array(day.runs[0].horizons), []
    for i, state in judged_states(day):
        usual = Line("day of calibration", at, normal.scales[:, i] / MAD, NORMAL)
        lines = [Line(name, at, np.median(np.abs(e[..., i]), axis=0), dots=True) for name, e in cars.items()]
        panels.append(Panel(f"{state} [{UNITS[state]}]", [usual, *lines], 140))
    return beside(panels, "ahead [s]")


def time_line(day: Day, normal: Normal, cars: Cars, onset: Mapping[str, float]) -> Markup:
    """Errors at the longest horizon over time, run by run, in those of the day of calibration."""
    parts = {name: np.sqrt(squares(normal, errors, LOST)[:, -1].mean(axis=-1)) for name, errors in cars.items()}
    panels = []
    for k, run in enumerate(day.runs):
        t = run.starts * run.period
        lines = [Line("day of calibration", t[[0, -1]], np.ones(2), NORMAL)]
        lines += [Line(name, t, values[day.run == k]) for name, values in parts.items()]
        sets_in = f"; gap sets in at {onset[run.name]:.1f} s" if run.name in onset else ""
        panels.append(Panel(f"{run.name}: error, in normal ones{sets_in}", lines, 90, log=True))
    return stacked(panels)
