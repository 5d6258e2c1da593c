"""The package's structure, from its imports: folders, what a command, a log and an effect pass through, and a picture.

    python -m experiments.structure --out docs/structure.png
    python -m experiments.structure --commit 7d596cc --command cli

The folders are those of `drift_drake`. An arrow from one folder to another says that a module of the first imports one
of the second; arrows that follow from others are left out of the picture.
"""

import ast
import dataclasses
import io
import statistics
import subprocess
import tarfile
import tempfile
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path

import pygraphviz

from diagrams.command import run_command

PACKAGE = "drift_drake"
ROOT = Path(__file__).parents[1]
CATALOGUE = "car/effects/catalogue/"  # folder whose modules assign a dictionary of records
EFFECTS = ("car/effects/magnitudes", "vehicle/effects")  # before, whose class `Effects` had an effect a field
LOG = ("car/log/table", "logs/table")  # where a log's table is


@dataclasses.dataclass(frozen=True)
class StructureConfig:
    """What is looked at."""

    commit: str | None = None
    """Of this repository; the working tree without."""
    command: str = "cli/diagnose"
    """Module of the command that is followed."""
    out: Path | None = None
    """Picture of the folders (PNG or SVG)."""


class Tree:
    """The modules of a package by their place in it (`car/tyre`), each with its syntax tree and imports."""

    def __init__(self, root: Path) -> None:
        files = sorted((root / PACKAGE).rglob("*.py"))
        self.text = {str(path.relative_to(root / PACKAGE).with_suffix("")): path.read_text() for path in files}
        self.trees = {name: ast.parse(text) for name, text in self.text.items()}
        self.imports = {name: set(self._imported(tree)) - {name} for name, tree in self.trees.items()}

    def _imported(self, tree: ast.AST) -> Iterable[str]:
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == PACKAGE:
                place = "/".join(node.module.split(".")[1:])
                inside = [f"{place}/{alias.name}".lstrip("/") for alias in node.names]
                yield from ([place] if place in self.text else [name for name in inside if name in self.text])

    def reached(self, start: str) -> set[str]:
        """Modules that a module imports, and those that they import."""
        found, next_ones = {start}, [start]
        while next_ones:
            new = self.imports[next_ones.pop()] - found
            found |= new
            next_ones += new
        return found

    def effects(self) -> list[str]:
        """Names of the catalogue's effects."""
        records = [n for name, tree in self.trees.items() if name.startswith(CATALOGUE) for n in tree.body
                   if isinstance(n, ast.AnnAssign) and isinstance(n.value, ast.Dict)]  # fmt: skip
        if records:
            keys = [key for n in records if isinstance(n.value, ast.Dict) for key in n.value.keys]
            return [key.value for key in keys if isinstance(key, ast.Constant) and isinstance(key.value, str)]
        tree = next(self.trees[name] for name in EFFECTS if name in self.trees)
        (fields,) = (n for n in tree.body if isinstance(n, ast.ClassDef) and n.name == "Effects")
        return [n.target.id for n in fields.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)]

    def naming(self, word: str) -> set[str]:
        """Modules that have a word as a name, a keyword, an attribute or a whole string."""
        return {name for name, words in self.words.items() if word in words}

    @cached_property
    def words(self) -> dict[str, set[str]]:
        """By module what it has as a name, a keyword, an attribute or a whole string."""
        keys = ("id", "attr", "arg", "value")
        values = {
            name: [getattr(n, k, None) for n in ast.walk(tree) for k in keys] for name, tree in self.trees.items()
        }
        return {name: {value for value in found if isinstance(value, str)} for name, found in values.items()}

    def functions(self) -> list[int]:
        """Lengths of all functions [lines]."""
        kinds = ast.FunctionDef | ast.AsyncFunctionDef
        nodes = [n for tree in self.trees.values() for n in ast.walk(tree) if isinstance(n, kinds)]
        return [(n.end_lineno or n.lineno) - n.lineno + 1 for n in nodes]


