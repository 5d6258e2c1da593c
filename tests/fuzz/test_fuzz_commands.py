"""Commands on spoilt files, as a shell runs them; the kept corpus; sequences of commands, some of them killed."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("hypothesis", reason="fuzzing needs the extra `test`")

import yaml
from as_command import Ended, command, warm, well
from corpus_targets import CORPUS, TARGETS
from fuzzing import CASES, COUNTS, LONGEST, cases, tried
from hypothesis import given, settings, target
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from mutations import mutated, spoilt
from small_recordings import small_recordings
from test_fuzz import ANSWER, MAPPING, VEHICLE, as_json, as_yaml, log_text, written

from drift_drake.common.run_folder import is_done

FEW = 5  # of a target in the test suite
REPORT = {"mapping": {"trust": ["v"]}, "runs": [{"std": {"v": 0.1}}]}
LONG = 300  # [s] that a command may compute, if it fits a car
SHARE = 0.01  # of all cases, of a target of commands


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Good files, and what is compiled on first use compiled."""
    folder = tmp_path_factory.mktemp("commands")
    good_files(folder)
    warm()
    return folder


def good_files(folder: Path) -> None:
    written(folder / "car.yaml", as_yaml(VEHICLE))
    written(folder / "answer.json", as_json(ANSWER))
    written(folder / "mapping.yaml", as_yaml(MAPPING))
    t = np.arange(0.0, 4.0, 0.02)
    wave = 30.0 * np.sin(3.0 * t)
    rows = np.column_stack([1e3 * t, wave, 40.0 + 0.0 * t, t, -np.deg2rad(wave), 10.0 * wave])
    np.savetxt(folder / "recording.csv", rows, delimiter=",", header="time,yaw,speed,stamp,g,s", comments="")


def guided(ended: Ended, of: str = "") -> None:
    """Hypothesis looks for inputs that take long, and for those that are said much about; of: one of two commands."""
    target(ended.seconds, label=f"seconds {of}")
    target(float(len(ended.said)), label=f"characters said {of}")


@cases(SHARE, FEW)
@given(content=st.one_of(mutated(MAPPING).map(as_yaml), spoilt(as_yaml(MAPPING))))
def test_imports(folder: Path, content: bytes) -> None:
    written(folder / "spoilt.yaml", content)
    shutil.rmtree(folder / "runs", ignore_errors=True)
    guided(well("import", command(folder, "import", "recording.csv", "--mapping", "spoilt.yaml", "--out", "runs")))


@cases(SHARE, FEW)
@given(data=st.data())
def test_looks_at_recordings(folder: Path, data: st.DataObject) -> None:
    """Of foreign formats: read in a process of their own, which may end."""
    (folder / "recordings").mkdir(exist_ok=True)
    if not any((folder / "recordings").iterdir()):
        small_recordings(folder / "recordings")
    paths = sorted(path for path in (folder / "recordings").rglob("*") if path.is_file())
    path = data.draw(st.sampled_from(paths))
    good = path.read_bytes()
    read = path.parent if path.name == "metadata.yaml" else path
    path.write_bytes(data.draw(spoilt(good)))
    try:
        guided(well(f"look ({path.suffix[1:]})", command(folder, "import", "--look", read, longest=60.0)))
    finally:
        path.write_bytes(good)


@cases(SHARE, FEW)
@given(
    content=spoilt(log_text().encode()),
    report=st.none() | mutated({"mapping": {"trust": ["v"]}, "runs": [{"std": {"v": 0.1}}]}),
)
def test_checks_of_logs(folder: Path, content: bytes, report: object) -> None:
    case = folder / "case"
    shutil.rmtree(case, ignore_errors=True)
    case.mkdir()
    written(case / "run_0.csv", content)
    if report is not None:
        written(case / "import.json", as_json(report))
    guided(well("export", command(folder, "export", "case", "--format", "parquet", "--out", "exported")))


@cases(SHARE, FEW)
@given(answer=mutated(ANSWER).map(as_json), vehicle=st.just(VEHICLE) | mutated(VEHICLE, 1))
def test_corrections(folder: Path, answer: bytes, vehicle: object) -> None:
    written(folder / "spoilt.json", answer)
    written(folder / "spoilt_car.yaml", as_yaml(vehicle))
    guided(
        well("apply", command(folder, "apply", "spoilt.json", "--vehicle", "spoilt_car.yaml", "--out", "new.yaml")),
        "apply",
    )
    guided(well("effects", command(folder, "effects", "--vehicle", "spoilt_car.yaml", "--json", "-")), "effects")


