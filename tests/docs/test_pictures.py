"""Pictures of the pages: each has an alt text, a caption with its command, and few bytes for a phone's connection."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
SHOWN = re.compile(r"!\[([^]]*)\]\(([^)\s]+)|<img\b([^>]*)>")
CAPTION = re.compile(r"\)?\n\n?\*(?!\*)((?:[^\n]|\n(?!\n))+?)\*\n")
COMMAND = re.compile(r"`(?:python -m (?:experiments|diagrams)\.|make )[^`]+`", re.DOTALL)
LEAST, LARGEST = 20, 1.5e6  # letters, bytes
FEWEST = 3  # words of a caption in addition to the command


def pictures(text: str) -> list[tuple[str, str]]:
    """(alt text, file) of each picture that a page shows."""
    found = []
    for alt, file, tag in SHOWN.findall(text):
        named = dict(re.findall(r'(\w+)="([^"]*)"', tag))
        found.append((named.get("alt", ""), named.get("src", "")) if tag else (alt, file))
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_each_picture_has_an_alt_text_and_is_small(page: Path) -> None:
    for alt, file in pictures(page.read_text(encoding="utf-8")):
        assert len(alt) >= LEAST, f"{file}: say in its alt text what it shows"
        assert (page.parent / file).stat().st_size <= LARGEST, file


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_each_picture_has_a_caption_with_the_command_that_makes_it(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for found in SHOWN.finditer(text):
        caption = CAPTION.match(text, found.end())
        assert caption, f"{found.group()}: no caption below it"
        assert COMMAND.search(caption[1]), f"{found.group()}: its caption names no command"
        assert len(COMMAND.sub("", caption[1]).split()) >= FEWEST, f"{found.group()}: its caption says nothing"


def test_pictures_are_found_in_either_form() -> None:
    text = 'A ![what it shows](a.png) and <img alt="the other" src="b.gif" width="390">, no [link](c.md).'
    assert pictures(text) == [("what it shows", "a.png"), ("the other", "b.gif")]