def folder(module: str) -> str:
    """The folder of a module: two deep at most."""
    return "/".join(module.split("/")[:-1][:2]) or "."


def folders(tree: Tree) -> dict[str, set[str]]:
    """Folders, and those that each imports from; a folder and what lies in it are one, and do not import each other."""
    out: dict[str, set[str]] = {folder(name): set() for name in tree.text}
    for name, imported in tree.imports.items():
        own = folder(name).split("/")
        out[folder(name)] |= {r for r in map(folder, imported) if not _one(own, r.split("/"))}
    return out


def _one(first: list[str], second: list[str]) -> bool:
    """Whether one of two folders lies in the other, or they are the same."""
    return all(a == b for a, b in zip(first, second, strict=False))


def mutual(graph: dict[str, set[str]]) -> list[tuple[str, str]]:
    """Pairs of folders that import from each other."""
    return sorted((a, b) for a in graph for b in graph[a] if a < b and a in graph[b])


def numbers(tree: Tree, command: str) -> dict[str, object]:
    """What is said of a structure, in words and numbers."""
    reached, runs = tree.reached(command), {n for n in tree.text if tree.imports[n] & {*LOG}}
    lines, lengths = [text.count("\n") for text in tree.text.values()], tree.functions()
    named = [len(tree.naming(effect)) for effect in tree.effects()]
    return {
        "modules": len(tree.text),
        "lines": sum(lines),
        "folders": len(folders(tree)),
        "pairs of folders that import from each other": len(mutual(folders(tree))),
        "most modules in one folder": max(sum(folder(n) == r for n in tree.text) for r in folders(tree)),
        "longest file": max(lines),
        "functions above 60 lines": sum(length > 60 for length in lengths),
        f"modules behind `{command}`": len(reached),
        f"folders behind `{command}`": len({folder(n) for n in reached}),
        "modules that take a log": len(runs),
        "modules that name one effect, median": statistics.median(named),
        "modules that name one effect, most": max(named),
    }


def draw(tree: Tree, path: Path) -> None:
    """Folders as boxes with their modules counted, the ones that others rest on at the bottom."""
    graph = pygraphviz.AGraph(directed=True, rankdir="TB", nodesep=0.15, ranksep=0.35, dpi=110)
    graph.node_attr.update(shape="box", style="rounded,filled", fillcolor="#E4EAF1", color="#8A929C", fontname="sans")
    graph.edge_attr.update(color="#8A929C", arrowsize=0.6)
    for name, imported in folders(tree).items():
        if name == "." or not any(folder(n) == name and not n.endswith("__init__") for n in tree.text):
            continue
        graph.add_node(name, label=f"{name}\\n{sum(folder(n) == name for n in tree.text)}")
        for other in imported - {"."}:
            graph.add_edge(name, other)
    graph.tred().draw(str(path), prog="dot")


def tree_of(config: StructureConfig) -> Tree:
    """The package as it is, or as it was at a commit."""
    if config.commit is None:
        return Tree(ROOT)
    archive = subprocess.run(["git", "archive", config.commit, PACKAGE], cwd=ROOT, capture_output=True, check=True)
    with tempfile.TemporaryDirectory() as folder, tarfile.open(fileobj=io.BytesIO(archive.stdout)) as files:
        files.extractall(folder, filter="data")
        return Tree(Path(folder))


def main(config: StructureConfig) -> None:
    """Prints the numbers, and draws the picture if one is asked for."""
    tree = tree_of(config)
    for name, number in numbers(tree, config.command).items():
        print(f"{name}: {number}")
    for one, other in mutual(folders(tree)):
        print(f"  both ways: {one}, {other}")
    if config.out is not None:
        draw(tree, config.out)


if __name__ == "__main__":
    run_command(main, StructureConfig, __doc__)
