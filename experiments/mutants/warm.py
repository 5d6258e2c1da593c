"""A Python that has imported what tests import, apart from this repository, and forks for each run of pytest.

Half of a short test's time is imports of Drake, numba and scipy; a fork has them at once. The repository's own modules
are imported by each run anew, so that it sees the files as they are then.
"""

import contextlib
import dataclasses
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

IMPORTED = (
    "pytest", "numpy", "scipy.linalg", "scipy.optimize", "scipy.signal", "scipy.interpolate", "scipy.special",
    "scipy.stats", "scipy.sparse.linalg", "scipy.spatial", "numba", "pandas", "yaml", "tyro", "jinja2", "tqdm",
    "pydrake.all", "matplotlib.pyplot", "filelock", "osqp", "threadpoolctl",
    "asyncio", "multiprocessing.pool", "concurrent.futures.process", "lazy_loader", "plotly.graph_objects",
)  # fmt: skip
SERVING = "import sys; sys.path.insert(0, {!r}); import warm; warm.serve()"
WALL = 20.0  # times a limit of CPU, after which a run hangs

BROKEN = 99  # exit of a run that did not come as far as pytest


@dataclasses.dataclass(frozen=True)
class TestRun:
    """How a run of pytest ended."""

    code: int  # of its exit; negative where a signal ended it
    seconds: float  # of CPU
    output: str

    @property
    def finished(self) -> bool:
        """Whether it came to an end by itself."""
        return self.code >= 0


class WarmPython:
    """Runs pytest in a tree, by forks of one process."""

    def __init__(self, tree: Path, environment: dict[str, str]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", SERVING.format(str(Path(__file__).parent))], cwd=tree, env=environment, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    def run(self, arguments: Iterable[str], limit: float, bytecode: bool = False) -> TestRun:
        """Runs pytest with these arguments, for `limit` seconds of CPU at most.

        Args:
            bytecode: whether compiled sources are kept on the disk: not while a source is a mutant.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        request = {"arguments": list(arguments), "limit": limit, "bytecode": bytecode}
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        return TestRun(**json.loads(self._process.stdout.readline()))

    def close(self) -> None:
        """Ends the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


@contextlib.contextmanager
def warm_python(tree: Path, environment: dict[str, str]) -> Iterator[WarmPython]:
    """A `WarmPython` that is ended afterwards."""
    warm = WarmPython(tree, environment)
    try:
        yield warm
    finally:
        warm.close()


def serve() -> None:
    """Answers requests, a line each, until there are no more."""
    for name in IMPORTED:
        with contextlib.suppress(ImportError):
            __import__(name)
    sys.path[0] = os.getcwd()  # in place of this file's folder
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        answers.write(json.dumps(_answer(json.loads(line))) + "\n")
        answers.flush()


def _answer(request: dict[str, Any]) -> dict[str, Any]:
    with tempfile.TemporaryFile() as output:
        child = os.fork()
        if child == 0:
            _run_here(request, output.fileno())
        deadline, ended = time.monotonic() + WALL * request["limit"], 0
        while not ended:
            ended, status, used = os.wait4(child, os.WNOHANG)
            if not ended:
                time.sleep(0.02)
                if time.monotonic() > deadline:
                    os.killpg(child, 9)
        output.seek(0)
        text = output.read().decode(errors="replace")
    return {"code": os.waitstatus_to_exitcode(status), "seconds": used.ru_utime + used.ru_stime, "output": text}


def _run_here(request: dict[str, Any], output: int) -> None:
    """In the fork: pytest, and the end of the process."""
    os.setsid()
    for stream in (1, 2):
        os.dup2(output, stream)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    seconds = int(request["limit"]) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    sys.dont_write_bytecode = not request["bytecode"]
    import pytest

    sys.argv = ["pytest", *request["arguments"]]
    code = BROKEN
    try:
        code = int(pytest.main(request["arguments"]))
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
