"""The public names by their source: nodes, docstrings, and the errors that they raise, read without a run."""

import ast
import builtins
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
Definition = ast.FunctionDef | ast.ClassDef
HEADING = re.compile(r"\s*(Args|Returns|Raises|Examples|Attributes|Input ports?|Output ports?)\b[^\n]*:$")
IN_WORDS = re.compile(r"\b(\w+Error) where|[Rr]aises (?:an? )?(\w+Error)")
CONSTRUCTORS = ("__init__", "__post_init__")
# Where a name is an alias of what a module makes: the class that its docstring is of.
ALIASES = {"VehiclePlant": "SingleTrackPlant"}


class Door(NamedTuple):
    """What a user calls: a function, a class, a public method of a class."""

    name: str
    module: str
    nodes: tuple[ast.FunctionDef, ...]  # bodies: of a class those of its constructor
    text: str  # docstrings that it may be said in
    owner: ast.ClassDef | None


@cache
def tree(module: str) -> ast.Module:
    """Of a module's source; empty where it is no module of the package."""
    path = ROOT.joinpath(*module.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return ast.parse(file.read_text(encoding="utf-8") if file.exists() else "")


@cache
def resolved(module: str, name: str) -> tuple[str, Definition] | None:
    """(module, node) of a function or class of the package by the name that a module has for it."""
    for node in own_statements(tree(module)):
        if isinstance(node, Definition) and node.name == name:
            return module, node
    found = imports(module).get(name)
    return resolved(*found) if found else None


@cache
def imports(module: str) -> dict[str, tuple[str, str]]:
    """(module, name) of what a module has from the package, at its top or within a function, by its name there."""
    return {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(tree(module))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("drift_drake")
        for alias in node.names
    }


def own_statements(module: ast.Module) -> list[ast.stmt]:
    """A module's own statements, and those below a condition."""
    return [part for node in module.body for part in (node.body if isinstance(node, ast.If) else [node])]


def docstring(node: Definition) -> str:
    """Of a function or a class; empty where there is none."""
    return ast.get_docstring(node) or ""


def methods(node: ast.ClassDef) -> list[ast.FunctionDef]:
    """Of a class, its own."""
    return [part for part in node.body if isinstance(part, ast.FunctionDef)]


def bases(module: str, node: ast.ClassDef) -> list[ast.ClassDef]:
    """Classes of the package that a class is derived from, directly or through others."""
    found = [resolved(module, ast.unparse(base)) for base in node.bases]
    direct = [(where, one) for where, one in filter(None, found) if isinstance(one, ast.ClassDef)]
    return [one for where, base in direct for one in (base, *bases(where, base))]


def public() -> dict[str, tuple[str, Definition]]:
    """(module, node) of each public function and class by name."""
    stub = (ROOT / "drift_drake" / "__init__.pyi").read_text(encoding="utf-8")
    names = {name: f"drift_drake.{module}" for module, name in re.findall(r"from \.([\w.]+) import (\w+) as", stub)}
    found = {name: resolved(module, ALIASES.get(name, name)) for name, module in names.items()}
    return {name: one for name, one in found.items() if one}


def doors() -> Iterator[Door]:
    """All that users call: functions, constructors, public methods."""
    for name, (module, node) in public().items():
        if isinstance(node, ast.FunctionDef):
            yield Door(name, module, (node,), docstring(node), None)
            continue
        above = bases(module, node)
        inherited = "\n".join(docstring(one) for base in above for one in [base, *methods(base)])
        built = tuple(one for one in methods(node) if one.name in CONSTRUCTORS)
        yield Door(name, module, built, "\n".join(map(docstring, [node, *built])), node)
        for one in methods(node):
            if not one.name.startswith("_"):
                texts = [docstring(one), docstring(node), inherited]
                yield Door(f"{name}.{one.name}", module, (one,), "\n".join(texts), node)


def documented(text: str) -> set[str]:
    """Errors that a docstring names: in its section, or in a sentence."""
    found, inside = {one for pair in IN_WORDS.findall(text) for one in pair if one}, False
    for line in text.splitlines():
        heading = HEADING.match(line)
        inside = heading[1] == "Raises" if heading else inside and (not line or line.startswith(" "))
        if inside:
            found |= set(re.findall(r"\b\w+Error\b", line))
    return found


@cache
def errors() -> dict[str, set[str]]:
    """All errors by name, Python's own and the package's, with their own names and those of all classes above."""
    above: dict[str, set[str]] = {
        name: {one.__name__ for one in kind.__mro__}
        for name, kind in vars(builtins).items() if isinstance(kind, type) and issubclass(kind, BaseException)
    }  # fmt: skip
    direct = {
        node.name: [ast.unparse(base) for base in node.bases]
        for file in sorted((ROOT / "drift_drake").rglob("*.py"))
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef) and node.name.endswith("Error")
    }

    def ancestors(name: str) -> set[str]:
        if name not in above:
            above[name] = {name}.union(*map(ancestors, direct.get(name, [])))
        return above[name]

    for name in direct:
        ancestors(name)
    return above


