"""What ends a command is answered in one line, from its imports on."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from drift_drake.interruption import ctrl_c_waits, signals_wait

BEGINNING = """
import time
from drift_drake.interruption import ended_at_once

with ended_at_once():
    print("ready", flush=True)
    try:
        time.sleep(60.0)
    except BaseException:
        print("an import that swallows exceptions", flush=True)
"""
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}


@pytest.mark.parametrize(
    ("number", "how", "code"), [(signal.SIGINT, "interrupted", 130), (signal.SIGTERM, "terminated", 143)]
)
def test_what_has_not_begun_ends_at_once(number: signal.Signals, how: str, code: int) -> None:
    beginning = subprocess.Popen([sys.executable, "-c", BEGINNING], env=ENVIRONMENT, stdout=subprocess.PIPE,
                                 stderr=subprocess.PIPE, text=True)  # fmt: skip
    assert beginning.stdout is not None
    assert beginning.stdout.readline() == "ready\n"
    beginning.send_signal(number)
    said, error = beginning.communicate(timeout=30.0)
    assert (beginning.returncode, said, error) == (code, "", f"drift-drake: {how} before anything was begun\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
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
