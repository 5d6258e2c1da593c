"""Columns: which column is which quantity, laid over what others say of it; what looks wrong, and how to fix it."""

import asyncio
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import ui

from drift_drake.app import stages
from drift_drake.app.jobs import Jobs
from drift_drake.app.mapping_edits import edit, first_mapping, look_command, set_global
from drift_drake.app.pages.compared import comparison
from drift_drake.app.pages.frame import own_edit, typing
from drift_drake.app.pages.logs import set_of_day
from drift_drake.app.pages.parts import (
    box,
    button,
    choice,
    comes_first,
    field,
    later,
    next_step,
    number,
    or_why,
    quietly,
    run_button,
    saying,
    section,
    text,
    tick,
)
from drift_drake.app.project import MAPPING, Project
from drift_drake.app.recordings import Recordings
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.safe_files import write_text
from drift_drake.gap.logs.wording.conversion import units_of

MEANINGS = {
    "r": "yaw rate", "v": "speed", "delta_cmd": "angle of the road wheels", "beta": "sideslip: course less heading",
    "vx": "speed ahead (in place of v)", "vy": "speed to the left", "omega_r": "speed of the rear wheels",
    "ax": "acceleration ahead", "ay": "acceleration to the left", "tau_cmd": "torque of the engine",
    "psi": "heading", "x": "position", "y": "position", "latitude": "position", "longitude": "position",
    "course": "direction of travel",
}  # fmt: skip
NEEDED = ("r", "v", "delta_cmd")
FRAMES = {
    "": "the file's",
    "iso8855": "left is positive",
    "ned": "right is positive (ned)",
    "sae": "right is positive (sae)",
}
SIGNS = {"1": "+", "-1": "- (turned)"}
PAUSE = 0.2  # [s]
LOOKED_AT = 300.0  # [s] of a recording, that what is said of the columns at once is judged by


def columns_page(project: Project, readings: Recordings, jobs: Jobs, data: dict[str, Any]) -> None:
    """The page's content."""
    days = {name: day for day, several in project.days(data).items() for name in several}
    names = list(days)
    if not names:
        comes_first("Give a recording a day first (folders of runs are in the log format already)", "Logs")
        return
    if project.mapping() is None:
        _first(project, readings, names[0])
        return
    view = _View(project, readings, jobs, days, names[0])
    if len(names) > 1:
        choice("Recording that is shown", {name: Path(name).name for name in names}, names[0], view.other)
    with box("div", "pair"):
        with section("Quantities"):
            view.rows = box("div")
        with section("What they say of each other", "aside"):
            view.said = box("div", aria_live="polite")
            with view.said:
                text("p", "is being compared ...", "note")
    with section("Import"):
        text("p", "Each day becomes a folder of runs at 100 Hz, with what was estimated and what looks wrong.", "note")
        view.imports = box("div")
    view.draw_imports()
    later(view.draw)
    next_step("Car")


