"""Where a long command's jobs run: this machine's cores, or a cluster's.

Either way the command sees a `concurrent.futures.Executor`. The cluster's engine is dask.distributed, an extra:

    pip install "drift_drake[cluster]"
    dask scheduler                                                 # on one machine
    dask worker tcp://SCHEDULER:8786 --nworkers -1 --nthreads 1    # on each machine, in the repository's root
    python -m experiments.drifting.figure_8 --executor dask --scheduler tcp://SCHEDULER:8786

Jobs and results travel as messages and the command's own process writes all files, so machines share no disk.
"""

import concurrent.futures
import dataclasses
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Literal, TypeVar

from tqdm import tqdm

from drift_drake.errors import DriftDrakeError
from drift_drake.workers import worker_processes

Job = TypeVar("Job")
Result = TypeVar("Result")


@dataclasses.dataclass(frozen=True)
class ExecutorConfig:
    """Where jobs run."""

    executor: Literal["processes", "dask"] = "processes"
    workers: int = 2
    """Processes on this machine; a cluster that `scheduler` names has its own."""
    scheduler: str | None = None
    """Address of a dask scheduler, such as tcp://HOST:8786; without, dask runs `workers` processes here."""


class NoClusterError(DriftDrakeError, RuntimeError):
    """A cluster that cannot be used; the message names the remedy."""


class JobsFailedError(DriftDrakeError, RuntimeError):
    """Some jobs failed; the message says how many, and the first one's error."""


@contextmanager
def make_executor(config: ExecutorConfig) -> Iterator[concurrent.futures.Executor]:
    """The executor that a config asks for, shut down at the end.

    Raises:
        NoClusterError: dask.distributed is not installed, or no scheduler answers at the address.
    """
    if config.executor == "processes":
        with worker_processes(config.workers) as pool:
            yield pool
        return
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise NoClusterError(
            'dask.distributed is missing; install it with pip install "drift_drake[cluster]"'
        ) from None
    if config.scheduler is None:
        with (
            LocalCluster(n_workers=config.workers, threads_per_worker=1, dashboard_address=None) as cluster,
            Client(cluster) as client,
            client.get_executor() as pool,
        ):
            yield pool
        return
    try:
        client = Client(config.scheduler)
    except (OSError, ValueError) as error:
        raise NoClusterError(
            f"no dask scheduler answers at {config.scheduler} ({error}); start one with `dask scheduler`"
        ) from None
    with client, client.get_executor() as pool:
        yield pool


def run_jobs(
    config: ExecutorConfig,
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    finish: Callable[[Job, Result], None],
    unit: str,
) -> None:
    """Runs jobs anywhere, with a progress bar; `finish` is called here with each result as it comes in.

    Raises:
        JobsFailedError: some job raised; all others have been finished.
    """
    if not jobs:
        return
    failures: list[str] = []
    with make_executor(config) as pool:
        waiting = {pool.submit(function, job): job for job in jobs}
        try:
            for future in tqdm(concurrent.futures.as_completed(list(waiting)), total=len(jobs), unit=unit):
                job, error = waiting.pop(future), future.exception()
                if error is None:
                    finish(job, future.result())
                else:
                    failures.append(f"{type(error).__name__}: {error}")
        except BaseException:  # broken off: the pool must not work through what is left first
            for future in waiting:
                future.cancel()
            raise
    if failures:
        raise JobsFailedError(
            f"{len(failures)} of {len(jobs)} jobs failed, the first with {failures[0]}; the others' results are kept"
        )
