"""Commands as a shell runs them: each in a process with limits, none of its warnings hidden.

The process is a copy of this one, which has imported what commands need: a fresh interpreter takes a second, a copy a
hundredth of one.
"""

import contextlib
import dataclasses
import os
import re
import resource
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from fuzzing import COUNTS, LONGEST

from drift_drake.cli.main import load, main

CLOCK_FACTOR = 6.0  # times as long on the clock: what rests then hangs; what waits for a processor does not
MEMORY = 2 << 30  # bytes on top of what the interpreter has already
SPOKEN = ("check", "watch", "apply", "effects", "import", "export", "replay", "diagnose", "fleet")
BAD = re.compile(rb"Traceback \(most recent call last\)|Warning:|Fatal Python error|core dumped|NoneType: None")


@dataclasses.dataclass(frozen=True)
class Ended:
    """How a command ended: its exit code (negative: the signal), what it said, and what it took; printed: standard
    output alone; memory: the most that it or a process of its had [bytes]."""

    code: int
    said: str
    seconds: float
    hung: bool = False
    printed: str = ""
    memory: int = 0

    @property
    def flaw(self) -> str:
        """What is wrong with it; nothing where it ended well, or refused its input in a sentence."""
        if self.hung or self.code == -signal.SIGXCPU:
            return f"it took more than {LONGEST} s"
        if self.code < 0:
            return f"it was ended by {signal.Signals(-self.code).name}"
        if self.memory > MEMORY or "too little memory" in self.said:
            return f"it took more than {MEMORY >> 30} GB, or wanted to"
        found = BAD.search(self.said.encode(errors="replace"))
        if found:
            return f"it said {found[0].decode()}"
        return "" if self.code in (0, 2, 3) else f"its exit code is {self.code}"


def warm() -> None:
    """Imports what commands need."""
    for name in SPOKEN:
        load(name)


def command(folder: Path, *words: str | Path, killed_after: float | None = None, longest: float = LONGEST) -> Ended:
    """Runs `drift-drake WORDS` in a folder.

    Args:
        killed_after: [s] after which it is killed (-9), if it has not ended; longest: [s] of processor time.
    """
    arguments, heard = [str(word) for word in words], (folder / ".printed", folder / ".said")
    begun = time.monotonic()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of 3.12 on: threads are not copied
        child = os.fork()
    if child == 0:
        _run(folder, arguments, heard, longest)
    with contextlib.suppress(OSError):  # whichever of the two comes first; it may have ended already
        os.setpgid(child, child)
    end, hung = begun + (CLOCK_FACTOR * longest if killed_after is None else killed_after), False
    while (ended := os.wait4(child, os.WNOHANG))[0] == 0:
        if time.monotonic() > end and (killed_after is not None or _rests(child)):
            hung = killed_after is None
            os.killpg(child, signal.SIGKILL)
            ended = os.wait4(child, 0)
            break
        time.sleep(0.002)
    seconds = time.monotonic() - begun
    with contextlib.suppress(OSError):  # what it began and left
        os.killpg(child, signal.SIGKILL)
    printed, said = (path.read_text(errors="replace") if path.exists() else "" for path in heard)
    for path in heard:
        path.unlink(missing_ok=True)
    code, memory = os.waitstatus_to_exitcode(ended[1]), 1024 * ended[2].ru_maxrss
    return Ended(code, printed + said, seconds, hung, printed, memory)


def _rests(group: int) -> bool:
    """Whether no process of a group runs, or would if a processor were free, at ten looks."""
    for _ in range(10):
        for path in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                state, _, its_group = path.read_text().rpartition(")")[2].split()[:3]
                if int(its_group) == group and state in "RD":
                    return False
        time.sleep(0.05)
    return True


def _run(folder: Path, arguments: Sequence[str], heard: Sequence[Path], longest: float) -> None:
    """The copy: runs the command and ends."""
    code = 1
    try:
        os.setpgid(0, 0)
        signal.alarm(0)
        for number, path in enumerate(heard, 1):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), number)
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", closefd=False, errors="backslashreplace")  # noqa: SIM115  (as Python opens it)
        space = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (space + MEMORY, space + MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        used = resource.getrusage(resource.RUSAGE_SELF)
        time_limit = int(used.ru_utime + used.ru_stime + longest) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (time_limit, time_limit + 1))
        warnings.resetwarnings()
        warnings.filterwarnings("default", category=DeprecationWarning, module="__main__")
        for kind in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
            warnings.filterwarnings("ignore", category=kind)
        os.chdir(folder)
        code = main(arguments)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except BaseException:
                code = 1
        os._exit(code)


def well(target: str, ended: Ended) -> Ended:
    """Counts a trial and sees that the command ended well."""
    counts = COUNTS.setdefault(target, Counter())
    counts["tried"] += 1
    counts["taken" if ended.code in (0, 3) else "refused"] += 1
    assert not ended.flaw, f"{ended.flaw}:\n{ended.said}"
    return ended
