"""The pages' `python -m` commands take their options, and those that do not do what a page says are found."""

import dataclasses
import functools
import inspect
import runpy
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
import tyro

import diagrams.command
from experiments.page_commands import (
    Command,
    PageCommandsConfig,
    Result,
    commands_of,
    differs,
    judged,
    main,
    pages,
    report,
    run,
)

COMMANDS = [command for page in pages() for command in commands_of(page)]


class HandedOverError(Exception):
    """What a module hands to `run_command`."""


def not_called(options: Any) -> Any:
    """In place of a function one of the same options that does nothing; classes, and choices of them, as they are."""
    return functools.wraps(options)(lambda *_, **__: None) if inspect.isfunction(options) else options


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: f"{command.page}: {command.text[:60]}")
def test_a_pages_command_takes_its_options(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def handed_over(main: Any, options: Any = None, _description: str | None = None) -> None:
        raise HandedOverError(main if options is None else options)

    monkeypatch.setattr(diagrams.command, "run_command", handed_over)
    _, _, module, *words = shlex.split(command.text)
    monkeypatch.setattr(sys, "argv", [module])
    for name in (module, f"{module}.__main__"):  # which another test may have imported
        monkeypatch.delitem(sys.modules, name, raising=False)
    with pytest.raises(HandedOverError) as found:
        runpy.run_module(module, run_name="__main__", alter_sys=False)
    if words != ["--help"]:
        tyro.cli(not_called(found.value.args[0]), args=words)  # SystemExit where an option is unknown


def test_commands_are_found_in_blocks_and_in_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "Text `python -m one.two --three\n4`, `python -m left out ...` and `python -m make | score`.\n\n"
        "    python -m indented OUT \\\n        --more 1\n\n"
        "```\npython -m plain     # said\n```\n\n"
        "```console\n$ python -m shown\nr  1.25\ntotal 3\n$ drift-drake check\nnothing\n```\n"
    )
    monkeypatch.setattr("experiments.page_commands.ROOT", tmp_path)
    assert set(commands_of(page)) == {
        Command("page.md", "python -m one.two --three 4"), Command("page.md", "python -m indented OUT --more 1"),
        Command("page.md", "python -m plain"), Command("page.md", "python -m shown", ("r  1.25", "total 3")),
    }  # fmt: skip
    assert len(COMMANDS) > 50


def test_numbers_may_differ_by_a_little_and_words_not() -> None:
    assert not differs("total 15.2, |e| <= 1.00 m", "total   15.3, |e| <= 1.01 m")
    assert differs("total 11.3", "total 15.2")
    assert differs("total 11.3", "sum 11.3")
    assert differs("1 and 2", "1")


def test_what_a_commands_end_says_of_its_page() -> None:
    command = Command("page.md", "python -m module DATA", ("total 3",))
    assert judged(command, 0, "first\ntotal 3\n", "").verdict == "passes"
    assert judged(command, 0, "total 4\n", "")[:2] == ("fails", "does not print: total 3")
    assert judged(command, None, "", "").verdict == "cut off"
    assert judged(command, 2, "", "warning\nDATA: no such folder").verdict == "not checked"
    assert judged(command, 2, "", "runs/drives/held_out.npz: no such file; make it").verdict == "not checked"
    assert judged(command, 2, "", "runs/saloon: has no start.yaml; make it with x").verdict == "not checked"
    assert judged(command, 2, "", "module: car.yaml: cannot be read (No such file or dir").verdict == "not checked"
    elsewhere = Command("page.md", "python -m module --scheduler tcp://SCHEDULER:8786")
    assert judged(elsewhere, 2, "", "no dask scheduler answers at tcp://SCHEDULER:8786").verdict == "not checked"
    assert judged(command, 2, "", "module: docs/car.yaml: cannot be read (No such file").verdict == "fails"
    assert judged(command, 2, "", "docs/held_out.npz: no such file").verdict == "fails"
    assert judged(command, 2, "", "no first guess led to a plan")[:2] == (
        "fails", "exit code 2: no first guess led to a plan",
    )  # fmt: skip
    assert judged(command, 1, "", "DATA: KeyError").verdict == "fails"


def test_a_command_is_run_and_interrupted(tmp_path: Path) -> None:
    (tmp_path / "quick.py").write_text("print('total', 3)\n")
    (tmp_path / "slow.py").write_text("import time\nfor _ in range(600):\n    time.sleep(0.1)\n")
    assert run(Command("p", "python -m quick", ("total 3",)), tmp_path, 60.0).verdict == "passes"
    assert run(Command("p", "python -m slow"), tmp_path, 1.0).verdict == "cut off"
    assert run(Command("p", "python -m missing"), tmp_path, 60.0).verdict == "fails"


def test_the_report_names_the_page() -> None:
    command = Command("docs/page.md", "python -m module")
    text = report({"docs/page.md": [(command, judged(command, 2, "", "no such option"))]})
    assert "| docs/page.md | 0 | 0 | 0 | 1 |" in text
    assert "- fails: docs/page.md: `python -m module`: exit code 2: no such option (0 s of 0 s)" in text
    assert "| all, each once: 1 | 0 | 0 | 0 | 1 |" in text


def test_what_was_run_is_not_run_again_but_for_what_was_cut_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "clone").mkdir()
    ran: list[str] = []

    def running(command: Command, _: Path, seconds: float) -> Result:
        ran.append(command.text)
        return Result("cut off" if "layers" in command.text else "passes", "", seconds)

    monkeypatch.setattr("experiments.page_commands.run", running)
    config = PageCommandsConfig(pages=("docs/contributing.md",), matching="structure|layers", seconds=1.0, out=tmp_path)
    for seconds in (1.0, 1.0, 2.0):
        main(dataclasses.replace(config, seconds=seconds))
    layers, structure = (
        "python -m experiments.pictures layers",
        "python -m experiments.structure --out docs/structure.png",
    )
    assert ran == [layers, structure, layers]
    assert "| all, each once: 2 | 1 | 1 | 0 | 0 |" in capsys.readouterr().out


@pytest.mark.slow
def test_a_page_is_checked_in_a_clean_clone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(PageCommandsConfig(pages=("docs/contributing.md",), out=tmp_path))
    assert "| docs/contributing.md | 3 | 0 | 0 | 0 |" in capsys.readouterr().out