class _View:
    """What one window shows of a mapping: edits are written at once, and what depends on them is drawn anew."""

    rows: Any
    said: Any
    imports: Any

    def __init__(self, project: Project, readings: Recordings, jobs: Jobs, days: dict[str, str], name: str) -> None:
        self.project, self.readings, self.jobs, self.days, self.name = project, readings, jobs, days, name

    def mapping(self) -> dict[str, Any]:
        """What the mapping file of the recording's day holds."""
        return self.project.mapping(self.project.mapping_of(self.days[self.name])) or {}

    def part(self) -> tuple[float, float, float]:
        """Length, start and end [s] of what is looked at of the recording."""
        day = self.project.day(self.days[self.name])
        return LOOKED_AT, float(day.get("start") or 0.0), float(math.inf if day.get("end") is None else day["end"])

    async def draw(self) -> None:
        """All of it."""
        await self.draw_rows()
        await self.compare()

    async def other(self, name: str) -> None:
        """Shows another recording."""
        self.name = name
        self.said.props["aria-busy"] = "true"
        await self.draw()

    async def edit(self, change: Callable[[dict[str, Any]], None], again: bool = False) -> None:
        """Changes the mapping; again: rows too, whose choices depend on it."""
        self.said.props["aria-busy"] = "true"  # what it offers is of the mapping before
        self.project.change_mapping(change, self.project.mapping_of(self.days[self.name]))
        own_edit(self.project, self.jobs)
        self.draw_imports()
        if again:
            await self.draw_rows()
        await self.compare()

    def draw_imports(self) -> None:
        """The days' imports, stale or not."""
        data = self.project.read()
        self.imports.clear()
        with self.imports:
            for day, recordings in self.project.days(data).items():
                if recordings:
                    text("h3", day)
                    stage = stages.import_day(self.project, day, data)
                    run_button(stage, self.jobs, data, f"Import {day}")
                    saying(stage, data, "What the import says")

    async def draw_rows(self) -> None:
        """A row a quantity: those that are chosen, and the others folded."""
        ranked = await or_why(_ranked, self.readings, self.name, self.part(), _signals(self.mapping()))
        await self.closed_to_typing()
        mapping = self.mapping()  # as it is by now
        signals = _signals(mapping)
        self.rows.clear()
        self.rows.props["inert"] = False
        with self.rows:
            if isinstance(ranked, str):
                text("p", ranked, "refusal")
                return
            if len(set(self.days.values())) > 1:
                day = self.days[self.name]
                own = self.project.mapping_of(day) != MAPPING
                tick(f"{day} has a mapping of its own", own, partial(_own, self.project, day))
            _globals(self, mapping)
            used = [name for name in MEANINGS if name in NEEDED or name in signals or _formula(name, mapping)]
            for quantity in used:
                _row(self, quantity, signals.get(quantity), ranked.get(quantity, []), mapping)
            with box("details"):
                text("summary", "Further quantities")
                for quantity in MEANINGS:
                    if quantity not in used:
                        _row(self, quantity, None, ranked.get(quantity, []), mapping)

    async def closed_to_typing(self) -> None:
        """Waits until nobody types, and lets nobody begin: what is typed now would go with its field."""
        while True:
            while await typing():
                await asyncio.sleep(PAUSE)
            self.rows.props["inert"] = True
            if not await typing():
                return
            self.rows.props["inert"] = False

    async def compare(self) -> None:
        """What looks wrong, and the overlays."""
        while True:
            asked = self.name, self.mapping()
            found = await or_why(_previewed, self.readings, self.name, self.part(), asked[1])
            if asked == (self.name, self.mapping()):
                break  # else an edit came meanwhile, and this is of what was before
        if self.said.is_deleted:  # another page is shown by now
            return
        self.said.clear()
        self.said.props["aria-busy"] = "false"
        with self.said:
            if isinstance(found, str):
                text("p", found, "refusal")
                return
            comparison(self.edit, asked[1], *found)


def _own(project: Project, day: str, on: bool) -> None:
    """Gives a day a mapping of its own, which begins as the shared one, or takes it back; the file stays."""
    shared, path = project.folder / MAPPING, project.folder / f"mapping {day}.yaml"
    if on and not path.exists():
        write_text(path, shared.read_text(encoding="utf-8"))
    set_of_day(project, day, "own_mapping", on or None)


def _first(project: Project, readings: Recordings, name: str) -> None:
    """Offers the mapping that `import --look` guesses."""
    with section("A first mapping"):
        text("p", "Columns, units and frame are guessed from names and numbers; you correct what is wrong.")

        async def go() -> None:
            try:
                await quietly(first_mapping, project, readings, name)
            except DriftDrakeError as error:
                ui.notify(str(error), type="negative")

        button("Guess it", go, "main")
        with box("div", "command"):
            text("span", "The same in a terminal, in the project's folder:")
            text("code", look_command(name))


def _ranked(readings: Recordings, name: str, part: tuple[float, ...], signals: dict[str, Any]) -> Any:
    from drift_drake.gap.logs.importing.candidates import ranked

    return ranked(readings.excerpt(name, *part).topics, signals)


def _signals(mapping: dict[str, Any] | None) -> dict[str, Any]:
    signals = (mapping or {}).get("signals")
    return signals if isinstance(signals, dict) else {}


