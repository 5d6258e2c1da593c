"""The rows of a log that is still being written."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.logs.table import COLUMNS, REQUIRED, InvalidLogError, Run, make_run
from drift_drake.monitoring.watch import HEAD, Row

POLL = 0.05  # [s] between looks at the file


def growing_lines(path: Path, idle: float) -> Iterator[str]:
    """The complete lines of a text file, as they come; ends after `idle` seconds without new ones (0: never)."""
    with path.open(encoding="utf-8") as file:
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
        InvalidLogError: a missing column, or a line that holds no numbers.
    """
    header = [name.strip() for name in next(lines, "").split(",")]
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
            raise InvalidLogError(f"{path}: line {number} holds no row of numbers; mend the writer") from None


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


def as_row(columns: dict[str, float]) -> Row:
    """One row for the monitor."""
    y = np.array([columns.get(name, np.nan) for name in CHANNELS])
    return Row(columns["t"], y, np.array([columns["delta_cmd"], columns["tau_cmd"]]))
