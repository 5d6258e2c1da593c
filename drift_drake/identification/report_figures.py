"""Figures of an identification's report, as SVG text."""

import numpy as np
from matplotlib.axes import Axes

from drift_drake.diagnosis.report_figures import CORRECTED, NOMINAL, UNITS, svg
from drift_drake.identification.calibration import Parameter
from drift_drake.identification.held_out import HeldOut

PRIOR = "#cccccc"


def intervals(parameters: dict[str, Parameter]) -> str:
    """Every parameter's 95 % interval (blue) in its prior's (grey), around the first guess."""
    shown = {name: p for name, p in parameters.items() if p.prior > 0.0}

    def draw(axes: np.ndarray) -> None:
        ax: Axes = axes[0, 0]
        for i, p in enumerate(shown.values()):
            origin = 0.0 if p.kind == "effect" else p.start
            ax.plot([-1.96, 1.96], [i, i], color=PRIOR, lw=7, solid_capstyle="butt", zorder=1)
            ends = [(q - origin) / p.prior for q in (p.low, p.estimate, p.high)]
            ax.plot([ends[0], ends[2]], [i, i], color=CORRECTED, lw=3, zorder=2)
            ax.plot(ends[1], i, "o", color=CORRECTED, ms=4, zorder=3)
        ax.axvline(0.0, color="#222222", lw=0.6)
        ax.set_yticks(range(len(shown)), list(shown))
        ax.invert_yaxis()
        ax.set_xlabel("from the first guess (effects: from zero) [standard deviations of the prior]", fontsize=8)

    return svg(8.0, 0.6 + 0.26 * len(shown), 1, 1, draw)


def errors(held: HeldOut) -> str:
    """Held-out root mean square errors against the horizon, first guess and calibrated."""

    def draw(axes: np.ndarray) -> None:
        for i, state in enumerate(held.states):
            ax: Axes = axes[0, i]
            lines = ((held.before, NOMINAL, "first guess"), (held.after, CORRECTED, "calibrated"))
            for values, color, label in lines:
                ax.loglog(held.horizons, [row[i] for row in values], "o-", color=color, lw=1.2, ms=3, label=label)
            ax.set_title(f"{state} [{UNITS[state]}]", fontsize=8)
            ax.set_xlabel("horizon [s]", fontsize=7)
        axes[0, 0].legend(fontsize=6)

    return svg(9.0, 2.5, 1, len(held.states), draw)


def correlations(names: list[str], matrix: list[list[float]]) -> str:
    """The correlation matrix of the posterior."""

    def draw(axes: np.ndarray) -> None:
        ax: Axes = axes[0, 0]
        image = ax.imshow(np.array(matrix), cmap="RdBu_r", vmin=-1.0, vmax=1.0)
        ax.set_xticks(range(len(names)), names, rotation=90)
        ax.set_yticks(range(len(names)), names)
        ax.figure.colorbar(image, ax=ax, shrink=0.7).ax.tick_params(labelsize=6)

    return svg(6.5, 5.6, 1, 1, draw)
