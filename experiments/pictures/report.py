"""The tutorial's report as a phone shows it, and the files that the tutorial's commands make."""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.pictures.photograph import photograph

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial.md"
RUN = re.compile(r"<!-- run -->\n```(\w+)\n(.*?)```", re.DOTALL)
PARTS = ("h1", ".verdict", "h2", ".bars", "table.cards", ".chart")


@contextmanager
def tutorial() -> Iterator[Path]:
    """A folder with all that the tutorial's commands write."""
    with tempfile.TemporaryDirectory() as folder:
        for language, text in RUN.findall(TUTORIAL.read_text(encoding="utf-8")):
            if language == "python":
                command = [sys.executable, "-c", text]
            else:
                ours = f'drift-drake() {{ "{sys.executable}" -m drift_drake "$@"; }}\n'
                command = ["bash", "-e", "-c", ours + re.sub(r"^\$ ", "", text, flags=re.MULTILINE)]
            subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        yield Path(folder)


def take(out: Path) -> None:
    """Writes the picture: the sentence, the probabilities, the magnitudes, the errors before and after."""
    with tutorial() as folder:
        photograph(folder / "answer.html", out, PARTS)
