"""The documentation stays short, in the field's words and with links that lead somewhere; and the counts are right."""

from pathlib import Path

import numpy as np
import pytest

from experiments.reading import (
    ROOT,
    ReadingConfig,
    UnreadablePagesError,
    anchors,
    broken_links,
    coinages,
    coinages_of_code,
    main,
    of_users,
    pages,
    reading,
    sentences,
)

LONGEST_README, LONGEST_GLOSSARY, LONGEST_TOGETHER = 100, 40, 1500  # lines
SENTENCE = {"mean": 15.0, "95 %": 30.0}  # words
PAGES = pages(ROOT)


def names(page: Path) -> str:
    return str(page.relative_to(ROOT))


def test_pages_are_short() -> None:
    assert reading(ROOT / "README.md").lines <= LONGEST_README
    assert reading(ROOT / "docs" / "glossary.md").lines <= LONGEST_GLOSSARY
    users = of_users(ROOT)
    assert {page.name for page in users} >= {"tutorial.md", "own_logs.md", "limits.md"}
    assert sum(reading(page).lines for page in users) <= LONGEST_TOGETHER


def test_sentences_are_short() -> None:
    lengths = [length for page in [ROOT / "README.md", *of_users(ROOT)] for length in reading(page).sentences]
    assert np.mean(lengths) <= SENTENCE["mean"]
    assert np.percentile(lengths, 95) <= SENTENCE["95 %"]


@pytest.mark.parametrize("page", PAGES, ids=names)
def test_links_lead_somewhere_and_words_are_the_fields(page: Path) -> None:
    assert not broken_links(page)
    assert page.is_relative_to(ROOT / "experiments") or not coinages(page.read_text(encoding="utf-8"))


def test_the_code_has_the_fields_words() -> None:
    assert not coinages_of_code(ROOT)


def test_coinages_are_found_in_strings_comments_and_names(tmp_path: Path) -> None:
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "some.py").write_text(
        '"""A car beside another."""\n\nEVERYDAY_MISFIT = {"deaf": "a key"}  # what is\n# normal\n\n\n'
        'class WithMemoryScale:\n    """`told` is a name."""\n'
    )
    assert coinages_of_code(tmp_path) == [
        "tests/some.py:1: beside", "tests/some.py:3: what is normal", "tests/some.py:3: EVERYDAY_MISFIT",
        "tests/some.py:7: WithMemoryScale",
    ]  # fmt: skip


def test_sentences_are_found_in_paragraphs_and_lists_alone() -> None:
    prose = "# A title\n\nOne idea. Another: of\nfour words!\n\n- An item.\n- [A link](to.md) too\n\n"
    text = prose + "| a | table |\n\n```\ncode here\n```\n"
    assert sentences(text) == ["One idea.", "Another: of four words!", "- An item.", "- A link too"]


def test_coinages_are_found_where_they_are_no_code() -> None:
    assert coinages("What is\nnormal; `row_weight`, `told`. Beside it, make room for a push.\n```\ntold\n```\n") == [
        "What is normal", "Beside", "push",
    ]  # fmt: skip
    assert not coinages("A process that is out of memory; besides, mending.py; relative to another.")[1:]


def test_links_to_no_file_and_to_no_heading_are_broken(tmp_path: Path) -> None:
    (tmp_path / "other.md").write_text("# The two `criteria`, in short\n")
    page = tmp_path / "page.md"
    page.write_text(
        "# Here\n[a](other.md) [b](other.md#the-two-criteria-in-short) [c](#here) [d](https://example.org/x)\n"
        "[e](none.md) [f](other.md#here) ![g](none.png) [h](#there) `[i](code.md)`\n"
    )
    assert anchors(page.read_text()) == {"here"}
    assert broken_links(page) == ["none.md", "other.md#here", "none.png", "#there"]


def test_a_page_with_a_coinage_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "drift_drake").mkdir()
    (tmp_path / "README.md").write_text("# A car\n\nIt is fast. It drifts.\n")
    (tmp_path / "docs" / "page.md").write_text("A car beside a [wall](wall.md).\n")
    (tmp_path / "drift_drake" / "says.py").write_text('"""A car."""\n\nTEXT = "a car of another day"\n')
    with pytest.raises(UnreadablePagesError) as found:
        main(ReadingConfig(tmp_path))
    assert str(found.value).splitlines()[1:] == [
        "docs/page.md: beside", "docs/page.md: wall.md", "drift_drake/says.py:3: another day",
    ]  # fmt: skip
    assert "| README.md | 3 | 8 | 2.5 | 3 | 0 | 0 |" in capsys.readouterr().out
