"""`--json FILE` of every command: a file, or `-` for standard output, where a person is then told nothing."""

import sys
from pathlib import Path
from typing import TextIO

STANDARD_OUTPUT = Path("-")


def said_to(json: Path | None) -> TextIO:
    """Where sentences for a person go: standard output, unless the JSON does."""
    return sys.stderr if json == STANDARD_OUTPUT else sys.stdout


def write_text(path: Path, text: str) -> None:
    """Writes a text, ended by one line break, to a file (whose folder is made) or to standard output."""
    text = text.rstrip("\n") + "\n"
    if path == STANDARD_OUTPUT:
        sys.stdout.write(text)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
