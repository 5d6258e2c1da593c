"""Interactive charts of a page: plotly figures as data, drawn by the one copy of plotly.js at the page's end."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup
from plotly.subplots import make_subplots

from drift_drake.common.errors import significant
from drift_drake.view.colours import CARS, INK, REFERENCE

Array = np.ndarray

GRID = "#e6e6e6"
VEIL = "rgba(255,255,255,0.8)"  # behind a word that lies on lines
NORMAL = "#b5b5b5"  # a car's baseline
TALL, LOW = 150, 80  # [px] of a panel of values, and of one of what is left over
ROW, MANY = 18, 25  # [px] of a name on an axis; names from which they are small
FONT = {"family": "system-ui, sans-serif", "size": 12, "color": INK}
MARGIN = {"l": 48, "r": 12, "t": 34, "b": 40}
HEAT = "YlOrBr"
FEW_DECADES = 100.0  # a logarithmic axis of less has labels between the powers of ten
APART = 1.5  # times a label that the next one on a logarithmic axis must be, not to cover it
ASTRAY = 1.5  # times the measured range beyond which a prediction is left out of the picture
MOST_POINTS = 4000  # of a line: a longer one is thinned


@dataclasses.dataclass(frozen=True)
class Line:
    """One line of a panel; of a car, its colour is the car's. x, y: [n]."""

    name: str
    x: Array
    y: Array
    colour: str = ""
    dots: bool = False

    @property
    def drawn(self) -> str:
        return self.colour or CARS.get(self.name, INK)


@dataclasses.dataclass(frozen=True)
class Panel:
    """One pair of axes: a title with the unit, lines, and the baseline as a band about zero (half its width)."""

    title: str
    lines: Sequence[Line]
    height: int = TALL
    normal: float | None = None
    reach: tuple[float, float] | None = None  # of the y axis at first
    log: bool = False


def reach_of(measured: np.ndarray, predicted: Sequence[np.ndarray]) -> tuple[float, float]:
    """Of an axis that shows all predictions, but for those that go far astray."""
    low, high = float(np.min(measured)), float(np.max(measured))
    span, all_of = high - low, np.concatenate(predicted)
    ends = max(float(np.nanmin(all_of)), low - ASTRAY * span), min(float(np.nanmax(all_of)), high + ASTRAY * span)
    low, high = min(low, ends[0]), max(high, ends[1])
    return low - 0.05 * (high - low), high + 0.05 * (high - low)


def stacked(panels: Sequence[Panel], events: Mapping[str, float] | None = None) -> Markup:
    """Panels over time above each other, which zoom together; events are vertical lines by name [s]."""
    gap = 34  # [px] for a panel's title
    heights = [panel.height for panel in panels]
    total = sum(heights) + gap * (len(panels) - 1)
    figure = make_subplots(
        rows=len(panels), cols=1, shared_xaxes=True, vertical_spacing=gap / total, row_heights=heights,
    )  # fmt: skip
    for row, panel in enumerate(panels, start=1):
        _draw(figure, panel, row, 1)
    for name, x in (events or {}).items():
        figure.add_vline(x, line={"color": INK, "width": 1, "dash": "dot"})
        figure.add_annotation(
            x=x, y=1.0, yref="y domain", text=name, showarrow=False, xanchor="left", yanchor="top", bgcolor=VEIL,
        )  # fmt: skip
    figure.update_xaxes(title_text="t [s]", row=len(panels), col=1)
    return finished(figure, total)


