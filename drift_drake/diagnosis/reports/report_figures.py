"""Charts of a report of the filter's diagnosis."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from drift_drake.diagnosis.likelihood.diagnose import Diagnosis
from drift_drake.diagnosis.likelihood.isolability import Isolability
from drift_drake.estimation.commands import without_actuators
from drift_drake.estimation.everyday import with_more_process_noise
from drift_drake.estimation.filter_state import CHANNELS, MEASURED, SIZE
from drift_drake.estimation.fit import Fit, no_effects
from drift_drake.estimation.horizons import HORIZONS, JUDGED, STATES, roll_out, start_rows
from drift_drake.estimation.problem import Problem, car, filter_case, observe, run_commands
from drift_drake.estimation.reduction import errors_of
from drift_drake.pages.charts import LOW, NORMAL, Line, Panel, beside, heat_map, stacked

UNITS = {"r": "rad/s", "v": "m/s", "beta": "rad", "omega_r": "m/s"}
LONGEST_CORRELATION = 40  # rows
CELLS = 8  # of a map, along either axis
ASTRAY = 1.5  # times the measured range beyond which a prediction is left out of the picture

Cars = dict[str, Fit]  # the fits that are drawn, by the name of their car


def cars_of(d: Diagnosis) -> Cars:
    """The nominal car, and the corrected one where a cause is named."""
    nominal = {"nominal": no_effects(d.problem)}
    return nominal | {"corrected": d.fit} if d.answer.verdict == "effect" else nominal


def half_second_ahead(problem: Problem, fit: Fit, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows [starts] and measurements [starts, 4] that a car predicts half a second ahead, from its filter's states."""
    rough = with_more_process_noise(problem)
    run = rough.runs[index]
    constants, effects = car(rough, fit.theta, fit.names)
    states = np.empty((len(run.y), SIZE))
    observe(rough, filter_case(rough, fit.theta, fit.names), fit.theta, fit.names, index, states=states)
    delta, torque = run_commands(rough, index, fit.theta, effects)
    ahead = round(HORIZONS[JUDGED] / run.period)
    starts = start_rows(run)
    starts = starts[starts + ahead < len(run.y)]
    out = np.empty((len(starts), 1, MEASURED))
    dynamic = without_actuators(effects)
    roll_out(states, starts, np.array([ahead]), delta, torque, run.period, constants, dynamic, out)
    return starts + ahead, out[:, 0, : len(STATES)]


def worst_runs(d: Diagnosis, count: int = 2) -> list[int]:
    """Indices of the runs with the largest gap."""
    runs = d.problem.runs
    return sorted(range(len(runs)), key=lambda i: -d.answer.where["runs"].get(runs[i].name, 0.0))[:count]


def overlay(d: Diagnosis, index: int, cars: Cars) -> Markup:
    """One run as measured and as predicted half a second ahead, and below each state what is left over."""
    run = d.problem.runs[index]
    t = np.arange(len(run.y)) * run.period
    predicted = {name: half_second_ahead(d.problem, fit, index) for name, fit in cars.items()}
    onset = d.answer.where["onset"].get(run.name)
    panels = []
    for i, state in enumerate(STATES):
        measured = [Line("measured", t, run.y[:, i])] if run.used[i] else []
        lines = [Line(name, rows * run.period, values[:, i]) for name, (rows, values) in predicted.items()]
        reach = reach_of(run.y[:, i], [line.y for line in lines]) if run.used[i] else None
        panels.append(Panel(f"{state} [{UNITS[state]}]", [*measured, *lines], reach=reach))
        if run.used[i]:
            left = [Line(name, rows * run.period, run.y[rows, i] - values[:, i])
                    for name, (rows, values) in predicted.items()]  # fmt: skip
            panels.append(Panel(f"measured less predicted [{UNITS[state]}]", left, LOW))
    return stacked(panels, {} if onset is None else {"gap sets in": onset})


def reach_of(measured: np.ndarray, predicted: Sequence[np.ndarray]) -> tuple[float, float]:
    """Of an axis that shows all predictions, but for those that go far astray."""
    low, high = float(np.min(measured)), float(np.max(measured))
    span, all_of = high - low, np.concatenate(predicted)
    ends = max(float(np.nanmin(all_of)), low - ASTRAY * span), min(float(np.nanmax(all_of)), high + ASTRAY * span)
    low, high = min(low, ends[0]), max(high, ends[1])
    return low - 0.05 * (high - low), high + 0.05 * (high - low)


def squares(problem: Problem, fit: Fit) -> list[np.ndarray]:
    """Mean square half-second errors [starts] of each run, in noise variances; NaN where the run ends sooner."""
    errors = errors_of(problem, fit.theta, fit.names)
    return [
        np.mean(e[:, JUDGED][:, run.used[: len(STATES)]], axis=-1) for run, e in zip(problem.runs, errors, strict=True)
    ]


