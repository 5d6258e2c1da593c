"""A log that is still being written, followed as `tail -F` does: cut, replaced or not there yet, it begins anew."""

import math
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

import numpy as np

from drift_drake.car.log.table import COLUMNS, REQUIRED, InvalidLogError, Run, check_names, make_run
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.monitoring.watch import HEAD, Row

PSI = CHANNELS.index("psi")
POLL = 0.05  # [s] between looks at the file


class Tail:
    """A text file that grows, and may be cut, replaced, gone or not there yet.

    Attributes:
        ended: why the lines ended: the file "has been cut", "has been replaced"; empty where nothing new came;
        last_end: the same of the file before.
    """

    def __init__(self, path: Path, idle: float, say: Callable[[str], None] = lambda _: None) -> None:
        """idle: seconds without anything new after which it ends, 0: never; say: is called with what is waited for."""
        self.path, self.idle, self.ended, self.last_end, self._say = path, idle, "", "", say
        self._last = time.monotonic()

    def lines(self) -> Iterator[str]:
        """The complete lines of the file that is there now, or will be, as they come, until it ends.

        Bytes that are no UTF-8 come as the replacement character.
        """
        self.ended, self.last_end = "", self.ended or self.last_end
        if not self._waited_for():
            return
        with self.path.open(encoding="utf-8", errors="replace") as file:
            part = ""
            while not self.ended:
                text = file.read()
                if text:
                    *whole, part = (part + text).split("\n")
                    self._last = time.monotonic()
                    yield from whole
                    continue
                self.ended = _why_it_ends(self.path, file)
                if not self.ended and not self._goes_on():
                    return

    def _waited_for(self) -> bool:
        """Waits until there is a file; False where there is none in time."""
        if not self.path.exists():
            self._say(f"{self.path}: is not there; waiting for it")
        while not self.path.exists():
            if not self._goes_on():
                return False
        return True

    def _goes_on(self) -> bool:
        """Waits a moment; False where nothing has come for long."""
        if 0.0 < self.idle < time.monotonic() - self._last:
            return False
        time.sleep(POLL)
        return True


def _why_it_ends(path: Path, file: TextIO) -> str:
    """Why nothing more comes of a file that has been read to its end; empty where more may come."""
    here = os.fstat(file.fileno())
    try:
        there = path.stat()
    except OSError:
        return ""  # moved away: its writer may go on, until another takes its place
    if (there.st_dev, there.st_ino) != (here.st_dev, here.st_ino):
        return "has been replaced"
    return "has been cut" if here.st_size < file.buffer.tell() else ""


def growing_rows(path: Path, lines: Iterator[str]) -> Iterator[dict[str, float]]:
    """Each line's columns of the log format by name, after the header.

    Raises:
        InvalidLogError: a column that is missing or there twice, or a line that holds no numbers.
    """
    first = next(lines, None)
    if first is None:
        return
    header = [name.strip() for name in first.split(",")]
    check_names(path, header)
    missing = [name for name in (*REQUIRED, "tau_cmd") if name not in header]
    if missing:
        raise InvalidLogError(f"{path}: missing column {', '.join(missing)}; the monitor needs them, write a CSV")
    kept = [(i, name) for i, name in enumerate(header) if name in COLUMNS]
    for number, line in enumerate(lines, start=2):
        if not line.strip():
            continue
        cells = line.split(",")
        try:
            yield {name: float(cells[i]) for i, name in kept}
        except (IndexError, ValueError):
            raise InvalidLogError(f"{path}: line {number} holds no row of numbers; correct the writer") from None


def head_of(path: Path, rows: Iterator[dict[str, float]]) -> tuple[Run, list[dict[str, float]]]:
    """The first seconds of a growing log, as a run and as rows.

    Raises:
        InvalidLogError: they cannot be used.
    """
    first: list[dict[str, float]] = []
    for row in rows:
        first.append(row)
        if row["t"] - first[0]["t"] >= HEAD:
            break
    columns = {name: np.array([row[name] for row in first]) for name in (first[0] if first else {})}
    if not columns:
        raise InvalidLogError(f"{path}: has no rows; follow a log that is being written")
    return make_run(path, columns), first


def on_the_clock(path: Path, rows: Iterator[dict[str, float]], head: Run) -> Iterator[dict[str, float]]:
    """The rows after the first seconds of a growing log, which keep its period.

    Raises:
        InvalidLogError: one comes earlier or later.
    """
    t = float(head.t[-1])
    for row in rows:
        if not abs(row["t"] - t - head.period) < 0.5 * head.period:
            raise InvalidLogError(
                f"{path}: t goes from {t:g} to {row['t']:g} s among steps of {head.period:g} s, so a row is missing or "
                "out of order; write each of them once"
            )
        t = row["t"]
        yield row


def as_rows(rows: Iterator[dict[str, float]]) -> Iterator[Row]:
    """The rows for the monitor, their headings without jumps by a turn."""
    psi = np.nan
    for columns in rows:
        y = np.array([columns.get(name, np.nan) for name in CHANNELS])
        if np.isfinite(y[PSI]):
            psi = y[PSI] = y[PSI] if np.isnan(psi) else psi + math.remainder(y[PSI] - psi, 2.0 * math.pi)
        yield Row(columns["t"], y, np.array([columns["delta_cmd"], columns["tau_cmd"]]), columns.get("bank", 0.0))
