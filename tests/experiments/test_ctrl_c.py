"""Ctrl-C and SIGTERM in an experiment or a diagram are answered in one line, from the imports on."""

import ast
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ENDS = pytest.mark.parametrize(
    ("number", "how", "code"), [(signal.SIGINT, "interrupted", 130), (signal.SIGTERM, "terminated", 143)]
)
SWALLOWING = """
print("ready", flush=True)
try:
    import time
    time.sleep(60.0)
except BaseException:
    raise ImportError("initialization failed")  # as Drake's import says it
"""
WORKING = """
import time
from diagrams.command import run_command


def main() -> None:
    print("ready", flush=True)
    {}


run_command(main)
"""
IMPORTED = """
import time
try:
    time.sleep(1.0)
except BaseException:
    print("lines of its own")
    raise ImportError("initialization failed")
"""
BODIES = {
    "as it is": "time.sleep(60.0)",
    "within an import": "import imported; time.sleep(60.0)",
    "as compiled code hands it on": """
    try:
        time.sleep(60.0)
    except BaseException:
        raise RuntimeError("a callback failed")
""",
}
STARTING = """
import time
from pathlib import Path
from diagrams.command import run_command
from drift_drake.common.executors import ExecutorConfig, run_jobs


def work(_job: int) -> None:
    Path("at work").touch()
    time.sleep(60.0)


def main() -> None:
    print("ready", flush=True)
    run_jobs(ExecutorConfig(), work, [1, 2], print, "job", quiet=True)


if __name__ == "__main__":
    run_command(main)
time.sleep(1.0)  # a worker imports this file
"""


def said_after(
    arguments: list[str], path: Path, end: Callable[[int], None], wait: Callable[[], None] = lambda: None
) -> tuple[int, str]:
    """(exit code, standard error) of Python in a folder, ended once it is ready and has been waited for."""
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env=os.environ | {"PYTHONPATH": os.pathsep.join([str(path), str(ROOT)])},
                               start_new_session=True, cwd=path,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    wait()
    end(process.pid)
    _, error = process.communicate(timeout=60.0)
    return process.returncode, error


@ENDS
@pytest.mark.parametrize("module", ["experiments.model.drives", "diagrams.closed_loop"])
def test_imports_end_at_once(tmp_path: Path, module: str, number: signal.Signals, how: str, code: int) -> None:
    (tmp_path / "pydrake").mkdir()
    (tmp_path / "pydrake" / "__init__.py").write_text(SWALLOWING)
    said = said_after(["-m", module], tmp_path, lambda process: os.kill(process, number))
    assert said == (code, f"{module}: {how} before anything was begun\n")


@ENDS
@pytest.mark.parametrize("body", sorted(BODIES))
def test_work_ends_in_one_line(tmp_path: Path, body: str, number: signal.Signals, how: str, code: int) -> None:
    (tmp_path / "working.py").write_text(WORKING.format(BODIES[body]))
    (tmp_path / "imported.py").write_text(IMPORTED)
    ended, error = said_after([str(tmp_path / "working.py")], tmp_path, lambda process: os.kill(process, number))
    assert ended == code
    assert error.startswith(f"experiments: {how}; what is done stays")
    assert error.count("\n") == 1


def at_work(path: Path) -> None:
    """Waits until a worker is."""
    end = time.monotonic() + 30.0
    while not (path / "at work").exists() and time.monotonic() < end:
        time.sleep(0.02)
    (path / "at work").unlink()


@pytest.mark.parametrize("working", [False, True])
def test_workers_leave_the_answer_to_their_parent(tmp_path: Path, working: bool) -> None:
    (tmp_path / "starting.py").write_text(STARTING)
    wait = partial(at_work, tmp_path) if working else partial(time.sleep, 0.3)  # within the workers' imports
    for end in (lambda process: os.killpg(process, signal.SIGINT), lambda process: os.kill(process, signal.SIGTERM)):
        code, error = said_after([str(tmp_path / "starting.py")], tmp_path, end, wait)
        assert code in (130, 143)
        assert error.count("\n") == 1


def test_nothing_is_said_after_a_kill(tmp_path: Path) -> None:
    (tmp_path / "starting.py").write_text(STARTING)
    end: Callable[[int], None] = lambda process: os.kill(process, signal.SIGKILL)  # noqa: E731
    wait = partial(at_work, tmp_path)
    assert said_after([str(tmp_path / "starting.py")], tmp_path, end, wait) == (-signal.SIGKILL, "")


def test_other_errors_are_reported_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "failing.py").write_text(WORKING.format("raise ValueError('x')"))
    done = subprocess.run([sys.executable, str(tmp_path / "failing.py")], env=os.environ | {"PYTHONPATH": str(ROOT)},
                          capture_output=True, text=True)  # fmt: skip
    assert done.stderr.endswith("ValueError: x\n")


@pytest.mark.parametrize("package", ["diagrams", "experiments"])
def test_every_module_that_can_be_run_ends_so(package: str) -> None:
    others = []
    for path in (ROOT / package).rglob("*.py"):
        last = ast.parse(path.read_text()).body[-1:]
        if last and isinstance(last[0], ast.If) and "run_command(" not in ast.unparse(last[0]):
            others.append(path.name)
    assert others == []
