"""Figures of a report, as SVG text."""

import io
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drift_drake.diagnosis.diagnose import Diagnosis
from drift_drake.diagnosis.isolability import Isolability
from drift_drake.estimation.commands import without_actuators
from drift_drake.estimation.everyday import coarse
from drift_drake.estimation.filter_state import CHANNELS, MEASURED, SIZE
from drift_drake.estimation.fit import Fit
from drift_drake.estimation.horizons import HORIZONS, JUDGED, STATES, roll_out, start_rows
from drift_drake.estimation.problem import Problem, car, filter_case, observe, run_commands
from drift_drake.estimation.reduction import errors_of

REAL, NOMINAL, CORRECTED = "#222222", "#d1495b", "#00798c"
UNITS = {"r": "rad/s", "v": "m/s", "beta": "rad", "omega_r": "m/s"}
LONGEST_CORRELATION = 40  # rows


def svg(width: float, height: float, rows: int, columns: int, draw: Callable[[np.ndarray], None]) -> str:
    """A figure's SVG element; `draw` gets its axes [rows, columns]."""
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    draw(axes)
    for ax in axes.flat:
        ax.tick_params(labelsize=7)
        ax.spines[["top", "right"]].set_visible(False)
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None})
    text = out.getvalue()
    return text[text.index("<svg") :]


def nothing(problem: Problem) -> Fit:
    """The nominal car as a fit."""
    count = problem.nuisances
    return Fit((), np.zeros(count), 0.0, np.eye(count), 0.0, 0.0, 0)


def posterior_bars(probabilities: dict[str, float]) -> str:
    """Bars of the leading hypotheses' probabilities."""
    lead = list(probabilities.items())[:8][::-1]

    def draw(axes: np.ndarray) -> None:
        ax: Axes = axes[0, 0]
        ax.barh([name.replace("+", " +\n") for name, _ in lead], [p for _, p in lead], color=CORRECTED)
        ax.set_xlim(0.0, 1.0)
        ax.set_xlabel("probability", fontsize=8)
        for i, (_, p) in enumerate(lead):
            ax.text(min(p + 0.01, 0.92), i, f"{p:.3f}", va="center", fontsize=7)

    return svg(7.0, 0.4 + 0.34 * len(lead), 1, 1, draw)


