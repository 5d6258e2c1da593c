"""`drift-drake drive`: the closed loop on a reference."""

import contextlib
import dataclasses
from pathlib import Path
from typing import Literal

import tyro

from drift_drake.car.car_file import read_plant
from drift_drake.common.errors import InvalidOptionError, OutputError
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import alone_in, try_outputs
from drift_drake.common.standard_output import said_to, write_results

MonitorPolicy = Literal["off", "watch", "correct", "slow", "correct_or_slow", "forget"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class DriveOptions:
    """What is driven with which model, and what a run leaves behind."""

    vehicle: Path | None = None
    """Vehicle file (YAML), single-track or double-track; its `effects:` act too. If not given, the default coupe or,
    with the double-track plant, the single-track car nearest to it."""
    plant: Literal["single_track", "double_track"] = "single_track"
    """The true car: the vehicle file's, or a coupe on four tyres with a single-track vehicle file's effects."""
    model: Literal["nominal", "known", "prior", "online", "offset_free", "varied"] = "nominal"
    """The controller's model: the vehicle file without its effects (nominal), or with those that it can plan with
    (known); or the shipped learnt model, of cars like the default coupe, without adaptation (prior), adapting while it
    drives, the actuators' lags too (online), with an estimated offset too (offset_free), or so with the
    prior of cars of many structures (varied)."""
    after: tuple[Path, ...] = ()
    """Logs of earlier drives, which a model that adapts begins with (such as run_0.csv of their folders): of this
    course, or of the other one with the same circles, which count 0.3 of a drive together."""
    radius: float | None = None
    """Radius of the circles [m]; if not given, 18 m for the default coupe. Other cars' lengths are in proportion to the
    wheelbase, and speeds to its root."""
    transition: float | None = None
    """Length of the transition between drifts [m]; if not given, 20 m for the default coupe."""
    sideslip: float = 0.6
    """Sideslip of the drifts [rad]."""
    half_width: float | None = None
    """Half width of the lane [m]; if not given, 3 m for the default coupe."""
    seed: int = 0
    """Seed of the sensors' noise."""
    fault: tuple[str, ...] = ()
    """What goes wrong and when: KIND:START:DURATION[:SIZE[:CHANNEL]] in seconds, such as dropout:2.0:0.5. Kinds:
    dropout, nan, freeze, spike, bias, delay, jitter, hold, drift (of the measured state), solver_failure, lost_plans,
    late_plans, clock_drift, saturated, steering_stuck, torque_stuck, torque_lost (the actuators), friction_patch."""
    monitor: MonitorPolicy = "off"
    """Report changes of the car relative to its simulator (events.jsonl in the folder), and react. watch: no reaction;
    correct: the named cause is added to the nominal model, or subtracted from the readings; slow: the lane is driven in
    grip until the change is over; correct_or_slow: slow while the cause cannot be corrected; forget: the adapting model
    forgets what it learnt before the change."""
    out: Path | None = None
    """New folder for the results; runs/closed_loop-DATE-TIME without."""
    graph: bool = False
    """Only draw the block diagram (closed_loop.svg and .png in the folder); needs the extra `graph`."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClosedLoopDrive(DriveOptions):
    """Drive a reference under model predictive control, and leave numbers, pictures and a 3D replay in a folder.

    drift-drake drive figure_8

    drift-drake drive figure_8 --vehicle corrected.yaml --model online --out drive

    The car starts half a metre and 0.1 rad of sideslip off the reference, with sensor noise. The controller knows the
    vehicle file but not its effects, unless they are given to it (--model known).
    """

    reference: tyro.conf.Positional[Literal["figure_8", "loops"]]
    """What to drive: drifts in both directions, or the same loop over and over, entered from grip."""
    json: Path | None = None
    """Where to write the folder's name and the run's numbers as JSON (-: standard output)."""


def run_drive(command: ClosedLoopDrive) -> None:
    """`drift-drake drive`.

    Raises:
        InvalidVehicleError: names the file, the key and the remedy.
        InvalidLogError: of the earlier drive; InvalidOptionError: a fault that cannot be read, a negative seed, or a
            policy or an earlier drive that the model cannot take.
        OutputError: the folder holds files already, or cannot be written to.
    """
    if command.seed < 0:
        raise InvalidOptionError(f"--seed {command.seed}: give 0 or more")
    if command.vehicle is not None:
        read_plant(command.vehicle)
    try_outputs({"--json": command.json}, [path for path in (command.vehicle, *command.after) if path is not None])
    with contextlib.nullcontext() if command.out is None else alone_in(command.out):
        if command.out is not None and any(not path.name.startswith(".") for path in command.out.iterdir()):
            raise OutputError(f"--out {command.out}: holds files already; give a new folder")
        with ended_at_once():
            from drift_drake.cli.drive_run import ClosedLoopConfig, main

        options = {field.name: getattr(command, field.name) for field in dataclasses.fields(command)}
        del options["json"]
        write_results(command.json, main(ClosedLoopConfig(**options), said_to(command.json)))
