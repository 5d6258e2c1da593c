"""The house's rules that a machine can hold: files and functions stay short enough to be read at once."""

import ast
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "drift_drake"
FILES = sorted(PACKAGE.rglob("*.py"))
LONGEST_FILE, LONGEST_FUNCTION = 350, 60  # lines
LAYERS = ("common", "car", "drive", "view", "gap", "app", "cli")  # each imports from itself and from those before it


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_files_and_functions_are_short(path: Path) -> None:
    text = path.read_text()
    assert text.count("\n") <= LONGEST_FILE
    functions = [f for f in ast.walk(ast.parse(text)) if isinstance(f, ast.FunctionDef | ast.AsyncFunctionDef)]
    long = {f.name: f.end_lineno - f.lineno + 1 for f in functions if f.end_lineno - f.lineno >= LONGEST_FUNCTION}
    assert not long


def test_no_class_is_defined_twice() -> None:
    places: dict[str, list[str]] = {}
    for path in FILES:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(str(path.relative_to(PACKAGE)))
    assert not {name: found for name, found in places.items() if len(found) > 1}


def imports() -> Iterator[tuple[Path, Path]]:
    """Pairs of modules, one of which imports from the other, by their places in the package."""
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{PACKAGE.name}."):
                module = PACKAGE.parent.joinpath(*node.module.split("."))
                for alias in node.names if module.is_dir() else ():
                    yield path.relative_to(PACKAGE), (module / alias.name).relative_to(PACKAGE)
                if not module.is_dir():
                    yield path.relative_to(PACKAGE), module.relative_to(PACKAGE)


def test_layers_rest_on_those_below_them_alone() -> None:
    assert {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name[0] != "_"} == {*LAYERS, "data"}
    places = [(one, other) for one, other in imports() if len(one.parts) > 1]
    assert not [(one, other) for one, other in places if LAYERS.index(other.parts[0]) > LAYERS.index(one.parts[0])]


def test_no_folders_import_each_other_directly_or_through_others() -> None:
    """Folders side by side: a folder and what lies in it are one."""
    graphs: dict[Path, dict[str, set[str]]] = {}
    for one, other in imports():
        shared = next(i for i in range(len(one.parts)) if one.with_suffix("").parts[i] != other.parts[i])
        names = one.with_suffix("").parts[shared], other.parts[shared]
        if all(PACKAGE.joinpath(*one.parts[:shared], name).is_dir() for name in names):
            graph = graphs.setdefault(Path(*one.parts[:shared]), {})
            graph.setdefault(names[0], set()).add(names[1])
    for graph in graphs.values():
        tuple(TopologicalSorter(graph).static_order())  # raises CycleError, which names the loop


def test_a_diagnosis_needs_no_replay_and_no_closed_loop() -> None:
    """What draws a calibration plays runs to cars; a diagnosis, and its report, come without."""
    graph: dict[Path, set[Path]] = {}
    for one, other in imports():
        graph.setdefault(one.with_suffix(""), set()).add(other)
    reached, left = set[Path](), [Path("cli/diagnose")]
    while left:
        new = graph.get(left.pop(), set()) - reached
        reached |= new
        left += new
    assert Path("gap/diagnosis/reports/change_report") in reached
    assert not [path for path in reached if path.parts[:2] in (("view", "playback"), ("drive", "loop"))]
