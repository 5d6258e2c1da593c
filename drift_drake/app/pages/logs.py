"""Logs: recordings, what they hold, and the day that each belongs to."""

import json
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.element import Element

from drift_drake.app import stages
from drift_drake.app.jobs import Jobs
from drift_drake.app.pages.figures import Chart, thumbnail
from drift_drake.app.pages.parts import box, field, later, next_step, quietly, section, text, tick
from drift_drake.app.project import Project
from drift_drake.app.recordings import Recordings, Summary
from drift_drake.common.errors import DriftDrakeError
from drift_drake.view.colours import RUNS
from drift_drake.view.pages.charts import Line, Panel

MOST_SHOWN = 6  # signals in one chart
FORMATS = (
    "CSV and other text tables, Parquet, MCAP, ROS bags, MDF, MATLAB .mat, .npz, HDF5, VBOX .vbo, AiM .xrk, PX4 .ulg; "
    "at most 1 GB each; what you put into the folder yourself is listed too, of any size, once the page is loaded anew"
)


def logs_page(project: Project, readings: Recordings, _jobs: Jobs, data: dict[str, Any]) -> None:
    """The page's content."""
    script = (resources.files("drift_drake.app.pages") / "upload.js").read_text()
    ui.add_body_html(f"<script>{script}</script>")
    with section("Add recordings"), box("div", "drop"):
        text("p", "Drop files here, or choose them:")
        box("input_", type="file", multiple="multiple", id="recordings", aria_label="Choose recordings")
        text("p", FORMATS, "note")
    names, days = project.recordings(), project.days(data)
    with section("Recordings"):
        if not names:
            text("p", "None yet.", "note")
        with box("datalist", id="days"):
            for day in days:
                box("option", value=day)
        for name in names:
            _recording(project, readings, name, data)
    with section("Days"):
        text("p", "A day is what was driven without a change to the car. Calibrate on a day when the car was as it "
             "should be; the others are compared with it.", "note")  # fmt: skip
        if not days:
            text("p", "None yet: give a recording a day.", "note")
        for day, recordings in days.items():
            _day(project, day, recordings, data)
        if names:
            new = next(day for k in range(1, len(days) + 2) if (day := f"day {k}") not in days)
            with box("article", "part", aria_label="new day") as card:
                _takes(project, card, new)
                text("p", f"Drop a recording here for {new}.", "note")
    next_step("Columns")


def _recording(project: Project, readings: Recordings, name: str, data: dict[str, Any]) -> None:
    chosen = str(data["recordings"].get(name) or "")
    with box("article", "part", aria_label=name, draggable="true") as card:
        card.on("dragstart", js_handler=f"(e) => e.dataTransfer.setData('text/plain', {_quoted(name)})")
        text("h3", Path(name).name)
        field("day (empty: not used)", chosen, lambda day: assign(project, name, day), kind="text", of=Path(name).name,
              list="days", maxlength="40")  # fmt: skip
        about = box("div")
        with about:
            text("p", "is being read ...", "note")

    async def shown() -> None:
        summary = await quietly(readings.summary, name)
        about.clear()
        with about:
            _summary(readings, name, summary)

    later(shown)


def _summary(recordings: Recordings, name: str, summary: Summary) -> None:
    if summary.found is None:
        with box("div", "refusal", role="alert"):
            text("p", summary.refused)
        return
    for topic in summary.found.topics:
        gaps = summary.gaps.get(topic.name, 0)
        clock = f"{topic.rate:.4g} Hz, {topic.span:.1f} s by {topic.clock}" if topic.rate else "no clock found"
        gapped = f", {gaps} gap{'s' * (gaps > 1)}" if gaps else ", no gaps" if topic.rate else ""
        text("p", f"{topic.name or 'table'}: {topic.rows} rows, {clock}{gapped}")
        if topic.left_out:
            left = ", ".join(f"{column} ({why})" for column, why in topic.left_out.items())
            text("p", f"left out: {left}", "note")
    chosen: list[str] = []
    buttons: dict[str, Any] = {}

    async def toggle(column: str) -> None:
        chosen.remove(column) if column in chosen else chosen.append(column)
        del chosen[:-MOST_SHOWN]
        for other, element in buttons.items():
            element.props["aria-pressed"] = "true" if other in chosen else "false"
        lines = await quietly(_signals, recordings, name, list(chosen))
        signals.clear()
        with signals:
            if lines:
                Chart(lines, f"Signals of {name}")

    with box("details"):
        text("summary", f"{len(summary.thumbs)} channels")
        text(
            "p",
            f"Press a channel to see it below, {MOST_SHOWN} at most; drag there, or press + and -, to zoom.",
            "note",
        )
        with box("div", "thumbs"):
            for one in summary.thumbs:
                buttons[one.column] = thumbnail(one, partial(toggle, one.column))
        signals = box("div")


def _signals(recordings: Recordings, name: str, columns: list[str]) -> list[Any]:
    """Panels of a chart, one a column."""
    try:
        return [Panel(column, [Line("", *recordings.signal(name, column), RUNS[0])], 100) for column in columns]
    except (DriftDrakeError, KeyError):
        return []


def _day(project: Project, day: str, recordings: list[str], data: dict[str, Any]) -> None:
    with box("article", "part", aria_label=f"day {day}") as card:
        _takes(project, card, day)
        text("h3", day)
        runs = project.runs(day)
        listed = ", ".join(Path(name).name for name in recordings) if recordings else f"a folder of {len(runs)} runs"
        text("p", listed, "note")
        with box("div", "fields"):
            tick(f"calibrate on {day}", day in stages.baseline(project, data),
                 lambda on: set_of_day(project, day, "baseline", on))  # fmt: skip


def _takes(project: Project, card: Element, day: str) -> None:
    """A recording that is dropped on the card gets the day."""
    card.on("dragover", js_handler="(e) => e.preventDefault()")
    card.on("drop", lambda event: assign(project, str(event.args), day),
            js_handler="(e) => { e.preventDefault(); emit(e.dataTransfer.getData('text/plain')); }")  # fmt: skip


def assign(project: Project, name: str, day: str) -> None:
    """Gives a recording a day; an empty one takes it out."""
    day = day.strip()
    if name not in project.recordings():
        return
    if day and not stages.DAY.fullmatch(day):
        ui.notify("a day is called by letters, digits, spaces, '.', '_' and '-', 40 at most", type="warning")
        return
    with project.changing() as data:
        data["recordings"][name] = day


def set_of_day(project: Project, day: str, key: str, value: Any) -> None:
    """Says something of a day; None takes it back."""
    with project.changing() as data:
        if key == "baseline":  # what was so by default is said from now on
            for one in stages.baseline(project, data):
                data["days"].setdefault(one, {})["baseline"] = True
        given = data["days"].setdefault(day, {})
        given[key] = value
        if value is None:
            given.pop(key)


def _quoted(name: str) -> str:
    return json.dumps(name).replace("<", "\\u003c")
