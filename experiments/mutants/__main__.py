"""Mutation testing: small faults are put into the package one at a time, and the tests must see each.

    python -m experiments.mutants --out runs/mutants

A seeded sample of cosmic-ray's mutants is tried in a copy of the working tree. Given the same folder again it goes on
where it was; `--again` tries once more, with the tests of now, what survived. The report is OUT/report.md.

A mutant of a module with compiled functions is tried first as plain Python, on the test files that are
quick so: nothing is compiled, and no compiled function can be stale. What survives is tried on the other files,
compiled, in caches that are put back after each.
"""

import dataclasses
import difflib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path

from cosmic_ray.mutating import use_mutation
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkItem, WorkResult
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.common.errors import DriftDrakeError, InvalidOptionError
from experiments.mutants.chosen_tests import Timings, imported, test_files
from experiments.mutants.report import TOO_LONG, write_report
from experiments.mutants.sample import PARTS, part_of, sample
from experiments.mutants.warm import BROKEN, TestRun, WarmPython, warm_python

ROOT = Path(__file__).parents[2]
COMPILED = re.compile(r"\b(compiled|jitable)\b")
NO_TESTS = 5  # pytest's exit where all are left out
NOT_RUN = TestRun(0, 0.0, "no test is quick enough")


@dataclasses.dataclass(frozen=True)
class MutantsConfig:
    """What is tried."""

    out: Path = Path("runs/mutants")
    """Folder of the session, its copy of the working tree and its report."""
    samples: int = 400
    """Mutants, as many of each part."""
    seed: int = 0
    """Of the sample."""
    parts: tuple[str, ...] = tuple(PARTS)
    """Parts whose mutants are tried now."""
    again: bool = False
    """Try once more, with the tests of now, those that survived."""
    plain: float = 20.0
    """Seconds of CPU that a test file may take as plain Python."""
    together: float = 25.0
    """Seconds of CPU that a mutant's test files may take together."""
    compiled: float = 40.0
    """The same of those that take too long as plain Python, compiled; none is tried where it is zero."""
    limit: float = 150.0
    """Seconds of CPU of one mutant's tests."""


