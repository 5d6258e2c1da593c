"""Which stretches of the baseline's runs nothing is fitted to: by dragging or clicking in a timeline, or in words."""

import re
from collections.abc import Sequence
from functools import partial
from typing import Any

from nicegui import ui

from drift_drake.app import stages
from drift_drake.app.pages.check import driven_runs, with_dragging
from drift_drake.app.pages.logs import set_of_day
from drift_drake.app.pages.parts import box, field, later, section, text
from drift_drake.app.project import Project
from drift_drake.view.pages.templates import part

ALL = "all"
SPAN = re.compile(r"\d+(?:\.\d*)?-\d+(?:\.\d*)?")


def validation_part(project: Project, data: dict[str, Any]) -> None:
    """A timeline for each run of the days that are calibrated on, and a field with what of it is kept."""
    with_dragging()
    with section("Training and validation"):
        text("p", "Automatic: every fourth 1.5 s is held out at first, and the car is then fitted to all. Or drag in a "
             "timeline to keep a stretch for validation, click for the whole run or none of it: nothing is fitted to "
             "what is kept, and the car is judged by it.", "note")  # fmt: skip
        for day in stages.baseline(project, data):
            if project.runs(day):
                place = box("div")
                with place:
                    text("p", f"{day} is being drawn ...", "note")
                later(partial(_drawn, project, day, data, place))


async def _drawn(project: Project, day: str, data: dict[str, Any], place: Any) -> None:
    found = await driven_runs(project, day, data, place)
    if found is None:
        return
    with place:
        stretches = project.day(day, data).get("validation") or []
        kept = {run.name: spans_of(run.name, stretches) for run in found}
        drawn = {run.name: [(run.start, run.stop)] if kept[run.name] == ALL else _numbers(kept[run.name])
                 for run in found}  # fmt: skip
        text("h3", day)
        lines = ui.html(part("timelines", found, False, drawn), sanitize=False).classes("trims")
        lines.on("keep", lambda event: _dragged(project, day, kept, event.args), js_handler="(e) => emit(e.detail)")
        with box("div", "fields"):
            for run in found:
                written = partial(_written, project, day, run.name)
                field(f"{run.name}, for validation [s]", kept[run.name], written, "text",
                      placeholder="all, or 5-12, 20-25")  # fmt: skip


def spans_of(run: str, stretches: Sequence[Any]) -> str:
    """What of a run is kept, in the words of its field."""
    spans = [str(one)[len(run) + 1 :] for one in stretches if str(one).startswith(f"{run}:")]
    return ALL if run in stretches else ", ".join(span for span in spans if SPAN.fullmatch(span))


def _numbers(words: str) -> list[tuple[float, float]]:
    return [(float(a), float(b)) for a, b in (span.split("-") for span in SPAN.findall(words))]


def _dragged(project: Project, day: str, kept: dict[str, str], detail: dict[str, Any]) -> None:
    run, before = str(detail["run"]), kept.get(str(detail["run"]), "")
    if detail["start"] is None:
        _written(project, day, run, "" if before else ALL)
        return
    span = f"{float(detail['start']):.1f}-{float(detail['end']):.1f}"
    _written(project, day, run, span if before in ("", ALL) else f"{before}, {span}")


def _written(project: Project, day: str, run: str, words: str) -> None:
    """Keeps what a field says of one run, which may be nothing."""
    spans = [word for word in re.split(r"[,;\s]+", words.strip()) if word]
    if spans == [ALL]:
        new = [run]
    elif all(SPAN.fullmatch(span) and span.split("-")[0] != span.split("-")[1] for span in spans):
        new = [f"{run}:{span}" for span in spans]
    else:
        ui.notify(f"'{words}' is neither '{ALL}' nor stretches such as 5-12, 20-25", type="warning")
        return
    before = project.day(day).get("validation") or []
    others = [one for one in before if one != run and not (str(one).startswith(f"{run}:") and spans_of(run, [one]))]
    set_of_day(project, day, "validation", [*others, *new] or None)
