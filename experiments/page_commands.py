"""Runs each command that a page of the documentation names, in a clean clone, and says which one fails.

    python -m experiments.page_commands                     # make commands
    python -m experiments.page_commands --seconds 3600 --pages docs/concepts.md
    python -m experiments.page_commands --matching "pictures|benchmark_mpc"

A command passes if it ends well and prints what the page shows below it. One that is still at work when its time is
over is interrupted: it is cut off, which says that it started and no more. What asks for recordings that are not
shipped, or for what another command makes in hours, is listed as not checked. A command of several pages is run once.
Written: results.json, report.md. Broken off, it goes on where it was (give --out); with more --seconds, what was cut
off is run again. The exit code is 1 where a command fails. Commands of `drift-drake` are run by `make test-slow`.
"""

import dataclasses
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Literal, NamedTuple

from diagrams.command import run_command
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.run_folder import is_done, make_run_folder, write_json, write_versions
from drift_drake.common.safe_files import write_text
from experiments.made import RunConfig, tabulated

ROOT = Path(__file__).parents[1]
FENCE = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
INDENTED = re.compile(r"^\n((?: {4}.*\n)+)", re.MULTILINE)
INLINE = re.compile(r"`(python -m [^`]+)`", re.DOTALL)
PLACEHOLDER = re.compile(r"(?:(?<=//)|(?<![\w./]))[A-Z]{3,}(?![\w.])")
MADE_BEFORE = re.compile(  # by another command, which takes longer than it is given, or a file of the reader's own
    r"\bruns/\S+: (?:no such file|has no \S+; make it with)|(?<![\w/])\w+\.yaml: cannot be read \(No such file"
)
UNFINISHED = re.compile(r"\.\.\.| \| ")  # of a command that is named, not given
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
WAITED = 20  # [s] for a command that is interrupted
TOLERANCE = 0.02  # of a number that is shown: other processors' last digits differ, and what follows from them

Verdict = Literal["passes", "cut off", "not checked", "fails"]


class FailingCommandsError(DriftDrakeError):
    """Some page names a command that fails or prints something else; the message lists the pages."""


class Command(NamedTuple):
    """A command and what the page shows below it."""

    page: str  # path from the root
    text: str
    shown: tuple[str, ...] = ()


class Result(NamedTuple):
    """What became of a command."""

    verdict: Verdict
    reason: str
    limit: float = 0.0  # [s] that it was given
    took: float = 0.0  # [s] of wall clock


@dataclasses.dataclass(frozen=True)
class PageCommandsConfig(RunConfig):
    """Which pages, for how long."""

    pages: tuple[str, ...] = ()
    """Paths from the root; all without."""
    matching: str = ""
    """Regular expression that is found in each command that is run; all without."""
    seconds: float = 120.0
    """That each command is given."""


def pages() -> list[Path]:
    """All pages: the documentation, and the results by date."""
    found = [*sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "experiments" / "results").glob("*.md"))]
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *found]


def commands_of(page: Path) -> list[Command]:
    """The commands `python -m ...` that a page names, each once, in its blocks and in its lines."""
    text, name = page.read_text(encoding="utf-8"), str(page.relative_to(ROOT))
    found: dict[str, Command] = {}
    outside = FENCE.sub("", text)
    for block in [block for _, block in FENCE.findall(text)] + INDENTED.findall(outside):
        for command in _of_block(name, block):
            if command.text not in found or command.shown:
                found[command.text] = command
    for line in INLINE.findall(outside):
        command = Command(name, " ".join(line.split()))
        found.setdefault(command.text, command)
    return [command for command in found.values() if not UNFINISHED.search(command.text)]


def _of_block(page: str, block: str) -> list[Command]:
    """Of a fenced block: lines that begin with $, with what is shown below each, or lines that are commands."""
    lines = block.replace("\\\n", " ").splitlines()
    prompted = any(line.lstrip().startswith("$ ") for line in lines)
    found: list[Command] = []
    shown = False
    for line in map(str.strip, lines):
        given = line.removeprefix("$ ") if not prompted or line.startswith("$ ") else ""
        if given.startswith("python -m "):
            found.append(Command(page, re.sub(r"\s+#.*", "", " ".join(given.split()))))
        shown = given.startswith("python -m ") if given else shown
        if prompted and not given and line and shown:
            found[-1] = found[-1]._replace(shown=(*found[-1].shown, line))
    return found


def differs(shown: str, printed: str) -> bool:
    """Whether a shown line is another one than a printed one: in its words, or in a number by more than 2 %."""
    if NUMBER.sub("#", " ".join(shown.split())) != NUMBER.sub("#", " ".join(printed.split())):
        return True
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True)
    return any(abs(float(a) - float(b)) > TOLERANCE * abs(float(a)) + 1e-12 for a, b in pairs)


