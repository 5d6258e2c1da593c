"""`--json FILE` of every command: what it found or made, to a file or (`-`) to standard output.

Where the JSON goes to standard output, sentences for a person go to standard error.
"""

import contextlib
import dataclasses
import shlex
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

from drift_drake.common import safe_files
from drift_drake.common.run_folder import to_json
from drift_drake.common.safe_files import STANDARD_OUTPUT

__all__ = ["STANDARD_OUTPUT", "said_to", "write_results", "write_text"]
Progress = Callable[[str, float], None]
"""Is given a stage's name and the share done."""


def said_to(json: Path | None) -> TextIO:
    """Where sentences for a person go: standard output, unless the JSON does."""
    return sys.stderr if json == STANDARD_OUTPUT else sys.stdout


def write_results(json: Path | None, results: Any) -> None:
    """A command's results where `--json` asks for them, if it does.

    Args:
        results: what `run_folder.plain` takes; paths become text, numbers that are not finite null.
    """
    if json is not None:
        write_text(json, to_json(results))


def write_text(path: Path, text: str) -> None:
    """Writes a text, ended by one line break, to a file (whose folder is made) or to standard output."""
    text = text.rstrip("\n") + "\n"
    if path == STANDARD_OUTPUT:
        sys.stdout.write(text)
        return
    safe_files.write_text(path, text)


def command_line(name: str, command: Any, positional: str) -> str:
    """`drift-drake NAME ...` with the options that differ from their defaults.

    Args:
        command: a command's dataclass; positional: its field that is given without a name.
    """
    words = ["drift-drake", name, *_words(getattr(command, positional))]
    for field in dataclasses.fields(command):
        value = getattr(command, field.name)
        if field.name == positional or value == field.default:
            continue
        option = "--" + field.name.replace("_", "-")
        if isinstance(value, bool):
            words.append(option if value else option.replace("--", "--no-", 1))
        else:
            words += [option, *_words(value)]
    return shlex.join(words)


def _words(value: Any) -> list[str]:
    return list(map(str, value)) if isinstance(value, tuple) else [str(value)]


@contextlib.contextmanager
def progress_bar(quiet: bool) -> Iterator[Progress]:
    """A bar that is given a stage's name and the share done; nothing where `quiet`."""
    with tqdm(total=100, disable=quiet, file=sys.stderr, bar_format="{l_bar}{bar}| {elapsed}") as bar:

        def show(stage: str, share: float) -> None:
            bar.set_description(stage)
            bar.update(round(100 * share) - bar.n)

        yield show