def side_by_side(panels: Sequence[Panel], x_title: str, columns: int = 2, log_x: bool = False) -> Markup:
    """Small panels in rows of `columns`."""
    rows = -(-len(panels) // columns)
    height = sum(max(p.height for p in panels[i * columns : (i + 1) * columns]) for i in range(rows)) + 56 * (rows - 1)
    figure = make_subplots(
        rows=rows, cols=columns, vertical_spacing=56 / height if rows > 1 else 0.0,
        horizontal_spacing=0.24 / columns,
    )  # fmt: skip
    for index, panel in enumerate(panels):
        row, column = index // columns + 1, index % columns + 1
        _draw(figure, panel, row, column)
        figure.update_xaxes(title_text=x_title if row == rows else "", row=row, col=column)
        if log_x:
            figure.update_xaxes(**_log_axis([line.x for line in panel.lines], at_points=True), row=row, col=column)
    return finished(figure, height)


def heat_map(
    x: Array | Sequence[float] | Sequence[str],
    y: Array | Sequence[float] | Sequence[str],
    values: Array,
    texts: Sequence[Sequence[str]],
    labels: tuple[str, str, str, str],
    top: float | None = None,
    height: int = 330,
) -> Markup:
    """Coloured cells [x, y] with a text in each.

    Args:
        x, y: edges or names of the cells; labels: title, x and y axis, colour bar; top: of the colours; height: of the
            axes [px] at least: names are not closer than they are high.
    """
    title, x_title, y_title, of_colours = labels
    cells = go.Heatmap(
        x=x, y=y, z=np.asarray(values).T, text=list(map(list, zip(*texts, strict=True))), texttemplate="%{text}",
        colorscale=HEAT, zmin=0.0, zmax=top, hoverongaps=False, textfont={"size": 8},
        hovertemplate=f"%{{x}}, %{{y}}<br>{of_colours}: %{{z:.3g}}<br>%{{text}}<extra></extra>",
        colorbar={"thickness": 10, "title": {"text": of_colours, "side": "right"}, "outlinewidth": 0},
    )  # fmt: skip
    figure = go.Figure(cells)
    figure.update_layout(title={"text": title, "font": {"size": 12}, "x": 0.0, "xanchor": "left"})
    figure.update_xaxes(title_text=x_title)
    figure.update_yaxes(title_text=y_title)
    if isinstance(x[0], str):
        # As many names as the catalogue has stand closer than text of the page's size.
        figure.update_xaxes(
            tickangle=-90, automargin=True, nticks=len(x), tickfont={"size": 12 if len(x) < MANY else 9}
        )
    named = isinstance(y[0], str)
    height = max(height, ROW * len(y)) if named else height
    return finished(figure, height, legend=False, ticks=len(y) if named else 6)


def _draw(figure: go.Figure, panel: Panel, row: int, column: int) -> None:
    known = {trace.name for trace in figure.data}
    for line in panel.lines:
        every = max(1, -(-len(line.x) // MOST_POINTS))
        figure.add_trace(
            go.Scatter(
                x=np.asarray(line.x)[::every].round(6), y=_short(np.asarray(line.y)[::every]), name=line.name,
                legendgroup=line.name, showlegend=line.name not in known,
                mode="lines+markers" if line.dots else "lines",
                line={"color": line.drawn, "width": 1.4, "dash": "solid"}, marker={"size": 4},
            ),
            row=row, col=column,
        )  # fmt: skip
        known.add(line.name)
    # Above the panel's left end, where a narrow screen has space for a title.
    figure.add_annotation(
        text=panel.title, xref="x domain", yref="y domain", x=0.0, y=1.0, xanchor="left", yanchor="bottom",
        showarrow=False, row=row, col=column,
    )  # fmt: skip
    if panel.normal is not None:
        figure.add_hrect(-panel.normal, panel.normal, fillcolor=NORMAL, opacity=0.35, line_width=0, row=row, col=column)
    figure.update_yaxes(range=panel.reach, row=row, col=column)
    if panel.log:
        figure.update_yaxes(**_log_axis([line.y for line in panel.lines]), row=row, col=column)


def _log_axis(drawn: Sequence[Array], at_points: bool = False) -> dict[str, Any]:
    """A logarithmic axis with labels in full: at the points, at powers of ten, or at 1, 2 and 5 where these are few."""
    values = np.concatenate([np.asarray(part, dtype=float)[np.asarray(part) > 0.0] for part in drawn])
    if not len(values):
        return {"type": "log"}
    low, high = float(np.min(values)), float(np.max(values))
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1.0)
    ticks = np.unique(values) if at_points else decades
    if not at_points and high < FEW_DECADES * low:
        ticks = np.sort(np.concatenate([decades, 2.0 * decades, 5.0 * decades]))
        ticks = ticks[(ticks > 0.8 * low) & (ticks < 1.25 * high)]
    if not len(ticks):
        ticks = np.array([low, high]) if high > APART * low else np.array([high])
    return {"type": "log", "tickvals": ticks, "ticktext": [significant(tick, 2) for tick in ticks]}


def _short(values: Array) -> Array:
    """Six digits of the largest: the page stays small."""
    largest = float(np.nanmax(np.abs(values))) if np.any(np.isfinite(values)) else 0.0
    return values if largest == 0.0 else values.round(max(0, 5 - int(np.floor(np.log10(largest)))))


def finished(figure: go.Figure, height: int, legend: bool = True, ticks: int = 6) -> Markup:
    """A figure in the page's look, as a place and its data; `height` is that of its axes [px]."""
    top = 64 if legend else MARGIN["t"]
    figure.update_layout(
        template="none", font=FONT, margin=MARGIN | {"t": top}, paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)", hovermode="x unified" if legend else "closest", showlegend=legend,
        modebar={"bgcolor": "rgba(0,0,0,0)", "color": "#aaaaaa", "activecolor": INK},
        legend={"orientation": "h", "x": 0.0, "y": 1.0, "yref": "container", "yanchor": "top"},
        height=height + MARGIN["b"] + top,
    )  # fmt: skip
    figure.update_xaxes(gridcolor=GRID, zeroline=False, ticks="outside", tickcolor=REFERENCE, ticklen=3)
    figure.update_yaxes(gridcolor=GRID, zeroline=False, automargin=True, nticks=ticks)
    data = figure.to_json().replace("</", "<\\/")
    return Markup(
        f'<div class="chart" style="min-height:{figure.layout.height}px">'
        f'<script type="application/json">{data}</script></div>'
    )
