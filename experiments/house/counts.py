"""Counts of the package's structure, from its sources alone: what a redesign is to make smaller.

    python -m experiments.house.counts
    python -m experiments.house.counts --commit ac3d759

A walk follows the calls of a function through the package, in the order of the sources, each function once. A stay is
a stretch of it in one module; every stay beyond a module's first is a return.
"""

import ast
import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path

import networkx as nx

from diagrams.command import run_command
from experiments.structure import PACKAGE, ROOT, StructureConfig, Tree, numbers, tree_of

DIAGNOSIS = "diagnose_change"  # the function that is followed
WEIGHTS = re.compile(r"\b(1\.0|h|step|dt) / 6\.0")  # of a classical Runge-Kutta step
Place = tuple[str, str]  # module, and name of a function, or CLASS.METHOD


class Walk:
    """The calls of functions in a tree."""

    def __init__(self, tree: Tree) -> None:
        self.bodies: dict[Place, ast.AST] = {}
        self.known: dict[str, dict[str, Place]] = {}  # by module: what a name in it stands for
        methods: dict[str, set[Place]] = {}
        for module, syntax in tree.trees.items():
            for node in syntax.body:
                for name, body in _definitions(node):
                    self.bodies[module, name] = body
                    if "." in name:
                        methods.setdefault(name.split(".")[1], set()).add((module, name))
        for module, syntax in tree.trees.items():
            own = {name: (module, name) for place, name in self.bodies if place == module and "." not in name}
            self.known[module] = own | dict(self._imported(syntax))
        self.methods = {name: next(iter(places)) for name, places in methods.items() if len(places) == 1}

    def _imported(self, syntax: ast.Module) -> Iterator[tuple[str, Place]]:
        for node in ast.walk(syntax):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{PACKAGE}."):
                module = "/".join(str(node.module).split(".")[1:])
                for alias in node.names:
                    yield alias.asname or alias.name, (module, alias.name)

    def called(self, place: Place) -> Iterator[Place]:
        """What a function calls, in the order of its source."""
        calls = [node for node in ast.walk(self.bodies[place]) if isinstance(node, ast.Call)]
        for call in sorted(calls, key=lambda node: (node.lineno, node.col_offset)):
            if isinstance(call.func, ast.Name):
                found = self.known[place[0]].get(call.func.id)
            elif isinstance(call.func, ast.Attribute):
                found = self.methods.get(call.func.attr)
            else:
                found = None
            if found is not None and (found[0], f"{found[1]}.__init__") in self.bodies:
                found = found[0], f"{found[1]}.__init__"
            if found in self.bodies:
                yield found

    def stays(self, start: Place) -> list[str]:
        """Modules in the order in which a function's calls enter and leave them, none twice in a row."""
        seen, out = {start}, [start[0]]

        def visit(place: Place) -> None:
            for next_one in self.called(place):
                if next_one not in seen:
                    seen.add(next_one)
                    out.append(next_one[0])
                    visit(next_one)
                    out.append(place[0])

        visit(start)
        return [module for i, module in enumerate(out) if i == 0 or module != out[i - 1]]


def _definitions(node: ast.stmt) -> Iterator[tuple[str, ast.AST]]:
    """Functions of a module, and methods of its classes."""
    if isinstance(node, ast.FunctionDef):
        yield node.name, node
    if isinstance(node, ast.ClassDef):
        for inner in node.body:
            if isinstance(inner, ast.FunctionDef):
                yield f"{node.name}.{inner.name}", inner


def folder_loops(tree: Tree) -> list[list[str]]:
    """Folders of the package (the first level) that import each other, directly or through others."""
    graph = nx.DiGraph()
    for module, imported in tree.imports.items():
        ends = [(module.split("/")[0], other.split("/")[0]) for other in imported]
        graph.add_edges_from((a, b) for a, b in ends if a != b)
    return sorted(sorted(group) for group in nx.strongly_connected_components(graph) if len(group) > 1)


def constants(tree: Tree) -> int:
    """Upper-case names that modules assign."""
    count = 0
    for syntax in tree.trees.values():
        for node in syntax.body:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(
                node, ast.AnnAssign) else []  # fmt: skip
            names = [name for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]
            count += sum(name.id.strip("_").isupper() for name in names)
    return count


def runge_kuttas(tree: Tree) -> list[str]:
    """Functions that hold the weights of a classical Runge-Kutta step."""
    out = []
    for module, syntax in tree.trees.items():
        for node in syntax.body:
            for name, body in _definitions(node):
                if WEIGHTS.search(ast.unparse(body)):
                    out.append(f"{module}:{name}")
    return out


def counts(tree: Tree, command: str) -> dict[str, object]:
    """The table's rows that sources tell, by name."""
    walk, function = Walk(tree), DIAGNOSIS
    stays = next((walk.stays(place) for place in walk.bodies if place[1] == function), [])
    found = numbers(tree, command)
    code = "\n".join(tree.text.values()).split("\n")
    return {
        "Runge-Kutta bodies in the package": len(runge_kuttas(tree)),
        "modules that name a built-in effect, median": found["modules that name one effect, median"],
        "loops of folders": len(folder_loops(tree)),
        "folders in loops": sum(map(len, folder_loops(tree))),
        f"`{function}` walk: modules": len(set(stays)),
        f"`{function}` walk: stays": len(stays),
        f"`{function}` walk: returns": len(stays) - len(set(stays)),
        "modules behind `diagnose`": found[f"modules behind `{command}`"],
        "modules": found["modules"],
        "package, lines": found["lines"],
        "files called `command.py`": sum(name.rpartition("/")[2] == "command" for name in tree.text),
        "upper-case constants": constants(tree),
        "lines with `: Any`": sum(": Any" in line for line in code),
        "longest file": found["longest file"],
    }


@dataclasses.dataclass(frozen=True)
class CountsConfig:
    """What is counted."""

    commit: str | None = None
    """Of this repository; the working tree without."""
    command: str = "cli/diagnose"
    """Module of the command whose imports are counted."""
    root: Path = ROOT


def main(config: CountsConfig) -> None:
    """Prints the counts."""
    tree = tree_of(StructureConfig(config.commit, config.command)) if config.commit else Tree(config.root)
    for name, number in counts(tree, config.command).items():
        print(f"{name}: {number}")
    print("Runge-Kutta:", ", ".join(runge_kuttas(tree)))
    print("loops:", "; ".join(" - ".join(group) for group in folder_loops(tree)))


if __name__ == "__main__":
    run_command(main, CountsConfig, __doc__)
