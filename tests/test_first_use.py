"""What a command says where functions are compiled first: once, and not where they are kept already."""

import subprocess
import sys
from pathlib import Path

import pytest

from drift_drake.common.first_use import SENTENCE, said_once, say

PROGRAM = """
import sys
from drift_drake.car.compilation import compiled
from drift_drake.common.first_use import said_once

@compiled
def twice(x):
    return 2.0 * x

@compiled
def thrice(x):
    return 3.0 * x

with said_once():
    print(twice(1.0) + thrice(1.0))
"""


def test_a_command_says_once_that_it_compiles_and_not_where_it_is_kept(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    said = [
        subprocess.run([sys.executable, tmp_path / "program.py"], capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert [done.stdout for done in said] == ["5.0\n", "5.0\n"]
    assert [done.stderr for done in said] == [f"{SENTENCE}\n", ""]


def test_nothing_is_said_outside_of_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    say()
    assert capsys.readouterr().err == ""
    with said_once():
        say()
        say()
    say()
    assert capsys.readouterr().err == f"{SENTENCE}\n"
