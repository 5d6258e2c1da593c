"""Interactive charts as plotly's figures in plain data: of reports, and of the workbench."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from drift_drake.common.errors import significant
from drift_drake.view.colours import CARS, INK, REFERENCE, RUNS

Array = np.ndarray
Figure = dict[str, Any]
"""`data` and `layout` of plotly.js."""

GRID = "#e6e6e6"
VEIL = "rgba(255,255,255,0.8)"  # behind a word that lies on lines
NORMAL = "#b5b5b5"  # a car's baseline
TALL, LOW = 150, 80  # [px] of a panel of values, and of one of what is left over
ROW, MANY = 18, 25  # [px] of a name on an axis; names from which they are small
FONT = {"family": "system-ui, sans-serif", "size": 12, "color": INK}
MARGIN = {"l": 48, "r": 12, "t": 34, "b": 40}
TITLE, APART = 34, 56  # [px] between panels, for a title; and for names of axes too
HEAT = [[0.0, "#ffffe5"], [0.25, "#fee391"], [0.5, "#fe9929"], [0.75, "#cc4c02"], [1.0, "#662506"]]  # of ColorBrewer
FEW_DECADES = 100.0  # a logarithmic axis of less has labels between the powers of ten
FARTHER = 1.5  # times a label that the next one on a logarithmic axis must be, not to cover it
ASTRAY = 1.5  # times the measured range beyond which a prediction is left out of the picture
MOST_POINTS = 1600  # of a line: of a longer one least and largest values are drawn
MOST_NAMED = 10  # lines in a legend
CLOUD = 700  # points of a run in a cloud
KEYS = "keys: + and - zoom, arrows move, 0 shows all"  # of `keys.js`


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


def reach_of(measured: Array, predicted: Sequence[Array]) -> tuple[float, float]:
    """Of an axis that shows all predictions, but for those that go far astray."""
    low, high = float(np.min(measured)), float(np.max(measured))
    span, all_of = high - low, np.concatenate(predicted)
    ends = max(float(np.nanmin(all_of)), low - ASTRAY * span), min(float(np.nanmax(all_of)), high + ASTRAY * span)
    low, high = min(low, ends[0]), max(high, ends[1])
    return low - 0.05 * (high - low), high + 0.05 * (high - low)


def stacked(
    panels: Sequence[Panel], events: Mapping[str, float] | None = None, part: tuple[float, float] | None = None
) -> Figure:
    """Panels over time above each other, with one zoom and one cursor.

    Args:
        events: vertical lines by name [s]; part: of the time axis that is shown [s], more finely than all of it.
    """
    total = sum(panel.height for panel in panels) + TITLE * (len(panels) - 1)
    layout: Figure = {"shapes": [], "annotations": [], "hoversubplots": "axis"}
    data: list[Figure] = []
    top = total
    for number, panel in enumerate(panels, start=1):
        kept = [line if part is None else _within(line, part) for line in panel.lines]
        _draw(data, layout, dataclasses.replace(panel, lines=kept), "", _suffix(number))
        layout[f"yaxis{_suffix(number)}"]["domain"] = [(top - panel.height) / total, top / total]
        top -= panel.height + TITLE
    for name, x in (events or {}).items():
        line = {"color": INK, "width": 1, "dash": "dot"}
        layout["shapes"].append({"type": "line", "x0": x, "x1": x, "y0": 0, "y1": 1, "yref": "paper", "line": line})
        word = {"x": x, "y": 1, "yref": "paper", "text": name, "xanchor": "left", "yanchor": "top", "bgcolor": VEIL}
        layout["annotations"].append(word | {"showarrow": False})
    layout["xaxis"] = {"title": {"text": "t [s]"}, "anchor": f"y{_suffix(len(panels))}", "showspikes": True,
                       "spikemode": "across", "spikethickness": 1, "spikedash": "solid"}  # fmt: skip
    if part is not None:
        layout["xaxis"]["range"] = list(part)
    return finished({"data": data, "layout": layout}, total)


def _suffix(number: int) -> str:
    return "" if number == 1 else str(number)


def _within(line: Line, part: tuple[float, float]) -> Line:
    first, last = np.searchsorted(line.x, part[0]), np.searchsorted(line.x, part[1], side="right")
    kept = slice(max(int(first) - 1, 0), int(last) + 1)
    return dataclasses.replace(line, x=line.x[kept], y=line.y[kept])


def side_by_side(panels: Sequence[Panel], x_title: str, columns: int = 2, log_x: bool = False) -> Figure:
    """Small panels in rows of `columns`."""
    rows = [panels[i : i + columns] for i in range(0, len(panels), columns)]
    heights = [max(panel.height for panel in row) for row in rows]
    total, between = sum(heights) + APART * (len(rows) - 1), 0.24 / columns
    wide = (1.0 - between * (columns - 1)) / columns
    layout: Figure = {"shapes": [], "annotations": []}
    data: list[Figure] = []
    top, number = total, 0
    for row, height in zip(rows, heights, strict=True):
        for column, panel in enumerate(row):
            number += 1
            suffix = _suffix(number)
            _draw(data, layout, panel, suffix, suffix)
            layout[f"yaxis{suffix}"] |= {
                "domain": [max((top - height) / total, 0.0), top / total], "anchor": f"x{suffix}",
            }  # fmt: skip
            left = column * (wide + between)
            axis: Figure = {"domain": [left, min(left + wide, 1.0)], "anchor": f"y{suffix}"}
            axis |= {"title": {"text": x_title}} if row is rows[-1] else {}
            axis |= _log_axis([line.x for line in panel.lines], at_points=True) if log_x else {}
            layout[f"xaxis{suffix}"] = axis
        top -= height + APART
    return finished({"data": data, "layout": layout}, total)


def heat_map(
    x: Array | Sequence[float] | Sequence[str],
    y: Array | Sequence[float] | Sequence[str],
    values: Array,
    texts: Sequence[Sequence[str]],
    labels: tuple[str, str, str, str],
    top: float | None = None,
    height: int = 330,
) -> Figure:
    """Coloured cells [x, y] with a text in each.

    Args:
        x, y: edges or names of the cells; labels: title, x and y axis, colour bar; top: of the colours; height: of the
            axes [px] at least: names are not closer than they are high.
    """
    title, x_title, y_title, of_colours = labels
    cells = {
        "type": "heatmap", "x": list(x), "y": list(y), "z": [_plain(row) for row in np.asarray(values).T],
        "text": list(map(list, zip(*texts, strict=True))), "texttemplate": "%{text}", "colorscale": HEAT, "zmin": 0.0,
        "hoverongaps": False, "textfont": {"size": 8},
        "hovertemplate": f"%{{x}}, %{{y}}<br>{of_colours}: %{{z:.3g}}<br>%{{text}}<extra></extra>",
        "colorbar": {"thickness": 10, "title": {"text": of_colours, "side": "right"}, "outlinewidth": 0},
    }  # fmt: skip
    cells |= {} if top is None else {"zmax": top}
    x_axis: Figure = {"title": {"text": x_title}}
    if isinstance(x[0], str):
        # As many names as the catalogue has stand closer than text of the page's size.
        x_axis |= {"tickangle": -90, "automargin": True, "nticks": len(x),
                   "tickfont": {"size": 12 if len(x) < MANY else 9}}  # fmt: skip
    layout = {"title": {"text": title, "font": {"size": 12}, "x": 0.0, "xanchor": "left"}, "xaxis": x_axis,
              "yaxis": {"title": {"text": y_title}}}  # fmt: skip
    named = isinstance(y[0], str)
    height = max(height, ROW * len(y)) if named else height
    return finished({"data": [cells], "layout": layout}, height, "closest", len(y) if named else 6)


def cloud(points: Sequence[tuple[str, Array, Array]], x_title: str, y_title: str) -> Figure:
    """Points of two quantities, x and y [n] by name, each name in a colour of its own."""
    data = []
    for k, (name, x, y) in enumerate(points):
        thin = slice(None, None, max(1, len(x) // CLOUD))
        data.append({"x": _plain(x[thin]), "y": _plain(y[thin]), "name": name, "type": "scatter", "mode": "markers",
                     "marker": {"size": 3, "color": RUNS[k % 6], "opacity": 0.6}})  # fmt: skip
    layout = {"xaxis": {"title": {"text": x_title}}, "yaxis": {"title": {"text": y_title}}}
    return finished({"data": data, "layout": layout}, 250, "closest")


def _draw(data: list[Figure], layout: Figure, panel: Panel, x: str, y: str) -> None:
    known = {trace["name"] for trace in data}
    for line in panel.lines:
        seen, values = decimated(np.asarray(line.x, dtype=float), np.asarray(line.y, dtype=float), MOST_POINTS)
        data.append({
            "x": _plain(seen), "y": _plain(values), "name": line.name, "legendgroup": line.name, "type": "scatter",
            "showlegend": line.name not in known, "mode": "lines+markers" if line.dots else "lines",
            "line": {"color": line.drawn, "width": 1.4}, "marker": {"size": 4}, "xaxis": f"x{x}", "yaxis": f"y{y}",
        })  # fmt: skip
        known.add(line.name)
    # Above the panel's left end, where a narrow screen has space for a title.
    layout["annotations"].append({
        "text": panel.title, "xref": f"x{x} domain", "yref": f"y{y} domain", "x": 0.0, "y": 1.0, "xanchor": "left",
        "yanchor": "bottom", "showarrow": False,
    })  # fmt: skip
    if panel.normal is not None:
        layout["shapes"].append({
            "type": "rect", "xref": f"x{x} domain", "x0": 0, "x1": 1, "yref": f"y{y}", "y0": -panel.normal,
            "y1": panel.normal, "fillcolor": NORMAL, "opacity": 0.35, "line": {"width": 0},
        })  # fmt: skip
    axis: Figure = {} if panel.reach is None else {"range": list(panel.reach)}
    layout[f"yaxis{y}"] = axis | (_log_axis([line.y for line in panel.lines]) if panel.log else {})


def _log_axis(drawn: Sequence[Array], at_points: bool = False) -> Figure:
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
        ticks = np.array([low, high]) if high > FARTHER * low else np.array([high])
    return {"type": "log", "tickvals": _plain(ticks), "ticktext": [significant(tick, 2) for tick in ticks]}


def decimated(t: Array, values: Array, points: int) -> tuple[Array, Array]:
    """At most about so many samples of a signal [n], least and largest of each part, so that no peak is lost."""
    if len(t) <= points:
        return t, values
    edges = np.linspace(0, len(t), max(points // 2, 1) + 1).astype(int)[:-1]
    size = np.diff(np.append(edges, len(t)))
    held = np.where(np.isfinite(values), values, np.nan)
    low = np.fmin.reduceat(held, edges)
    high = np.fmax.reduceat(held, edges)
    middle = t[edges + size // 2]
    rising = held[np.minimum(edges + size - 1, len(t) - 1)] >= held[edges]
    first, second = np.where(rising, low, high), np.where(rising, high, low)
    return np.repeat(middle, 2), np.column_stack([first, second]).ravel()


def _plain(values: Array) -> list[float | None]:
    """Six digits: the page stays small; None where there is no number."""
    return [float(f"{q:.6g}") if np.isfinite(q) else None for q in values]


def finished(figure: Figure, height: int, hover: str = "x unified", ticks: int = 6) -> Figure:
    """A figure in the pages' look; `height` is that of its axes [px]."""
    layout, legend = figure["layout"], 1 < len({trace.get("name") for trace in figure["data"]}) <= MOST_NAMED
    top = 64 if legend else MARGIN["t"]
    for name in layout:
        if name.startswith(("xaxis", "yaxis")):
            layout[name] |= {"gridcolor": GRID, "zeroline": False}
            layout[name] |= {"ticks": "outside", "tickcolor": REFERENCE, "ticklen": 3} if name[0] == "x" else {
                "automargin": True, "nticks": ticks}  # fmt: skip
    layout |= {
        "font": FONT, "margin": MARGIN | {"t": top}, "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)", "hovermode": hover, "showlegend": legend,
        "hoverlabel": {"bgcolor": "#f4f4f4", "font": {"color": INK}},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "#888888", "activecolor": REFERENCE},
        "legend": {"orientation": "h", "x": 0.0, "y": 1.0, "yref": "container", "yanchor": "top"},
        "height": height + MARGIN["b"] + top,
    }  # fmt: skip
    return figure


def placed(figure: Figure, label: str = "") -> Markup:
    """A figure as a place of a page and its data; label: what a screen reader says of it."""
    data = json.dumps(figure, separators=(",", ":")).replace("</", "<\\/")
    place = '<div class="chart" role="application" tabindex="0" aria-label="{}" aria-description="{}" style="{}">'
    style = f"min-height:{figure['layout']['height']}px"
    return Markup(place).format(label or _titles(figure), KEYS, style) + Markup(
        f'<script type="application/json">{data}</script></div>'
    )


def _titles(figure: Figure) -> str:
    """What a figure shows, by the titles of its panels or axes."""
    layout = figure["layout"]
    panels = [one["text"] for one in layout.get("annotations", ())]
    axes = [layout[name]["title"]["text"] for name in ("yaxis", "xaxis") if "title" in layout.get(name, {})]
    return "Chart of " + ("; ".join(dict.fromkeys(panels)) or " against ".join(filter(None, axes)) or "likeness")
