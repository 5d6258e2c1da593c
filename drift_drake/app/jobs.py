"""Commands in processes of their own: one at a time, with progress, to be cancelled, recorded in the project file.

A command ends with its workbench, however that ends, and holds the folder's lock as long as it runs: who has the lock
next puts back what it has written over, and says what is lost.
"""

import contextlib
import datetime
import fcntl
import os
import re
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from drift_drake.app.aside import drop, put_aside, put_back, there
from drift_drake.app.project import Project
from drift_drake.app.stages import Stage, good
from drift_drake.common.interruption import BAD_INPUT

BAR = re.compile(r"(?:(?P<stage>[^:\r\n]*): )?\s*(?P<percent>\d{1,3})%\|")
LAST_LINES = 200
CANCELLED = "was cancelled; files are as they were before"
LOST = (
    "was cut off when the workbench ended; files are as they were before, and what it had computed is lost: run it anew"
)
GRACE = 5.0  # [s] for a command to end by itself
LOCK = ".running.lock"
PROGRAM = """import os, signal, sys, threading, time
def end():
    os.read(0, 1)  # until the workbench is gone
    os.killpg(0, signal.SIGTERM)
    time.sleep({grace})
    os.killpg(0, signal.SIGKILL)
threading.Thread(target=end, daemon=True).start()
sys.path[:] = {path!r}
from drift_drake.__main__ import main
sys.exit(main())
"""


class RunningCommand:
    """A command that runs: its progress, and what it has said."""

    def __init__(self, stage: Stage) -> None:
        self.stage, self.share, self.doing = stage, 0.0, "starts"
        self.lines: deque[str] = deque(maxlen=LAST_LINES)
        self.cancelled = ""  # why
        self.process: subprocess.Popen[bytes] | None = None

    def hear(self, text: str) -> None:
        """Takes in what the command writes: its progress bar, and sentences."""
        for line in filter(str.strip, re.split(r"[\r\n]", text)):
            bar = BAR.match(line)
            if bar:
                self.share = int(bar["percent"]) / 100.0
                self.doing = (bar["stage"] or self.doing).strip()
            else:
                self.lines.append(line)


class Jobs:
    """The one command that may run, and what is recorded once it has ended."""

    def __init__(self, project: Project) -> None:
        self.project, self.running, self._lock = project, None, threading.Lock()
        self.ended = 0  # commands so far
        self._thread: threading.Thread | None = None
        if (lock := self._hold()) is not None:
            os.close(lock)
        else:  # of a command that is about to end with its workbench, or of another workbench's
            threading.Thread(target=self._settle, daemon=True).start()

    running: RunningCommand | None

    def start(self, stage: Stage) -> str | None:
        """Starts a step's command; a sentence where it cannot be."""
        with self._lock:
            if self.running is not None:
                return f"{self.running.stage.title} is running; wait for its end, or cancel it"
            if (why := stage.refused()) is not None:
                return why
            if (lock := self._hold()) is None:
                return "another workbench on this folder runs a command; wait for its end"
            job = self.running = RunningCommand(stage)
        digest, written = stage.digest(), there(self.project.folder, stage.written)
        self._record(stage, digest, ended="running", said="", written=written)
        self._thread = threading.Thread(target=self._run, args=(job, digest, written, lock), daemon=True)
        self._thread.start()
        return None

    def cancel(self, why: str = CANCELLED) -> None:
        """Ends what runs, as Ctrl-C in a terminal would."""
        job = self.running
        if job is not None and job.process is not None:
            job.cancelled = why
            with contextlib.suppress(ProcessLookupError):
                os.killpg(job.process.pid, signal.SIGTERM)

    def end(self) -> None:
        """Of the workbench: nothing goes on without it."""
        job = self.running
        self.cancel(LOST)
        if job is not None and job.process is not None:
            try:
                job.process.wait(GRACE)
            except subprocess.TimeoutExpired:
                os.killpg(job.process.pid, signal.SIGKILL)
        if self._thread is not None:
            self._thread.join(GRACE)

    def _hold(self, wait: bool = False) -> int | None:
        """The folder's lock, once what a workbench that is gone has left is put right; None while another has it."""
        lock = os.open(self.project.folder / LOCK, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            os.close(lock)
            return None
        with self.project.changing() as data:
            for record in data["steps"].values():
                if isinstance(record, dict) and record.get("ended") == "running":
                    put_back(self.project.folder, record.pop("written", {}))
                    record.update(ended="cancelled", said=LOST)
        return lock

    def _settle(self) -> None:
        lock = self._hold(wait=True)
        assert lock is not None
        os.close(lock)

    def _run(self, job: RunningCommand, digest: str, written: dict[str, bool], lock: int) -> None:
        path = [entry for entry in sys.path if entry]  # of this process: no module of the project's folder
        words = [sys.executable, "-P", "-c", PROGRAM.format(path=path, grace=GRACE), *job.stage.words]
        folder, stamps = self.project.folder, job.stage.stamps()
        put_aside(folder, written)
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "NO_COLOR": "1", "COLUMNS": "120"}
        try:
            with subprocess.Popen(
                words, cwd=folder, env=environment, start_new_session=True, stdin=subprocess.PIPE,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, pass_fds=[lock],
            ) as process:  # fmt: skip
                job.process = process
                assert process.stdout is not None
                while piece := os.read(process.stdout.fileno(), 4096):
                    job.hear(piece.decode("utf-8", "replace"))
            code = process.returncode
        except OSError as error:
            job.lines.append(str(error))
            code = BAD_INPUT
        renewed = all(new is not None and new != old for new, old in zip(job.stage.stamps(), stamps, strict=True))
        ended = "cancelled" if job.cancelled else "done" if code == 0 and renewed else "refused"
        if ended == "done":
            drop(folder, written)
        else:  # whatever a command that was ended in the middle, or in its last moment, has written
            put_back(folder, written)
        self._record(job.stage, digest, ended=ended, said=job.cancelled or "\n".join(job.lines))
        os.close(lock)
        with self._lock:
            self.running = None
            self.ended += 1

    def _record(self, stage: Stage, digest: str, **more: Any) -> None:
        def write(record: dict[str, Any]) -> None:
            kept = good(record)  # if it does not end well, the outputs are as they were before
            record.clear()
            record.update(command=stage.command(), inputs=digest, good=kept, **more,
                          at=datetime.datetime.now().astimezone().isoformat(timespec="seconds"))  # fmt: skip

        self.record(stage.name, write)

    def record(self, name: str, change: Callable[[dict[str, Any]], None]) -> None:
        """Changes what is recorded of a step."""
        with self.project.changing() as data:
            kept = data["steps"].get(name)
            record = data["steps"][name] = dict(kept) if isinstance(kept, dict) else {}
            change(record)