def judged(command: Command, code: int | None, output: str, error: str) -> Result:
    """What a command's end says of its page; code: None where it was still working when its time was over."""
    if code is None:
        return Result("cut off", "interrupted when its time was over")
    last = error.strip().splitlines()[-1] if error.strip() else output.strip().splitlines()[-1:] or "no output"
    if code != 0:
        asked = [word for word in PLACEHOLDER.findall(command.text) if word in error]
        if code == 2 and (asked or MADE_BEFORE.search(error)):
            return Result("not checked", str(last))
        return Result("fails", f"exit code {code}: {last}")
    printed = output.splitlines()
    missing = [line for line in command.shown if all(differs(line, other) for other in printed)]
    return Result("fails", f"does not print: {missing[0]}") if missing else Result("passes", "")


def run(command: Command, folder: Path, seconds: float) -> Result:
    """Runs a command by a shell in a folder, all of its processes ended with it."""
    start = time.monotonic()
    return _run(command, folder, seconds)._replace(limit=seconds, took=round(time.monotonic() - start, 1))


def _run(command: Command, folder: Path, seconds: float) -> Result:
    environment = os.environ | {"PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    python = f'python() {{ "{sys.executable}" "$@"; }}; '
    process = subprocess.Popen(
        ["bash", "-c", python + command.text], cwd=folder, env=environment, text=True, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        output, error = process.communicate(timeout=seconds)
        return judged(command, process.returncode, output, error)
    except subprocess.TimeoutExpired:
        for sent in (signal.SIGINT, signal.SIGKILL):
            os.killpg(process.pid, sent)
            try:
                process.communicate(timeout=WAITED)
                break
            except subprocess.TimeoutExpired:
                continue
        return judged(command, None, "", "")


def report(results: dict[str, list[tuple[Command, Result]]]) -> str:
    """A row a page, the sum of all commands, each counted once, and those that do not pass."""
    kinds: tuple[Verdict, ...] = ("passes", "cut off", "not checked", "fails")
    rows: list[tuple[object, ...]] = []
    for page, found in results.items():
        rows.append((page, *(sum(result.verdict == kind for _, result in found) for kind in kinds)))
    once = {(command.text, command.shown): result for found in results.values() for command, result in found}
    counts = [sum(result.verdict == kind for result in once.values()) for kind in kinds]
    lines = [*tabulated(("page", *kinds), [*rows, (f"all, each once: {len(once)}", *counts)]), ""]
    for kind in ("fails", "not checked", "cut off"):
        of_kind = [
            (command, result) for found in results.values() for command, result in found if result.verdict == kind
        ]
        lines += [
            f"- {kind}: {command.page}: `{command.text}`: {result.reason} ({result.took:g} s of {result.limit:g} s)"
            for command, result in of_kind
        ]
    return "\n".join(lines) + "\n"


def main(config: PageCommandsConfig) -> None:
    """Clones, runs what the folder lacks and reports.

    Raises:
        FailingCommandsError: some command fails.
    """
    folder = make_run_folder("page_commands", config.out).resolve()
    clone = folder / "clone"
    if not clone.exists():
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
    write_versions(folder)
    file = folder / "results.json"
    done: dict[str, Result] = {}
    if is_done(file):
        done = {text: Result(**found) for text, found in json.loads(file.read_text()).items()}
    results: dict[str, list[tuple[Command, Result]]] = {}
    for command in _chosen(config):
        key = "\n".join([command.text, *command.shown])
        if key not in done or (done[key].verdict == "cut off" and done[key].limit < config.seconds):
            print(f"{command.page}: {command.text}", end=": ", flush=True)
            done[key] = run(command, clone, config.seconds)
            print(done[key].verdict, done[key].reason, flush=True)
            write_json(file, done)
        results.setdefault(command.page, []).append((command, done[key]))
    text = report(results)
    write_text(folder / "report.md", text)
    print(text)
    failing = [page for page, found in results.items() if any(result.verdict == "fails" for _, result in found)]
    if failing:
        raise FailingCommandsError(f"{', '.join(failing)}: a command there fails; see {folder}/report.md")


def _chosen(config: PageCommandsConfig) -> list[Command]:
    """The commands of the pages that are asked for, those that match."""
    chosen = [page for page in pages() if not config.pages or str(page.relative_to(ROOT)) in config.pages]
    found = [command for page in chosen for command in commands_of(page)]
    return [command for command in found if re.search(config.matching, command.text)]


if __name__ == "__main__":
    run_command(main, PageCommandsConfig)
