"""How an experiment begins its run folder, and ends it: with a report of tables, and below them when, where, by which
version and command they were made."""

import dataclasses
import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import tyro

from drift_drake.common.executors import ExecutorConfig
from drift_drake.common.run_folder import machine, make_run_folder, write_json, write_versions
from drift_drake.common.safe_files import write_text

ROOT = Path(__file__).parents[1]
DRAWN = ("population", "drives_seed", "vehicle_seed", "seed", "first", "count", "tuned", "tuned_count", "vehicles",
         "noise_seeds", "loops")  # fmt: skip
"""Fields of a config that say which vehicles and seeds were taken."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunConfig:
    """What every experiment with a run folder is asked."""

    out: Path | None = None
    """Folder for the results, runs/NAME-DATE-TIME without; an experiment that can be broken off goes on in its own."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SpreadConfig:
    """What every experiment is asked whose jobs run in several processes."""

    run_on: Annotated[ExecutorConfig, tyro.conf.arg(name="")] = dataclasses.field(default_factory=ExecutorConfig)


def begun(name: str, config: RunConfig) -> Path:
    """The run folder `config.out`, or a new one of a name, with config.json and versions.json."""
    folder = make_run_folder(name, config.out)
    write_json(folder / "config.json", config)
    write_versions(folder)
    return folder


def write_report(folder: Path, text: str, config: Any) -> None:
    """Writes report.md, to be pasted into a page as it is, and prints its text and the folder.

    Args:
        text: Markdown; config: the dataclass that the run was made from.
    """
    write_text(folder / "report.md", f"{text.rstrip()}\n\n{made(config)}\n")
    print(f"{text}\nresults in {folder}")


def tabulated(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """The lines of a Markdown table: its heads, and below them rows of cells."""
    return [f"| {' | '.join(map(str, cells))} |" for cells in (heads, ["---"] * len(heads), *rows)]


def write_results(folder: Path, config: Any, numbers: Any, text: str) -> None:
    """`write_report`, and numbers.json."""
    write_json(folder / "numbers.json", numbers)
    write_report(folder, text, config)


def made(config: Any) -> str:
    """The sentences below the tables."""
    given = {field.name: getattr(config, field.name) for field in dataclasses.fields(config)}
    drawn = ", ".join(f"{name.replace('_', ' ')} {given[name]}" for name in DRAWN if name in given)
    by = f"drift_drake {version('drift_drake')}{_commit()} on {machine()}"
    command = shlex.join(["python", *sys.orig_argv[1:]])
    return f"Made on {date.today().isoformat()} by {by}{': ' if drawn else ''}{drawn}.\n\n    {command}"


def _commit() -> str:
    """Of the clone that the experiment is run from; nothing outside of one."""
    try:
        words = ["git", "describe", "--always", "--dirty"]
        found = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return ""
    return f" ({found.stdout.strip()})"
