"""A log watched row by row, as the monitor would have seen it in the car."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.logs.noise import white_noise_level
from drift_drake.logs.table import InvalidLogError, Run
from drift_drake.monitoring.events import Events
from drift_drake.monitoring.evidence import EvidenceProblem, whitened
from drift_drake.monitoring.history import History, Sums, since, unpacked, until
from drift_drake.monitoring.monitor import Monitor, State, after_row, make_monitor
from drift_drake.sensing.sensors import NoiseLevels
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters

HEAD = 3.0  # [s] of a log that the sensors' noise is taken from
LEAST_NOISE = 0.25  # of a good inertial system's: a smoothed column hides its noise
APART = 0.3  # relative difference of two signatures below which they are one group
WATCHED = ("r", "v", "beta", "omega_r", "psi", "ax", "ay")


class Row(NamedTuple):
    """One row of a log."""

    t: float
    y: np.ndarray  # [9] `CHANNELS`, NaN where there is none
    command: np.ndarray  # [2]


def rows_of(run: Run) -> Iterator[Row]:
    """The rows of a run."""
    columns = [run.column(name) for name in CHANNELS]
    y = np.stack([np.full(len(run), np.nan) if a is None else a for a in columns], axis=1)
    y[:, CHANNELS.index("psi")] = np.unwrap(y[:, CHANNELS.index("psi")])
    commands = np.stack([run.delta_cmd, np.asarray(run.tau_cmd)], axis=1)
    for i in range(len(run)):
        yield Row(float(run.t[i]), y[i], commands[i])


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
        state = after_row(monitor, state, row.y, row.command, row.t)
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
