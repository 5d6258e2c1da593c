"""The steps of a project: of each the command, the files that it reads and writes, and whether it has to be run."""

import json
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from drift_drake.app.project import CALIBRATED, CALIBRATION, CALIBRATION_REPORT, CAR, Project
from drift_drake.car.log.table import IMPORT_REPORT

DAY = re.compile(r"[^\W_][\w .-]{0,39}")  # what a day may be called: it is a folder's name
STATES = {
    "none": "not run yet", "running": "running", "done": "done", "stale": "out of date, run it again",
    "refused": "refused", "cancelled": "cancelled",
}  # fmt: skip


@dataclass(frozen=True)
class Stage:
    """A step: its command's words, and its inputs and outputs as paths within the folder."""

    project: Project
    name: str
    title: str
    words: list[str]
    inputs: list[str]
    outputs: list[str]
    refused: Callable[[], str | None] = field(default=lambda: None)
    replaces: str = ""  # a folder that the command makes anew
    rests_on: "Callable[[], list[Stage]]" = field(default=list)  # steps whose outputs it reads

    def command(self) -> str:
        """What gives the same files in a terminal, from within the folder."""
        return shlex.join(["drift-drake", *self.words])

    def digest(self) -> str:
        """Of all that the outputs depend on."""
        return self.project.digest(self.inputs, self.words)

    def state(self, data: Mapping[str, Any]) -> str:
        """One of `STATES`, by what the project file holds."""
        record = data["steps"].get(self.name)
        if not isinstance(record, dict):
            return "none"
        ended = str(record.get("ended", "none"))
        if ended == "done" and not all((self.project.folder / path).exists() for path in self.outputs):
            return "none"
        if ended == "running":
            return ended
        if record.get("inputs") != self.digest() or ended not in STATES:
            return "stale"
        return ended if ended != "done" or all(one.current(data) for one in self.rests_on()) else "stale"

    def current(self, data: Mapping[str, Any]) -> bool:
        """Whether the outputs are there, and of what there is now, all the way back."""
        record = data["steps"].get(self.name)
        there = isinstance(record, dict) and all((self.project.folder / path).exists() for path in self.outputs)
        return there and good(record) == self.digest() and all(one.current(data) for one in self.rests_on())

    def said(self, data: Mapping[str, Any]) -> str:
        """What the command said when it was last run."""
        record = data["steps"].get(self.name)
        return str(record.get("said", "")) if isinstance(record, dict) else ""

    def stamps(self) -> list[int | None]:
        """When each output was written last."""
        paths = [self.project.folder / path for path in self.outputs]
        return [path.stat().st_mtime_ns if path.exists() else None for path in paths]

    @property
    def written(self) -> list[str]:
        """What the command makes anew, or writes over."""
        return [self.replaces] if self.replaces else self.outputs


def good(record: Mapping[str, Any]) -> Any:
    """The digest of the inputs that a step's outputs are of, by its record; None where there are none."""
    return record.get("inputs") if record.get("ended") == "done" else record.get("good")


def import_day(project: Project, day: str, data: dict[str, Any]) -> Stage:
    """A day's recordings to runs."""
    recordings, given, out = project.days(data).get(day, []), project.day(day, data), f"logs/{day}"
    mapping = project.mapping_of(day, data)
    words = ["import", *recordings, "--mapping", mapping, "--out", out]
    for name in ("start", "end"):
        if given.get(name) is not None:
            words += [f"--{name}", f"{given[name]:g}"]
    return Stage(project, f"import {day}", f"the import of {day}", words, [*recordings, mapping],
                 [f"{out}/{IMPORT_REPORT}"], replaces=out)  # fmt: skip


def first_guess(data: Mapping[str, Any]) -> str:
    """The vehicle file that a calibration begins with: the form's, or one of the folder."""
    return str(data["options"].get("vehicle") or CAR)


def check_day(project: Project, day: str, data: dict[str, Any]) -> Stage:
    """Whether a day is good enough to calibrate on."""
    out = f"check/{day}.json"
    car = first_guess(data)
    words = ["check", f"logs/{day}", "--vehicle", car, "--for-calibration", "--json", out]
    return Stage(project, f"check {day}", f"the check of {day}", words, [*_logs(project, day), car], [out],
                 lambda: _there(project, car, day), rests_on=lambda: _imported(project, [day], data))  # fmt: skip


def baseline(project: Project, data: dict[str, Any]) -> list[str]:
    """Days that a car is calibrated on: those that were chosen, else the first."""
    days = list(project.days(data))
    return [day for day in days if project.day(day, data).get("baseline")] or days[:1]


def validation(project: Project, data: dict[str, Any]) -> list[str]:
    """Runs of the baseline's days, and stretches of them, that nothing is fitted to (`identify --validation`)."""
    days = baseline(project, data)
    return [f"{day}/{one}" if len(days) > 1 else str(one)
            for day in days for one in project.day(day, data).get("validation") or []]  # fmt: skip


def calibrate(project: Project, data: dict[str, Any]) -> Stage:
    """The calibration on the baseline's days."""
    days, options = baseline(project, data), data["options"]
    logs = [f"logs/{day}" for day in days]
    words = ["identify", *logs, "--vehicle", first_guess(data), "--out", CALIBRATED, "--json", CALIBRATION]
    words += ["--report", CALIBRATION_REPORT]
    words += [word for name in ("criterion", "car") if options.get(name) for word in (f"--{name}", str(options[name]))]
    kept = validation(project, data)
    words += ["--validation", *kept] if kept else []

    def refused() -> str | None:
        now = project.read()
        open_ = [day for day in days if not passed(project, day, now)]
        return f"check first whether {', '.join(open_) or 'a day'} can be calibrated on" if open_ or not days else None

    inputs = [path for day in days for path in _logs(project, day)] + [first_guess(data)]
    return Stage(project, "calibrate", "the calibration", words, inputs,
                 [CALIBRATED, CALIBRATION, CALIBRATION_REPORT], refused,
                 rests_on=lambda: _imported(project, days, data))  # fmt: skip


