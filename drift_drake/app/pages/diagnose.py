"""Diagnose: all days in one table, and of each what is left over, what it says, and its report."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from drift_drake.app import stages
from drift_drake.app.jobs import Jobs
from drift_drake.app.pages.figures import drawn
from drift_drake.app.pages.parts import box, comes_first, frame_of, next_step, run_button, section, table, text, tick
from drift_drake.app.project import CALIBRATED, Project
from drift_drake.app.recordings import Recordings
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.common.errors import DriftDrakeError, significant
from drift_drake.gap.diagnosis.answers.answer import Answer, read_answer
from drift_drake.view.colours import REFERENCE, RUNS
from drift_drake.view.pages.charts import Figure, finished

LABEL = 14  # characters of a day's name under the trend
HEAD = ("day", "verdict", "what", "size (95 %)", "probability", "errors removed", "state")


def diagnose_page(project: Project, _readings: Recordings, jobs: Jobs, data: dict[str, Any]) -> None:
    """The page's content."""
    days = [day for day in project.days(data) if project.runs(day)]
    if not days:
        comes_first("Import a day first", "Columns")
        return
    with section("All days"):
        answers = {day: answer for day in days if (answer := answer_of(project, day)) is not None}
        if answers:
            rows = [
                _row(day, answer, stages.diagnose(project, day, data).state(data)) for day, answer in answers.items()
            ]
            table(HEAD, rows, "What was found on each day")
            for name in dict.fromkeys(name for answer in answers.values() for name in answer.magnitudes):
                if len(answers) > 1 and name in CATALOGUE:
                    drawn(trend(name, answers), f"{name} by day")
        else:
            text("p", "No day has been diagnosed yet.", "note")
        as_it_is = bool(data["options"].get("as_it_is"))
        vehicle = stages.first_guess(data)
        tick(
            f"relative to {vehicle} as it is, in place of {CALIBRATED}",
            as_it_is,
            partial(project.set_option, "as_it_is"),
        )
        _effects(project, data)
    for day in days:
        with section(day):
            stage = stages.diagnose(project, day, data)
            run_button(stage, jobs, data, f"Diagnose {day}")
            if day in answers and stage.state(data) in ("done", "stale"):
                _answer(answers[day])
                with box("details") as details:
                    text("summary", f"Report of {day}")
                    frame_of(stage.outputs[1], f"Report of {day}")
                if len(answers) == 1:
                    details.props["open"] = True
    next_step("Apply")


def answer_of(project: Project, day: str) -> Answer | None:
    """What was found on a day, None where nothing was asked or the file is none."""
    path = project.folder / "answers" / f"{day}.json"
    try:
        return read_answer(path) if path.exists() else None
    except DriftDrakeError:
        return None


def trend(name: str, answers: Mapping[str, Answer]) -> Figure:
    """An effect's magnitude by day with its 95 % interval; where it was not named, up to what would have been."""
    data: list[Figure] = []
    days = list(answers)
    for day, answer in answers.items():
        found, limit = answer.magnitudes.get(name), answer.details.get("detection", {}).get(name, {}).get("least")
        if found is None and not isinstance(limit, float):
            continue
        at, above, below = (0.0, limit, limit) if found is None else (
            found.estimate, found.high - found.estimate, found.estimate - found.low)  # fmt: skip
        colour = REFERENCE if found is None else RUNS[0]
        data.append({
            "x": [day], "y": [at], "type": "scatter", "mode": "markers", "name": "", "marker": {
                "size": 8, "color": colour, "symbol": "circle-open" if found is None else "circle"},
            "error_y": {"type": "data", "array": [above], "arrayminus": [below], "symmetric": False, "color": colour},
            "text": ["not named: below what these logs show" if found is None else "named"],
        })  # fmt: skip
    unit = CATALOGUE[name].unit
    layout = {
        "xaxis": {"type": "category", "automargin": True, "tickvals": days, "ticktext": [_short(day) for day in days]},
        "yaxis": {"title": {"text": f"{name}{'' if unit == '-' else f' [{unit}]'}"}},
    }
    return finished({"data": data, "layout": layout}, 170, "closest")


def _short(day: str) -> str:
    return day if len(day) <= LABEL else f"{day[: LABEL - 1]}\N{HORIZONTAL ELLIPSIS}"


def _row(day: str, answer: Answer, state: str) -> list[str]:
    sizes = [
        f"{significant(q.estimate, 3)} ({significant(q.low, 3)} to {significant(q.high, 3)}){CATALOGUE[name].suffix}"
        for name, q in answer.magnitudes.items()
        if name in CATALOGUE
    ]
    probability = f"{answer.posterior.get('+'.join(sorted(answer.causes)) or answer.verdict, 0.0):.2f}"
    removed = f"{100.0 * answer.reduction.estimate:.0f} %" if answer.causes else ""
    return [day, answer.verdict, ", ".join(answer.causes), "; ".join(sizes), probability, removed, stages.STATES[state]]


def left_over_text(left: Mapping[str, Any]) -> str:
    """What `details.left_over` says, and how probable it is where that is no more than one half."""
    probability, like = left.get("probability", 1.0), left.get("like")
    begins = "Left over" if probability > 0.5 else f"Perhaps left over ({probability:.2f})"
    return f"{begins}: something that no effect of the catalogue explains{f'; it acts like {like}' if like else ''}."


def _answer(answer: Answer) -> None:
    """What is left over first, then the sentence and its warnings."""
    if left := answer.details.get("left_over"):
        text("p", left_over_text(left if isinstance(left, dict) else {}), "warning")
    text("p", answer.sentence(), "verdict" if answer.verdict == "none" else "verdict not")
    for warning in answer.warnings:
        text("p", warning, "warning")


def _effects(project: Project, data: dict[str, Any]) -> None:
    """Effects to consider: all, unless some are chosen."""
    chosen = [name for name in data["options"].get("effects") or [] if name in CATALOGUE]
    with box("details") as details:
        if chosen:
            details.props["open"] = True
        text("summary", f"Effects that are considered: {', '.join(chosen) if chosen else 'all'}")
        with box("div", "form"):
            for name in CATALOGUE:
                tick(name, name in chosen, partial(_consider, project, name))


def _consider(project: Project, name: str, on: bool) -> None:
    with project.changing() as data:
        kept = [one for one in data["options"].get("effects") or [] if one != name]
        data["options"]["effects"] = [*kept, name] if on else kept
