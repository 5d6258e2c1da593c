"""Other packages' functions are tried in a process of their own before they are used here: they may loop for ever, or
end Python. That all went well is remembered of their sources, so that it is asked once."""

import hashlib
import importlib.util
import itertools
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout, suppress
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from drift_drake.car.effects.record import InvalidExtensionError
from drift_drake.common.errors import one_line
from drift_drake.common.interruption import TerminatedError, ctrl_c_waits

EFFECTS, TYRES, CARS = "drift_drake.effects", "drift_drake.tyres", "drift_drake.cars"  # groups of entry points
WORDS = {EFFECTS: "effect", TYRES: "tyre", CARS: "car"}
SECONDS = 30  # of processor time that a trial may take, compilation included
RESTS = 120.0  # [s] on the clock
TRYING = "DRIFT_DRAKE_TRYING"  # in the environment of a trial, which begins no further one
TRIED = "DRIFT_DRAKE_TRIED"  # of processes that this one starts
ENDED, REFUSED = "all end", "refused: "
PROGRAM = (
    "import sys; sys.path[:] = {path!r}; from drift_drake.car.effects.trial import trial; "
    "trial({function!r}, {seconds!r})"
)


def extensions(group: str) -> dict[str, EntryPoint]:
    """What other packages install in a group, by what messages call it, in the order of the names.

    Raises:
        InvalidExtensionError: two have one name.
    """
    points, word = sorted(entry_points(group=group), key=lambda point: point.name), WORDS[group]
    for one, other in itertools.pairwise(points):
        if one.name == other.name:
            raise InvalidExtensionError(
                f"{word} {one.name} is installed twice ({one.value}, {other.value}); uninstall one of them"
            )
    return {f"{word} {point.name} ({point.value})": point for point in points}


def loaded(where: str, point: EntryPoint) -> Any:
    """What an entry point names; an InvalidExtensionError, which begins with `where`, if it cannot be imported."""
    try:
        with redirect_stdout(sys.stderr):  # standard output is the command's own
            return point.load()
    except (KeyboardInterrupt, TerminatedError):
        raise
    except BaseException as error:  # one that ends Python, too
        raise InvalidExtensionError(
            f"{where}: cannot be imported ({type(error).__name__}: {one_line(error)}); correct it or uninstall it"
        ) from None


def see_that_they_end(points: Mapping[str, EntryPoint], function: Callable[[Callable[[str], None]], None]) -> None:
    """Runs a function of this package, which tries a group's extensions, in a process with limits.

    Args:
        points: the extensions, as `extensions` gives them; function: it is given a function to call with what messages
            call an extension, as it begins with that one.

    Raises:
        InvalidExtensionError: one does not end, ends Python, or is refused.
    """
    if not points or TRYING in os.environ:
        return
    mark = extensions_folder() / f"tried-{_digest(points)}"
    if mark.is_file() or os.environ.get(TRIED) == mark.name:
        return
    path = [entry or os.getcwd() for entry in sys.path]
    name = f"{function.__module__}:{function.__name__}"
    program = PROGRAM.format(path=path, function=name, seconds=SECONDS)
    with ctrl_c_waits():
        process = subprocess.Popen(
            [sys.executable, "-c", program], env=os.environ | {TRYING: "1"}, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, errors="replace",
        )  # fmt: skip
    try:
        said = process.communicate(timeout=RESTS)[0]
        hung = process.returncode == -signal.SIGXCPU
    except subprocess.TimeoutExpired:
        hung = True
        process.kill()
        said = process.communicate()[0]
    except BaseException:
        process.kill()
        raise
    lines = said.splitlines()
    if refusal := next((line.removeprefix(REFUSED) for line in lines if line.startswith(REFUSED)), None):
        raise InvalidExtensionError(refusal)
    if ENDED not in lines:
        where = next((line for line in reversed(lines) if line in points), next(iter(points)))
        limit = f"takes more than {SECONDS} s"
        how = limit if hung else f"ends Python (exit code {process.returncode})"
        raise InvalidExtensionError(
            f"{where}: {how} when it is imported or its functions are called; let them end in every state of the car, "
            "or uninstall it"
        )
    os.environ[TRIED] = mark.name  # for workers, where nothing can be kept
    with suppress(OSError):
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.touch()


def trial(function: str, seconds: int) -> None:
    """What the process does: tries all, in so many seconds of processor time, and says of each that it begins."""
    out = os.fdopen(os.dup(1), "w")
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))  # the first says why it ends
    module, _, name = function.partition(":")
    try:
        getattr(importlib.import_module(module), name)(lambda where: print(where, file=out, flush=True))
        print(ENDED, file=out, flush=True)
    except InvalidExtensionError as error:
        print(f"{REFUSED}{error}", file=out, flush=True)
    os._exit(0)  # whatever threads they began


def extensions_folder() -> Path:
    """Where what is compiled of other packages is kept."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "drift_drake"


def installed_sources() -> str:
    """A hash of all other packages' extensions and their sources; empty without any. None is imported."""
    points = {f"{group} {point.name}": point for group in (EFFECTS, TYRES, CARS) for point in entry_points(group=group)}
    return _digest(points) if points else ""


def _digest(points: Mapping[str, EntryPoint]) -> str:
    """Of the names, and of all sources next to the modules and above them in their packages: nothing is imported."""
    digest = hashlib.sha256(f"{sys.version} {os.environ.get('NUMBA_DISABLE_JIT')}".encode())
    for where, point in points.items():
        digest.update(where.encode())
        top, *inner = point.module.split(".")
        spec = importlib.util.find_spec(top)
        folders = [Path(folder) for folder in (spec.submodule_search_locations or ()) if spec] if spec else []
        files = [Path(spec.origin)] if spec and spec.origin else []
        for depth in range(len(inner) + 1):
            files += [file for folder in folders for file in sorted(folder.joinpath(*inner[:depth]).glob("*.py"))]
        for file in dict.fromkeys(files):
            with suppress(OSError):
                digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
