"""The rows of a log that is still being written."""

import math
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.logs.table import COLUMNS, REQUIRED, InvalidLogError, Run, check_names, make_run
from drift_drake.monitoring.watch import HEAD, Row

PSI = CHANNELS.index("psi")
POLL = 0.05  # [s] between looks at the file


def growing_lines(path: Path, idle: float) -> Iterator[str]:
    """The complete lines of a text file, as they come; ends after `idle` seconds without new ones (0: never).

    Bytes that are no UTF-8 come as the replacement character.
    """
    with path.open(encoding="utf-8", errors="replace") as file:
        part, last = "", time.monotonic()
        while True:
            text = file.read()
            if text:
                *whole, part = (part + text).split("\n")
                last = time.monotonic()
                yield from whole
            elif 0.0 < idle < time.monotonic() - last:
                return
            else:
                time.sleep(POLL)


def growing_rows(path: Path, lines: Iterator[str]) -> Iterator[dict[str, float]]:
    """Each line's columns of the log format by name, after the header.

    Raises:
        InvalidLogError: a column that is missing or there twice, or a line that holds no numbers.
    """
    header = [name.strip() for name in next(lines, "").split(",")]
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
        yield Row(columns["t"], y, np.array([columns["delta_cmd"], columns["tau_cmd"]]))
