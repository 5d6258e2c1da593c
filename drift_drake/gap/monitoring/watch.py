"""A log watched row by row, as the monitor would have seen it in the car."""

import math
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import COLUMNS, REQUIRED, InvalidLogError, Run, check_names, make_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import NoiseLevels
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.logs.noise import white_noise_level
from drift_drake.gap.monitoring.evidence import EvidenceProblem, History, Sums, since, unpacked, until, whitened
from drift_drake.gap.monitoring.monitor import Events, Monitor, State, after_row, make_monitor

HEAD = 3.0  # [s] of a log that the sensors' noise is taken from
LEAST_NOISE = 0.25  # of a good inertial system's: a smoothed column hides its noise
APART = 0.3  # relative difference of two signatures below which they are one group
WATCHED = ("r", "v", "beta", "omega_r", "psi", "ax", "ay")
PSI = CHANNELS.index("psi")
POLL = 0.05  # [s] between looks at the file


class Row(NamedTuple):
    t: float
    y: np.ndarray  # [9] `CHANNELS`, NaN where there is none
    command: np.ndarray  # [2]
    road: float = 0.0  # its bank [rad]


def rows_of(run: Run) -> Iterator[Row]:
    columns = [run.column(name) for name in CHANNELS]
    y = np.stack([np.full(len(run), np.nan) if a is None else a for a in columns], axis=1)
    y[:, CHANNELS.index("psi")] = np.unwrap(y[:, CHANNELS.index("psi")])
    commands = np.stack([run.delta_cmd, np.asarray(run.tau_cmd)], axis=1)
    road = np.zeros(len(run)) if run.bank is None else run.bank
    for i in range(len(run)):
        yield Row(float(run.t[i]), y[i], commands[i], float(road[i]))


def monitor_of(run: Run, vehicle: VehicleParameters, own: Effects, watched: Sequence[str] = WATCHED) -> Monitor:
    """A monitor for those of the columns `watched` that a log has; the sensors' noise is what its first seconds show.

    Raises:
        InvalidLogError: the log has no torque commands.
    """
    if run.tau_cmd is None:
        raise InvalidLogError(f"{run.name}: has no column tau_cmd, without which the monitor cannot predict; add it")
    used = [name for name in watched if run.column(name) is not None]
    head = run.rows(0, max(round(HEAD / run.period), 1))
    good, levels = NoiseLevels(), {}
    for name in used:
        found = white_noise_level(np.asarray(head.column(name)))
        levels[name] = max(float(found), LEAST_NOISE * getattr(good, name))
    return make_monitor(vehicle, own, used, run.period, NoiseLevels(**levels))


def watched(monitor: Monitor, rows: Iterator[Row]) -> Iterator[tuple[float, np.ndarray, list[dict[str, Any]]]]:
    """At every verdict: the time [s], the verdict (`monitor.State`) and the events to report.

    There is one every `BLOCK` seconds in which a row could be judged.
    """
    state, reported = monitor.start(), Events()
    for row in rows:
        before = state.verdict
        state = after_row(monitor, state, row.y, row.command, row.t, row.road)
        if state.verdict is not before:
            reported, events = reported.after(monitor, state.verdict, row.t)
            yield row.t, state.verdict, [with_group(monitor, state, event) for event in events]


def with_group(monitor: Monitor, state: State, event: dict[str, Any]) -> dict[str, Any]:
    """The event of a cause with the effects that it could be mistaken for (`mistakable`), where there are any."""
    if event["event"] != "cause":
        return event
    history = unpacked(state.history, len(monitor.problem.nodes))
    others = mistakable(monitor.problem, history, float(state.clock[2]), event["cause"])
    return event | {"or": list(others)} if others else event


def mistakable(problem: EvidenceProblem, history: History, edge: float, name: str) -> tuple[str, ...]:
    """Effects that could be mistaken for the effect `name`, which leads: on the rows since the change they do the same.

    What an effect does is known to a share of it alone, less so on a car that the equations do not follow. Two effects
    whose whitened signatures differ by less than that, whatever their magnitudes, are one group to the monitor, however
    probable the equations make one of the two.

    Args:
        edge: age [blocks] of the change.
    """
    ages, recent = since(history)
    if name not in problem.names or not len(ages):
        return ()
    i = int(np.argmin(np.abs(ages - edge)))
    w, m = (a[0] for a in whitened(problem, *(Sums(*(a[i : i + 1] for a in s)) for s in (recent, until(history)))))
    unit = m / np.maximum(np.linalg.norm(m, axis=0), 1e-12)
    own = np.flatnonzero(problem.member[:, problem.names.index(name)])
    fits = unit.T @ w
    leading = own[np.argmax(np.where(problem.signed[own], np.abs(fits[own]), fits[own]))]
    sign = np.sign(fits[leading]) if problem.signed[leading] else 1.0
    cosine = sign * (unit.T @ unit[:, leading])
    like = np.where(problem.signed, np.abs(cosine), cosine) >= np.sqrt(1.0 - APART**2)
    return tuple(n for j, n in enumerate(problem.names) if n != name and np.any(like & (problem.member[:, j] > 0.0)))


def growing_lines(path: Path, idle: float) -> Iterator[str]:
    """The complete lines of a text file, as they come; ends after `idle` seconds without new ones (0: never).

    Bytes that are no UTF-8 come as the replacement character.

    Raises:
        InvalidLogError: the file is cut, or another one has taken its place: nothing more would come.
    """
    with path.open(encoding="utf-8", errors="replace") as file:
        part, last = "", time.monotonic()
        while True:
            text = file.read()
            if text:
                *whole, part = (part + text).split("\n")
                last = time.monotonic()
                yield from whole
                continue
            _see_that_it_is_there(path, file)
            if 0.0 < idle < time.monotonic() - last:
                return
            time.sleep(POLL)


def _see_that_it_is_there(path: Path, file: TextIO) -> None:
    """Raises InvalidLogError where a file that has been read to its end is cut, or is no longer at its path."""
    here = os.fstat(file.fileno())
    try:
        there = path.stat()
    except OSError as error:
        raise InvalidLogError(
            f"{path}: is gone while it is followed ({error.strerror}); begin the watch anew when it is there"
        ) from None
    if (there.st_dev, there.st_ino) != (here.st_dev, here.st_ino):
        raise InvalidLogError(f"{path}: another file has taken its place while it is followed; begin the watch anew")
    if here.st_size < file.buffer.tell():
        raise InvalidLogError(f"{path}: has been cut or written anew while it is followed; begin the watch anew")


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
        yield Row(columns["t"], y, np.array([columns["delta_cmd"], columns["tau_cmd"]]), columns.get("bank", 0.0))
