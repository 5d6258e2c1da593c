"""The report of an identification: one self-contained HTML file."""

from pathlib import Path

import numpy as np
from markupsafe import Markup

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import SHORTEST_RUN, UNITS, InvalidLogError
from drift_drake.gap.estimation.driven import all_driven
from drift_drake.gap.estimation.prior import REACH
from drift_drake.gap.evidence.limit_rows import outlook_rows
from drift_drake.gap.identification.calibration import Identification, Parameter, grouped
from drift_drake.gap.identification.held_out import HeldOut
from drift_drake.view.colours import CARS
from drift_drake.view.pages.charts import NORMAL, Figure, Line, Panel, finished, heat_map, placed, side_by_side, stacked
from drift_drake.view.pages.driving import driving
from drift_drake.view.pages.page import Source, page_html
from drift_drake.view.playback.predicted import predicted

TEMPLATE = Path(__file__).parent / "report.html"
WORDS = ("95 % interval", "innovation", "held out", "calibrated car", "sideslip (beta)", "yaw rate (r)", "omega_r")
MOST_PLAYED, LONGEST = 120.0, 60.0  # [s] of all runs, and of one, that both cars are played on
DECADE = 10.0  # of horizons, beyond which their axis is logarithmic


def intervals(parameters: dict[str, Parameter]) -> Markup:
    """Every parameter's 95 % interval in its prior's (grey), around the first guess."""
    data: list[Figure] = []
    for name, p in parameters.items():
        if p.prior > 0.0:
            origin = 0.0 if p.kind == "effect" else p.start
            line = {"type": "scatter", "y": [name] * 3}
            data.append(line | {"x": [-1.96, 0.0, 1.96], "mode": "lines", "line": {"color": NORMAL, "width": 9},
                                "hoverinfo": "skip"})  # fmt: skip
            data.append(line | {
                "x": [(q - origin) / p.prior for q in (p.low, p.estimate, p.high)], "mode": "lines+markers",
                "line": {"color": CARS["corrected"], "width": 3}, "marker": {"size": [0, 8, 0], "opacity": 1},
                "hovertemplate": f"{name}: {p.estimate:.4g} ({p.low:.4g} to {p.high:.4g})<extra></extra>",
            })  # fmt: skip
    layout = {"yaxis": {"autorange": "reversed", "dtick": 1}, "xaxis": {"title": {"text": "sigma of the prior"}}}
    figure = finished({"data": data, "layout": layout}, 60 + 22 * len(parameters), "closest", len(parameters))
    return placed(figure, "Intervals of all parameters")


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
    return placed(side_by_side(panels, "ahead [s]", log_x=horizons[-1] > DECADE * horizons[0]))


def correlations(names: list[str], matrix: list[list[float]]) -> Markup:
    """The sizes of the posterior's correlations."""
    texts = [["" if abs(q) < 0.5 else f"{q:+.1f}" for q in row] for row in matrix]
    return placed(heat_map(names, names, np.abs(np.array(matrix)), texts, ("", "", "", "correlation"), 1.0, 480))


def played(found: Identification) -> tuple[list[tuple[str, Markup, str]], str]:
    """Runs as measured and as both cars predict them: name, chart, errors in words; and which are not drawn."""
    out, left = list[tuple[str, Markup, str]](), MOST_PLAYED
    for run in found.runs if found.first is not None else ():
        part = run.rows(0, min(len(run), round(LONGEST / run.period)))
        if left <= 0.0 or len(part) < SHORTEST_RUN:
            continue
        left -= len(part) * run.period
        try:
            seen = predicted(part, found.first or found.vehicle, (found.vehicle, found.effects))
        except InvalidLogError as error:
            out.append((run.name, Markup(), str(error)))
            continue
        out.append((run.name, placed(stacked(seen.panels)), seen.sentence))
    beyond = len(found.runs) - len(out)
    return out, f"{beyond} more runs are not drawn." if beyond > 0 and out else ""


def report_html(found: Identification, source: Source | None = None) -> str:
    """The report's HTML; nothing is loaded from elsewhere."""
    c, (runs, more) = found.calibration, played(found)
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
        played=runs,
        more=more,
        how=driving(all_driven(found.runs, found.vehicle)) if runs else None,
        limits=outlook_rows(c.outlook, found.vehicle.single_track()),
        reach=REACH,
        correlations=correlations(list(c.parameters), c.correlation),
    )
