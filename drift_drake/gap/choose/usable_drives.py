"""Which parts of a car's logs are asked what they identify."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.usable import lasting, pieces_of, spread

NEEDED = ("beta", "omega_r", "tau_cmd")  # in addition to what every log has
PERIOD, CLOSE = 0.01, 1e-4  # [s] between rows
LIVELY = 95  # [%] of a drive's rows; informative drives exceed the grip in more than 5 %, by 1.1 to 2.5 times
PIECE = 4.5  # [s] of an informative drive
MOST_SECONDS = 9.0  # that are asked: two such drives, on which what is usual was measured


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
    pieces = [piece for run in runs for piece in pieces_of(run, PIECE, PIECE)]
    gentle = np.array([liveliness(piece) < vehicle.friction * vehicle.gravity for piece in pieces])
    kept = spread(pieces, MOST_SECONDS + PERIOD, gentle)
    used = sum(lasting(pieces[i]) for i in kept)
    where = "them" if not gentle.any() or gentle.all() else "their lively parts"
    return [pieces[i] for i in kept], [
        f"of {total:.0f} s of logs {used:.0f} s are asked: {len(kept)} pieces spread evenly over {where}"
    ]


def liveliness(run: Run) -> float:
    """Lateral acceleration [m/s^2] that a run exceeds in a twentieth of its rows, by yaw rate times speed."""
    return float(np.percentile(np.abs(run.v * run.r), LIVELY))
