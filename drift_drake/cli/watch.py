"""`drift-drake watch`: changes of the car against its simulator during a drive, reported as the log's rows come."""

import contextlib
import dataclasses
import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tyro

from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.given_vehicle import vehicle_given
from drift_drake.car.log.table import InvalidLogError
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.plain_files import check_file
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import STANDARD_OUTPUT, progress_bar, said_to, write_text


@dataclasses.dataclass(frozen=True)
class Watch:
    """Watch a drive row by row: when the car began to differ from its simulator, and which effect explains it.

    drift-drake watch logs/monday/run_0.csv --vehicle car.yaml --json events.jsonl
    """

    log: tyro.conf.Positional[Path]
    """One run in the log format (CSV, .csv.gz or Parquet), with torque commands."""
    vehicle: Path
    """Vehicle file of the simulator (YAML)."""
    calibration: Path | None = None
    """What 'identify --json' wrote of this car, so that its baseline residuals are no change."""
    json: Path | None = None
    """Where to write the events, one JSON object a line (-: standard output)."""
    page: Path | None = None
    """Where to draw the probabilities and list the events (HTML). With --follow, an open page loads itself anew."""
    follow: bool = False
    """Wait for further rows: the log (a CSV) is still being written. Events are then written as they come."""
    idle: float = 0.0
    """With --follow: end after so many seconds without a new row; 0: never."""
    false_alarms_per_hour: float = 0.3
    """Changes that may be reported in an hour of driving in which nothing changes, in the mean."""


def run_watch(command: Watch) -> None:
    simulated = isinstance(vehicle_given(command.vehicle).parameters, SimulatorCar)
    if not 0.0 <= command.idle < math.inf:
        raise InvalidOptionError(f"--idle {command.idle:g}: give seconds, 0 or more")
    if not command.follow:
        check_file(command.log, InvalidLogError, "give the path of a run (CSV or Parquet)")
    inputs = [command.log, command.vehicle, *([command.calibration] if command.calibration else [])]
    try_outputs({"--json": command.json, "--page": command.page}, inputs)
    with ended_at_once():
        from drift_drake.gap.monitoring.events import sentence
        from drift_drake.gap.watching.watch_log import watch

    reported: list[Mapping[str, Any]] = []

    def say(text: str) -> None:
        print(text, file=sys.stderr if text.startswith("warning: ") else said_to(command.json), flush=True)

    def tell(events: Sequence[Mapping[str, Any]]) -> None:
        for event in events:
            say(sentence(event))
        reported.extend(events)
        if command.json is not None and command.follow:
            write_text(command.json, _lines(events if command.json == STANDARD_OUTPUT else reported))
            sys.stdout.flush()

    with contextlib.ExitStack() as bar:
        show = bar.enter_context(progress_bar(quiet=command.follow or not simulated))

        def progress(stage: str, share: float) -> None:
            show(stage, share)
            if share >= 1.0:  # events follow
                bar.close()

        seen = watch(
            command.log, command.vehicle, command.calibration, follow=command.follow, idle=command.idle,
            page=command.page, tell=tell, false_alarms_per_hour=command.false_alarms_per_hour, say=say,
            progress=progress,
        )  # fmt: skip
    if seen.sentence():
        say(f"{command.log}: {seen.sentence()}")
    if command.json is not None:
        last = [seen.summary()] if seen.sentence() else []
        streams = command.follow and command.json == STANDARD_OUTPUT
        write_text(command.json, _lines(last if streams else [*reported, *last]))


def _lines(events: Sequence[Mapping[str, Any]]) -> str:
    return "".join(json.dumps(event) + "\n" for event in events)
