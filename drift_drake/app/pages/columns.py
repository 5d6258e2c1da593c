"""Columns: which column is which quantity, laid over what others say of it; what looks wrong, and one click to fix it."""

from functools import partial
from pathlib import Path
from typing import Any

import yaml
from nicegui import ui

from drift_drake.app import stages
from drift_drake.app.jobs import Jobs
from drift_drake.app.mapping_edits import edit, first_mapping, look_command, set_global
from drift_drake.app.pages.figures import MEASURED, RUNS, Chart
from drift_drake.app.pages.parts import (
    box,
    button,
    choice,
    field,
    later,
    number,
    quietly,
    run_button,
    saying,
    section,
    text,
)
from drift_drake.app.project import Project
from drift_drake.app.readings import Readings
from drift_drake.common.errors import DriftDrakeError
from drift_drake.gap.logs.wording.conversion import units_of

MEANINGS = {
    "r": "yaw rate", "v": "speed", "delta_cmd": "angle of the road wheels", "beta": "sideslip: course less heading",
    "vx": "speed ahead (in place of v)", "vy": "speed to the left", "omega_r": "speed of the rear wheels",
    "ax": "acceleration ahead", "ay": "acceleration to the left", "tau_cmd": "torque of the engine",
    "psi": "heading", "x": "position", "y": "position", "latitude": "position", "longitude": "position",
    "course": "direction of travel",
}  # fmt: skip
NEEDED = ("r", "v", "delta_cmd")
FRAMES = {"": "as the file's", "iso8855": "left is positive", "ned": "right is positive (ned)", "sae": "right is positive (sae)"}
SIGNS = {"1": "+", "-1": "- (turned)"}
LOOKED_AT = 300.0  # [s] of a recording, that what is said of the columns at once is judged by


def columns_page(project: Project, readings: Readings, jobs: Jobs, data: dict[str, Any]) -> None:
    """The page's content."""
    names = [name for day in project.days(data).values() for name in day]
    if not names:
        text("p", "Give a recording a day first (Logs). Folders of runs are in the log format already.", "warning")
        return
    current = {"name": names[0]}
    if project.mapping() is None:
        _first(project, readings, names[0])
        return
    with section("Recording", "tight"):
        choice("Shown below", {name: name for name in names}, names[0], lambda name: _show_other(current, name, rows, seen))
    seen = _seen(project, readings, current)
    rows = _rows(project, readings, current, seen)
    seen()
    rows()
    with section("Import"):
        text("p", "Each day becomes a folder of runs at 100 Hz, with what was estimated and what looks wrong.", "note")
        for day, recordings in project.days(data).items():
            if recordings:
                text("h3", day)
                stage = stages.import_day(project, day, data)
                run_button(stage, jobs, data, f"Import {day}")
                saying(stage, data, "What the import says")
    text("p", "Next: Car.", "note")


def _show_other(current: dict[str, str], name: str, *parts: Any) -> None:
    current["name"] = name
    for part in parts:
        part.refresh()


def _first(project: Project, readings: Readings, name: str) -> None:
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


def _rows(project: Project, readings: Readings, current: dict[str, str], seen: Any) -> Any:
    """A row a quantity."""

    @ui.refreshable
    def drawn() -> None:
        with section("Quantities"):
            place = box("div")

        async def shown() -> None:
            mapping = project.mapping() or {}
            signals = mapping.get("signals", {})
            signals = signals if isinstance(signals, dict) else {}
            ranked = await quietly(_ranked, readings, current["name"], signals)
            with place:
                if isinstance(ranked, str):
                    text("p", ranked, "refusal")
                    return
                _globals(project, mapping, seen)
                for quantity in MEANINGS:
                    _row(project, quantity, signals.get(quantity), ranked.get(quantity, []), mapping, drawn, seen)

        later(shown)

    return drawn


def _ranked(readings: Readings, name: str, signals: dict[str, Any]) -> Any:
    from drift_drake.gap.logs.importing.candidates import ranked

    try:
        return ranked(readings.topics(name), signals)
    except DriftDrakeError as error:
        return str(error)


def _globals(project: Project, mapping: dict[str, Any], seen: Any) -> None:
    """What is said of the car and of all columns."""

    def told(key: str, value: Any) -> None:
        project.change_mapping(lambda data: set_global(data, key, value))
        seen.refresh()

    with box("div", "fields"):
        frames = {name: words for name, words in FRAMES.items() if name}
        choice("Frame of the file", frames, str(mapping.get("frame", "iso8855")), partial(told, "frame"))
        field("wheelbase", mapping.get("wheelbase"), lambda q: told("wheelbase", number(q)), unit="m", min="0")
        point = mapping.get("measured_point") or [None, None]
        for k, words in enumerate(("speed is measured ahead by", "and to the left by")):
            field(words, point[k] if len(point) > k else None,
                  lambda q, k=k: told("measured_point", (k, number(q))), unit="m")  # fmt: skip
    text("p", "A wheelbase lets the steering ratio be judged. Speed is measured relative to the centre of gravity.", "note")


