"""Commands in processes of their own: one at a time, with progress, to be cancelled, recorded in the project file."""

import contextlib
import datetime
import os
import re
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from drift_drake.app.project import Project
from drift_drake.app.stages import Stage
from drift_drake.common.interruption import BAD_INPUT

BAR = re.compile(r"(?:(?P<stage>[^:\r\n]*): )?\s*(?P<percent>\d{1,3})%\|")
LAST_LINES = 200
CANCELLED = "was cancelled; files are as they were before"
LOST = (
    "was cut off when the workbench ended; files are as they were before, and what it had computed is lost: run it anew"
)
PROGRAM = "import sys; sys.path[:] = {path!r}; from drift_drake.__main__ import main; sys.exit(main())"
GRACE = 5.0  # [s] for a command to end by itself


class RunningCommand:
    """A command that runs: its progress, and what it has said."""

    def __init__(self, stage: Stage) -> None:
        self.stage, self.share, self.doing = stage, 0.0, "starts"
        self.lines: deque[str] = deque(maxlen=LAST_LINES)
        self.cancelled = False
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
        with project.changing() as data:  # a workbench that ended in the middle of a command
            for record in data["steps"].values():
                if isinstance(record, dict) and record.get("ended") == "running":
                    record.update(ended="cancelled", said=LOST)

    running: RunningCommand | None

    def start(self, stage: Stage) -> str | None:
        """Starts a step's command; a sentence where it cannot be."""
        with self._lock:
            if self.running is not None:
                return f"{self.running.stage.title} is running; wait for its end, or cancel it"
            if (why := stage.refused()) is not None:
                return why
            job = self.running = RunningCommand(stage)
        self._record(stage, "running", "", stage.digest())
        threading.Thread(target=self._run, args=(job, stage.digest()), daemon=True).start()
        return None

    def cancel(self) -> None:
        """Ends what runs, as Ctrl-C in a terminal would."""
        job = self.running
        if job is not None and job.process is not None:
            job.cancelled = True
            with contextlib.suppress(ProcessLookupError):
                os.killpg(job.process.pid, signal.SIGTERM)

    def end(self) -> None:
        """Of the workbench: nothing goes on without it."""
        job = self.running
        self.cancel()
        if job is not None and job.process is not None:
            try:
                job.process.wait(GRACE)
            except subprocess.TimeoutExpired:
                os.killpg(job.process.pid, signal.SIGKILL)

    def _run(self, job: RunningCommand, digest: str) -> None:
        path = [entry for entry in sys.path if entry]  # of this process: no module of the project's folder
        words = [sys.executable, "-P", "-c", PROGRAM.format(path=path), *job.stage.words]
        stamps = job.stage.stamps()
        held = job.stage.before()
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "NO_COLOR": "1", "COLUMNS": "120"}
        try:
            with subprocess.Popen(
                words, cwd=self.project.folder, env=environment, start_new_session=True, stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            ) as process:  # fmt: skip
                job.process = process
                assert process.stdout is not None
                while piece := os.read(process.stdout.fileno(), 4096):
                    job.hear(piece.decode("utf-8", "replace"))
            code = process.returncode
        except OSError as error:
            job.lines.append(str(error))
            code = BAD_INPUT
        written = all(new is not None and new != old for new, old in zip(job.stage.stamps(), stamps, strict=True))
        ended = "cancelled" if job.cancelled else "done" if code == 0 and written else "refused"
        job.stage.after(ended == "done", held)
        said = CANCELLED if job.cancelled else "\n".join(job.lines)
        self._record(job.stage, ended, said, digest)
        with self._lock:
            self.running = None
            self.ended += 1

    def _record(self, stage: Stage, ended: str, said: str, digest: str) -> None:
        def write(record: dict[str, Any]) -> None:
            record.update(command=stage.command(), inputs=digest, ended=ended, said=said,
                          at=datetime.datetime.now().astimezone().isoformat(timespec="seconds"))  # fmt: skip

        self.record(stage.name, write)

    def record(self, name: str, change: Callable[[dict[str, Any]], None]) -> None:
        """Changes what is recorded of a step."""
        with self.project.changing() as data:
            kept = data["steps"].get(name)
            record = data["steps"][name] = dict(kept) if isinstance(kept, dict) else {}
            change(record)
