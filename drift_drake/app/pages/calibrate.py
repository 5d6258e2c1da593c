"""Calibrate: the car's parameters relative to the first guess, and every run as both cars predict it."""

from functools import partial
from typing import Any, get_args

from drift_drake.app import stages
from drift_drake.app.jobs import Jobs
from drift_drake.app.looks import predicted
from drift_drake.app.pages.figures import Chart
from drift_drake.app.pages.parts import (
    box,
    button,
    choice,
    frame_of,
    next_step,
    or_why,
    run_button,
    saying,
    section,
    table,
    text,
)
from drift_drake.app.pages.validation import validation_part
from drift_drake.app.project import CALIBRATED, CALIBRATION, CALIBRATION_REPORT, Project
from drift_drake.app.recordings import Recordings
from drift_drake.common.errors import DriftDrakeError, significant
from drift_drake.common.plain_files import read_json
from drift_drake.gap.identification.options import AskedKind, Criterion

HEAD = ("parameter", "first guess", "estimate", "95 % interval", "note")
KINDS = {"known": "held by its tolerance", "unseen": "kept: not shown by these drives"}


def calibrate_page(project: Project, _readings: Recordings, jobs: Jobs, data: dict[str, Any]) -> None:
    """The page's content."""
    stage = stages.calibrate(project, data)
    validation_part(project, data)
    with section("Calibration"):
        days = stages.baseline(project, data)
        text("p", f"On {', '.join(days)} (chosen under Logs)." if days else "No day yet (Logs).", "note")
        with box("div", "fields"):
            for key, label, kinds in (("car", "kind of car", AskedKind), ("criterion", "judged by", Criterion)):
                options = {"": "auto", **{one: one for one in get_args(kinds) if one != "auto"}}
                choice(label, options, str(data["options"].get(key, "")), partial(project.set_option, key))
        run_button(stage, jobs, data, "Calibrate")
        text("p", "It takes minutes. It can be cancelled; then, or if the workbench is closed, what it had computed is "
             "lost and all files stay as they were.", "note")  # fmt: skip
        saying(stage, data, "What the calibration says")
    if not all((project.folder / path).exists() for path in stage.outputs):
        return
    _estimates(project)
    with section("Measured against both cars"):
        text("p", "The simulated cars are put back onto the real one every second. Drag in the picture to zoom, double "
             "click to see all.", "note")  # fmt: skip
        fitted, buttons, place = stages.baseline(project, data), box("div"), box("div")
        for day in project.days(data):
            names = project.names(day)
            with buttons, box("div", "run"):
                text("span", f"{day}, {'calibrated on' if day in fitted else 'for validation: not calibrated on'}:")
                for path in project.runs(day):
                    name = path.name.split(".")[0]
                    button(names.get(name, name), partial(_predict, project, str(path), data, place),
                           label=f"Show {path}")  # fmt: skip
    with section("Report"):
        frame_of(CALIBRATION_REPORT, "Report of the calibration")
    next_step("Diagnose")


def _estimates(project: Project) -> None:
    try:
        found = read_json(project.folder / CALIBRATION, DriftDrakeError, "calibrate again")
        rows = [
            [name, *(_number(one[key], one["unit"]) for key in ("start", "estimate")),
             f"{_number(one['low'])} to {_number(one['high'])}", KINDS.get(one["kind"], "")]
            for name, one in found["parameters"].items()
        ]  # fmt: skip
    except (DriftDrakeError, KeyError, TypeError) as error:
        text("p", f"{CALIBRATION}: {error}", "refusal")
        return
    with section("Estimates"):
        table(["parameter", "first guess", "estimate", "95 % interval", "note"], rows, "Estimates and the first guess")


def _number(value: float | None, unit: str = "") -> str:
    return "" if value is None else f"{significant(value, 4)} {unit if unit != '-' else ''}".strip()


async def _predict(project: Project, path: str, data: dict[str, Any], place: Any) -> None:
    place.clear()
    with place:
        text("p", f"{path} is being simulated ...", "note")
    cars = project.folder / stages.first_guess(data), project.folder / CALIBRATED
    found = await or_why(predicted, project.folder / path, *cars)
    place.clear()
    with place:
        if isinstance(found, str):
            text("p", found, "refusal", role="alert")
            return
        text("h3", path)
        Chart(found.panels, f"{path}: measured and predicted")
        text("pre", found.sentence, "wide")
