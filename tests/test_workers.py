"""Worker processes end with the process that started them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from drift_drake.common.worker_pool import worker_processes

PARENT = """
import sys, time
from pathlib import Path
from drift_drake.common.worker_pool import worker_processes
from test_workers import work

if __name__ == "__main__":
    with worker_processes(1) as submit:
        submit(work, sys.argv[1])
        submit(work, sys.argv[1]).result()
"""
PATIENCE = 30.0  # [s] for processes to start and end; they take less than one


def work(file: str) -> None:
    """Tells its process and goes on for long."""
    Path(file + ".part").write_text(str(os.getpid()))
    Path(file + ".part").replace(file)
    time.sleep(10 * PATIENCE)


def pid(_: None) -> int:
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
    script, reported = tmp_path / "parent.py", tmp_path / "worker"
    script.write_text(PARENT)
    paths = os.pathsep.join([str(Path(__file__).parents[1]), str(Path(__file__).parent)])
    parent = subprocess.Popen([sys.executable, str(script), str(reported)], env=os.environ | {"PYTHONPATH": paths},
                              stderr=subprocess.DEVNULL)  # fmt: skip
    try:
        assert waited_for(reported.exists)
        worker = int(reported.read_text())
        assert running(worker)
        parent.send_signal(number)
        parent.wait(PATIENCE)
        assert waited_for(lambda: not running(worker))
    finally:
        parent.kill()
        parent.wait()


def children(process: int) -> list[int]:
    """Of all threads: a pool starts its workers from one of its own."""
    found = [file.read_text().split() for file in Path(f"/proc/{process}/task").glob("*/children")]
    return [int(child) for several in found for child in several]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="looks processes up in /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_diagnosis_of_a_folder_leaves_no_worker(tmp_path: Path, number: signal.Signals) -> None:
    # Imported here: the worker processes of the other tests import this module, and need none of it.
    import numpy as np

    from drift_drake.car.log.table import write_run
    from drift_drake.car.parameters import VehicleParameters
    from experiments.benchmarks.compiled_cases import make_case
    from experiments.benchmarks.truths import Truth

    runs = make_case(Truth({"rear_stiffness_error": -0.3}, {}, {}), VehicleParameters(), np.random.default_rng(2), 3.0)
    for run in runs:
        write_run(run, tmp_path / "cases" / "a" / f"{run.name}.csv")
        write_run(run, tmp_path / "cases" / "b" / f"{run.name}.csv")
    vehicle = tmp_path / "car.yaml"
    VehicleParameters().to_yaml(vehicle)
    command = [sys.executable, "-m", "drift_drake", "diagnose", str(tmp_path / "cases"), "--vehicle", str(vehicle)]
    parent = subprocess.Popen([*command, "--quiet"], env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])},
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)  # fmt: skip
    try:
        assert waited_for(lambda: len(children(parent.pid)) >= 2)
        workers = children(parent.pid)
        time.sleep(4.0)  # into their work
        assert all(running(worker) for worker in workers)
        parent.send_signal(number)
        _, error = parent.communicate(timeout=PATIENCE)
        assert parent.returncode == 128 + number
        assert error.count("\n") == 1
        assert waited_for(lambda: not any(running(worker) for worker in workers))
    finally:
        parent.kill()
        parent.wait()


def ctrl_c_is_blocked(_: None) -> bool:
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_workers_never_see_ctrl_c() -> None:
    with worker_processes(1, tasks_per_worker=1) as submit:
        assert submit(ctrl_c_is_blocked, None).result()
        assert submit(ctrl_c_is_blocked, None).result()  # by the next process
    assert not ctrl_c_is_blocked(None)


def test_the_pool_works_and_ends() -> None:
    with worker_processes(1) as submit:
        worker = submit(pid, None).result()
        assert worker != os.getpid()
    assert not running(worker)
