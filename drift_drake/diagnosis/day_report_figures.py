"""Figures of another day's report, as SVG text; small enough to be read on a narrow screen."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from drift_drake.diagnosis.day_gap import STATES, squares
from drift_drake.diagnosis.report_figures import CORRECTED, NOMINAL, REAL, UNITS, svg
from drift_drake.estimation.robust_fit import MAD
from drift_drake.estimation.scores import Day, Normal
from drift_drake.estimation.windows import HORIZONS, STRIDE, WindowedRun

NORMAL = "#9a9a9a"
WIDTH = 4.4  # [inches]: two lie side by side on a wide screen
LABEL = 8  # [pt]

Line = tuple[np.ndarray, str, str]  # errors [windows, HORIZONS, channels], colour, label


def lines_of(errors: np.ndarray, corrected: np.ndarray | None) -> list[Line]:
    """The calibrated car's errors, and the corrected car's where there is one."""
    lines = [(errors, NOMINAL, "calibrated car")]
    return lines if corrected is None else [*lines, (corrected, CORRECTED, "corrected car")]


def ends(run: WindowedRun) -> np.ndarray:
    """Rows [windows] that are predicted half a second ahead."""
    return np.asarray(run.starts + HORIZONS * run.stride)


def overlay(day: Day, index: int, lines: Sequence[Line]) -> str:
    """One run as measured and as predicted half a second ahead."""
    run = day.runs[index]
    t = np.arange(len(run.y)) * run.period

    def draw(axes: np.ndarray) -> None:
        for i, state in enumerate(STATES):
            ax: Axes = axes[i, 0]
            ax.plot(t, run.y[:, i], color=REAL, lw=0.7, label="measured")
            for errors, color, label in lines:
                at = ends(run)
                ahead = run.y[at, i] - errors[day.run == index][:, -1, i]
                ax.plot(at * run.period, ahead, "o-", color=color, lw=0.8, ms=1.8, label=label)
            low, high = float(np.min(run.y[:, i])), float(np.max(run.y[:, i]))
            ax.set_ylim(low - 0.35 * (high - low), high + 0.35 * (high - low))
            ax.set_ylabel(f"{state} [{UNITS[state]}]", fontsize=LABEL)
            ax.label_outer()
        axes[-1, 0].set_xlabel("t [s]", fontsize=LABEL)
        axes[0, 0].set_title(run.name, fontsize=LABEL, loc="left")
        labelled(axes, 3)

    return svg(WIDTH, 5.6, len(STATES), 1, draw)


def misses(day: Day, normal: Normal, index: int, lines: Sequence[Line]) -> str:
    """One run's errors half a second ahead, measured less predicted, beside the robust scale of what is normal."""
    run = day.runs[index]

    def draw(axes: np.ndarray) -> None:
        for i, state in enumerate(STATES):
            ax: Axes = axes[i, 0]
            scale = float(normal.scales[-1, i])
            ax.axhspan(-2.0 * scale, 2.0 * scale, color=NORMAL, alpha=0.3, lw=0.0, label="normal (2 sigma)")
            for errors, color, label in lines:
                ax.plot(ends(run) * run.period, errors[day.run == index][:, -1, i], "o-", color=color, lw=0.8, ms=1.8,
                        label=label)  # fmt: skip
            ax.set_ylabel(f"{state} [{UNITS[state]}]", fontsize=LABEL)
            ax.label_outer()
        axes[-1, 0].set_xlabel("t [s]", fontsize=LABEL)
        axes[0, 0].set_title("measured less predicted", fontsize=LABEL, loc="left")
        labelled(axes, 3)

    return svg(WIDTH, 5.6, len(STATES), 1, draw)


def labelled(axes: np.ndarray, columns: int) -> None:
    """A legend above all panels."""
    ax: Axes = axes[0, 0]
    ax.figure.legend(*ax.get_legend_handles_labels(), fontsize=LABEL - 1, ncols=columns, frameon=False,
                     loc="outside upper center", columnspacing=1.2, handlelength=1.4)  # fmt: skip


def by_horizon(normal: Normal, lines: Sequence[Line]) -> str:
    """Median absolute errors of each state against the horizon, beside those of the day of calibration."""
    horizons = STRIDE * np.arange(1, HORIZONS + 1)

    def draw(axes: np.ndarray) -> None:
        for i, state in enumerate(STATES):
            ax: Axes = axes[i // 2, i % 2]
            ax.plot(horizons, normal.scales[:, i] / MAD, color=NORMAL, lw=4, alpha=0.5, label="day of calibration")
            for errors, color, label in lines:
                ax.plot(horizons, np.median(np.abs(errors[..., i]), axis=0), "o-", color=color, lw=1.2, ms=3,
                        label=label)  # fmt: skip
            ax.set_title(f"{state} [{UNITS[state]}]", fontsize=LABEL, loc="left")
            ax.set_ylim(bottom=0.0)
            ax.set_xticks(horizons)
        for ax in axes[-1]:
            ax.set_xlabel("ahead [s]", fontsize=LABEL)
        labelled(axes, 3)

    return svg(WIDTH, 4.0, 2, 2, draw)


def time_line(day: Day, normal: Normal, lines: Sequence[Line], onset: dict[str, float]) -> str:
    """Errors half a second ahead over time, run by run, in those of the day of calibration, with the onset."""
    parts = [(np.sqrt(squares(normal, errors)[:, -1].mean(axis=-1)), color, label)
             for errors, color, label in lines]  # fmt: skip

    def draw(axes: np.ndarray) -> None:
        for k, run in enumerate(day.runs):
            ax: Axes = axes[k, 0]
            ax.axhline(1.0, color=NORMAL, lw=3, alpha=0.5)
            for values, color, label in parts:
                ax.plot(run.starts * run.period, values[day.run == k], color=color, lw=1.0, label=label)
            if run.name in onset:
                ax.axvline(onset[run.name], color=REAL, ls=":", lw=1.0)
                ax.annotate("onset", (onset[run.name], 1.0), xycoords=("data", "axes fraction"), fontsize=LABEL - 1,
                            xytext=(2, -2), textcoords="offset points", va="top")  # fmt: skip
            ax.set_ylim(0.0, max(float(np.max(values)) for values, _, _ in parts) * 1.05)
            ax.set_title(run.name, fontsize=LABEL, loc="left")
        axes[-1, 0].set_xlabel("t [s]", fontsize=LABEL)
        axes[0, 0].figure.supylabel("error [that of the day of calibration]", fontsize=LABEL)
        labelled(axes, 2)

    return svg(WIDTH, 0.7 + 1.0 * len(day.runs), len(day.runs), 1, draw)
