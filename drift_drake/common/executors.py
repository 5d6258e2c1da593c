"""Where a long command's jobs run: this machine's cores, or a cluster's.

The cluster's engine is dask.distributed, an extra:

    pip install "drift_drake[cluster]"
    dask scheduler                                                 # on one machine
    dask worker tcp://SCHEDULER:8786 --nworkers -1 --nthreads 1    # on each machine
    python -m experiments.drifting.figure_8 --executor dask --scheduler tcp://SCHEDULER:8786

The workers need the installed package alone. Jobs and results travel as messages, and so does the code of a command
that is not in the package; the command's own process writes all files, so machines share no disk.
"""

import concurrent.futures
import dataclasses
import functools
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal, TypeVar

from tqdm import tqdm

from drift_drake.common.errors import DriftDrakeError, InvalidOptionError
from drift_drake.common.worker_pool import Submit, WorkerEndedError, WorkerLostError, worker_processes

Job = TypeVar("Job")
Result = TypeVar("Result")
ATTEMPTS = 3  # at a job whose worker process ends before it does


@dataclasses.dataclass(frozen=True)
class ExecutorConfig:
    """Where jobs run."""

    executor: Literal["processes", "dask"] = "processes"
    workers: int = 2
    """Processes on this machine; a cluster that `scheduler` names has its own."""
    scheduler: str | None = None
    """Address of a dask scheduler, such as tcp://HOST:8786; without, dask runs `workers` processes here."""

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise InvalidOptionError(f"--workers {self.workers}: give 1 or more")


class NoClusterError(DriftDrakeError, RuntimeError):
    """A cluster that cannot be used; the message names the remedy."""


class JobsFailedError(DriftDrakeError, RuntimeError):
    """Some jobs failed; the message says how many, and the first one's error."""


@contextmanager
def _cluster(config: ExecutorConfig) -> Iterator[Any]:
    """A client of the cluster that a config asks for.

    Raises:
        NoClusterError: dask.distributed is not installed, or no scheduler answers at the address.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise NoClusterError(
            'dask.distributed is missing; install it with pip install "drift_drake[cluster]"'
        ) from None
    if config.scheduler is None:
        any_port = "127.0.0.1:0"  # without, it asks for 8787, which another command's cluster may have
        with (
            LocalCluster(n_workers=config.workers, threads_per_worker=1, dashboard_address=any_port) as cluster,
            Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = Client(config.scheduler)
    except (OSError, ValueError) as error:
        raise NoClusterError(
            f"no dask scheduler answers at {config.scheduler} ({error}); start one with `dask scheduler`"
        ) from None
    with client:
        yield client


@contextmanager
def _dask(config: ExecutorConfig, function: Callable[..., Any]) -> Iterator[Submit]:
    """Submits to a cluster, which starts a job again where its worker is lost."""
    import cloudpickle

    while isinstance(function, functools.partial):
        function = function.func
    package = function.__module__.partition(".")[0]
    if package not in ("drift_drake", "__main__"):
        cloudpickle.register_pickle_by_value(sys.modules[package])
    with _cluster(config) as client, client.get_executor() as pool:
        waiting: list[concurrent.futures.Future[Any]] = []

        def submit(function: Callable[..., Any], job: Any) -> "concurrent.futures.Future[Any]":
            waiting.append(pool.submit(function, job))
            return waiting[-1]

        try:
            yield submit
        except BaseException:
            for future in waiting:
                future.cancel()
            raise


def run_jobs(
    config: ExecutorConfig,
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    finish: Callable[[Job, Result], None],
    unit: str,
    failed: Callable[[Job, BaseException], None] | None = None,
    tasks_per_worker: int = 0,
    quiet: bool = False,
) -> None:
    """Runs jobs anywhere, with a progress bar; `finish` is called here with each result as it comes in.

    A job whose worker process ends before it (killed, or out of memory) is begun anew, three times at most.

    Args:
        failed: called with each job that failed and its error.
        tasks_per_worker: a process is replaced by a fresh one after so many jobs (Drake keeps Python systems for ever);
            0 for never. On a cluster that is its own to decide (`dask worker --lifetime`).

    Raises:
        JobsFailedError: some job failed and there is no `failed`; all others have been finished.
        NoClusterError: there is no cluster where one is asked for.
    """
    if not jobs:
        return
    failures: list[str] = []
    lost: Counter[int] = Counter()
    place = _dask(config, function) if config.executor == "dask" else worker_processes(config.workers, tasks_per_worker)
    with place as submit, tqdm(total=len(jobs), unit=unit, disable=quiet, file=sys.stderr) as bar:
        waiting = {submit(function, job): k for k, job in enumerate(jobs)}
        while waiting:
            done, _ = concurrent.futures.wait(waiting, return_when=concurrent.futures.FIRST_COMPLETED)
            for future in done:
                k, error = waiting.pop(future), future.exception()
                if isinstance(error, WorkerEndedError):
                    lost[k] += 1
                    if lost[k] < ATTEMPTS:
                        waiting[submit(function, jobs[k])] = k
                        continue
                    error = WorkerLostError(f"its process ended {ATTEMPTS} times before it, perhaps for want of memory")
                bar.update()
                if error is None:
                    finish(jobs[k], future.result())
                elif failed is not None:
                    failed(jobs[k], error)
                else:
                    failures.append(f"{type(error).__name__}: {error}")
    if failures:
        raise JobsFailedError(
            f"{len(failures)} of {len(jobs)} jobs failed, the first with {failures[0]}; the others' results are kept"
        )


def results_of(
    config: ExecutorConfig,
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    unit: str,
    tasks_per_worker: int = 0,
) -> list[Result]:
    """The jobs' results in their order; see `run_jobs`."""
    numbered = list(enumerate(jobs))
    found: dict[int, Result] = {}

    def finish(job: tuple[int, Job], result: Result) -> None:
        found[job[0]] = result

    run_jobs(config, functools.partial(_second, function), numbered, finish, unit, tasks_per_worker=tasks_per_worker)
    return [found[k] for k in range(len(jobs))]


def _second(function: Callable[[Job], Result], job: tuple[int, Job]) -> Result:
    return function(job[1])
