"""The same jobs on processes and on a cluster."""

import os

import pytest

from drift_drake.executors import ExecutorConfig, JobsFailedError, run_jobs


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


def test_no_jobs_start_no_worker() -> None:
    run_jobs(ExecutorConfig(executor="dask"), square, [], lambda _job, _result: None, "job")


def test_a_local_cluster_of_two_workers() -> None:
    pytest.importorskip("distributed", reason="the cluster's engine is an extra: pip install drift_drake[cluster]")
    results, processes = collect(ExecutorConfig(executor="dask", workers=2))
    assert results == {0.5 * k: 0.25 * k * k for k in range(12)}
    assert len(processes) == 2
    assert os.getpid() not in processes
