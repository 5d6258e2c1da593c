"""`drift-drake watch`: what the simulator comes to lack during a drive, told as the log's rows come."""

import dataclasses
import json
from pathlib import Path

import tyro

from drift_drake.interruption import ended_at_once
from drift_drake.logs.table import InvalidLogError
from drift_drake.plain_files import check_file
from drift_drake.safe_files import try_outputs
from drift_drake.standard_output import said_to, write_text
from drift_drake.vehicle.vehicle_file import read_vehicle


@dataclasses.dataclass(frozen=True)
class Watch:
    """Watch a drive row by row: when the car became another one than the simulator's, and which effect tells it.

    drift-drake watch logs/monday/run_0.csv --vehicle car.yaml --json events.jsonl
    """

    log: tyro.conf.Positional[Path]
    """One run in the log format (CSV, .csv.gz or Parquet), with torque commands."""
    vehicle: Path
    """What the simulator believes of the car (YAML)."""
    json: Path | None = None
    """Where to write the events, one JSON object a line (-: standard output)."""


def run_watch(command: Watch) -> None:
    """`drift-drake watch`.

    Raises:
        InvalidLogError, InvalidVehicleError: names the file, the place and the mend.
    """
    vehicle, own = read_vehicle(command.vehicle)
    check_file(command.log, InvalidLogError, "give the path of a run (CSV or Parquet)")
    try_outputs({"--json": command.json}, [command.log, command.vehicle])
    with ended_at_once():
        from drift_drake.logs.table import read_run
        from drift_drake.monitoring.events import sentence
        from drift_drake.monitoring.watch import monitor_of, rows_of, watched

    run = read_run(command.log)
    monitor = monitor_of(run, vehicle, own)
    told = []
    for _, _, events in watched(monitor, rows_of(run)):
        for event in events:
            print(sentence(event), file=said_to(command.json), flush=True)
        told += events
    if not told:
        print(f"{command.log}: nothing has changed in {run.t[-1] - run.t[0]:.0f} s", file=said_to(command.json))
    if command.json is not None:
        write_text(command.json, "".join(json.dumps(event) + "\n" for event in told))
