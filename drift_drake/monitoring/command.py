"""`drift-drake watch`: changes of the car against its simulator during a drive, reported as the log's rows come."""

import dataclasses
import functools
import itertools
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from drift_drake.errors import InvalidOptionError
from drift_drake.interruption import ended_at_once
from drift_drake.logs.table import InvalidLogError
from drift_drake.plain_files import check_file
from drift_drake.safe_files import try_outputs
from drift_drake.standard_output import STANDARD_OUTPUT, said_to, write_text
from drift_drake.vehicle.vehicle_file import read_vehicle

if TYPE_CHECKING:
    from drift_drake.monitoring.monitor import Monitor


@dataclasses.dataclass(frozen=True)
class Watch:
    """Watch a drive row by row: when the car began to differ from its simulator, and which effect explains it.

    drift-drake watch logs/monday/run_0.csv --vehicle car.yaml --json events.jsonl
    """

    log: tyro.conf.Positional[Path]
    """One run in the log format (CSV, .csv.gz or Parquet), with torque commands."""
    vehicle: Path
    """What the simulator believes of the car (YAML)."""
    calibration: Path | None = None
    """What 'identify --json' wrote of this car, so that what is normal for it is no change."""
    json: Path | None = None
    """Where to write the events, one JSON object a line (-: standard output)."""
    page: Path | None = None
    """Where to draw the probabilities and list the events (HTML). With --follow, an open page loads itself anew."""
    follow: bool = False
    """Wait for further rows: the log (a CSV) is still being written. Events are then written as they come."""
    idle: float = 0.0
    """With --follow: end after so many seconds without a new row; 0: never."""


def run_watch(command: Watch) -> None:
    vehicle, own = read_vehicle(command.vehicle)
    if not 0.0 <= command.idle < math.inf:
        raise InvalidOptionError(f"--idle {command.idle:g}: give seconds, 0 or more")
    check_file(command.log, InvalidLogError, "give the path of a run (CSV or Parquet)")
    inputs = [command.log, command.vehicle, *([command.calibration] if command.calibration else [])]
    try_outputs({"--json": command.json, "--page": command.page}, inputs)
    with ended_at_once():
        from drift_drake.logs.table import read_run
        from drift_drake.monitoring.monitor import BLOCK, sentence
        from drift_drake.monitoring.normal import calibrated_monitor, read_normal_scores
        from drift_drake.monitoring.watch import (
            Row,
            as_rows,
            growing_lines,
            growing_rows,
            head_of,
            monitor_of,
            on_the_clock,
            rows_of,
            watched,
        )

    rows: Iterator[Row]
    monitor_for = functools.partial(monitor_of, vehicle=vehicle, own=own)
    if command.calibration is not None:
        scores = read_normal_scores(command.calibration)
        monitor_for = functools.partial(calibrated_monitor, scores, vehicle=vehicle, own=own)
    if command.follow:
        coming = growing_rows(command.log, growing_lines(command.log, command.idle))
        head, first = head_of(command.log, coming)
        monitor = monitor_for(head)
        rows = as_rows(itertools.chain(first, on_the_clock(command.log, coming, head)))
    else:
        run = read_run(command.log)
        monitor, rows = monitor_for(run), rows_of(run)
    verdicts = watched(monitor, rows)
    if command.page is not None:
        from drift_drake.monitoring.live_page import shown_while  # jinja2 is slow to import

        verdicts = shown_while(verdicts, command.page, str(command.log), monitor.labels, command.follow)
    reported, judged = [], 0.0
    for _, _, events in verdicts:
        judged += BLOCK
        for event in events:
            print(sentence(event), file=said_to(command.json), flush=True)
        reported += events
        if events and command.json is not None and command.follow:
            write_text(command.json, _lines(events if command.json == STANDARD_OUTPUT else reported))
            sys.stdout.flush()
    if not reported:
        print(f"{command.log}: {no_change_sentence(monitor, judged)}", file=said_to(command.json))
    if command.json is not None and not (command.follow and reported):
        write_text(command.json, _lines(reported))


def no_change_sentence(monitor: "Monitor", judged: float) -> str:
    """What is said where no change is reported: that none was seen, or that none could be; judged: [s]."""
    from drift_drake.monitoring.monitor import SPIN

    if judged > 0.0:
        return f"nothing has changed in the {judged:.3g} s that could be judged"
    return (
        f"no row can be judged: the equations hold above {monitor.slowest:.2g} m/s and below {SPIN:g} rad of sideslip, "
        "and the filter needs a third of a second; watch a drive"
    )


def _lines(events: Sequence[Mapping[str, Any]]) -> str:
    return "".join(json.dumps(event) + "\n" for event in events)
