"""Apply: the corrected vehicle file, what has changed in it, its replay, exports, and the next drive."""

import difflib
from pathlib import Path
from typing import Any

import numpy as np

from drift_drake.app import stages
from drift_drake.app.jobs import Jobs
from drift_drake.app.pages.diagnose import answer_of
from drift_drake.app.pages.figures import Chart
from drift_drake.app.pages.parts import address, box, comes_first, frame_of, run_button, saying, section, text
from drift_drake.app.project import Project
from drift_drake.app.recordings import Recordings
from drift_drake.car.log.table import UNITS
from drift_drake.view.colours import RUNS
from drift_drake.view.pages.charts import LOW, Line, Panel

PLANNED = ("delta_cmd", "tau_cmd", "v", "r", "beta")


def apply_page(project: Project, _readings: Recordings, jobs: Jobs, data: dict[str, Any]) -> None:
    """The page's content."""
    days = [day for day in project.days(data) if answer_of(project, day) is not None]
    if not days:
        comes_first("Diagnose a day first", "Diagnose")
    for day in days:
        answer = answer_of(project, day)
        stage = stages.apply(project, day, data)
        with section(f"Corrected by {day}"):
            run_button(stage, jobs, data, f"Apply {day}")
            if (project.folder / stage.outputs[0]).exists():
                _save(stage.outputs[0])
                _difference(project, stages.believed(data)[0], stage.outputs[0])
                text("h3", "Replay")
                names = project.names(day)
                for path in project.runs(day):
                    again = stages.replay(project, day, path.name, data)
                    name = path.name.split(".")[0]
                    run_button(again, jobs, data, f"Replay {names.get(name, name)}")
                    saying(again, data, "Errors of both cars")
                    if again.state(data) == "done":
                        frame_of(again.outputs[0], f"Replay of {path.name}")
        if answer is not None and len(answer.ambiguity) > 1:
            with section(f"The next drive after {day}"):
                text("p", "The drive that distinguishes best between what is still open.", "note")
                plan = stages.plan_next(project, day, data)
                run_button(plan, jobs, data, f"Plan after {day}")
                saying(plan, data, "What the drive is expected to bring")
                if plan.state(data) == "done":
                    _planned(project, plan.outputs[0])
    imported = [day for day in project.days(data) if project.runs(day)]
    if imported:
        with section("For other tools"):
            for day in imported:
                run_button(stages.export(project, day), jobs, data, f"Export {day} for Foxglove")


def _save(path: str) -> None:
    text("a", f"Save {path}", href=address(path), download=Path(path).name)


def _planned(project: Project, path: str) -> None:
    """The commands of the next drive, and what they are expected to lead to."""
    _save(path)
    table = np.genfromtxt(project.folder / path, delimiter=",", names=True)
    Chart([Panel(f"{name} [{UNITS[name]}]", [Line("", table["t"], table[name], RUNS[0])], LOW) for name in PLANNED],
          "The next drive")  # fmt: skip


def _difference(project: Project, before: str, after: str) -> None:
    """The lines of a vehicle file that are others than before."""
    old, new = ((project.folder / path).read_text(encoding="utf-8").splitlines() for path in (before, after))
    text("h3", f"{after} against {before}")
    with box("pre", "diff", aria_label=f"Difference of {after} and {before}"):
        for line in difflib.unified_diff(old, new, before, after, lineterm="", n=1):
            text("span", f"{line}\n", {"+": "plus", "-": "minus"}.get(line[:1], ""))