def half_second_ahead(problem: Problem, fit: Fit, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Times [starts] and measurements [starts, 4] that a car predicts half a second ahead, from its filter's states."""
    rough = coarse(problem)
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
    return (starts + ahead) * run.period, out[:, 0, : len(STATES)]


def overlays(d: Diagnosis) -> str:
    """Real, nominal and corrected motion, predicted half a second ahead, in the two runs with the largest gap."""
    problem = d.problem
    worst = sorted(range(len(problem.runs)), key=lambda i: -d.answer.where["runs"].get(problem.runs[i].name, 0.0))[:2]

    def draw(axes: np.ndarray) -> None:
        for column, index in enumerate(worst):
            run = problem.runs[index]
            t = np.arange(len(run.y)) * run.period
            nominal, corrected = (half_second_ahead(problem, f, index) for f in (nothing(problem), d.fit))
            for i, state in enumerate(STATES):
                ax: Axes = axes[i, column]
                if run.used[i]:
                    ax.plot(t, run.y[:, i], color=REAL, lw=0.6, label="real")
                    low, high = np.min(run.y[:, i]), np.max(run.y[:, i])
                    margin = 0.5 * (high - low)
                    ax.set_ylim(low - margin, high + margin)
                ax.plot(*nominal_line(nominal, i), color=NOMINAL, lw=1.0, label="nominal")
                ax.plot(*nominal_line(corrected, i), color=CORRECTED, lw=1.0, ls="--", label="corrected")
                ax.set_ylabel(f"{state} [{UNITS[state]}]", fontsize=7)
            axes[0, column].set_title(run.name, fontsize=8, parse_math=False)
            axes[-1, column].set_xlabel("t [s]", fontsize=7)
        axes[0, 0].legend(fontsize=6, ncols=3)

    return svg(9.0, 6.0, len(STATES), len(worst), draw)


def nominal_line(predicted: tuple[np.ndarray, np.ndarray], i: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and one state of a prediction."""
    return predicted[0], predicted[1][:, i]


def squares(problem: Problem, fit: Fit) -> list[np.ndarray]:
    """Mean square half-second errors [starts] of each run, in noise variances; NaN where the run ends sooner."""
    errors = errors_of(problem, fit.theta, fit.names)
    return [
        np.mean(e[:, JUDGED][:, run.used[: len(STATES)]], axis=-1) for run, e in zip(problem.runs, errors, strict=True)
    ]


def time_line(d: Diagnosis, before: Sequence[np.ndarray], after: Sequence[np.ndarray]) -> str:
    """Half-second errors over time, nominal and corrected, with the onset of the gap."""
    problem = d.problem

    def draw(axes: np.ndarray) -> None:
        for i, run in enumerate(problem.runs):
            ax: Axes = axes[0, i]
            t = start_rows(run) * run.period
            ax.semilogy(t, np.sqrt(before[i]), color=NOMINAL, lw=0.9, label="nominal")
            ax.semilogy(t, np.sqrt(after[i]), color=CORRECTED, lw=0.9, label="corrected")
            onset = d.answer.where["onset"].get(run.name)
            if onset is not None:
                ax.axvline(onset, color="grey", ls=":", lw=1.0)
                ax.text(onset, ax.get_ylim()[1], " onset", fontsize=6, va="top")
            ax.set_title(run.name, fontsize=8, parse_math=False)
            ax.set_xlabel("t [s]", fontsize=7)
        axes[0, 0].set_ylabel("error at 0.5 s [noise levels]", fontsize=7)
        axes[0, 0].legend(fontsize=6)

    return svg(9.0, 2.2, 1, len(problem.runs), draw)


def heat_maps(d: Diagnosis, before: Sequence[np.ndarray], after: Sequence[np.ndarray]) -> str:
    """Half-second errors over (speed, lateral acceleration) and (sideslip, rear slip), with sample counts."""
    problem = d.problem
    places = []
    for run in problem.runs:
        rows = start_rows(run)
        y = run.y[rows]
        slip = (y[:, 3] - y[:, 1] * np.cos(y[:, 2])) / np.maximum(y[:, 3], 0.5)
        places.append(np.column_stack([y[:, 1], y[:, 1] * y[:, 0], y[:, 2], slip]))
    place = np.concatenate(places)
    axes_of = [(0, 1, "speed [m/s]", "v r [m/s²]"), (2, 3, "sideslip [rad]", "rear longitudinal slip [-]")]

    def draw(axes: np.ndarray) -> None:
        for row, (a, b, x_name, y_name) in enumerate(axes_of):
            x_edges, y_edges = (np.linspace(place[:, k].min(), place[:, k].max() + 1e-9, 9) for k in (a, b))
            for column, (title, parts) in enumerate((("nominal", before), ("corrected", after))):
                value = np.nan_to_num(np.concatenate(parts))
                at = (place[:, a], place[:, b])
                count, _, _ = np.histogram2d(*at, bins=(x_edges, y_edges))
                total, _, _ = np.histogram2d(*at, bins=(x_edges, y_edges), weights=value)
                mean = np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))
                ax: Axes = axes[row, column]
                top = np.sqrt(np.nanquantile(np.concatenate(before), 0.98))
                image = ax.pcolormesh(x_edges, y_edges, mean.T, cmap="magma_r", vmin=0.0, vmax=top)
                for i, j in zip(*np.nonzero(count), strict=True):
                    x, y = x_edges[i : i + 2].mean(), y_edges[j : j + 2].mean()
                    ax.text(x, y, f"{count[i, j]:.0f}", fontsize=5, ha="center", va="center", color="grey")
                ax.set_title(f"{title} [noise levels]", fontsize=8)
                ax.set_xlabel(x_name, fontsize=7)
                ax.set_ylabel(y_name, fontsize=7)
                ax.figure.colorbar(image, ax=ax).ax.tick_params(labelsize=6)

    return svg(9.0, 5.5, 2, 2, draw)


def correlations(d: Diagnosis) -> str:
    """Auto-correlation of the innovations and their cross-correlation with steering, before and after."""
    problem = d.problem
    parts = []
    for fit, color, label in ((nothing(problem), NOMINAL, "nominal"), (d.fit, CORRECTED, "corrected")):
        parts.append((filter_case(problem, fit.theta, fit.names).innovations, color, label))

    def correlation(a: np.ndarray, b: np.ndarray, lag: int) -> float:
        size = float(np.sqrt(np.mean(a**2) * np.mean(b**2)))
        return float(np.mean(a[lag:] * b[: len(b) - lag])) / max(size, 1e-12)

    def draw(axes: np.ndarray) -> None:
        for innovations, color, label in parts:
            for column, channel in enumerate((0, 2, 5)):
                auto, cross = np.zeros(LONGEST_CORRELATION), np.zeros(LONGEST_CORRELATION)
                for run, e in zip(problem.runs, innovations, strict=True):
                    signal = e[run.counted, channel]
                    steering = run.delta[run.counted] - np.mean(run.delta[run.counted])
                    for lag in range(LONGEST_CORRELATION):
                        auto[lag] += correlation(signal, signal, lag) / len(problem.runs)
                        cross[lag] += correlation(signal, steering, lag) / len(problem.runs)
                lags = np.arange(LONGEST_CORRELATION) * problem.runs[0].period
                axes[0, column].plot(lags[1:], auto[1:], color=color, lw=1.0, label=label)
                axes[1, column].plot(lags, cross, color=color, lw=1.0)
                axes[0, column].set_title(CHANNELS[channel], fontsize=8)
                axes[1, column].set_xlabel("lag [s]", fontsize=7)
        axes[0, 0].set_ylabel("auto-correlation", fontsize=7)
        axes[1, 0].set_ylabel("with steering", fontsize=7)
        axes[0, 0].legend(fontsize=6)

    return svg(9.0, 3.4, 2, 3, draw)


def error_by_horizon(d: Diagnosis) -> str:
    """Root mean square error against the horizon: nominal, corrected on runs not fitted, floor."""
    r = d.reduction

    def draw(axes: np.ndarray) -> None:
        ax: Axes = axes[0, 0]
        lines = ((r.before, NOMINAL, "effects off"), (r.after, CORRECTED, "held out"), (r.floor, "grey", "floor"))
        for values, color, label in lines:
            if values:
                ax.loglog(HORIZONS, np.sqrt(values), "o-", color=color, lw=1.0, ms=3, label=label)
        ax.set_xlabel("horizon [s]", fontsize=7)
        ax.set_ylabel("error [noise levels]", fontsize=7)
        if r.before:
            ax.legend(fontsize=6)

    return svg(4.5, 2.6, 1, 1, draw)


def isolability_matrix(found: Isolability) -> str:
    """How alike the effects' signatures are in these logs."""

    def draw(axes: np.ndarray) -> None:
        ax: Axes = axes[0, 0]
        image = ax.imshow(found.likeness, cmap="Blues", vmin=0.0, vmax=1.0)
        ax.set_xticks(range(len(found.names)), found.names, rotation=90)
        ax.set_yticks(range(len(found.names)), found.names)
        ax.figure.colorbar(image, ax=ax, shrink=0.6).ax.tick_params(labelsize=6)

    return svg(7.5, 7.0, 1, 1, draw)


def uncertainty(cells: dict[str, Any]) -> str:
    """The learnt model's predictive deviation over speed and sideslip, with sample counts."""
    speed, sideslip = cells["speed"], cells["sideslip"]
    deviation, count = np.array(cells["deviation"]), np.array(cells["count"])

    def draw(axes: np.ndarray) -> None:
        ax: Axes = axes[0, 0]
        image = ax.pcolormesh(speed, sideslip, deviation.T, cmap="magma_r", vmin=1.0)
        for i, j in zip(*np.nonzero(count), strict=True):
            x, y = 0.5 * (speed[i] + speed[i + 1]), 0.5 * (sideslip[j] + sideslip[j + 1])
            dark = deviation[i, j] > 0.5 * (1.0 + deviation.max())
            ax.text(x, y, f"{count[i, j]}", fontsize=5, ha="center", va="center", color="white" if dark else "black")
        ax.set_xlabel("speed [m/s]", fontsize=7)
        ax.set_ylabel("sideslip [rad]", fontsize=7)
        bar = ax.figure.colorbar(image, ax=ax)
        bar.set_label("deviation [noise levels]", fontsize=7)
        bar.ax.tick_params(labelsize=6)

    return svg(4.8, 3.2, 1, 1, draw)
