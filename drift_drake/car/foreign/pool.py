"""Roll-outs over worker processes: whatever a simulator does there, it ends no command and none waits for ever."""

import atexit
import concurrent.futures
import dataclasses
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress

import numpy as np

from drift_drake.car.foreign.rollouts import STARTED, Job, Rolled, SimulatorError, roll
from drift_drake.car.foreign.simulator import Simulator
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.worker_pool import Submit, WorkerEndedError, worker_processes

CHUNK, BATCH = 16, 1000  # roll-outs of a job for one worker at most, and of a batch
SLACK = 2.0  # times the limits of a job's roll-outs, after which its worker is ended
GIVEN_UP = 40  # workers that ended in roll-outs, from which on a simulator is given up
SMOOTHED = 0.2  # weight of the newest cost


@dataclasses.dataclass(frozen=True)
class Cost:
    """What a roll-out has cost, and how many there were and failed."""

    seconds: float = 0.0  # of one, of a worker's time
    count: int = 0
    failed: int = 0
    why: str = ""  # the last that failed

    def sentence(self) -> str:
        """On those that failed; empty where none has."""
        return f"{self.failed} of {self.count} roll-outs of the simulator failed ({self.why})" if self.failed else ""


def workers_here() -> int:
    """Processes that roll-outs are spread over."""
    return max(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1, 1)


class _Pool:
    """Worker processes, started for the first job and anew where one hangs."""

    def __init__(self) -> None:
        self.listeners: list[Callable[[], None]] = []
        self._lock, self._stack = threading.Lock(), ExitStack()
        self._submit: Submit | None = None
        self._owner, self._ended = os.getpid(), 0
        self.cost: dict[str, Cost] = {}

    def submit(self, job: Job) -> "concurrent.futures.Future[Rolled]":
        with self._lock:
            if self._submit is None:
                self._submit = self._stack.enter_context(worker_processes(workers_here(), with_main=False))
                atexit.register(self.end)
            return self._submit(roll, job)

    def end(self, at_once: bool = False) -> None:
        """Ends all processes, by themselves or at once."""
        with self._lock:
            if self._submit is None or os.getpid() != self._owner:
                return
            self._submit = None
            atexit.unregister(self.end)
            stack, self._stack = self._stack, ExitStack()
        with suppress(_EndedError), stack:
            if at_once:
                raise _EndedError

    def lose(self, target: str) -> None:
        """Counts a worker that ended, or was ended, within a roll-out."""
        self._ended += 1
        if self._ended >= GIVEN_UP:
            self._ended = 0
            raise SimulatorError(
                f"{target}: {GIVEN_UP} processes ended or hung in its roll-outs, and it is given up; run 'drift-drake "
                "simulator check', which says at which parameters"
            )

    def note(self, key: str, count: int, seconds: float, failures: tuple[str, ...]) -> None:
        """Keeps what roll-outs cost and which failed."""
        with self._lock:
            before = self.cost.get(key, Cost())
            each, newest = seconds / max(count, 1), before.seconds
            if seconds > 0.0:  # those that ended their process say nothing of the cost
                newest = each if newest == 0.0 else newest + SMOOTHED * (each - newest)
            self.cost[key] = Cost(newest, before.count + count, before.failed + len(failures),
                                     failures[-1] if failures else before.why)  # fmt: skip


class _EndedError(DriftDrakeError):
    """The pool is to end at once."""


_POOL = _Pool()


def cost_of(simulator: Simulator) -> Cost:
    """What roll-outs of a simulator have cost in this process so far."""
    return _POOL.cost.get(simulator.key, Cost())


@contextmanager
def listening(listener: Callable[[], None]) -> Iterator[None]:
    """Has a function called whenever roll-outs have come back."""
    _POOL.listeners.append(listener)
    try:
        yield
    finally:
        _POOL.listeners.remove(listener)


def end_workers() -> None:
    """Ends the processes; the next roll-out starts them anew."""
    _POOL.end()


def roll_all(jobs: list[Job]) -> list[dict[str, np.ndarray]]:
    """Outputs by name [n, steps + 1] of each job, NaN where a roll-out failed; failures are counted (`cost_of`).

    Jobs of one simulator that answers many roll-outs at once, with the same parameters and rows, are asked as one.

    Raises:
        SimulatorError: the simulator cannot be loaded, or its processes end again and again.
    """
    together: dict[object, list[int]] = {}
    for k, job in enumerate(jobs):
        alike = (job.dt, job.shape[1], tuple(job.parameters.items()), len(job.held)) if job.batch else k
        together.setdefault(alike, []).append(k)
    parts = -(-workers_here() // max(len(together), 1))  # of a batch: large ones cost less
    waiting = [(members, part, _POOL.submit(part)) for members in together.values()
               for part in _chunks(_joined([jobs[k] for k in members]), parts)]  # fmt: skip
    found: list[list[dict[str, np.ndarray]]] = [[] for _ in jobs]
    ended: dict[tuple[str, tuple[float, ...]], str] = {}
    for members, part, future in waiting:
        found[members[0]].append(_answer(part, future, ended))
    for listener in _POOL.listeners:
        listener()
    out: list[dict[str, np.ndarray]] = [{} for _ in jobs]
    for members in together.values():
        ends = np.cumsum([jobs[k].shape[0] for k in members])[:-1]
        for name in jobs[members[0]].outputs:
            whole = np.concatenate([part[name] for part in found[members[0]]])
            for k, own in zip(members, np.split(whole, ends), strict=True):
                out[k][name] = own
    return out


def _joined(jobs: list[Job]) -> Job:
    """Jobs that differ by their starts and inputs alone as one."""
    start, held, inputs = (
        {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        for parts in zip(*((job.start, job.held, job.inputs) for job in jobs), strict=True)
    )
    return jobs[0]._replace(start=start, held=held, inputs=inputs)


def _answer(
    part: Job, future: "concurrent.futures.Future[Rolled]", ended: dict[tuple[str, tuple[float, ...]], str]
) -> dict[str, np.ndarray]:
    """Outputs of a part of a job; ended: parameters with which a process has ended twice, and how, which ends all of
    their parts."""
    count, rows = part.shape
    parameters = part.key, tuple(part.parameters.values())
    lost = 0
    while parameters not in ended:
        try:
            rolled = future.result(2.0 * STARTED + SLACK * part.limit * count)
        except concurrent.futures.CancelledError:  # the pool was ended since another roll-out hung
            future = _POOL.submit(part)
            continue
        except TimeoutError:
            why = f"a roll-out took longer than {part.limit:g} s (limit:) and its process was ended"
            _POOL.end(at_once=True)
        except WorkerEndedError as error:
            why = f"its process ended in a roll-out ({error})"
        else:
            _POOL.note(part.key, count, rolled.seconds, rolled.failures)
            return rolled.outputs
        _POOL.lose(part.target)
        lost += 1
        if lost == 1:
            future = _POOL.submit(part)
        else:
            ended[parameters] = why
    future.cancel()
    _POOL.note(part.key, count, 0.0, (ended[parameters],) * count)
    return {name: np.full((count, rows), np.nan) for name in part.outputs}


def _chunks(job: Job, parts: int) -> list[Job]:
    """A job in parts for the workers, a batch in at least so many."""
    count, _ = job.shape
    size = min(-(-count // parts), BATCH) if job.batch else CHUNK
    return [job.part(slice(at, at + size)) for at in range(0, count, size)]