@pytest.mark.parametrize("path", sorted(CORPUS.rglob("*.*")), ids=lambda path: f"{path.parent.name}-{path.name}")
def test_the_kept_corpus(tmp_path: Path, path: Path) -> None:
    """Inputs that failed once, and the first ones of the guided fuzz."""
    ending, use = TARGETS[path.parent.name]
    name = "run_0.csv" if ending == ".csv" else f"import{ending}"
    tried("corpus", use, written(tmp_path / name, path.read_bytes()))


@pytest.mark.skipif(find_spec("atheris") is None, reason="guided fuzzing needs atheris: pip install drift_drake[fuzz]")
@pytest.mark.parametrize("name", sorted(TARGETS) if CASES else ["mapping"])
def test_inputs_guided_by_what_they_reach(name: str) -> None:
    runs = max(200, round(0.05 * CASES))
    script = Path(__file__).with_name("guided.py")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(script.parents[2]), str(script.parent)])}
    done = subprocess.run([sys.executable, str(script), name, f"-runs={runs}", "-seed=1"], env=environment,
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]
    COUNTS.setdefault("guided", Counter())["tried"] += runs


class Sequences(RuleBasedStateMachine):
    """A car's files, worked on by commands in any order, some of them killed: what is there is whole, and goes on.

    No rule's precondition looks at files: which are there depends on the moment of a kill, and would not repeat.
    """

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp(prefix="sequences"))
        warm()
        good_files(self.folder)

    def teardown(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)

    def _does(self, *words: str, after: float | None = None, longest: float = LONGEST) -> Ended:
        ended = command(self.folder, *words, killed_after=after, longest=longest)
        return ended if ended.code == -9 and after is not None else well("sequences", ended)

    @rule(after=st.none() | st.floats(0.0, 0.3), trust=st.booleans())
    def imports(self, after: float | None, trust: bool) -> None:
        words = ["import", "recording.csv", "--mapping", "mapping.yaml", "--out", "runs"]
        there = (self.folder / "runs").exists()
        ended = self._does(*words, *(["--trust", "v"] if trust else []), after=after)
        assert ended.code in (0, -9) or (there and "holds runs already" in ended.said), ended.said

    @rule(after=st.none() | st.floats(0.0, 0.3))
    def exports(self, after: float | None) -> None:
        self._does("export", "runs", "--format", "parquet", "--out", "exported", after=after)

    @rule(after=st.none() | st.floats(0.0, 0.3))
    def applies(self, after: float | None) -> None:
        ended = self._does("apply", "answer.json", "--vehicle", "car.yaml", "--out", "corrected.yaml", after=after)
        assert ended.code in (0, -9), ended.said

    @rule(after=st.none() | st.floats(0.0, 10.0))
    @precondition(lambda _: CASES > 0)
    def checks(self, after: float | None) -> None:
        self._does("check", "runs", "--vehicle", "car.yaml", after=after, longest=LONG)

    @rule(after=st.none() | st.floats(0.0, 20.0))
    @precondition(lambda _: CASES > 0)
    def identifies(self, after: float | None) -> None:
        words = ("identify", "runs", "--vehicle", "car.yaml", "--out", "identified.yaml", "--quiet")
        self._does(*words, after=after, longest=LONG)

    @rule()
    def takes_the_corrected_car(self) -> None:
        there = (self.folder / "corrected.yaml").exists()
        assert self._does("effects", "--vehicle", "corrected.yaml").code == (0 if there else 2)

    @rule(content=spoilt(log_text().encode()))
    def somebody_spoils_a_run(self, content: bytes) -> None:
        if (self.folder / "runs").exists():
            (self.folder / "runs" / "run_0.csv").write_bytes(content)

    @rule()
    def starts_again(self) -> None:
        shutil.rmtree(self.folder / "runs", ignore_errors=True)

    @invariant()
    def what_is_there_is_whole(self) -> None:
        for path in self.folder.rglob("*.json"):
            assert is_done(path), path
        for name in ("corrected.yaml", "identified.yaml"):
            path = self.folder / name
            assert not path.exists() or yaml.safe_load(path.read_text()), path


TestSequences = Sequences.TestCase
TestSequences.settings = settings(max_examples=max(3, round(0.002 * CASES)), stateful_step_count=8)
