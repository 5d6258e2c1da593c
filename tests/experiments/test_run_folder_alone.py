"""Two experiments do not write one run folder."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from diagrams.command import run_folder_of
from drift_drake.common.safe_files import alone_in

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Options:
    out: Path | None = None


@dataclass(frozen=True)
class Picture:
    out: Path = Path("a.png")


def test_the_second_experiment_in_a_run_folder_is_refused_in_one_sentence(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "experiments.drifting.figure_8", "--vehicles", "1", "--out", str(tmp_path)]
    with alone_in(tmp_path):
        second = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, timeout=120)
    assert second.returncode == 2
    assert f"--out {tmp_path}: another process is writing there" in second.stderr
    assert not list(tmp_path.iterdir())


def test_pictures_and_folders_of_the_date_are_no_run_folders_to_hold(tmp_path: Path) -> None:
    assert run_folder_of(Options(tmp_path)) == tmp_path
    assert run_folder_of(Options(tmp_path / "v1.2")) == tmp_path / "v1.2"
    assert run_folder_of(Options()) is None
    assert run_folder_of(Options(tmp_path / "a.svg")) is None
    assert run_folder_of(Picture()) is None
