"""Roll-outs of a simulator: what is asked of it, and how each kind answers. Runs in a worker process (`pool`)."""

import contextlib
import importlib
import io
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from drift_drake.car.foreign.simulator import Kind
from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError, one_line

STARTED = 60.0  # [s] that a simulator's loading and first roll-out may take
WAITS = 0.1  # share of a roll-out's time that is the processor's, below which the simulator waits for another program
AGAIN = 2.0  # [s] after which a limit strikes anew, if a simulator, or a library under it, has caught its exception
HANGS = 2  # roll-outs of one job that may take too long, before the others of it are given up


class SimulatorError(DriftDrakeError, RuntimeError):
    """A simulator of the user's that cannot be run; the message names it and the remedy."""


class Job(NamedTuple):
    """Roll-outs of one simulator with one set of parameters; all numbers in the simulator's own units."""

    key: str  # of the simulator
    kind: Kind
    target: str
    folder: str
    set_state: str
    batch: bool
    limit: float  # [s] of one roll-out
    dt: float  # [s]
    start: Mapping[str, Array]  # [n] by name of the start value
    held: Mapping[str, Array]  # [n, lead + 1] the same while the car is led in; empty without
    inputs: Mapping[str, Array]  # [n, steps + 1] by name
    outputs: tuple[str, ...]
    parameters: Mapping[str, float]

    @property
    def shape(self) -> tuple[int, int]:
        """Roll-outs and rows."""
        count, rows = next(iter(self.inputs.values())).shape
        return count, rows

    def part(self, at: Any) -> "Job":
        """Some of its roll-outs, or one."""
        start, held, inputs = ({name: values[at] for name, values in part.items()}
                               for part in (self.start, self.held, self.inputs))  # fmt: skip
        return self._replace(start=start, held=held, inputs=inputs)


class Rolled(NamedTuple):
    """What came of a job: outputs by name [n, steps + 1] (NaN where a roll-out failed), and why some failed."""

    outputs: dict[str, Array]
    failures: tuple[str, ...]
    seconds: float  # that the roll-outs took, but for loading


class Runner(Protocol):
    """A simulator that is loaded."""

    def roll(self, start: Mapping[str, Any], held: Mapping[str, Array], inputs: Mapping[str, Array], dt: float,
             outputs: tuple[str, ...], parameters: Mapping[str, float]) -> Mapping[str, Any]:  # fmt: skip
        """Outputs [steps + 1] by name from a start, under inputs [steps + 1]; `held`: start values [lead + 1]."""


def roll(job: Job) -> Rolled:
    """Answers a job in this process.

    Raises:
        SimulatorError: the simulator cannot be loaded.
    """
    count, rows = job.shape
    out = {name: np.full((count, rows), np.nan) for name in job.outputs}
    failures: list[str] = []
    with contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
        runner = loaded(job.kind, job.target, job.folder, job.set_state)
        _warm_up(runner, job)
        began = time.perf_counter(), time.process_time()
        slices: list[Any] = [slice(None)] if job.batch else list(range(count))
        for at in slices:
            if len([one for one in failures if "longer than" in one]) >= HANGS:
                failures += ["given up, since others took too long"] * (count - at)
                break
            try:
                with at_most(job.limit * (count if job.batch else 1)):
                    got = _rolled(runner, job.part(at))
                for name in job.outputs:
                    out[name][at] = output(got, name, out[name][at].shape)
            except Exception as error:  # of any class that a user's code raises
                failures += [_said(error)] * (count if job.batch else 1)
        took, worked = time.perf_counter() - began[0], time.process_time() - began[1]
    # A busy machine makes roll-outs take longer, and must not make their number another one.
    seconds = worked if worked > WAITS * took else took
    return Rolled(out, tuple(failures), seconds)


def _rolled(runner: Runner, job: Job) -> Mapping[str, Any]:
    return runner.roll(job.start, job.held, job.inputs, job.dt, job.outputs, job.parameters)


def _warm_up(runner: Runner, job: Job) -> None:
    """A first roll-out in this process, in which the simulator may compile what it needs."""
    if job.key not in _WARM:
        _WARM.add(job.key)
        with contextlib.suppress(Exception), at_most(STARTED):  # what fails here fails again below, and is said there
            _rolled(runner, job.part(slice(0, 1) if job.batch else 0))


