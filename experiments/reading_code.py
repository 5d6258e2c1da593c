"""Coinages of the code: its docstrings, comments, strings and names, in all that is written for this repository.

A name is read as its words: `EverydayMisfit` and `everyday_misfit` alike as "everyday misfit". Words in backquotes are
names, not prose.
"""

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

FOLDERS = ("drift_drake", "experiments", "tests", "examples", "diagrams")
LISTS = ("experiments/reading.py", "experiments/reading_code.py", "tests/docs/test_reading.py")  # coinages themselves
COINED_NAMES = re.compile(
    r"\b(?:beside|(?:un|fore)?told|another day|what is normal|row weight|deaf(?:ness)?|everyday|one thing more"
    r"|mend(?:s|ed|ing)?|push(?:es|ed)?|rooms?|wide vehicles?|drawn wide|has memory|settled memory"
    r"|memory (?:scale|rates|starts|observer))\b"
)
QUOTES = re.compile(r"^[a-zA-Z]*('''|\"\"\"|'|\")|('''|\"\"\"|'|\")$")
WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")


def sources(root: Path) -> list[Path]:
    """The Python files of a checkout, but for those that list coinages."""
    found = [path for folder in FOLDERS for path in sorted((root / folder).rglob("*.py"))]
    return [path for path in found if str(path.relative_to(root)) not in LISTS]


def words_of(name: str) -> str:
    """A name as the words that it is made of, in small letters."""
    return " ".join(WORDS.findall(name)).lower()


def said_in_code(source: str) -> Iterator[tuple[int, str]]:
    """(Line, text) of docstrings and other strings of several words, and of comments; neighbouring comments as one."""
    comments: list[tuple[int, str]] = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            comments.append((token.start[0], token.string.lstrip("#: ")))
        elif token.type == tokenize.STRING and " " in token.string.strip():
            yield token.start[0], QUOTES.sub("", token.string)
    while comments:
        first, text = comments.pop(0)
        last = first
        while comments and comments[0][0] == last + 1:
            last, more = comments.pop(0)
            text += f" {more}"
        yield first, text


def coined_names(source: str) -> Iterator[tuple[int, str]]:
    """(Line, name) of each coined name, where it is first."""
    seen: set[str] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NAME and token.string not in seen and COINED_NAMES.search(words_of(token.string)):
            seen.add(token.string)
            yield token.start[0], token.string
