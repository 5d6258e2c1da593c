"""The mutation tester on a package of two lines: what it samples, which tests it chooses, what it reports."""

from pathlib import Path

import pytest

pytest.importorskip("cosmic_ray", reason="mutation testing is an extra: pip install 'drift_drake[mutants]'")

from cosmic_ray import work_item
from cosmic_ray.work_db import WorkDB, use_db

from experiments.mutants import report, sample
from experiments.mutants.chosen_tests import test_files as files_of
from experiments.mutants.report import changed_lines, write_report
from experiments.mutants.sample import sample as draw

DIFF = """--- \n+++ \n@@ -1,2 +1,2 @@\n def f(a, b):\n-    return a + b\n+    return a - b"""


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with one module, and tests: of its name, that import it, of its folder, and of something else."""
    (tmp_path / "drift_drake" / "logs" / "importing").mkdir(parents=True)
    (tmp_path / "drift_drake" / "logs" / "importing" / "units.py").write_text("def f(a, b):\n    return a + b * 2\n")
    texts = {
        "logs/test_importing_units.py": "", "logs/test_other.py": "",
        "model/test_far.py": "from drift_drake.logs.importing import units\n",
        "docs/test_page.py": "from drift_drake.logs.importing import units\n",
    }  # fmt: skip
    for name, text in texts.items():
        (tmp_path / "tests" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "tests" / name).write_text(text)
    monkeypatch.setattr(sample, "PARTS", {"import": ("logs/importing/units",)})
    monkeypatch.setattr(report, "PARTS", sample.PARTS)
    return tmp_path


def test_a_modules_tests_are_those_of_its_name_and_those_that_import_it(tree: Path) -> None:
    own, importing = files_of(tree, "logs/importing/units")
    assert [file.name for file in own] == ["test_importing_units.py"]
    assert [file.name for file in importing] == ["test_far.py"]
    (tree / "tests" / "logs" / "test_importing_units.py").unlink()
    importing, near = files_of(tree, "logs/importing/units")
    assert [file.name for file in importing] == ["test_far.py"]
    assert [file.name for file in near] == ["test_other.py"]


def test_a_seed_draws_the_same_mutants_and_a_session_stays(tree: Path) -> None:
    drawn = []
    for name in ("one", "other"):
        draw(tree / "drift_drake", tree / name, 3, seed=5)
        with use_db(tree / name, WorkDB.Mode.open) as work:
            mutations = [item.mutations[0] for item in work.work_items]
        drawn.append(sorted((m.operator_name, m.occurrence) for m in mutations))
    assert drawn[0] == drawn[1]
    assert len(drawn[0]) == 3
    before = (tree / "one").read_bytes()
    draw(tree / "drift_drake", tree / "one", 3, seed=6)
    assert (tree / "one").read_bytes() == before


def test_the_report_counts_by_part_and_names_survivors(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert changed_lines(DIFF) == ("return a + b", "return a - b")
    draw(tree / "drift_drake", tree / "session", 4, seed=0)
    outcome_of = work_item.TestOutcome
    outcomes = [outcome_of.KILLED, outcome_of.KILLED, outcome_of.SURVIVED, outcome_of.SURVIVED]
    with use_db(tree / "session", WorkDB.Mode.open) as work:
        for i, (item, outcome) in enumerate(zip(work.work_items, outcomes, strict=True)):
            diff = DIFF.replace("a - b", "a * b") if i == 3 else DIFF
            output = report.TOO_LONG if i == 1 else "1 failed, 2 passed"
            work.set_result(item.job_id, work_item.WorkResult(work_item.WorkerOutcome.NORMAL, output, outcome, diff))
        known = {("logs/importing/units", "return a + b", "return a * b"): "for a reason"}
        monkeypatch.setattr(report, "equivalents", lambda: known)
        table = write_report(work, tree, tree / "report.md")
    assert "| import | 1 | 1 | 0 | 1 | 1 | 50.0 |" in table
    text = (tree / "report.md").read_text()
    assert "for a reason" in text
    assert "`return a - b`" in text
