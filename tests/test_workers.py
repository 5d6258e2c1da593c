"""Worker processes end with the process that started them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from drift_drake.workers import worker_processes

PARENT = """
import sys, time
from pathlib import Path
from drift_drake.workers import worker_processes
from test_workers import work

if __name__ == "__main__":
    with worker_processes(1) as pool:
        pool.submit(work, sys.argv[1])
        pool.submit(work, sys.argv[1]).result()
"""
PATIENCE = 30.0  # [s] for processes to start and end; they take less than one


def work(file: str) -> None:
    """Tells its process and goes on for long."""
    Path(file + ".part").write_text(str(os.getpid()))
    Path(file + ".part").replace(file)
    time.sleep(10 * PATIENCE)


def pid() -> int:
    return os.getpid()


def running(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def waited_for(condition: object) -> bool:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if condition():  # type: ignore[operator]
            return True
        time.sleep(0.02)
    return False


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks processes up in /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL, signal.SIGINT])
def test_a_worker_does_not_outlive_its_parent(tmp_path: Path, number: signal.Signals) -> None:
    script, told = tmp_path / "parent.py", tmp_path / "worker"
    script.write_text(PARENT)
    paths = os.pathsep.join([str(Path(__file__).parents[1]), str(Path(__file__).parent)])
    parent = subprocess.Popen([sys.executable, str(script), str(told)], env=os.environ | {"PYTHONPATH": paths},
                              stderr=subprocess.DEVNULL)  # fmt: skip
    try:
        assert waited_for(told.exists)
        worker = int(told.read_text())
        assert running(worker)
        parent.send_signal(number)
        parent.wait(PATIENCE)
        assert waited_for(lambda: not running(worker))
    finally:
        parent.kill()
        parent.wait()


def test_the_pool_works_and_ends() -> None:
    with worker_processes(1) as pool:
        worker = pool.submit(pid).result()
        assert worker != os.getpid()
    assert not running(worker)
