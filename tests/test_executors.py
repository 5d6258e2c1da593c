"""The same jobs on processes and on a cluster."""

import contextlib
import errno
import multiprocessing
import os
import signal
import socket
import threading
import time
from pathlib import Path

import pytest

from drift_drake.common import worker_pool
from drift_drake.common.errors import InvalidOptionError, MissingExtraError
from drift_drake.common.executors import ExecutorConfig, JobsFailedError, results_of, run_jobs


def square(number: float) -> tuple[float, int]:
    return number * number, os.getpid()


def collect(config: ExecutorConfig) -> tuple[dict[float, float], set[int]]:
    results: dict[float, float] = {}
    processes: set[int] = set()

    def finish(job: float, result: tuple[float, int]) -> None:
        results[job] = result[0]
        processes.add(result[1])

    run_jobs(config, square, [0.5 * k for k in range(12)], finish, "job")
    return results, processes


def test_processes() -> None:
    results, processes = collect(ExecutorConfig(workers=1))
    assert results == {0.5 * k: 0.25 * k * k for k in range(12)}
    assert os.getpid() not in processes


def refuse_two(number: int) -> int:
    if number == 2:
        raise ValueError("not this one")
    return number


def test_a_job_that_fails_loses_no_other() -> None:
    finished = []
    with pytest.raises(JobsFailedError, match="1 of 5 jobs failed, the first with ValueError: not this one"):
        run_jobs(ExecutorConfig(workers=1), refuse_two, list(range(5)), lambda job, _: finished.append(job), "job")
    assert sorted(finished) == [0, 1, 3, 4]


def once_killed(job: tuple[int, Path]) -> int:
    """Kills its own process the first time that job 1 is begun; job 2 kills it each time."""
    number, folder = job
    mark = folder / "begun"
    if number == 2 or (number == 1 and not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_killed_worker_loses_no_job_but_one_that_kills_each(tmp_path: Path) -> None:
    finished, failed = [], []
    run_jobs(ExecutorConfig(workers=2), once_killed, [(k, tmp_path) for k in range(6)],
             lambda _job, result: finished.append(result), "job",
             failed=lambda job, error: failed.append((job[0], str(error))))  # fmt: skip
    assert sorted(finished) == [0, 1, 3, 4, 5]
    assert failed == [(2, "its process ended 3 times before it, perhaps for want of memory")]


def process_of(_job: int) -> int:
    return os.getpid()


def test_a_process_is_renewed_after_some_jobs() -> None:
    processes = results_of(ExecutorConfig(workers=1), process_of, range(6), "job", tasks_per_worker=2)
    assert [len(set(processes[k : k + 2])) for k in (0, 2, 4)] == [1, 1, 1]
    assert len(set(processes)) == 3


def test_results_come_in_the_order_of_the_jobs() -> None:
    assert [result for result, _ in results_of(ExecutorConfig(workers=2), square, [3.0, 1.0, 2.0], "job")] == [9, 1, 4]


def test_a_cluster_that_loses_a_worker_does_all_jobs(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the cluster's engine is an extra: pip install drift_drake[cluster]")
    finished: list[int] = []
    run_jobs(ExecutorConfig(executor="dask", workers=2), once_killed, [(k, tmp_path) for k in (0, 1, 3, 4, 5)],
             lambda _job, result: finished.append(result), "job")  # fmt: skip
    assert sorted(finished) == [0, 1, 3, 4, 5]


def test_no_workers_are_refused() -> None:
    with pytest.raises(InvalidOptionError, match="--workers 0: give 1 or more"):
        ExecutorConfig(workers=0)


def test_no_jobs_start_no_worker() -> None:
    run_jobs(ExecutorConfig(executor="dask"), square, [], lambda _job, _result: None, "job")


def test_a_local_cluster_of_two_workers_starts_while_another_runs() -> None:
    pytest.importorskip("distributed", reason="the cluster's engine is an extra: pip install drift_drake[cluster]")
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        with contextlib.suppress(OSError):  # another test's cluster has it already
            other.bind(("0.0.0.0", 8787))  # the port that a first cluster takes
            other.listen()
        results, processes = collect(ExecutorConfig(executor="dask", workers=2))
    assert results == {0.5 * k: 0.25 * k * k for k in range(12)}
    assert len(processes) == 2
    assert os.getpid() not in processes


def slow_square(number: int) -> int:
    time.sleep(0.1)
    return number * number


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks processes up in /proc")
@pytest.mark.parametrize("after", [0.0, 0.02, 0.06, 0.15, 0.3, 0.6])
def test_a_worker_may_be_killed_at_any_moment(after: float) -> None:
    """While Python starts, while it imports, before its first job, within a job and between two."""
    killed: list[int] = []

    def kill() -> None:
        while not multiprocessing.active_children():
            time.sleep(0.001)
        time.sleep(after)
        for worker in multiprocessing.active_children()[-1:]:
            killed.append(worker.pid or 0)
            os.kill(killed[-1], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    assert results_of(ExecutorConfig(workers=2), slow_square, range(20), "job") == [k * k for k in range(20)]
    killer.join()
    assert killed


def test_workers_that_cannot_start_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_pool, "PAUSE", 0.0)
    monkeypatch.setattr(worker_pool._Worker, "__init__", short_of_memory)
    with pytest.raises(JobsFailedError, match="6 worker processes in a row ended while they started"):
        results_of(ExecutorConfig(workers=2), slow_square, range(3), "job")


def short_of_memory(_worker: object, _context: object) -> None:
    raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))


def fail_in_a_way(how: str) -> object:
    if how == "error that cannot be made again":
        raise MissingExtraError("this", "package", "extra")
    if how == "answer that cannot be sent":
        return lambda: None
    raise SystemExit(3)


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ("error that cannot be made again", "this needs package"),
        ("answer that cannot be sent", "pickle"),
        ("exit", "SystemExit: 3"),
    ],
)
def test_whatever_a_job_does_is_its_own_failure(how: str, says: str) -> None:
    with pytest.raises(JobsFailedError, match=says):
        results_of(ExecutorConfig(workers=1), fail_in_a_way, [how], "job")
