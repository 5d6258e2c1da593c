"""Drawings: thumbnails and bars as SVG and HTML, time series as plotly's figures, in the colours of the page."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from nicegui import html, ui
from nicegui.element import Element

from drift_drake.app.pages.parts import box, text
from drift_drake.app.recordings import Thumb, decimated
from drift_drake.common.arrays import Array
from drift_drake.common.errors import significant

# Okabe and Ito's colours, as in the other pictures (`view.style`, slow to import).
RUNS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
MEASURED = "#222222"  # the style sheet turns it light in the dark
POINTS = 1600  # of a line on the screen
Line = tuple[str, Array, Array, str]  # name, t, values, colour


def thumbnail(one: Thumb, chosen: Callable[[], Any]) -> Element:
    """A button that shows a column's course, its name, unit and range."""
    unit = f" [{one.unit}]" if one.unit else ""
    span = "" if one.low is None or one.high is None else f"{significant(one.low, 4)} to {significant(one.high, 4)}"
    with box("button", "thumb", type="button", aria_pressed="false") as element:
        text("b", f"{one.column}{unit}")
        svg = ui.element("svg")
        svg.props.update({"viewBox": "0 0 100 20", "preserveAspectRatio": "none", "aria-hidden": "true"})
        with svg:
            path = ui.element("path").classes("line")
            path.props["d"] = _path(one.values)
        text("i", span)
    return element.on("click", lambda _: chosen(), js_handler="() => emit()")


def _path(values: Sequence[float | None]) -> str:
    seen = [q for q in values if q is not None]
    if not seen:
        return ""
    low, high = min(seen), max(seen)
    size = (high - low) or 1.0
    parts, down = [], False
    for i, q in enumerate(values):
        if q is None:
            down = False
            continue
        x, y = 100.0 * i / max(len(values) - 1, 1), 19.0 - 18.0 * (q - low) / size
        parts.append(f"{'L' if down else 'M'}{x:.2f} {y:.2f}")
        down = True
    return "".join(parts)


class Chart:
    """Lines over time in panels one above the other, with one zoom and one cursor; a zoom brings finer lines."""

    def __init__(self, panels: Sequence[tuple[str, list[Line]]], label: str, height: int = 170) -> None:
        self.panels = list(panels)
        self.element = ui.plotly(self._figure(None, height)).classes("chart")
        self.element.props.update({"role": "img", "aria-label": label})
        self.height = height
        self.element.on("plotly_relayout", lambda event: self._zoomed(event.args))

    def _figure(self, part: tuple[float, float] | None, height: int) -> dict[str, Any]:
        count = len(self.panels)
        layout: dict[str, Any] = {
            "height": 60 + height * count, "margin": {"l": 62, "r": 12, "t": 26, "b": 40}, "hovermode": "x",
            "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)", "showlegend": True,
            "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.0},
            "grid": {"rows": count, "columns": 1}, "font": {"size": 12},
        }  # fmt: skip
        data, named = [], set[str]()
        gap = 0.16 / count
        for k, (title, lines) in enumerate(self.panels):
            suffix = "" if k == 0 else str(k + 1)
            top = 1.0 - k / count
            domain = [top - 1.0 / count + gap * (k < count - 1), top]
            layout[f"yaxis{suffix}"] = {
                "title": {"text": title}, "domain": domain, "zeroline": False, "automargin": True,
            }  # fmt: skip
            for name, t, values, colour in lines:
                x, y = _within(t, values, part)
                data.append({
                    "x": _plain(x), "y": _plain(y), "name": name, "type": "scatter", "mode": "lines", "xaxis": "x",
                    "yaxis": f"y{suffix}", "line": {"color": colour, "width": 1.4}, "legendgroup": name,
                    "showlegend": name not in named,
                })  # fmt: skip
                named.add(name)
        bottom = "y" if count == 1 else f"y{count}"
        layout["xaxis"] = {"title": {"text": "t [s]"}, "anchor": bottom, "showspikes": True, "spikemode": "across",
                           "spikethickness": 1, "zeroline": False}  # fmt: skip
        if part is not None:
            layout["xaxis"]["range"] = list(part)
        config = {"displaylogo": False, "displayModeBar": False, "responsive": True}
        return {"data": data, "layout": layout, "config": config}

    def _zoomed(self, args: Any) -> None:
        if not isinstance(args, dict):
            return
        ends = args.get("xaxis.range[0]"), args.get("xaxis.range[1]")
        if all(isinstance(end, int | float) for end in ends):
            self.element.update_figure(self._figure((float(ends[0]), float(ends[1])), self.height))  # type: ignore[arg-type]
        elif args.get("xaxis.autorange"):
            self.element.update_figure(self._figure(None, self.height))


def _within(t: Array, values: Array, part: tuple[float, float] | None) -> tuple[Array, Array]:
    if part is not None:
        first, last = np.searchsorted(t, part[0]), np.searchsorted(t, part[1], side="right")
        t, values = t[max(first - 1, 0) : last + 1], values[max(first - 1, 0) : last + 1]
    return decimated(t, values, POINTS)


def _plain(values: Array) -> list[float | None]:
    return [float(f"{q:.6g}") if np.isfinite(q) else None for q in values]


def cloud(points: Sequence[tuple[str, Array, Array]], titles: tuple[str, str], label: str) -> None:
    """Clouds of points of two quantities, each run in a colour of its own."""
    data = []
    for k, (name, x, y) in enumerate(points):
        thin = slice(None, None, max(1, len(x) // 700))
        data.append({"x": _plain(x[thin]), "y": _plain(y[thin]), "name": name, "type": "scatter", "mode": "markers",
                     "marker": {"size": 3, "color": RUNS[k % 6], "opacity": 0.6}})  # fmt: skip
    axes = [{"title": {"text": title}, "zeroline": False, "automargin": True} for title in titles]
    layout = {"height": 320, "margin": {"l": 60, "r": 10, "t": 10, "b": 44}, "paper_bgcolor": "rgba(0,0,0,0)",
              "plot_bgcolor": "rgba(0,0,0,0)", "showlegend": len(points) > 1, "xaxis": axes[0], "yaxis": axes[1],
              "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom"}}  # fmt: skip
    figure = {"data": data, "layout": layout, "config": {"displayModeBar": False, "responsive": True}}
    ui.plotly(figure).classes("chart").props.update({"role": "img", "aria-label": label})


def bars(rows: Sequence[tuple[str, float | None, str]], label: str) -> None:
    """Bars of shares of one; None: hatched, for what no size would show."""
    with box("div", "bars", role="list", aria_label=label):
        for name, share, words in rows:
            with box("div", role="listitem"):
                text("span", name)
                with box("span", "bar"):
                    inner = html.i().classes("" if share is not None else "not")
                    inner.props["style"] = f"width: {100.0 * min(1.0, 1.0 if share is None else share):.1f}%"
                text("span", words)