def believed(data: dict[str, Any]) -> tuple[str, list[str]]:
    """The vehicle file that days are diagnosed relative to, and its calibration's options."""
    as_it_is = bool(data["options"].get("as_it_is"))
    return (first_guess(data), []) if as_it_is else (CALIBRATED, ["--calibration", CALIBRATION])


def diagnose(project: Project, day: str, data: dict[str, Any]) -> Stage:
    """A day's diagnosis."""
    vehicle, trust = believed(data)
    outputs = [f"answers/{day}.json", f"answers/{day}.html"]
    words = ["diagnose", f"logs/{day}", "--vehicle", vehicle, *trust, "--json", outputs[0], "--report", outputs[1]]
    words += ["--effects", *data["options"]["effects"]] if data["options"].get("effects") else []

    def refused() -> str | None:
        now = project.read()
        if (why := _there(project, vehicle, day)) is not None:
            return why
        if vehicle == CALIBRATED and not calibrate(project, now).current(now):
            return f"calibrate the car first (the calibration: {STATES[calibrate(project, now).state(now)]})"
        return None

    def rests_on() -> list[Stage]:
        return _imported(project, [day], data) + ([calibrate(project, data)] if vehicle == CALIBRATED else [])

    return Stage(project, f"diagnose {day}", f"the diagnosis of {day}", words,
                 [*_logs(project, day), vehicle, *trust[1:]], outputs, refused, rests_on=rests_on)  # fmt: skip


def apply(project: Project, day: str, data: dict[str, Any]) -> Stage:
    """The vehicle file corrected by a day's answer."""
    vehicle, answer, out = believed(data)[0], f"answers/{day}.json", f"corrected/{day}.yaml"
    words = ["apply", answer, "--vehicle", vehicle, "--out", out]
    return Stage(project, f"apply {day}", f"the correction by {day}", words, [answer, vehicle], [out],
                 lambda: _done(diagnose(project, day, project.read())),
                 rests_on=lambda: [diagnose(project, day, data)])  # fmt: skip


def replay(project: Project, day: str, run: str, data: dict[str, Any]) -> Stage:
    """The 3D replay of a run with both cars."""
    vehicle, corrected = believed(data)[0], f"corrected/{day}.yaml"
    log, out = f"logs/{day}/{run}", f"replays/{day} {run.split('.')[0]}.html"
    words = ["replay", log, "--vehicle", vehicle, "--corrected", corrected, "--html", out]
    return Stage(project, f"replay {day} {run}", "the replay", words, [log, vehicle, corrected], [out],
                 lambda: _done(apply(project, day, project.read())),
                 rests_on=lambda: [apply(project, day, data)])  # fmt: skip


def export(project: Project, day: str) -> Stage:
    """A day's runs for Foxglove."""
    out = f"foxglove/{day}"
    words = ["export", f"logs/{day}", "--format", "mcap", "--out", out]
    return Stage(project, f"export {day}", "the export", words, _logs(project, day), [out], replaces=out,
                 rests_on=lambda: _imported(project, [day], project.read()))  # fmt: skip


def plan_next(project: Project, day: str, data: dict[str, Any]) -> Stage:
    """The drive that distinguishes what a day's answer leaves open."""
    vehicle, answer, out = believed(data)[0], f"answers/{day}.json", f"plans/{day}.csv"
    words = ["plan-next", answer, "--vehicle", vehicle, "--out", out]
    return Stage(project, f"plan {day}", "the plan of the next drive", words, [answer, vehicle], [out],
                 lambda: _done(diagnose(project, day, project.read())),
                 rests_on=lambda: [diagnose(project, day, data)])  # fmt: skip


def passed(project: Project, day: str, data: dict[str, Any]) -> bool:
    """Whether a day may be calibrated on: its check of these inputs said so, or somebody has taken it nevertheless."""
    stage = check_day(project, day, data)
    if not stage.current(data):
        return False
    return bool(checked(project, day)["for_calibration"]["good_enough"]) or accepted(project, day, data)


def accepted(project: Project, day: str, data: dict[str, Any]) -> bool:
    """Whether somebody has taken these very logs, of which the check said that they are not good enough."""
    return bool(project.day(day, data).get("accepted") == check_day(project, day, data).digest())


def checked(project: Project, day: str) -> dict[str, Any]:
    """What a day's check wrote."""
    return dict(json.loads((project.folder / f"check/{day}.json").read_text(encoding="utf-8")))


def _imported(project: Project, days: Sequence[str], data: dict[str, Any]) -> list[Stage]:
    """Imports of days, but for runs that were not imported here."""
    stages = [import_day(project, day, data) for day in days if project.days(data).get(day)]
    return [stage for stage in stages if stage.name in data["steps"]]


def _logs(project: Project, day: str) -> list[str]:
    paths = [str(path) for path in project.runs(day)]
    report = f"logs/{day}/{IMPORT_REPORT}"
    return paths + ([report] if (project.folder / report).exists() else [])


def _there(project: Project, vehicle: str, day: str) -> str | None:
    if not project.runs(day):
        return f"import {day} first"
    return None if (project.folder / vehicle).exists() else f"there is no {vehicle} yet; describe the car first"


def _done(stage: Stage) -> str | None:
    data = stage.project.read()
    return None if stage.current(data) else f"{stage.title} comes first ({STATES[stage.state(data)]})"
