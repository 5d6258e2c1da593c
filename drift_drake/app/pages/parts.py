"""What the pages are made of: plain HTML elements with labels, that a keyboard and a screen reader know."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nicegui import html, ui
from nicegui.element import Element

from drift_drake.app.jobs import Jobs
from drift_drake.app.project import Project
from drift_drake.app.stages import STATES, Stage
from drift_drake.common.errors import DriftDrakeError

Changed = Callable[[str], Any]
VALUE = "(e) => emit(e.target.value)"
CHECKED = "(e) => emit(e.target.checked ? '1' : '')"


def text(tag: str, words: str, classes: str = "", **more: str) -> Element:
    """An element with a text, and attributes."""
    element: Element = getattr(html, tag)(words)
    element.props.update({name.replace("_", "-"): value for name, value in more.items()})
    return element.classes(classes) if classes else element


def box(tag: str = "div", classes: str = "", **more: str) -> Element:
    """An element to be filled in a `with` block."""
    element: Element = getattr(html, tag)()
    element.props.update({name.replace("_", "-"): value for name, value in more.items()})
    return element.classes(classes) if classes else element


def section(title: str, classes: str = "") -> Element:
    """A part of a page under a heading, to be filled in a `with` block."""
    element = box("section", f"part {classes}", aria_label=title)
    with element:
        text("h2", title)
    return element


def button(words: str, does: Callable[[], Any], classes: str = "", label: str = "", off: bool = False) -> Element:
    """A button; label: what a screen reader says, where the words alone are too few."""
    element = text("button", words, classes, type="button")
    if label:
        element.props["aria-label"] = label
    if off:
        element.props["disabled"] = True
    return element.on("click", lambda _: does(), js_handler="() => emit()")


def choice(label: str, options: Mapping[str, str], value: str, changed: Changed, of: str = "") -> Element:
    """A select; options: what is said of each value; of: what a screen reader says after the label."""
    with _labelled(label):
        element = box("select", aria_label=f"{label} of {of}" if of else label)
        with element:
            for one, words in options.items():
                option = html.option(words)
                option.props["value"] = one
                if one == value:
                    option.props["selected"] = True
    return element.on("change", lambda event: changed(str(event.args)), js_handler=VALUE)


def field(
    label: str, value: Any, changed: Changed, kind: str = "number", unit: str = "", of: str = "", **more: str
) -> Element:
    """An input for a number, or of another kind."""
    said = f"{label} [{unit}]" if unit else label
    with _labelled(said):
        element = box("input_", aria_label=f"{said} of {of}" if of else said, type=kind, **more)
        # ^: as an attribute; as a property, each change elsewhere on the page would put it back while one types
        element.props["^value"] = "" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
        if kind == "number":
            element.props["step"] = "any"
    return element.on("change", lambda event: changed(str(event.args)), js_handler=VALUE)


def tick(label: str, value: bool, changed: Callable[[bool], Any]) -> Element:
    """A checkbox."""
    with box("label", "tick"):
        element = box("input_", type="checkbox", aria_label=label)
        if value:
            element.props["checked"] = True
        text("span", label)
    return element.on("change", lambda event: changed(bool(event.args)), js_handler=CHECKED)


def _labelled(label: str) -> Element:
    element = box("label", "field")
    with element:
        text("span", label)
    return element


def number(words: str) -> float | None:
    """A field's number; None where it is empty, or none."""
    try:
        value = float(words.replace(",", "."))
    except ValueError:
        return None
    return value if abs(value) < 1e12 else None


def table(head: Sequence[str], rows: Sequence[Sequence[str]], label: str) -> None:
    """A table of texts, which a narrow window shows as cards."""
    with box("div", "wide"), box("table", "cards", aria_label=label):
        with box("thead"), box("tr"):
            for words in head:
                text("th", words, scope="col")
        with box("tbody"):
            for row in rows:
                with box("tr"):
                    for words, name in zip(row, head, strict=True):
                        text("td", words, data_label=name)


def command(stage: Stage) -> None:
    """The command line that does the same."""
    with box("div", "command"):
        text("span", "The same in a terminal, in the project's folder:")
        text("code", stage.command())


def state_chip(state: str) -> None:
    """Whether a step has been run for its inputs."""
    text("span", STATES[state], f"state {state}")


def run_button(stage: Stage, jobs: Jobs, data: Mapping[str, Any], words: str) -> None:
    """A button that runs a step, its state, its command, and what it said if it was refused."""
    state = stage.state(data)
    why = stage.refused()

    def go() -> None:
        if (refused := jobs.start(stage)) is not None:
            ui.notify(refused, type="warning")

    with box("div", "run"):
        button(words, go, "main", off=why is not None or jobs.running is not None)
        state_chip(state)
        if why:
            text("span", f"Not yet: {why}.", "note")
    command(stage)
    if state in ("refused", "cancelled") and (said := stage.said(data)):
        with box("div", "refusal", role="alert"):
            text("pre", said)


def next_step(name: str) -> None:
    """The way on."""
    with box("p", "next"):
        text("a", f"Next: {name}", href=f"/{name.lower()}")


def comes_first(words: str, name: str) -> None:
    """What has to be done before, and the way there."""
    with box("p", "warning"):
        text("span", f"{words}: ")
        text("a", name, href=f"/{name.lower().removeprefix('logs')}")


def saying(stage: Stage, data: Mapping[str, Any], label: str) -> None:
    """What a command printed; of one that was refused, its button says it."""
    if stage.state(data) in ("done", "stale") and (said := stage.said(data)):
        with box("details"):
            text("summary", label)
            text("pre", said)


def address(path: str) -> str:
    """Of a file of the folder."""
    return f"/files/{quote(path)}"


def frame_of(path: str, title: str) -> None:
    """A page that a command wrote, in a frame; it runs in an origin of its own."""
    where = address(path)
    box("iframe", "page", src=where, title=title, loading="lazy", sandbox="allow-scripts allow-downloads")
    with box("p", "note"):
        link = text("a", f"{path} in a window of its own")
        link.props.update({"href": where, "target": "_blank", "rel": "noopener"})


# One thread: modules that import each other may not be imported by two at once, and a recording is read once.
WORKER = ThreadPoolExecutor(1, "workbench")


async def quietly(function: Callable[..., Any], *arguments: Any) -> Any:
    """A slow function's result, computed in another thread than the pages."""
    return await asyncio.get_running_loop().run_in_executor(WORKER, function, *arguments)


async def or_why(function: Callable[..., Any], *arguments: Any) -> Any:
    """The same; where what it is given cannot be used, the sentence that says why."""
    try:
        return await quietly(function, *arguments)
    except DriftDrakeError as error:
        return str(error)


def later(function: Callable[[], Awaitable[None]]) -> None:
    """Runs a coroutine once the page is shown."""
    ui.timer(0.01, function, once=True)


def stamp(project: Project, jobs: Jobs) -> tuple[Any, ...]:
    """Changes whenever a page may have to be shown anew: a command has begun or ended, a file was changed elsewhere."""
    paths = [project.folder / "project.yaml", project.folder / "car.yaml", *project.folder.glob("mapping*.yaml")]
    return (jobs.ended, jobs.running is not None, *(path.stat().st_mtime_ns if path.exists() else 0 for path in paths))


def folder_name(project: Project) -> str:
    return project.folder.name or str(Path(project.folder))
