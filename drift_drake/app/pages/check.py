"""Check: which parts of the logs are used, how the car was driven, and whether that is enough to calibrate on."""

from functools import partial
from importlib import resources
from typing import Any

from markupsafe import escape
from nicegui import ui

from drift_drake.app import stages
from drift_drake.app.jobs import Jobs
from drift_drake.app.looks import driven, limits
from drift_drake.app.pages.figures import drawn
from drift_drake.app.pages.logs import set_of_day
from drift_drake.app.pages.parts import (
    box,
    button,
    comes_first,
    field,
    later,
    next_step,
    number,
    or_why,
    run_button,
    saying,
    section,
    text,
)
from drift_drake.app.project import Project
from drift_drake.app.recordings import Recordings
from drift_drake.view.pages.templates import part


def check_page(project: Project, _readings: Recordings, jobs: Jobs, data: dict[str, Any]) -> None:
    """The page's content."""
    with_dragging()
    days = [day for day in project.days(data) if project.runs(day)]
    if not days:
        comes_first("Import a day first", "Columns")
        return
    chosen = [day for day in stages.baseline(project, data) if day in days]
    for day in chosen:
        with section(f"{day}: good enough to calibrate on?"):
            stage = stages.check_day(project, day, data)
            run_button(stage, jobs, data, f"Check {day}")
            if stage.state(data) == "done":
                _verdict(project, day, data)
            saying(stage, data, "What the check says")
    for day in days:
        if day in chosen:
            with section(f"{day}: what is used"):
                later(partial(_drawn, project, day, data, _place()))
    for day in days:
        if day not in chosen:
            _folded(project, day, data)
    next_step("Calibrate")


def _place() -> Any:
    place = box("div")
    with place:
        text("p", "is being drawn ...", "note")
    return place


def _folded(project: Project, day: str, data: dict[str, Any]) -> None:
    """A day that nothing is calibrated on: drawn once it is opened."""
    with box("details", "part") as details:
        text("summary", f"{day}: what is used")
        place = _place()
    shown = False

    async def opened() -> None:
        nonlocal shown
        if not shown:
            shown = True
            await _drawn(project, day, data, place)

    details.on("toggle", lambda _: opened(), js_handler="(e) => e.target.open && emit()")


def _verdict(project: Project, day: str, data: dict[str, Any]) -> None:
    found = stages.checked(project, day)["for_calibration"]
    good = bool(found["good_enough"])
    taken = stages.accepted(project, day, data)
    text("p", f"{day} is {'good enough' if good else 'not good enough'} to calibrate a car on.",
         "verdict" if good else "verdict not")  # fmt: skip
    for one in found["missing"]:
        with box("div", "warning"):
            text("p", f"{one['why']}, which leaves open: {', '.join(one['leaves'])}.")
            text("p", f"Drive {one['drive']}.")
    for remark in found["remarks"]:
        text("p", remark, "warning")
    if not good:
        with box("div", "run"):
            if taken:
                text("span", "Taken nevertheless, for exactly these logs and this car.", "note")
            else:
                button("Take it nevertheless", lambda: _accept(project, day),
                       label=f"Calibrate on {day} nevertheless")  # fmt: skip
    if found["outlook"]:
        place = box("div")

        async def shown() -> None:
            bars = await or_why(limits, found["outlook"], project.folder / stages.first_guess(data))
            with place:
                text("h3", "What a later day like this would show, from this size on")
                ui.html(escape(bars), sanitize=False)  # of what is a page's own nothing is escaped

        later(shown)


def _accept(project: Project, day: str) -> None:
    set_of_day(project, day, "accepted", stages.check_day(project, day, project.read()).digest())


def with_dragging() -> None:
    """Lets timelines on the page be dragged in."""
    script = (resources.files("drift_drake.app.pages") / "trim.js").read_text()
    ui.add_body_html(f"<script>{script}</script>")


async def driven_runs(project: Project, day: str, data: dict[str, Any], place: Any) -> Any:
    """How a day's runs were driven (`looks.driven`); the place is cleared, and says why where None is returned."""
    car = project.folder / stages.first_guess(data)
    found = await or_why(driven, project.folder / "logs" / day, car) if car.exists() else "describe the car first (Car)"
    place.clear()
    if not isinstance(found, str):
        return found
    with place:
        text("p", found, "refusal" if car.exists() else "note")
    return None


async def _drawn(project: Project, day: str, data: dict[str, Any], place: Any) -> None:
    found = await driven_runs(project, day, data, place)
    if found is None:
        return
    with place:
        trims = bool(project.days(data).get(day))
        if trims:
            _trim_fields(project, day, data)
        _timelines(project, day, found, trims)
        from drift_drake.view.pages.driving import accelerations, steering

        with box("div", "clouds"):
            drawn(accelerations(found), "Accelerations ahead and to the left")
            drawn(steering(found), "Steering against speed")


def _trim_fields(project: Project, day: str, data: dict[str, Any]) -> None:
    given = project.day(day, data)
    with box("div", "fields"):
        for key in ("start", "end"):
            field(key, given.get(key), partial(_trimmed, project, day, key), unit="s", of=day, min="0")
        text("span", "Seconds after each recording's first reading; the day is then imported again.", "note")


def _trimmed(project: Project, day: str, key: str, words: str) -> None:
    set_of_day(project, day, key, number(words))


def _timelines(project: Project, day: str, runs: Any, trims: bool) -> None:
    """Used and left-out stretches of the runs; of the first, ends that can be dragged."""
    lines = ui.html(part("timelines", runs, trims), sanitize=False).classes("trims")
    lines.on("trim", lambda event: set_of_day(project, day, str(event.args["key"]), round(float(event.args["at"]), 2)),
             js_handler="(e) => emit(e.detail)")  # fmt: skip