def main(config: MutantsConfig) -> None:
    """Tries what has not been tried yet, and writes the report."""
    unknown = set(config.parts) - set(PARTS)
    if unknown:
        raise InvalidOptionError(f"--parts {' '.join(sorted(unknown))}: give some of {', '.join(PARTS)}")
    out = config.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    tree, session = out / "tree", out / "session.sqlite"
    copy_of_working_tree(tree)
    sample(tree / "drift_drake", session, config.samples, config.seed)
    with use_db(session, WorkDB.Mode.open) as work:
        results = dict(work.results)
        tried = {job for job, r in results.items() if not (config.again and r.test_outcome == TestOutcome.SURVIVED)}
        items = [item for item in work.work_items if item.job_id not in tried]
        items = [item for item in items if part_of(module_of(item, tree)) in config.parts]
        items.sort(key=lambda item: list(PARTS).index(part_of(module_of(item, tree))))
        if items:
            own = {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
            compiled = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"} | own
            plain = compiled | {"NUMBA_DISABLE_JIT": "1"}
            with warm_python(tree, plain) as one, warm_python(tree, compiled) as other:
                trial = Trial(tree, out, config, one, other)
                for item in tqdm(items, unit="mutant", desc="mutants"):
                    work.set_result(item.job_id, trial.result(item))
        print(write_report(work, tree, out / "report.md"))


def copy_of_working_tree(tree: Path) -> None:
    """Copies files that are new or have changed, with their times, and removes those that are gone."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True, text=True).stdout.split("\0")
    names = {name for name in listed if name and (ROOT / name).is_file()}
    for name in names:
        source, target = ROOT / name, tree / name
        if not target.is_file() or source.read_bytes() != target.read_bytes():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target)
    for file in list(tree.rglob("*.py")):
        if str(file.relative_to(tree)) not in names:
            file.unlink()
    shared = tree.parent / "shared"
    if (ROOT.parent / "shared").is_dir() and not shared.exists():
        shared.symlink_to((ROOT.parent / "shared").resolve())


def module_of(item: WorkItem, tree: Path) -> str:
    """The mutated module by its place in the package."""
    return str(item.mutations[0].module_path.relative_to(tree / "drift_drake").with_suffix(""))


class Trial:
    """The tests of mutants in a tree."""

    def __init__(self, tree: Path, out: Path, config: MutantsConfig, plain: WarmPython, compiled: WarmPython) -> None:
        self.tree, self.config, self.caches = tree, config, out / "caches"
        self.plain = Timings(tree, out / "plain.json", plain, config.plain)
        self.compiled = Timings(tree, out / "compiled.json", compiled, config.limit)

    def result(self, item: WorkItem) -> WorkResult:
        """The outcome of one mutant."""
        module = module_of(item, self.tree)
        result = WorkResult(WorkerOutcome.NO_TEST, None, TestOutcome.SURVIVED)
        for files in test_files(self.tree, module):
            first = self.plain if is_compiled(module) else self.compiled
            before, result = result, self._tried(item, first, files, self.config.together)
            slow = [file for file in files if first.seconds(file) is None]
            if result.test_outcome == TestOutcome.SURVIVED and is_compiled(module) and slow and self.config.compiled:
                self.compiled.measure(slow)
                copy_caches(self.tree, self.caches)
                with caches_put_back(self.tree, self.caches):
                    result = self._tried(item, self.compiled, slow, self.config.compiled)
            if result.test_outcome != TestOutcome.SURVIVED:
                break
            if result.output == NOT_RUN.output and before.output:
                result = before
        return result

    def _tried(self, item: WorkItem, timings: Timings, files: list[Path], budget: float) -> WorkResult:
        timings.measure(files)
        files = timings.within(files, budget)
        (mutation,) = item.mutations
        path, operator = mutation.module_path, get_operator(mutation.operator_name)(**mutation.operator_args)
        before = path.stat()
        try:
            with use_mutation(path, operator, mutation.occurrence) as (original, mutant):
                Path(cache_from_source(str(path))).unlink(missing_ok=True)
                if not is_compiled(module_of(item, self.tree)):
                    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))  # so that no cache counts as stale
                run = timings.python.run(timings.arguments(files), self.config.limit) if files else NOT_RUN
        finally:
            os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
        if run.code == BROKEN:
            raise DriftDrakeError(f"{path}: its tests cannot be run:\n{run.output}")
        diff = "\n".join(difflib.unified_diff(original.split("\n"), mutant.split("\n"), lineterm=""))
        outcome = TestOutcome.SURVIVED if run.code in (0, NO_TESTS) else TestOutcome.KILLED
        return WorkResult(WorkerOutcome.NORMAL, run.output if run.finished else TOO_LONG, outcome, diff)


@cache
def is_compiled(module: str) -> bool:
    """Whether a module of the package has functions that numba compiles, or names that such a module imports."""
    files = [file for file in (ROOT / "drift_drake").rglob("*.py") if COMPILED.search(file.read_text(encoding="utf-8"))]
    dotted = f"drift_drake.{module.replace('/', '.')}"
    return ROOT / "drift_drake" / f"{module}.py" in files or any(dotted in imported(file) for file in files)


def copy_caches(source: Path, target: Path) -> None:
    """Copies numba's files with their times."""
    for file in source.rglob("*.nb[ic]"):
        copy = target / file.relative_to(source)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(file, copy)


@contextmanager
def caches_put_back(tree: Path, kept: Path) -> Iterator[None]:
    """The package itself drops what rests on a changed file (`car.compilation`); afterwards all is as it was."""
    try:
        yield
    finally:
        for file in tree.rglob("*.nb[ic]"):
            file.unlink()
        copy_caches(kept, tree)


if __name__ == "__main__":
    sys.setrecursionlimit(10_000)  # parso walks long expressions
    run_command(main, MutantsConfig, __doc__)