def _globals(view: _View, mapping: dict[str, Any]) -> None:
    """What is said of the car and of all columns."""

    async def given(key: str, value: Any) -> None:
        await view.edit(lambda data: set_global(data, key, value))

    async def pointed(axis: int, words: str) -> None:
        await given("measured_point", (axis, number(words)))

    with box("div", "fields"):
        frames = {name: words for name, words in FRAMES.items() if name}
        choice("frame of the file", frames, str(mapping.get("frame", "iso8855")), partial(given, "frame"))
        field("wheelbase", mapping.get("wheelbase"), lambda q: given("wheelbase", number(q)), unit="m", min="0")
        point = mapping.get("measured_point") or [None, None]
        for k, words in enumerate(("speed is measured ahead by", "and to the left by")):
            field(words, point[k] if len(point) > k else None, partial(pointed, k), unit="m")
    text("p", "A wheelbase lets the steering ratio be judged. Where the speed is measured is relative to the centre of "
         "gravity.", "note")  # fmt: skip


def _formula(quantity: str, mapping: dict[str, Any]) -> str:
    formulas = mapping.get("formulas")
    return str(formulas.get(quantity, "")) if isinstance(formulas, dict) else ""


def _row(view: _View, quantity: str, line: Any, candidates: list[Any], mapping: dict[str, Any]) -> None:
    line = line if isinstance(line, dict) else {}
    formula = _formula(quantity, mapping)

    async def change(key: str, value: Any, again: bool = False) -> None:
        await view.edit(lambda data: edit(data, quantity, key, value, candidates), again)

    with box("div", "quantity", role="group", aria_label=f"{quantity}, {MEANINGS[quantity]}"):
        with box("p"):
            text("b", f"{quantity}{' (needed)' if quantity in NEEDED else ''}")
            text("span", MEANINGS[quantity])
        options = {"": f"= {formula}" if formula else "none"}
        options |= {one.column: _said(one) for one in candidates}
        column = str(line.get("column", ""))
        if column and column not in options:
            options[column] = f"{column} (not in this recording)"
        choice("column", options, column, lambda name: change("column", name, True), of=quantity)
        if column:
            with box("div", "controls"):
                _controls(quantity, line, change)


def _controls(quantity: str, line: dict[str, Any], change: Callable[..., Any]) -> None:
    """Unit, sign, factor, offset and frame of a column."""
    unit = str(line.get("unit", "?"))
    units = dict.fromkeys([unit, *units_of(quantity)])
    choice(
        "unit", {one: one for one in units}, unit, lambda one: change("unit", one, quantity == "omega_r"), of=quantity
    )
    choice("sign", SIGNS, "-1" if line.get("sign", 1) == -1 else "1", lambda q: change("sign", float(q)), of=quantity)
    scale = line.get("scale", 1.0)
    if quantity == "delta_cmd":
        ratio = 1.0 / scale if isinstance(scale, int | float) and scale else 1.0
        field("steering ratio", float(f"{ratio:.6g}"), lambda q: change("ratio", number(q)), of=quantity)
    elif line.get("radius") is not None:
        field("wheel radius", line["radius"], lambda q: change("radius", number(q)), unit="m", of=quantity)
    else:
        field("factor", scale, lambda q: change("scale", number(q)), of=quantity)
    field("offset", line.get("offset", 0.0), lambda q: change("offset", number(q)), of=quantity)
    choice("frame", FRAMES, str(line.get("frame") or ""), partial(change, "frame"), of=quantity)


def _said(one: Any) -> str:
    why = f": {one.likeness:.2f} with {one.says}" if one.says else ""
    return f"{one.column}{why}{' (by its name)' if one.named and not one.says else ''}"


def _previewed(readings: Recordings, name: str, part: tuple[float, ...], mapping: dict[str, Any]) -> Any:
    from drift_drake.gap.logs.importing.importer import PERIOD
    from drift_drake.gap.logs.importing.preview import preview
    from drift_drake.gap.logs.screening.overlays import estimates, overlays, panels_of

    seen = readings.excerpt(name, *part)
    shown = (seen.start, seen.end) if math.isfinite(seen.end) else None
    found = preview(Path(name), seen.topics, mapping, *seen.own)
    length = mapping.get("wheelbase")
    length = length if isinstance(length, int | float) and length > 0.0 else None
    compared = overlays(found.pieces, PERIOD, length)
    return found, compared, panels_of(compared), estimates(found.pieces, PERIOD, length), shown
