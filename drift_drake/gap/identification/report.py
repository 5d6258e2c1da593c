"""The report of an identification: one self-contained HTML file."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import UNITS
from drift_drake.gap.identification.calibration import Identification, Parameter, grouped
from drift_drake.gap.identification.held_out import HeldOut
from drift_drake.view.colours import CARS
from drift_drake.view.pages.charts import NORMAL, Line, Panel, finished, heat_map, side_by_side
from drift_drake.view.pages.page import Source, page_html

TEMPLATE = Path(__file__).parent / "report.html"
WORDS = ("95 % interval", "innovation", "held out", "calibrated car", "sideslip (beta)", "yaw rate (r)", "omega_r")
DECADE = 10.0  # of horizons, beyond which their axis is logarithmic


def intervals(parameters: dict[str, Parameter]) -> Markup:
    """Every parameter's 95 % interval in its prior's (grey), around the first guess."""
    figure = go.Figure()
    for name, p in parameters.items():
        if p.prior > 0.0:
            origin = 0.0 if p.kind == "effect" else p.start
            low, at, high = ((q - origin) / p.prior for q in (p.low, p.estimate, p.high))
            figure.add_scatter(x=[-1.96, 1.96], y=[name, name], mode="lines", line={"color": NORMAL, "width": 9},
                               hoverinfo="skip")  # fmt: skip
            figure.add_scatter(
                x=[low, at, high], y=[name] * 3, mode="lines+markers", line={"color": CARS["corrected"], "width": 3},
                marker={"size": [0, 8, 0], "opacity": 1},
                hovertemplate=f"{name}: {p.estimate:.4g} ({p.low:.4g} to {p.high:.4g})<extra></extra>",
            )  # fmt: skip
    figure.update_yaxes(autorange="reversed", dtick=1)
    figure.update_xaxes(title_text="sigma of the prior")
    return finished(figure, 60 + 22 * len(parameters), legend=False, ticks=len(parameters))


def error_chart(held: HeldOut) -> Markup:
    """Held-out root mean square errors against the horizon, first guess and calibrated."""
    horizons = np.array(held.horizons)
    panels = []
    for i, state in enumerate(held.states):
        lines = [
            Line(name, horizons, np.array([row[i] for row in values]), colour, dots=True)
            for name, values, colour in (("first guess", held.before, NORMAL), ("calibrated", held.after, ""))
        ]
        panels.append(Panel(f"{state} [{UNITS[state]}]", lines, 140, log=True))
    return side_by_side(panels, "ahead [s]", log_x=horizons[-1] > DECADE * horizons[0])


def correlations(names: list[str], matrix: list[list[float]]) -> Markup:
    """The sizes of the posterior's correlations."""
    texts = [["" if abs(q) < 0.5 else f"{q:+.1f}" for q in row] for row in matrix]
    return heat_map(names, names, np.abs(np.array(matrix)), texts, ("", "", "", "correlation"), 1.0, 480)


def report_html(found: Identification, source: Source | None = None) -> str:
    """The report's HTML; nothing is loaded from elsewhere."""
    c = found.calibration
    return page_html(
        TEMPLATE,
        WORDS,
        c=c,
        source=source or Source(),
        sentence=c.sentence(),
        not_identified=grouped(c.not_identified, c.disagreed),
        rows=found.rows,
        unit_of=lambda name: CATALOGUE[name].unit,
        intervals=intervals(c.parameters),
        errors=error_chart(c.held_out),
        correlations=correlations(list(c.parameters), c.correlation),
    )