def _row(
    project: Project, quantity: str, line: Any, candidates: list[Any], mapping: dict[str, Any], rows: Any, seen: Any
) -> None:
    line = line if isinstance(line, dict) else {}
    formula = mapping.get("formulas", {}).get(quantity) if isinstance(mapping.get("formulas"), dict) else None

    def change(key: str, value: Any, again: bool = False) -> None:
        project.change_mapping(lambda data: edit(data, quantity, key, value, candidates))
        (rows if again else seen).refresh()
        if again:
            seen.refresh()

    with box("div", "quantity", role="group", aria_label=f"{quantity}, {MEANINGS[quantity]}"):
        with box("p"):
            text("b", f"{quantity}{' (needed)' if quantity in NEEDED else ''}")
            text("span", MEANINGS[quantity])
        options = {"": f"= {formula}" if formula else "none"}
        options |= {one.column: _said(one) for one in candidates}
        column = str(line.get("column", ""))
        if column and column not in options:
            options[column] = f"{column} (not in this recording)"
        choice(f"column of {quantity}", options, column, lambda name: change("column", name, True)).classes("wider")
        if not column:
            return
        units = dict.fromkeys([str(line.get("unit", "?")), *units_of(quantity)])
        choice(f"unit of {quantity}", {unit: unit for unit in units}, str(line.get("unit", "?")), partial(change, "unit"))
        sign = "-1" if line.get("sign", 1) == -1 else "1"
        choice(f"sign of {quantity}", SIGNS, sign, lambda q: change("sign", float(q)))
        if quantity == "delta_cmd":
            scale = line.get("scale", 1.0)
            ratio = 1.0 / scale if isinstance(scale, int | float) and scale else 1.0
            field("steering ratio", float(f"{ratio:.6g}"), lambda q: change("ratio", number(q)))
        elif quantity == "omega_r" and line.get("radius") is not None:
            field("wheel radius", line["radius"], lambda q: change("radius", number(q)), unit="m")
        else:
            field(f"factor of {quantity}", line.get("scale", 1.0), lambda q: change("scale", number(q)))
        field(f"offset of {quantity}", line.get("offset", 0.0), lambda q: change("offset", number(q)))
        choice(f"frame of {quantity}", FRAMES, str(line.get("frame") or ""), partial(change, "frame"))


def _said(one: Any) -> str:
    why = f": {one.likeness:.2f} with {one.says}" if one.says else ""
    return f"{one.column}{why}{' (by its name)' if one.named and not one.says else ''}"


def _seen(project: Project, readings: Readings, current: dict[str, str]) -> Any:
    """What looks wrong, and the overlays."""

    @ui.refreshable
    def drawn() -> None:
        with section("What the columns say of each other"):
            place = box("div", aria_live="polite")
            with place:
                text("p", "is being compared ...", "note")

        async def shown() -> None:
            mapping = project.mapping() or {}
            found = await quietly(_previewed, readings, current["name"], mapping)
            place.clear()
            with place:
                if isinstance(found, str):
                    text("p", found, "refusal")
                    return
                _remarks(project, *found, drawn)

        later(shown)

    return drawn


def _previewed(readings: Readings, name: str, mapping: dict[str, Any]) -> Any:
    from drift_drake.gap.logs.importing.importer import PERIOD
    from drift_drake.gap.logs.importing.preview import preview
    from drift_drake.gap.logs.screening.overlays import overlays

    try:
        found = preview(Path(name), readings.topics(name), mapping, end=LOOKED_AT)
        length = mapping.get("wheelbase")
        return found, overlays(found.pieces, PERIOD, length if isinstance(length, int | float) else None)
    except DriftDrakeError as error:
        return str(error)


def _remarks(project: Project, found: Any, overlays: list[Any], seen: Any) -> None:
    if found.refused:
        with box("div", "refusal", role="alert"):
            text("p", f"The import would be refused: {found.refused}")
    for remark in found.remarks:
        with box("div", "warning"):
            text("p", remark.sentence)
            with box("div", "run"):
                for fix in remark.fixes:
                    button(fix.label[0].upper() + fix.label[1:], partial(_fixed, project, fix))
    if not found.refused and not found.remarks and found.pieces:
        text("p", "Signs and units: nothing looks wrong.", "verdict")
    if found.unchecked:
        text("p", f"No other column can check {', '.join(found.unchecked)}.", "note")
    for one in overlays:
        text("h3", f"{one.column} against {one.against}")
        text("p", f"correlation {one.likeness:.3f}, {one.column} is {one.gain:.3g} times as large", "note")
        lines = [(one.column, one.t, one.measured, MEASURED), (one.against, one.t, one.expected, RUNS[1])]
        Chart([(f"{one.column} [{one.unit}]", lines)], f"{one.column} against {one.against}", 180)


def _fixed(project: Project, fix: Any) -> None:
    def put(data: dict[str, Any]) -> None:
        data.clear()
        data.update(yaml.safe_load(yaml.safe_dump(fix.mapping)))

    project.change_mapping(put)
