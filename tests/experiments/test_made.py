"""What stands below an experiment's tables."""

import dataclasses
from datetime import date
from pathlib import Path

from experiments import made


@dataclasses.dataclass(frozen=True)
class Config:
    """Of a run."""

    seed: int = 7
    noise_seeds: int = 3
    workers: int = 2


def test_a_report_says_when_where_and_of_which_seeds(tmp_path: Path) -> None:
    made.write_report(tmp_path, "| a |\n| --- |\n", Config())
    text = (tmp_path / "report.md").read_text()
    assert text.startswith("| a |\n| --- |\n\nMade on ")
    assert date.today().isoformat() in text
    assert ": seed 7, noise seeds 3.\n\n    python " in text
    assert "workers" not in text


def test_outside_of_a_clone_there_is_no_commit(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(made, "ROOT", tmp_path)
    assert "(" not in made.made(Config()).split(" on ")[1]
