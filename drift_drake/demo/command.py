"""`drift-drake demo`: the commands that a user would give, one after the other, on the sample log."""

import contextlib
import dataclasses
import shlex
import shutil
from importlib.resources import as_file, files
from pathlib import Path

import tyro

from drift_drake.errors import DriftDrakeError, OutputError
from drift_drake.safe_files import try_folder, try_outputs
from drift_drake.standard_output import said_to, write_results

SAMPLE_LOG = files("drift_drake") / "data" / "sample_log"
PAGES = {"report": "report.html", "replay": "replay.html", "drive": "drive/replay.html"}


class DemoError(DriftDrakeError, RuntimeError):
    """A command of the demo failed; it has said why."""


@dataclasses.dataclass(frozen=True)
class Demo:
    """Diagnose the sample log, correct its simulator, and drift a car: some minutes, one folder.

    drift-drake demo

    Four simulated runs of a car with an effect that its vehicle file lacks are diagnosed, the corrected vehicle is
    replayed beside them, and the car drifts a figure-8 under a model that learns as it drives. Each command is shown
    before it runs, to be given again with logs and a vehicle file of your own.
    """

    out: tyro.conf.Positional[Path] = Path("drift-drake-demo")
    """Folder for all that is written; there may be none yet."""
    json: Path | None = None
    """Where to write which commands were run and which pages they made, as JSON (-: standard output)."""


def run_demo(command: Demo) -> None:
    """`drift-drake demo`.

    Raises:
        OutputError: the folder is there already, or cannot be made.
        DemoError: one of its commands failed.
    """
    from drift_drake.cli import main

    if command.out.exists():
        raise OutputError(f"{command.out}: is there already; give the demo a new folder")
    try_outputs({"--json": command.json})
    try_folder(command.out, "OUT")
    with as_file(SAMPLE_LOG) as log:
        shutil.copytree(log, command.out / "sample", ignore=shutil.ignore_patterns("truth.json"))
    given = commands(command.out)
    with contextlib.redirect_stdout(said_to(command.json)):
        for words in given:
            print(f"\n$ drift-drake {shlex.join(words)}", flush=True)
            if main(words) != 0:
                raise DemoError(f"the demo ended at 'drift-drake {words[0]}'; what it has written is in {command.out}")
        pages = {name: command.out / page for name, page in PAGES.items()}
        print(f"\nOpen {pages['report']} (the diagnosis), {pages['replay']} (the log beside both simulators) and "
              f"{pages['drive']} (the drift).")  # fmt: skip
    write_results(command.json, {"out": command.out, "commands": given, "pages": pages})


def commands(folder: Path) -> list[list[str]]:
    """What the demo runs, as words of a command line."""
    car, corrected, answer = (str(folder / name) for name in ("car.yaml", "corrected.yaml", "answer.json"))
    sample, report, replay = (str(folder / name) for name in ("sample", "report.html", "replay.html"))
    log = str(folder / "sample" / "run_0.csv.gz")
    return [
        ["init", car],
        ["diagnose", sample, "--vehicle", car, "--json", answer, "--report", report],
        ["apply", answer, "--vehicle", car, "--out", corrected],
        ["replay", log, "--vehicle", car, "--corrected", corrected, "--html", replay],
        ["drive", "figure_8", "--vehicle", corrected, "--model", "online", "--out", str(folder / "drive")],
    ]