def time_line(d: Diagnosis, errors: dict[str, list[np.ndarray]]) -> Markup:
    """Half-second errors over time, run by run."""
    panels = []
    for i, run in enumerate(d.problem.runs):
        lines = [Line(name, start_rows(run) * run.period, np.sqrt(by_run[i])) for name, by_run in errors.items()]
        panels.append(Panel(f"{run.name}: error at 0.5 s [noise levels]", lines, 90, log=True))
    return stacked(panels)


def heat_maps(d: Diagnosis, errors: dict[str, list[np.ndarray]]) -> list[Markup]:
    """Half-second errors over (speed, lateral acceleration) and (sideslip, rear slip), with sample counts."""
    places = []
    for run in d.problem.runs:
        y = run.y[start_rows(run)]
        slip = (y[:, 3] - y[:, 1] * np.cos(y[:, 2])) / np.maximum(y[:, 3], 0.5)
        places.append(np.column_stack([y[:, 1], y[:, 1] * y[:, 0], y[:, 2], slip]))
    place = np.concatenate(places)
    top = float(np.sqrt(np.nanquantile(np.concatenate(errors["nominal"]), 0.98)))
    axes_of = [(0, 1, "speed [m/s]", "v r [m/s²]"), (2, 3, "sideslip [rad]", "rear slip")]
    maps = []
    for a, b, x_name, y_name in axes_of:
        edges = [np.linspace(place[:, k].min(), place[:, k].max() + 1e-9, CELLS + 1) for k in (a, b)]
        count, _, _ = np.histogram2d(place[:, a], place[:, b], bins=edges)
        texts = [[f"{n:.0f}" if n else "" for n in column] for column in count]
        for name, parts in errors.items():
            value = np.nan_to_num(np.concatenate(parts))
            total, _, _ = np.histogram2d(place[:, a], place[:, b], bins=edges, weights=value)
            mean = np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))
            labels = (f"{name} car", x_name, y_name, "error [noise levels]")
            maps.append(heat_map(edges[0].round(4), edges[1].round(4), mean, texts, labels, top))
    return maps


def correlations(d: Diagnosis, cars: Cars) -> Markup:
    """Auto-correlation of the innovations and their cross-correlation with steering."""
    problem = d.problem
    lags = np.arange(LONGEST_CORRELATION) * problem.runs[0].period
    innovations = {name: filter_case(problem, fit.theta, fit.names).innovations for name, fit in cars.items()}
    panels = []
    for channel in (0, 2, 5):
        auto, cross = [], []
        for name, parts in innovations.items():
            of_runs = []
            for run, e in zip(problem.runs, parts, strict=True):
                signal, steering = e[run.counted, channel], run.delta[run.counted]
                of_runs.append([correlation(signal, other) for other in (signal, steering - np.mean(steering))])
            mean = np.mean(of_runs, axis=0)
            auto.append(Line(name, lags[1:], mean[0, 1:]))
            cross.append(Line(name, lags, mean[1]))
        panels += [Panel(f"{CHANNELS[channel]} with itself", auto, 130),
                   Panel(f"{CHANNELS[channel]} with steering", cross, 130)]  # fmt: skip
    return beside(panels, "lag [s]")


def correlation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of one signal with the other [lags], the first later."""
    size = max(float(np.sqrt(np.mean(a**2) * np.mean(b**2))), 1e-12)
    return np.array([np.mean(a[lag:] * b[: len(b) - lag]) / size for lag in range(LONGEST_CORRELATION)])


def error_by_horizon(d: Diagnosis) -> Markup:
    """Root mean square error against the horizon: nominal, corrected on runs not fitted, floor."""
    r, horizons = d.reduction, np.array(HORIZONS)
    lines = [
        Line(label, horizons, np.sqrt(values), colour, dots=True)
        for values, colour, label in ((r.before, "", "nominal"), (r.after, "", "corrected"),
                                      (r.floor, NORMAL, "best fit to everything"))
    ]  # fmt: skip
    return beside([Panel("error [noise levels]", lines, 200, log=True)], "horizon [s]", columns=1, log_x=True)


def isolability_matrix(found: Isolability) -> Markup:
    """How alike the effects' signatures are in these logs."""
    texts = [["" if q < 0.9 else f"{100 * q:.0f}" for q in row] for row in found.likeness]
    labels = ("", "", "", "likeness")
    return heat_map(list(found.names), list(found.names), found.likeness, texts, labels, 1.0, 560)


def uncertainty(cells: dict[str, Any]) -> Markup:
    """The learnt model's predictive deviation over speed and sideslip, with sample counts."""
    texts: Sequence[Sequence[str]] = [[f"{n}" if n else "" for n in column] for column in cells["count"]]
    labels = ("", "speed [m/s]", "sideslip [rad]", "deviation [noise levels]")
    return heat_map(cells["speed"], cells["sideslip"], np.array(cells["deviation"], dtype=float), texts, labels)
