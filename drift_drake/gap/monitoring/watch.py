"""A log watched row by row, as the monitor would have seen it in the car."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import NoiseLevels
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.logs.noise import white_noise_level
from drift_drake.gap.monitoring.events import Events, SoFar, Watcher
from drift_drake.gap.monitoring.evidence import EvidenceProblem
from drift_drake.gap.monitoring.monitor import Monitor, make_monitor
from drift_drake.gap.monitoring.windowed.sums import harder

HEAD = 3.0  # [s] of a log that the sensors' noise is taken from
LEAST_NOISE = 0.25  # of a good inertial system's: a smoothed column hides its noise
APART = 0.3  # relative difference of two signatures below which they are one group
WATCHED = ("r", "v", "beta", "omega_r", "psi", "ax", "ay")


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


class VerdictAt(NamedTuple):
    """What a monitor says at a moment."""

    t: float  # [s]
    verdict: np.ndarray  # `State.verdict`
    events: list[dict[str, Any]]  # to report
    seen: SoFar


def watched(monitor: Watcher, rows: Iterator[Row]) -> Iterator[VerdictAt]:
    """What a monitor says at every verdict, and where it says that it cannot judge."""
    state, reported = monitor.start(), Events()
    for row in rows:
        before = state
        state = monitor.after_row(state, row.y, row.command, row.t, row.road)
        events = list[dict[str, Any]]()
        if state.seen is not before.seen:
            reported, events = reported.after_driving(state.seen, harder, row.t)
        if state.verdict is not before.verdict:
            reported, new = reported.after(monitor, state.verdict, row.t)
            events += [with_group(monitor, state, event) for event in new]
        if state.seen is not before.seen:
            yield VerdictAt(row.t, state.verdict, events, state.seen)


def with_group(monitor: Watcher, state: Any, event: dict[str, Any]) -> dict[str, Any]:
    """The event of a cause with the effects that it could be mistaken for (`mistakable`), where there are any."""
    at = monitor.at_edge(state) if event["event"] == "cause" else None
    others = mistakable(monitor.problem, *at, event["cause"]) if at is not None else ()
    return event | {"or": list(others)} if others else event


def mistakable(problem: EvidenceProblem, w: np.ndarray, m: np.ndarray, name: str) -> tuple[str, ...]:
    """Effects that could be mistaken for the effect `name`, which leads: on the rows since the change they do the same.

    What an effect does is known to a share of it alone, less so on a car that the equations do not follow. Two effects
    whose whitened signatures differ by less than that, whatever their magnitudes, are one group to the monitor, however
    probable the equations make one of the two.

    Args:
        w, m: whitened scores [s] since the change, and their mean by amplitudes [s, n].
    """
    if name not in problem.names:
        return ()
    unit = m / np.maximum(np.linalg.norm(m, axis=0), 1e-12)
    own = np.flatnonzero(problem.member[:, problem.names.index(name)])
    fits = unit.T @ w
    leading = own[np.argmax(np.where(problem.signed[own], np.abs(fits[own]), fits[own]))]
    sign = np.sign(fits[leading]) if problem.signed[leading] else 1.0
    cosine = sign * (unit.T @ unit[:, leading])
    like = np.where(problem.signed, np.abs(cosine), cosine) >= np.sqrt(1.0 - APART**2)
    return tuple(n for j, n in enumerate(problem.names) if n != name and np.any(like & (problem.member[:, j] > 0.0)))
