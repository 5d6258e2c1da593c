"""`--json FILE` of every command: a file, or `-` for standard output, where a person is then told nothing."""

import sys
from pathlib import Path
from typing import TextIO

from drift_drake import safe_files
from drift_drake.safe_files import STANDARD_OUTPUT

__all__ = ["STANDARD_OUTPUT", "said_to", "write_text"]


def said_to(json: Path | None) -> TextIO:
    """Where sentences for a person go: standard output, unless the JSON does."""
    return sys.stderr if json == STANDARD_OUTPUT else sys.stdout


def write_text(path: Path, text: str) -> None:
    """Writes a text, ended by one line break, to a file (whose folder is made) or to standard output."""
    text = text.rstrip("\n") + "\n"
    if path == STANDARD_OUTPUT:
        sys.stdout.write(text)
        return
    safe_files.write_text(path, text)
