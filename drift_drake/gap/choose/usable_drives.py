"""Which parts of a car's logs are asked what they identify."""

import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import VehicleParameters

NEEDED = ("beta", "omega_r", "tau_cmd")  # in addition to what every log has
PERIOD, CLOSE = 0.01, 1e-4  # [s] between rows
LIVELY = 95  # [%] of a drive's rows; informative drives exceed the grip in more than 5 %, by 1.1 to 2.5 times
PIECE = 4.5  # [s] of an informative drive
MOST_SECONDS = 9.0  # that are asked: two such drives, on which what is usual was measured
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def check_drives(runs: Sequence[Run], logs: str | Path) -> None:
    """Raises InvalidLogError for runs that cannot be asked."""
    for run in runs:
        missing = [name for name in NEEDED if run.column(name) is None]
        if missing:
            raise InvalidLogError(
                f"{logs}: run {run.name} has no column {', '.join(missing)}; a car is identified by the yaw rate, the "
                "speed, the sideslip and the rim speed under both commands"
            )
        if abs(run.period - PERIOD) > CLOSE:
            raise InvalidLogError(
                f"{logs}: the rows of run {run.name} are {run.period:.4g} s apart; what is usual was measured on "
                f"rows {PERIOD:g} s apart: resample the log"
            )


def asked_parts(runs: Sequence[Run], vehicle: VehicleParameters) -> tuple[list[Run], list[str]]:
    """At most `MOST_SECONDS` of the runs in pieces of one drive's length, and a sentence that says so.

    Lively pieces come first, spread evenly over the logs, then gentle ones; which are taken depends on nothing else.
    """
    total = sum(lasting(run) for run in runs)
    if total <= MOST_SECONDS + PERIOD:
        return list(runs), []
    pieces = [piece for run in runs for piece in _pieces(run)]
    gentle = np.array([liveliness(piece) < vehicle.friction * vehicle.gravity for piece in pieces])
    # Multiples of the golden ratio fall evenly and in no rhythm: manoeuvres that take turns are all met.
    place = np.empty(len(pieces))
    for kind in (False, True):
        place[gentle == kind] = np.arange(np.count_nonzero(gentle == kind)) * GOLDEN % 1.0
    order = np.lexsort((place, gentle))
    until = np.cumsum([lasting(pieces[i]) for i in order])
    kept = sorted(order[: max(int(np.count_nonzero(until <= MOST_SECONDS + PERIOD)), 1)])
    used = sum(lasting(pieces[i]) for i in kept)
    where = "them" if not gentle.any() or gentle.all() else "their lively parts"
    return [pieces[i] for i in kept], [
        f"of {total:.0f} s of logs {used:.0f} s are asked: {len(kept)} pieces spread evenly over {where}"
    ]


def lasting(run: Run) -> float:
    """From a run's first row to its last [s]: a drive of 4.5 s has one row more than periods."""
    return (len(run) - 1) * run.period


def liveliness(run: Run) -> float:
    """Lateral acceleration [m/s^2] that a run exceeds in a twentieth of its rows, by yaw rate times speed."""
    return float(np.percentile(np.abs(run.v * run.r), LIVELY))


def _pieces(run: Run) -> list[Run]:
    """A run in pieces of equal length, named by the seconds of the run that they begin at."""
    rows = max(round(PIECE / run.period), 1)
    count = max(round(len(run) / rows), 1)
    if count == 1:
        return [run.rows(0, min(len(run), rows + rows // 2))]
    edges = np.linspace(0, len(run), count + 1).round().astype(int)
    return [
        dataclasses.replace(
            run.rows(int(a), min(int(b), int(a) + rows)), name=f"{run.name} from {run.t[a] - run.t[0]:.0f} s"
        )
        for a, b in itertools.pairwise(edges)
    ]
