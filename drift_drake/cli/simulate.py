"""`drift-drake simulate`: a simulated car's log, from a manoeuvre by name or from the commands of another log."""

import logging
from pathlib import Path

import numpy as np

from drift_drake.car.effects.magnitudes import magnitudes_of
from drift_drake.car.log.table import InvalidLogError, write_run
from drift_drake.car.vehicle_file import read_vehicle
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import said_to, write_results
from drift_drake.drive.manoeuvres.options import NAMES, Simulate, check_options


def run_simulate(command: Simulate) -> None:
    """`drift-drake simulate`.

    Raises:
        InvalidLogError, InvalidVehicleError: names the file, the place and the remedy.
        InvalidOptionError: a number is out of range.
    """
    parameters, effects = read_vehicle(command.vehicle)
    check_options(command, parameters)
    source = [] if command.drive in NAMES else [command.drive]
    if source and not Path(command.drive).exists():
        raise InvalidLogError(f"{command.drive}: no such file or manoeuvre; give a log or one of {', '.join(NAMES)}")
    try_outputs({"--out": command.out, "--json": command.json}, [command.vehicle, *source])
    with ended_at_once():
        from drift_drake.drive.manoeuvres.simulate import simulate_drive

    logging.getLogger("drake").setLevel(logging.WARNING)
    run, ending = simulate_drive(command, parameters, effects)
    write_run(run, command.out)
    end = "as planned" if ending == "time" else f"early: {ending}"
    beta = np.zeros(1) if run.beta is None else run.beta
    print(f"{command.out}: {command.drive}, {run.t[-1]:.2f} s, ended {end}; {np.min(run.v):.1f} to {np.max(run.v):.1f} "
          f"m/s, sideslip up to {np.max(np.abs(beta)):.2f} rad", file=said_to(command.json))  # fmt: skip
    driven = {"command": command, "effects": magnitudes_of(effects), "ending": ending, "rows": len(run)}
    write_results(command.json, driven)
