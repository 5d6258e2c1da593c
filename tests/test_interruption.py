"""What ends a command is answered in one line, from its imports on."""

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from drift_drake.common.interruption import BAD_INPUT, ENDS, ctrl_c_waits, ended_well, signals_wait

BEGINNING = """
import time
from drift_drake.common.interruption import ended_at_once

with ended_at_once():
    print("ready", flush=True)
    try:
        time.sleep(60.0)
    except BaseException:
        print("an import that swallows exceptions", flush=True)
"""
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}


@pytest.mark.parametrize(
    ("number", "how", "code"),
    [(signal.SIGINT, "interrupted", 130), (signal.SIGTERM, "terminated", 143), (signal.SIGHUP, "hung up", 129)],
)
def test_what_has_not_begun_ends_at_once(number: signal.Signals, how: str, code: int) -> None:
    beginning = subprocess.Popen([sys.executable, "-c", BEGINNING], env=ENVIRONMENT, stdout=subprocess.PIPE,
                                 stderr=subprocess.PIPE, text=True)  # fmt: skip
    assert beginning.stdout is not None
    assert beginning.stdout.readline() == "ready\n"
    beginning.send_signal(number)
    said, error = beginning.communicate(timeout=30.0)
    assert (beginning.returncode, said, error) == (code, "", f"drift-drake: {how} before anything was begun\n")


def test_no_moment_of_a_command_has_pythons_own_answer() -> None:
    """Between its imports and its own answer, too, where a signal was answered with a traceback."""
    program = (
        "import os, signal, sys\n"
        "import drift_drake.cli.main\n"
        "drift_drake.cli.main.main = lambda: os.kill(os.getpid(), signal.SIGINT)\n"
        "from drift_drake.__main__ import main\n"
        "sys.exit(main())"
    )
    done = subprocess.run([sys.executable, "-c", program], env=ENVIRONMENT, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "drift-drake: interrupted before anything was begun\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_wait_for_a_blocks_end_whichever_thread_they_come_to(number: signal.Signals) -> None:
    came, other = [], threading.Thread(target=time.sleep, args=(0.5,))
    before = signal.signal(number, lambda *_: came.append("after"))
    try:
        other.start()  # does not block what the main thread blocks
        with signals_wait(), ctrl_c_waits():
            os.kill(os.getpid(), number)
            other.join()
            came.append("within")
    finally:
        signal.signal(number, before)
    assert came == ["within", "after"]


def said(command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["sh", "-c", f"{sys.executable} -m drift_drake {command}"], env=ENVIRONMENT,
                          capture_output=True, text=True, timeout=60.0)  # fmt: skip


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_standard_output_that_is_full_is_one_sentence() -> None:
    full = said("--help > /dev/full")
    sentence = "drift-drake: standard output cannot be written (No space left on device); free some space, or give it "
    assert (full.returncode, full.stderr) == (BAD_INPUT, sentence + "another place\n")
    assert said("nonsense 2> /dev/full").returncode == BAD_INPUT


@pytest.mark.parametrize("command", ["effects --json -", "effects", "drive --help", "import --look LOG"])
def test_standard_output_that_nobody_reads_ends_a_command_without_a_word(command: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,v\n" + "".join(f"{0.01 * i:.2f},{i}\n" for i in range(100)))
    read, write = os.pipe()
    os.close(read)
    words = command.replace("LOG", str(tmp_path / "log.csv")).split()
    unread = subprocess.run([sys.executable, "-m", "drift_drake", *words], env=ENVIRONMENT, stdout=write,
                            stderr=subprocess.PIPE, text=True, timeout=60.0)  # fmt: skip
    os.close(write)
    assert unread.returncode == 128 + signal.SIGPIPE
    assert "drift-drake:" not in unread.stderr
    assert "Traceback" not in unread.stderr


def test_standard_output_that_is_closed_is_one_sentence() -> None:
    closed = said("--help >&-")
    sentence = "drift-drake: standard output is closed; give it a place, such as > /dev/null\n"
    assert (closed.returncode, closed.stderr) == (BAD_INPUT, sentence)
    assert said("--help 2>&- <&-").returncode == 0
    refused = said("nonsense 2>&-")
    assert (refused.returncode, refused.stdout) == (BAD_INPUT, "")
    assert said("--help <&- >&- 2>&-").returncode == BAD_INPUT


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        ImportError("libx.so: failed to map segment from shared object"),
        OSError(errno.ENOMEM, os.strerror(errno.ENOMEM)),
    ],
)
def test_memory_that_is_short_is_one_sentence(error: BaseException, capsys: pytest.CaptureFixture[str]) -> None:
    def run() -> int:
        raise error

    assert ended_well(run, "drift-drake: ", "") == BAD_INPUT
    sentence = "drift-drake: there is too little memory for this; end other programs, or give less at a time\n"
    assert capsys.readouterr().err == sentence


def test_a_signal_that_comes_while_the_command_is_left_is_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before, asked, real = {number: signal.getsignal(number) for number in ENDS}, list[int](), signal.signal

    def put(number: signal.Signals, handler: Any) -> Any:
        asked.append(number)
        if len(asked) == len(ENDS) + 1:  # the first that is put back
            signal.raise_signal(signal.SIGTERM)
        return real(number, handler)

    monkeypatch.setattr(signal, "signal", put)
    try:
        assert ended_well(lambda: 0, "drift-drake: ", "what is done stays") == 143
    finally:
        for number, handler in before.items():
            real(number, handler)
    assert capsys.readouterr().err == "drift-drake: terminated; what is done stays\n"
