"""Writing: whole or not at all, to where it is possible, and reported."""

import errno
import fcntl
import io
import itertools
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from drift_drake.common import safe_files
from drift_drake.common.errors import OutputError
from drift_drake.common.safe_files import (
    alone_in,
    remove_left_behind,
    replacing,
    try_outputs,
    write_columns,
    write_table,
    write_text,
    writing_together,
)


def test_a_file_is_written_and_nothing_else_is_left(tmp_path: Path) -> None:
    write_text(tmp_path / "new" / "a.txt", "one\n")
    write_text(tmp_path / "new" / "a.txt", "two\n")
    assert (tmp_path / "new" / "a.txt").read_text() == "two\n"
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["a.txt"]


@pytest.mark.parametrize("name", ["run_0.csv", "run_0.csv.gz"])
def test_columns_of_numbers_are_the_text_that_pandas_writes(tmp_path: Path, name: str) -> None:
    numbers = np.random.default_rng(0).normal(size=25_000) * 10.0 ** np.resize(np.arange(-12, 12), 25_000)
    columns = {"t": np.arange(25_000.0), "v": numbers, "r": np.where(numbers > 0.0, numbers, np.nan)}
    write_columns(columns, tmp_path / "own" / name)
    write_table(pd.DataFrame(columns), tmp_path / "pandas" / name, index=False, float_format="%.9g")
    one, other = (
        pd.read_csv(tmp_path / folder / name, dtype=str, keep_default_na=False) for folder in ("own", "pandas")
    )
    pd.testing.assert_frame_equal(one, other)


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_was_there_stays_where_writing_breaks_off(tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "a.txt"
    path.write_text("before")

    def write() -> None:
        with replacing(path) as part:
            part.write_text("half")
            raise error

    with pytest.raises(error):
        write()
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_one_sentence_and_loses_nothing(tmp_path: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("needs a device that is always full")
    path = tmp_path / "a.txt"
    path.write_text("before")
    with pytest.raises(OutputError, match=r"a\.txt: cannot be written \(No space left"), replacing(path):
        Path("/dev/full").write_text("much")
    assert path.read_text() == "before"


def test_modes_and_links_are_kept(tmp_path: Path) -> None:
    path, link = tmp_path / "a.txt", tmp_path / "link.txt"
    path.write_text("before")
    path.chmod(0o640)
    link.symlink_to(path)
    write_text(link, "after")
    assert link.is_symlink()
    assert path.read_text() == "after"
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_device_is_written_to(tmp_path: Path) -> None:
    write_text(os.devnull, "text")
    assert not list(tmp_path.iterdir())


def test_a_named_pipe_is_written_to_where_somebody_reads_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE) as reader:
        write_text(pipe, "text")
        assert reader.communicate()[0] == b"text"
    monkeypatch.setattr(safe_files, "PATIENCE", 0.0)
    with pytest.raises(OutputError, match="is a pipe that nothing reads; start its reader"):
        write_text(pipe, "text")


def test_files_written_together_are_all_there_or_none(tmp_path: Path) -> None:
    def write(count: int) -> None:
        with writing_together(tmp_path / "case") as part:
            for k in range(count):
                (part / f"run_{k}.csv").write_text("t\n")
            if count == 1:
                raise ValueError("broken off")

    with pytest.raises(ValueError, match="broken off"):
        write(1)
    assert not list((tmp_path / "case").iterdir())
    write(2)
    assert sorted(path.name for path in (tmp_path / "case").iterdir()) == ["run_0.csv", "run_1.csv"]


def test_outputs_are_tried_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "file"
    file.write_text("text")
    for outputs, says in (
        ({"--out": tmp_path}, "is a folder"),
        ({"--out": file / "x.json"}, "cannot be written"),
        ({"--out": tmp_path / "\0"}, "cannot be written"),
        ({"--json": tmp_path / "a", "--report": tmp_path / "a"}, "is that of --json too"),
        ({"--out": file}, "is an input too"),
    ):
        with pytest.raises(OutputError, match=says):
            try_outputs(outputs, [file])
    capsys.readouterr()
    try_outputs({"--out": file, "--json": tmp_path / "new", "--report": None})
    assert capsys.readouterr().err == f"--out {file}: exists and will be replaced\n"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_disk_that_is_full_is_reported_before_a_computation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_path: Path, _data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match=r"--out .*: cannot be written \(No space left"):
        try_outputs({"--out": tmp_path / "a.json"})
    assert not list(tmp_path.iterdir())


