"""`drift-drake export`: logs and vehicle files in the formats of other tools."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

import tyro

from drift_drake.car.log.table import case_paths, read_run
from drift_drake.car.vehicle_file import read_vehicle
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import try_folder, try_outputs
from drift_drake.common.standard_output import said_to, write_results

Format = Literal["parquet", "mcap", "commonroad", "mujoco"]
ENDINGS = {"parquet": ".parquet", "mcap": ".mcap", "commonroad": ".yaml", "mujoco": ".xml"}
NEEDS = {"parquet": "parquet", "mcap": "ros"}  # extras of the package


@dataclasses.dataclass(frozen=True)
class Export:
    """Write logs or a vehicle file in the format of another tool.

    drift-drake export logs/monday --format mcap --out foxglove

    drift-drake export corrected.yaml --format mujoco --out car.xml

    Of logs (a run's file, or a folder of runs): parquet (columns with units), mcap (JSON messages that Foxglove shows).
    Of a vehicle file: commonroad (parameters of its single-track models), mujoco (a model with four wheels). Effects
    that only change parameters are included; what a format cannot hold is listed.
    """

    source: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOGS|VEHICLE")]
    """A run's file or a folder of runs, or a vehicle file."""
    format: Format
    """What to write."""
    out: Path
    """File to write; for a folder of runs, a folder."""
    json: Path | None = None
    """Where to write which files were written, and what was left out, as JSON (-: standard output)."""


def run_export(command: Export) -> None:
    if command.format in NEEDS:
        _export_logs(command)
    else:
        _export_vehicle(command)


def _export_logs(command: Export) -> None:
    if command.source.suffix in (".yaml", ".yml"):
        raise InvalidOptionError(f"--format {command.format} is for logs, and {command.source} is a vehicle file")
    paths = case_paths(command.source)
    if command.source.is_dir():
        try_folder(command.out, "--out")
        outs = [command.out / f"{path.name.split('.')[0]}{ENDINGS[command.format]}" for path in paths]
        try_outputs({f"--out {out.name}": out for out in outs}, paths)
    else:
        outs = [command.out]
    try_outputs({"--json": command.json} | ({} if command.source.is_dir() else {"--out": command.out}), paths)
    with ended_at_once():
        from drift_drake.view.exporting.logs import write_mcap, write_parquet

    write = write_parquet if command.format == "parquet" else write_mcap
    for path, out in zip(paths, outs, strict=True):
        try:
            write(read_run(path), out)
        except ImportError as error:
            raise InvalidOptionError(
                f"--format {command.format} needs a package ({error}): pip install "
                f'"drift_drake[{NEEDS[command.format]}]"'
            ) from None
        print(f"{out}: written from {path}", file=said_to(command.json))
    files = [{"source": path, "out": out} for path, out in zip(paths, outs, strict=True)]
    write_results(command.json, {"files": files, "left_out": []})


def _export_vehicle(command: Export) -> None:
    if command.source.is_dir():
        raise InvalidOptionError(f"--format {command.format} is for a vehicle file, and {command.source} is a folder")
    vehicle, effects = read_vehicle(command.source)
    try_outputs({"--out": command.out, "--json": command.json}, [command.source])
    with ended_at_once():
        from drift_drake.car.effects.magnitudes import magnitudes_of, make_effects
        from drift_drake.car.single_track.motion_with_effects import changed_constants
        from drift_drake.view.exporting.vehicles import write_commonroad, write_mujoco

    write = write_commonroad if command.format == "commonroad" else write_mujoco
    write(vehicle, effects, command.out)
    nominal = vehicle.constants()
    lost = [
        name
        for name, q in magnitudes_of(effects).items()
        if changed_constants(nominal, make_effects({name: q})) == nominal
    ]
    left = f"; {command.format} has no place for {', '.join(lost)}, left out" if lost else ""
    print(f"{command.out}: written from {command.source}{left}", file=said_to(command.json))
    write_results(command.json, {"files": [{"source": command.source, "out": command.out}], "left_out": lost})