def output(got: Any, name: str, shape: tuple[int, ...]) -> Array:
    """One output as an array of a shape; raises SimulatorError where it is none."""
    if not isinstance(got, Mapping):
        raise SimulatorError(f"returned {type(got).__name__}, not a dict of its outputs by name")
    if name not in got:
        raise SimulatorError(f"output {name} is not among what it returned ({', '.join(map(str, got))[:200]})")
    values = np.asarray(got[name], dtype=float)
    if values.shape != shape:
        raise SimulatorError(
            f"output {name} has the shape {values.shape}, expected {shape}: one number a row of inputs"
        )
    return values


_WARM: set[str] = set()


@lru_cache(maxsize=2)
def loaded(kind: Kind, target: str, folder: str, set_state: str) -> Runner:
    """The simulator; the last ones are kept."""
    if kind == "fmu":
        from drift_drake.car.foreign.fmu import Fmu

        return Fmu(target)
    if kind == "drake":
        from drift_drake.car.foreign.drake_system import DrakeSystem

        return DrakeSystem(function_of(target, folder), function_of(set_state, folder) if set_state else None)
    return _Python(function_of(target, folder))


class _Python:
    """A function `(start, inputs, dt, parameters) -> outputs`."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def roll(self, start: Mapping[str, Any], held: Mapping[str, Array], inputs: Mapping[str, Array], dt: float,  # noqa: ARG002
             outputs: tuple[str, ...], parameters: Mapping[str, float]) -> Mapping[str, Any]:  # noqa: ARG002  # fmt: skip
        return self._function(dict(start), dict(inputs), dt, dict(parameters))  # type: ignore[no-any-return]


_FOLDERS = set[str]()  # of simulators of this process
HOUSE = __name__.partition(".")[0]  # this package, which no folder replaces


@lru_cache(maxsize=8)
def function_of(target: str, folder: str) -> Callable[..., Any]:
    """The function `module:name`, its module found in a folder too.

    Raises:
        SimulatorError: there is none; names what is missing and the remedy.
    """
    module, _, name = target.partition(":")
    _look_first_in(folder, module.partition(".")[0])
    try:
        found = getattr(importlib.import_module(module), name, None)
    except Exception as error:
        raise SimulatorError(
            f"{target}: the module {module} cannot be imported ({_said(error)}); install what it needs, or name its "
            "folder with folder:"
        ) from None
    except SystemExit:
        raise SimulatorError(f"{target}: importing the module {module} ends Python; guard its script part") from None
    if not callable(found):
        raise SimulatorError(f"{target}: the module {module} has no function {name}; name one of its functions")
    return found  # type: ignore[no-any-return]


def _look_first_in(folder: str, package: str) -> None:
    """Has modules imported from a folder; those of its names that other simulators' folders gave are forgotten.

    Args:
        package: of the simulator, which is forgotten wherever it was imported from, if the folder has it.
    """
    _FOLDERS.add(folder)
    sys.path[:] = [folder, *(path for path in sys.path if path != folder)]
    others = _FOLDERS - {folder}
    names = {path.stem for path in Path(folder).glob("*.py")}
    names |= {path.parent.name for path in Path(folder).glob("*/__init__.py")}
    names = (names | ({package} if Path(folder, package).is_dir() else set())) - {HOUSE}
    for name, module in list(sys.modules.items()):
        top, file = name.partition(".")[0], Path(getattr(module, "__file__", None) or folder)
        of_another = "site-packages" not in file.parts and any(file.is_relative_to(other) for other in others)
        if top in names and not file.is_relative_to(folder) and (top == package or of_another):
            del sys.modules[name]
    importlib.invalidate_caches()


@contextlib.contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Raises TimeoutError in a block that takes longer, where Python comes back to look; again where that is caught."""

    def end(*_: Any) -> None:
        raise TimeoutError(f"a roll-out took longer than {seconds:g} s (limit:)")

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _said(error: BaseException) -> str:
    said = one_line(error)
    return said if isinstance(error, SimulatorError | TimeoutError) else f"{type(error).__name__}: {said}"