def test_no_two_processes_write_one_folder(tmp_path: Path) -> None:
    with alone_in(tmp_path):
        write_text(tmp_path / "a.txt", "mine")  # its own files next to it
        script = "from pathlib import Path\nfrom drift_drake.common.safe_files import alone_in\nimport sys\n"
        script += "with alone_in(Path(sys.argv[1])): pass"
        other = subprocess.run([sys.executable, "-c", script, str(tmp_path)], capture_output=True, text=True)
        assert "--out" in other.stderr
        assert "another process is writing there" in other.stderr
    with alone_in(tmp_path):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


CALLS = [(os, "mkdir"), (os, "open"), (os, "stat"), (os, "fsync"), (os, "replace"), (os, "chmod"), (os, "scandir"),
         (io, "open"), (fcntl, "flock")]  # fmt: skip


class Failing:
    """Lets the n-th call of the system fail that writing a file makes."""

    def __init__(self, patch: pytest.MonkeyPatch, number: int, code: int) -> None:
        self.left, self.failed = number, ""
        for module, name in CALLS:
            patch.setattr(module, name, self.wrapped(name, getattr(module, name), code))

    def wrapped(self, name: str, call: Any, code: int) -> Any:
        def function(*arguments: Any, **options: Any) -> Any:
            self.left -= 1
            if self.left == 0:
                self.failed = name
                raise OSError(code, os.strerror(code))
            return call(*arguments, **options)

        return function


def write_one(folder: Path) -> None:
    write_text(folder / "a.txt", "after")


def write_two(folder: Path) -> None:
    with writing_together(folder) as part:
        for name in ("a.txt", "b.txt"):
            (part / name).write_text("after")


def write_tried(folder: Path) -> None:
    try_outputs({"--out": folder / "a.txt"})
    write_one(folder)


@pytest.mark.parametrize("write", [write_one, write_two, write_tried])
@pytest.mark.parametrize("code", [errno.EIO, errno.ENOSPC])
def test_whichever_call_fails_nothing_is_lost(tmp_path: Path, write: Callable[[Path], None], code: int) -> None:
    """As SQLite's tests do: the first call fails, then the second, ..., until none is left to fail."""
    failed = set()
    for number in itertools.count(1):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "a.txt").write_text("before")
        remove_left_behind.cache_clear()
        with pytest.MonkeyPatch.context() as patch:
            failing = Failing(patch, number, code)
            try:
                write(folder)
                ended = "well"
            except OutputError as error:
                ended = str(error)
        if not failing.failed:
            break
        failed.add(failing.failed)
        assert ended == "well" or os.strerror(code) in ended
        assert (folder / "a.txt").read_text() in (("before", "after") if ended != "well" else ("after",))
        remove_left_behind.cache_clear()
        write(folder)  # the next one does it, and removes what the failure may have left
        assert (folder / "a.txt").read_text() == "after"
        assert {path.name for path in folder.iterdir()} <= {"a.txt", "b.txt"}
    assert {"mkdir", "open", "fsync", "replace"} <= failed


def test_a_file_that_may_not_grow_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    """In a process whose files have a limit: every length that a write can break off at."""
    path = tmp_path / "a.csv"
    for limit in (0, 1, 100, 4095, 4096, 5000, 9000):
        path.write_text("before")
        child = os.fork()
        if child == 0:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            code = 9
            try:
                write_text(path, 8192 * "x")
                code = 0
            except OutputError:
                code = 2
            finally:
                os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        assert (code, path.read_text()) == ((2, "before") if limit < 8192 else (0, 8192 * "x"))
        assert list(tmp_path.iterdir()) == [path]
