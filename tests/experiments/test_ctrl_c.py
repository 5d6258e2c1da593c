"""Ctrl-C in an experiment is answered in one line, from its imports on."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
ENDS = {
    "as it is": "time.sleep(60.0)",
    "as an import of a compiled module hands it on": """
try:
    time.sleep(60.0)
except BaseException:
    raise ImportError("initialization failed")
""",
}


@pytest.mark.parametrize("how", sorted(ENDS))
def test_ctrl_c_is_answered_in_one_line(how: str) -> None:
    script = f"import time\nimport experiments\nprint('ready', flush=True)\n{ENDS[how]}"
    process = subprocess.Popen([sys.executable, "-c", script], env=ENVIRONMENT, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60.0)
    assert process.returncode != 0
    assert error.split("\n") == ["", "interrupted; the same command with the same folder goes on where it was", ""]


STARTING = """
import time
import experiments
from drift_drake.workers import worker_processes

if __name__ == "__main__":
    with worker_processes(2) as pool:
        print("ready", flush=True)
        pool.submit(print)
        sum(range(10**8))  # some seconds in which this process cannot answer
time.sleep(60.0)  # a worker imports this file
"""


def test_workers_that_are_only_starting_leave_the_answer_to_their_parent(tmp_path: Path) -> None:
    script = tmp_path / "starting.py"
    script.write_text(STARTING)
    process = subprocess.Popen([sys.executable, str(script)], env=ENVIRONMENT, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True, start_new_session=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(1.0)  # into the workers' imports
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=60.0)
    assert error.split("\n") == ["", "interrupted; the same command with the same folder goes on where it was", ""]


def test_other_errors_are_told_as_they_are() -> None:
    done = subprocess.run([sys.executable, "-c", "import experiments\nraise ValueError('x')"], env=ENVIRONMENT,
                          capture_output=True, text=True)  # fmt: skip
    assert done.stderr.endswith("ValueError: x\n")
