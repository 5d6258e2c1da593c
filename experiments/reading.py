"""Counts of the documentation for its reader: lines, words, length of sentences, coinages, broken links, a row a page.

    python -m experiments.reading
    python -m experiments.reading --root /path/to/another/checkout

The exit code is 1 where a page has a coinage or a broken link. Coinages are also looked for in the code: in reports'
templates, and in docstrings, comments, strings and names (`experiments.reading_code`).
"""

import dataclasses
import re
import unicodedata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diagrams.command import run_command
from drift_drake.common.errors import DriftDrakeError
from experiments.made import tabulated
from experiments.reading_code import coined_names, said_in_code, sources

ROOT = Path(__file__).parents[1]
RESULTS = "experiments/results"
NOTEBOOK = (RESULTS, "docs/api.md", "docs/contributing.md", "CHANGELOG.md", "CONTRIBUTING.md")  # not for users
COINAGES = re.compile(
    r"\b(?:beside|(?:un)?told|another day(?:'s)?|what is normal|row (?:weight|is worth)|deaf(?:ness)?|everyday misfit"
    r"|misfit of every day|(?:actuators'|car's|commands'|effects'|own) memory|(?<!\.)push(?:es)?|(?<!make )rooms?"
    r"|opened once|wide vehicles?|mend(?:s|ed|ing)?|one thing more|something else (?:than|too))\b",
    re.IGNORECASE,
)
FENCE = re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE)
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
CODE = re.compile(r"`[^`]*`")
LINK = re.compile(r"!?\[([^\]]*)\]\(([^)\s]+)\)")
ELSEWHERE = re.compile(r"[a-z]+:")
SENTENCE_END = re.compile(r"(?<=[.!?:])\s+(?=[A-Z*`(])")
WORD = re.compile(r"\S*[^\W_]\S*")
NO_PROSE = ("|", "#", "    ", "![")  # beginnings of lines


class UnreadablePagesError(DriftDrakeError):
    """Some page has a coinage or a broken link; the message names them."""


@dataclasses.dataclass(frozen=True)
class ReadingConfig:
    """Of which checkout."""

    root: Path = ROOT
    """Its folder."""


class Reading(NamedTuple):
    """What is counted of a page."""

    lines: int
    words: int
    sentences: tuple[int, ...]  # words of each
    coinages: tuple[str, ...]
    broken: tuple[str, ...]  # links


def pages(root: Path) -> list[Path]:
    """README, the documentation, and the results by date."""
    folders = [root / "docs", root / RESULTS]
    single = [root / "README.md", root / "CONTRIBUTING.md", root / "CHANGELOG.md"]
    return single + [path for folder in folders for path in sorted(folder.rglob("*.md"))]


def of_users(root: Path) -> list[Path]:
    """Pages that users read from beginning to end: without the API, the contributors' page, the notebook."""
    return [page for page in pages(root) if not str(page.relative_to(root)).startswith((*NOTEBOOK, "README"))]


def sentences(text: str) -> list[str]:
    """A page's sentences: paragraphs and items of lists, without code blocks, tables, headings and pictures."""
    found: list[str] = []
    for paragraph in re.split(r"\n\s*\n|\n(?=[-*] )", COMMENT.sub("", FENCE.sub("\n", text))):
        prose = " ".join(line for line in paragraph.splitlines() if not line.startswith(NO_PROSE))
        found += [sentence for sentence in SENTENCE_END.split(LINK.sub(r"\1", prose)) if WORD.search(sentence)]
    return found


def coinages(text: str) -> list[str]:
    """Words of the project's own that a text has, where it is not code."""
    prose = CODE.sub("", LINK.sub(r"\1", FENCE.sub("", text)))
    return [match.group() for match in COINAGES.finditer(" ".join(prose.split()))]


def anchors(text: str) -> set[str]:
    """What links to a page's headings end in."""
    headings = re.findall(r"^#+ (.*)$", FENCE.sub("", text), re.MULTILINE)
    plain = (unicodedata.normalize("NFKD", CODE.sub(lambda m: m.group()[1:-1], h)).lower() for h in headings)
    return {
        re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", h.encode("ascii", "ignore").decode()).strip()) for h in plain
    }


def broken_links(page: Path) -> list[str]:
    """Links of a page to files or headings that are not there."""
    text, broken = page.read_text(encoding="utf-8"), []
    for _, target in LINK.findall(CODE.sub("", FENCE.sub("", text))):
        if ELSEWHERE.match(target):
            continue
        path, _, heading = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (heading and heading not in anchors(file.read_text(encoding="utf-8"))):
            broken.append(target)
    return broken


def reading(page: Path) -> Reading:
    """The counts of a page."""
    text = page.read_text(encoding="utf-8")
    lengths = tuple(len(WORD.findall(sentence)) for sentence in sentences(text))
    return Reading(len(text.splitlines()), len(text.split()), lengths, tuple(coinages(text)), tuple(broken_links(page)))


def coinages_of_code(root: Path) -> list[str]:
    """Places and words of coinages in reports' templates and in the code."""
    found = []
    for path in sorted((root / "drift_drake").rglob("*.html")):
        text = re.sub(r"<script.*?</script>", "", path.read_text(encoding="utf-8"), flags=re.S)
        found += [f"{path.relative_to(root)}: {word}" for word in coinages(text)]
    for path in sources(root):
        source, name = path.read_text(encoding="utf-8"), path.relative_to(root)
        found += [f"{name}:{line}: {word}" for line, text in said_in_code(source) for word in coinages(text)]
        found += [f"{name}:{line}: {word}" for line, word in coined_names(source)]
    return found


def table(found: dict[str, Reading]) -> str:
    """A row a page, and the sums of users' pages and of all."""
    rows = []
    for name, one in found.items():
        lengths = one.sentences or (0,)
        rows.append((name, one.lines, one.words, f"{np.mean(lengths):.1f}", f"{np.percentile(lengths, 95):.0f}",
                     len(one.coinages), len(one.broken)))  # fmt: skip
    heads = ("page", "lines", "words", "words a sentence, mean", "95 %", "coinages", "links broken")
    return "\n".join(tabulated(heads, rows))


def together(found: list[Reading]) -> Reading:
    """Sums of several pages."""
    return Reading(
        sum(one.lines for one in found), sum(one.words for one in found),
        tuple(length for one in found for length in one.sentences),
        tuple(word for one in found for word in one.coinages), tuple(link for one in found for link in one.broken),
    )  # fmt: skip


def main(config: ReadingConfig) -> None:
    """Prints the table.

    Raises:
        UnreadablePagesError: some page has a coinage or a broken link.
    """
    root = config.root.resolve()
    found = {str(page.relative_to(root)): reading(page) for page in pages(root) if page.exists()}
    users = [str(page.relative_to(root)) for page in of_users(root)]
    found["users' pages together"] = together([found[name] for name in users])
    print(table(found))
    said = coinages_of_code(root)
    print(f"\ncoinages in the code: {len(said)}")
    dated = {name: one for name, one in found.items() if not name.startswith((RESULTS, "users"))}
    bad = [f"{name}: {word}" for name, one in dated.items() for word in one.coinages]
    bad += [f"{name}: {link}" for name, one in found.items() if name[0] != "u" for link in one.broken]
    if bad or said:
        raise UnreadablePagesError("\n".join(["coinages and broken links:", *bad, *said]))


if __name__ == "__main__":
    run_command(main, ReadingConfig)
