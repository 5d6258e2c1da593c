"""`drift-drake replay`: a log compared with what the simulator makes of its commands."""

import dataclasses
from pathlib import Path
from typing import Annotated

import tyro

from drift_drake.car.car_file import read_car
from drift_drake.car.log.table import InvalidLogError
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.plain_files import check_file
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import said_to, write_results


@dataclasses.dataclass(frozen=True)
class Replay:
    """Play a log's commands to the simulator's car and to the corrected one, and watch both next to the real car.

    drift-drake replay logs/monday/run_0.csv --vehicle car.yaml --corrected corrected.yaml --html replay.html
    """

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOG")]
    """One run in the log format (CSV, .csv.gz or Parquet)."""
    vehicle: Path
    """Vehicle file or simulator file of the simulator (YAML)."""
    corrected: Path | None = None
    """The corrected vehicle, as `drift-drake apply` writes it."""
    restart: float = 1.0
    """Seconds after which the simulated cars are put back onto the real one, over and over; 0: never."""
    html: Path | None = None
    """Where to write the 3D replay: one HTML file that any browser plays."""
    json: Path | None = None
    """Where to write the errors as JSON (-: standard output)."""


def run_replay(command: Replay) -> None:
    files = [path for path in (command.vehicle, command.corrected) if path is not None]
    for path in files:
        read_car(path)
    check_file(command.log, InvalidLogError, "give the path of a run (CSV or Parquet)")
    try_outputs({"--html": command.html, "--json": command.json}, [command.log, *files])
    with ended_at_once():
        from drift_drake.view.playback.replay import replay
    played = replay(command.log, command.vehicle, command.corrected, restart=command.restart)
    print(played.sentence(), file=said_to(command.json))
    found = {"log": command.log, "restart": command.restart} | dataclasses.asdict(played.comparison)
    write_results(command.json, found)
    if command.html is not None:
        played.write(command.html)
        print(f"{command.html}: open it in a browser", file=said_to(command.json))
