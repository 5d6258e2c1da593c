"""Which test files a mutant is tried on, and how long each takes without one."""

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from drift_drake.common.errors import DriftDrakeError
from experiments.mutants.warm import BROKEN, WarmPython

NAMED = re.compile(r"^[ \t]*(?:from|import) +((?:drift_drake|tests|experiments)[\w.]*)(?: +import +(\([^)]*\)|.*))?",
                   re.MULTILINE)  # fmt: skip

LEFT_OUT = ("docs", "fuzz", "experiments", "diagrams")  # folders whose tests are of something else
PLUGINS = ("-p", "no:cacheprovider", "-p", "experiments.mutants.quick_tests")
MOST_FILES = 5  # that import a module
QUICK = 10.0  # [s] of CPU in which nothing is compiled


def imported(file: Path) -> set[str]:
    """Modules that a file imports by name, with what it imports from packages."""
    found = set()
    for module, names in NAMED.findall(file.read_text(encoding="utf-8")):
        found |= {module, *(f"{module}.{name}" for name in re.findall(r"\w+", names))}
    return found


def test_files(tree: Path, module: str) -> tuple[list[Path], list[Path]]:
    """The test files of a module (`car/tyre`): those with its name, and others that import it, its folder's first.

    Without one of its name: those that import it, and others of the nearest folder that mirrors the module's.
    """
    folder, (name, *parents) = tree / "tests", Path(module).parts[::-1]
    for part in parents[::-1]:
        folder = folder / part if (folder / part).is_dir() else folder
    near = sorted(folder.glob("test_*.py"))
    stems = tuple(f"test_{prefix}{name}" for prefix in ("", *(f"{part}_" for part in parents)))
    own = [file for file in near if file.stem.startswith(stems)]
    dotted = f"drift_drake.{module.replace('/', '.')}"
    everywhere = (
        file for file in (tree / "tests").rglob("test_*.py") if file.relative_to(tree).parts[1] not in LEFT_OUT
    )
    importing = [file for file in everywhere if dotted in imported(file) and file not in own]
    importing.sort(key=lambda file: (file.relative_to(tree).parts[1] != parents[-1], file))
    importing = importing[:MOST_FILES]
    return (own, importing) if own else (importing, [file for file in near if file not in importing][:MOST_FILES])


class Timings:
    """Clean runs of test files, kept in a file: seconds of CPU of each, and the tests that fail by themselves."""

    def __init__(self, tree: Path, path: Path, python: WarmPython, limit: float) -> None:
        self.tree, self.path, self.python, self.limit = tree, path, python, limit
        self.kept: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}

    def measure(self, files: Iterable[Path]) -> None:
        """Runs each file that is new, or has changed."""
        for file in files:
            name, changed = self.name(file), file.stat().st_mtime
            if self.kept.get(name, {}).get("changed") != changed:
                self.kept[name] = {"changed": changed, **self._timed(name)}
                self.path.write_text(json.dumps(self.kept, indent=1))

    def _timed(self, name: str) -> dict[str, Any]:
        """Of the second run where the first one may have compiled functions."""
        first = self._run(name)
        return self._run(name) if (first["seconds"] or 0.0) > QUICK else first

    def _run(self, name: str) -> dict[str, Any]:
        run = self.python.run(["-q", "-rfE", "--tb=no", *PLUGINS, name], self.limit, bytecode=True)
        if run.code == BROKEN:
            raise DriftDrakeError(f"{name} cannot be run:\n{run.output}")
        failed = re.findall(r"^(?:FAILED|ERROR) (\S+::\S+)", run.output, re.MULTILINE)
        return {"seconds": run.seconds if run.code in (0, 1, 5) else None, "failed": failed}

    def name(self, file: Path) -> str:
        """A test file's path in the tree."""
        return str(file.relative_to(self.tree))

    def seconds(self, file: Path) -> float | None:
        """How long a file takes, None where it takes longer than the limit."""
        found = self.kept[self.name(file)]["seconds"]
        return None if found is None else float(found)

    def within(self, files: Iterable[Path], budget: float) -> list[Path]:
        """The quickest files, within a budget [s] together, the quickest first."""
        taken = []
        for seconds, file in sorted((s, file) for file in files if (s := self.seconds(file)) is not None):
            budget -= seconds
            if budget >= 0.0:
                taken.append(file)
        return taken

    def arguments(self, files: Iterable[Path]) -> list[str]:
        """pytest's, for these files in this order up to the first failure, without tests that fail by themselves."""
        names = [self.name(file) for file in files]
        deselected = [word for name in names for test in self.kept[name]["failed"] for word in ("--deselect", test)]
        return ["-x", "-q", "--tb=line", *PLUGINS, *deselected, *names]
