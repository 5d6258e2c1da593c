"""Counts of a made-up package, and differences between frozen results."""

from pathlib import Path

import pytest

from experiments.house import baseline
from experiments.house.baseline import differences
from experiments.house.counts import Walk, constants, folder_loops, runge_kuttas
from experiments.structure import Tree

MODULES = {
    "diagnosis/day.py": """
from drift_drake.logs.table import Run, read

def start():
    read()
    own()
    Run().used()

def own():
    return read()
""",
    "logs/table.py": """
from drift_drake.diagnosis import day

MOST, LEAST = 3, 1
_OWN: int = 2

def read():
    helper()

def helper():
    pass

class Run:
    def used(self):
        return helper()
""",
    "vehicle/plant.py": """
def row(x, h):
    return x + h / 6.0 * (1.0 + 2.0 * x)
""",
}


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    for name, text in MODULES.items():
        path = tmp_path / "drift_drake" / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    return Tree(tmp_path)


def test_a_walk_enters_each_function_once(tree: Tree) -> None:
    stays = Walk(tree).stays(("diagnosis/day", "start"))
    # read and its helper; back, own; back and into Run.used; back.
    assert stays == ["diagnosis/day", "logs/table", "diagnosis/day", "logs/table", "diagnosis/day"]


def test_loops_constants_and_integrators_are_counted(tree: Tree) -> None:
    assert folder_loops(tree) == [["diagnosis", "logs"]]
    assert constants(tree) == 3
    assert runge_kuttas(tree) == ["vehicle/plant:row"]


def test_differences_are_named_and_times_are_none() -> None:
    before = {"causes": ["a"], "posterior": {"a": 0.9, "b": 0.1}, "seconds": 3.0, "details": {"provenance": "x"}}
    assert list(differences(before, before | {"seconds": 9.0, "details": {"provenance": "y"}})) == []
    now = before | {"posterior": {"a": 0.8, "b": 0.1}, "causes": ["a", "b"]}
    assert list(differences(before, now)) == ["causes: ['a'] -> ['a', 'b']", "posterior.a: 0.9 -> 0.8"]


def test_frozen_results_are_made_once_and_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    made: list[str] = []

    def items(kinds):
        return [(name, lambda name=name: made.append(name) or {"value": len(made)}) for name in kinds]

    monkeypatch.setattr(baseline, "items", items)
    monkeypatch.setattr(baseline, "sources", lambda: "now")
    baseline.main(baseline.Freeze(tmp_path, ("counts", "plans")))
    baseline.main(baseline.Freeze(tmp_path, ("counts", "plans")))
    assert made == ["counts", "plans"]
    with pytest.raises(SystemExit):
        baseline.main(baseline.Compare(tmp_path, ("counts",)))
    assert "value: 1 -> 3" in capsys.readouterr().out
    monkeypatch.setattr(baseline, "items", lambda kinds: [(name, lambda: {"value": 1}) for name in kinds])
    monkeypatch.setattr(baseline, "sources", lambda: "later")
    baseline.main(baseline.Compare(tmp_path, ("counts",)))
    assert "counts: as frozen" in capsys.readouterr().out