def covered(error: str, by: set[str] | frozenset[str]) -> bool:
    """Whether an error is one of some, or of a class below."""
    return bool(errors().get(error, set()) & by)


def raised(door: Door) -> set[str]:
    """Errors that a door raises: by itself, by what it calls without a word of it, or as what it calls says."""
    return {error for node in door.nodes for error in _of_body(door.module, node, door.owner, ())}


def _of_body(module: str, node: ast.FunctionDef, owner: ast.ClassDef | None, above: tuple[int, ...]) -> set[str]:
    if id(node) in above:
        return set()
    found: set[str] = set()

    def visit(part: ast.AST, caught: frozenset[str]) -> None:
        if isinstance(part, ast.Try):
            inside = caught | {name.id for handler in part.handlers for name in _names(handler.type)}
            for one in part.body:
                visit(one, frozenset(inside))
            for one in [*(line for handler in part.handlers for line in handler.body), *part.orelse, *part.finalbody]:
                visit(one, caught)
            return
        here: set[str] = set()
        if isinstance(part, ast.Raise) and part.exc is not None:
            what = part.exc.func if isinstance(part.exc, ast.Call) else part.exc
            here = {what.id} if isinstance(what, ast.Name) and what.id in errors() else set()
        elif isinstance(part, ast.Call):
            here = _of_call(module, part.func, owner, (*above, id(node)))
        found.update(error for error in here if not covered(error, caught))
        for one in ast.iter_child_nodes(part):
            visit(one, caught)

    for part in node.body:
        visit(part, frozenset())
    return found


def _names(caught: ast.expr | None) -> list[ast.Name]:
    if caught is None:
        return [ast.Name("BaseException")]
    return [part for part in ast.walk(caught) if isinstance(part, ast.Name)]


def _of_call(module: str, called: ast.expr, owner: ast.ClassDef | None, above: tuple[int, ...]) -> set[str]:
    """Of a function, a class, or a method of either the same object or a class that is named."""
    if isinstance(called, ast.Name) and (target := resolved(module, called.id)):
        where, node = target
        if isinstance(node, ast.FunctionDef):
            return documented(docstring(node)) or _of_body(where, node, None, above)
        built = [one for one in methods(node) if one.name in CONSTRUCTORS]
        said = documented(docstring(node))
        return said or {error for one in built for error in _of_body(where, one, node, above)}
    if isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name):
        place = (module, owner) if called.value.id == "self" else resolved(module, called.value.id)
        if place and isinstance(place[1], ast.ClassDef):
            for one in methods(place[1]):
                if one.name == called.attr:
                    return documented(docstring(one)) or _of_body(place[0], one, place[1], above)
    return set()
