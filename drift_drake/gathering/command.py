"""`drift-drake choose`: which model may drive a car at its limits, asked of its logs."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from drift_drake.errors import InvalidOptionError
from drift_drake.interruption import ended_at_once
from drift_drake.logs.table import InvalidLogError, Run, read_case, run_paths
from drift_drake.safe_files import try_outputs
from drift_drake.standard_output import progress_bar, said_to, write_results
from drift_drake.vehicle.double_track.car_file import write_double_track
from drift_drake.vehicle.effects import magnitudes_of
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.vehicle_file import read_vehicle, write_vehicle

if TYPE_CHECKING:
    from drift_drake.arrays import Array
    from drift_drake.gathering.identified import IdentifiedCar
    from drift_drake.model.samples import Samples

NEEDED = ("beta", "omega_r", "tau_cmd")  # beside what every log has
PERIOD, CLOSE = 0.01, 1e-4  # [s] between rows


@dataclasses.dataclass(frozen=True)
class Choose:
    """Say which model may drive a car at its limits, by its logs: the learnt one, the car that they identify, or none.

    drift-drake choose logs/monday --vehicle car.yaml --out identified.yaml
    """

    logs: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOGS")]
    """Run CSV, or case folder, of lively drives in which the tyres slide for a part of the time."""
    vehicle: Path | None = None
    """Vehicle file, a first guess; its effects are identified anew (without: the shipped coupe's)."""
    checkpoint: Path | None = None
    """The learnt model (without: the shipped one)."""
    out: Path | None = None
    """Where to write the identified car, as a vehicle file that 'drive --model known' takes."""
    json: Path | None = None
    """Where to write the choice, as JSON (-: standard output)."""
    quiet: bool = False
    """No progress bar."""


def run_choose(command: Choose) -> None:
    first_guess = VehicleParameters() if command.vehicle is None else read_vehicle(command.vehicle)[0]
    inputs = [path for path in (command.vehicle, command.checkpoint, *run_paths(command.logs)) if path is not None]
    try_outputs({"--out": command.out, "--json": command.json}, inputs)
    runs = read_case(command.logs)
    check_runs(runs, command.logs)
    with ended_at_once():
        from drift_drake.gathering.choice import ask, usual_for
        from drift_drake.model.checkpoint import load_model
        from drift_drake.model.lag_bank import learn_with_lags
        from drift_drake.model.samples import concatenate

    model = load_model(command.checkpoint)
    usual = usual_for(model)
    if usual is None:
        raise InvalidOptionError(
            f"{command.checkpoint}: what is usual for this model is not known; measure it with 'python -m "
            "experiments.gathering.lane_trust', or leave --checkpoint out"
        )
    model, belief = learn_with_lags(
        model, lambda lag: concatenate([samples_of(run, number, lag) for number, run in enumerate(runs)])
    )
    with progress_bar(command.quiet) as show:
        found = ask(model, belief, runs, first_guess, show)
    choice = usual.choice(found)
    print(choice.sentence(), file=said_to(command.json))
    if command.out is not None:
        said = "not written, since no car was identified: give some nine seconds of lively driving"
        if found.car is not None:
            write_identified(command.out, found.car)
            said = "the car that the logs identify"
        print(f"{command.out}: {said}", file=said_to(command.json))
    write_results(command.json, {
        "believed": choice.believed, "forecast_error": {"learnt": found.learnt, "identified": found.identified},
        "limit": {"learnt": choice.learnt_limit, "identified": choice.identified_limit}, "doubts": found.doubts,
        "beyond": choice.beyond,
        "lags": dict(zip(("steering", "torque"), model.lag.tolist(), strict=True)),
        "tracks": found.car and (1 if isinstance(found.car.vehicle, VehicleParameters) else 2),
        "vehicle": found.car and found.car.vehicle, "effects": found.car and magnitudes_of(found.car.effects),
    })  # fmt: skip


def write_identified(path: Path, car: "IdentifiedCar") -> None:
    """Writes a vehicle file of the car, of one track or two."""
    if isinstance(car.vehicle, VehicleParameters):
        write_vehicle(path, car.vehicle, car.effects)
    else:
        write_double_track(path, car.vehicle, car.effects)


def check_runs(runs: list[Run], logs: Path) -> None:
    """Raises InvalidLogError for runs that a learnt model cannot be asked about."""
    for run in runs:
        missing = [name for name in NEEDED if run.column(name) is None]
        if missing:
            raise InvalidLogError(
                f"{logs}: run {run.name} has no column {', '.join(missing)}; a model of the whole car is asked for the "
                "yaw rate, the speed, the sideslip and the rim speed under both commands"
            )
        if abs(run.period - PERIOD) > CLOSE:
            raise InvalidLogError(
                f"{logs}: the rows of run {run.name} are {run.period:.4g} s apart; the learnt model takes rows "
                f"{PERIOD:g} s apart: resample the log"
            )


def samples_of(run: Run, drive: int, lag: "Array") -> "Samples":
    """A run as samples at 10 Hz, its lagged commands behind lags [2] [s]; where it is on a path is not asked for."""
    import pandas as pd

    from drift_drake.model.samples import samples_from_log

    columns = {name: run.column(name) for name in ("t", "r", "v", "beta", "omega_r", "delta_cmd", "tau_cmd")}
    return samples_from_log(pd.DataFrame(columns).assign(e=0.0, dphi=0.0), None, 0, drive, lag=lag)
