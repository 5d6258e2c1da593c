"""Drawings: thumbnails as SVG, and the charts of the reports, which bring finer lines when one zooms."""

from collections.abc import Callable, Sequence
from typing import Any

from nicegui import ui
from nicegui.element import Element

from drift_drake.app.pages.parts import box, text
from drift_drake.app.recordings import Thumb
from drift_drake.common.errors import significant
from drift_drake.view.pages.charts import KEYS, Figure, Panel, stacked

CONFIG = {"displaylogo": False, "displayModeBar": False, "responsive": True}


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


def drawn(figure: Figure, label: str) -> ui.plotly:
    """A figure of `view.pages.charts`; label: what a screen reader says of it."""
    element = ui.plotly(figure | {"config": CONFIG}).classes("chart")
    element.props.update({"role": "application", "tabindex": "0", "aria-label": label, "aria-description": KEYS})
    return element


class Chart:
    """Lines over time in panels one above the other, with one zoom and one cursor; a zoom brings finer lines."""

    def __init__(self, panels: Sequence[Panel], label: str) -> None:
        self.panels = panels
        self.element = drawn(stacked(panels), label)
        self.element.on("plotly_relayout", lambda event: self._zoomed(event.args))

    def _zoomed(self, args: Any) -> None:
        if not isinstance(args, dict):
            return
        ends = args.get("xaxis.range[0]"), args.get("xaxis.range[1]")
        if isinstance(ends[0], int | float) and isinstance(ends[1], int | float):
            self._show((float(ends[0]), float(ends[1])))
        elif args.get("xaxis.autorange"):
            self._show(None)

    def _show(self, part: tuple[float, float] | None) -> None:
        self.element.update_figure(stacked(self.panels, part=part) | {"config": CONFIG})
