"""The house's rules that a machine can hold: files and functions stay short enough to be read at once."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "drift_drake"
FILES = sorted(PACKAGE.rglob("*.py"))
LONGEST_FILE, LONGEST_FUNCTION = 350, 60  # lines


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


def test_no_room_rests_on_the_benchmarks() -> None:
    inside = PACKAGE / "benchmarks"
    assert not [path for path in FILES if inside not in path.parents and "drift_drake.benchmarks" in path.read_text()]


def test_no_two_folders_import_each_other() -> None:
    imported: dict[Path, set[Path]] = {}
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{PACKAGE.name}."):
                module = PACKAGE.parent.joinpath(*node.module.split("."))
                imported.setdefault(path.parent, set()).add(module if module.is_dir() else module.parent)
    pairs = [(one, other) for one, others in imported.items() for other in others if one != other]
    assert not [(one, other) for one, other in pairs if one in imported.get(other, ())]
