"""Makes the drives that the Bayesian model is trained on and judged by.

    python -m experiments.model.drives --seed 0

For each of `vehicles` simulated vehicles of a population: drives by the MPC with the nominal (wrong) model and with the
true vehicle's parameters, LQR holds and manual scripts, all with dither, many of which end in a spin or off the road;
until 325 samples at 10 Hz have been driven. Written: the logs (log format, 100 Hz), what was driven (JSON), and one
table of samples for each population: every tenth row (`train.npz`), and all ten phases of that (`train_phases.npz`),
without the first sample of each drive. Broken off, it goes on with the vehicle it was at.
"""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import COLUMNS, Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.path_plant import CurvedPath, PathPlant
from drift_drake.car.single_track.motion_with_effects import changed_constants
from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.arrays import Array
from drift_drake.common.executors import run_jobs
from drift_drake.common.run_folder import is_done
from drift_drake.common.safe_files import write_text
from drift_drake.drive.learnt.samples import (
    DECIMATION,
    PHASE_STRIDE,
    Samples,
    concatenate,
    content_hash,
    load_samples,
    samples_from_log,
    save_samples,
)
from drift_drake.drive.loop.drive import Drive
from drift_drake.drive.manoeuvres.drivers import ROW_PERIOD
from drift_drake.drive.mpc.controller import MpcController
from drift_drake.drive.mpc.mpc import Mpc
from drift_drake.drive.mpc.plan import DT, Plan
from drift_drake.drive.reference.equilibrium import drift_equilibrium
from drift_drake.drive.reference.trajectory import Reference, figure_8, loops
from experiments.benchmarks.drifters import HoldDriver, dither, manual_script, wander
from experiments.benchmarks.vehicles import POPULATIONS, Population, draw_effects
from experiments.made import SpreadConfig

MIN_SAMPLES = 5  # a drive shorter than this teaches nothing
# Kind of drive and its longest duration [s], in the order in which a vehicle is driven, from a place of its own on.
SCHEDULE = (
    ("mpc_figure_8", 9.0),
    ("hold", 6.0),
    ("manual", 5.0),
    ("mpc_loops", 8.0),
    ("mpc_true", 8.0),
    ("manual", 5.0),
    ("hold", 6.0),
)
HORIZON = 20
PERIOD = 0.02  # [s] between plans
# Samples of a drive's beginning that are left out: within the first, the driver's command jumps from where the
# actuators stood. A model of the commands at both ends of a step cannot know of that, and no car is driven so.
TAKEOVER = 1
DRIVING_STREAM = 1  # of a vehicle's random numbers; its effects come from another
PlantOn = Callable[[CurvedPath | None], PathPlant | None]
STATE_SCATTER = np.array([0.08, 0.5, 0.08, 0.8, 0.3, 0.05])  # of where a drive starts


@dataclasses.dataclass(frozen=True)
class DrivesConfig(SpreadConfig):
    """What to drive; a cluster's machines must share the output folder."""

    seed: int = 0
    train: int = 360  # vehicles
    validation: int = 20  # for choices made while training
    held_out: int = 20  # the same distributions, never looked at before the end
    wide: int = 20  # out of distribution
    samples: int = 325  # a vehicle, at 10 Hz, the first of each drive among them
    output: Path = Path("runs/drives")


def main(config: DrivesConfig) -> None:
    """Makes all populations."""
    jobs: list[tuple[Path, Population, int, int, int]] = [
        (config.output, population, index, config.seed, config.samples)
        for population in POPULATIONS
        for index in range(getattr(config, population))
    ]
    # Drake keeps Python systems for ever, so a worker is replaced after a few vehicles.
    run_jobs(config.run_on, _drive_vehicle, jobs, lambda _job, _nothing: None, "vehicle", tasks_per_worker=4)
    summary: dict[str, Any] = {"config": dataclasses.asdict(config) | {"output": config.output.name}}
    for population in POPULATIONS:
        folders = [config.output / population / f"vehicle_{i:02d}" for i in range(getattr(config, population))]
        if folders:
            summary[population] = _join(config.output, population, folders)
    write_text(config.output / "summary.json", json.dumps(summary, indent=1))
    print(json.dumps(summary, indent=1))


def join_vehicles(folders: list[Path], name: str, drives: int | None = None) -> Samples:
    """One table of the vehicles' tables `name`.npz.

    Args:
        drives: of a vehicle; without, as many as its drives.json holds.
    """
    parts, numbered = [], 0
    for folder in folders:
        samples = load_samples(folder / f"{name}.npz")
        count = drives or len(json.loads((folder / "drives.json").read_text())["drives"])
        # One vehicle per phase: windows that run on through a vehicle's drives shall not meet the same drive again.
        vehicle = samples.vehicle + PHASE_STRIDE * (samples.drive // count)
        parts.append(samples._replace(drive=samples.drive + numbered, vehicle=vehicle))
        numbered += int(samples.drive.max()) + 1
    return concatenate(parts)


def _join(output: Path, population: str, folders: list[Path]) -> dict[str, Any]:
    """The population's tables from its vehicles', and what they hold."""
    save_samples(join_vehicles(folders, "phases"), output / f"{population}_phases.npz")
    found = join_vehicles(folders, "samples")
    save_samples(found, output / f"{population}.npz")
    drives = [drive for folder in folders for drive in json.loads((folder / "drives.json").read_text())["drives"]]
    frame = pd.DataFrame(drives)
    return {
        "samples": len(found.x),
        "hash": content_hash(found),
        "drives": len(drives),
        "endings": frame.groupby("kind")["ending"].value_counts().unstack(fill_value=0).to_dict("index"),
        "rms_e": {str(k): float(v) for k, v in frame.groupby("kind")["rms_e"].median().dropna().items()},
    }


def _drive_vehicle(job: tuple[Path, Population, int, int, int]) -> None:
    drive_vehicle(*job)


def drive_vehicle(output: Path, population: Population, index: int, seed: int, wanted: int) -> None:
    """Drives one vehicle until `wanted` samples have been driven, unless its folder is complete already."""
    folder = output / population / f"vehicle_{index:02d}"
    if is_done(folder / "samples.npz"):
        return
    folder.mkdir(parents=True, exist_ok=True)
    effects = draw_effects(population, index, seed)
    generator = np.random.default_rng([seed, POPULATIONS.index(population), index, DRIVING_STREAM])
    phases: list[list[Samples]] = [[] for _ in range(DECIMATION)]
    drives: list[dict[str, Any]] = []
    count, turn = 0, index
    while count < wanted:
        kind, table, ending, reference = one_drive(turn, effects, generator)
        turn += 1
        if len(table) <= MIN_SAMPLES * DECIMATION:
            continue
        path = None if reference is None else reference.path
        needed = table.iloc[: (wanted - count + 1) * DECIMATION]
        found = [samples_from_log(needed, path, index, len(drives), phase) for phase in range(DECIMATION)]
        count += len(found[0].x)
        for phase, samples in enumerate(found):
            phases[phase].append(samples.where(np.arange(len(samples.x)) >= TAKEOVER))
        name = f"run_{len(drives)}"
        columns: dict[str, Any] = {column: table[column].to_numpy() for column in COLUMNS if column in table}
        write_run(Run(name, **columns), folder / f"{name}.csv")
        rms_e = None if reference is None else float(np.sqrt(np.mean(table["e"] ** 2)))
        drives.append({"kind": kind, "ending": ending, "seconds": len(table) / 100.0, "rms_e": rms_e})
    write_text(folder / "drives.json", json.dumps({"effects": effects._asdict(), "drives": drives}, indent=1))
    save_samples(all_phases(phases), folder / "phases.npz")
    save_samples(concatenate(phases[0]), folder / "samples.npz")


def one_drive(
    turn: int, effects: Effects, generator: np.random.Generator, plant_on: PlantOn = lambda _path: None
) -> tuple[str, pd.DataFrame, str, Reference | None]:
    """(kind, log at 100 Hz, how it ended, reference) of a drive, of the kind whose turn it is.

    Args:
        plant_on: makes the true car on a path, or on none; `Car`'s own plant where it makes none.
    """
    kind, duration = SCHEDULE[turn % len(SCHEDULE)]
    noise_seed = int(generator.integers(2**31))
    drive, state, s, reference = _prepare(kind, duration, VehicleParameters(), effects, generator, plant_on)
    table, ending = drive.run(state, s, duration, noise_seed)
    return kind, table, ending, reference


def _prepare(
    kind: str, duration: float, parameters: VehicleParameters, effects: Effects, generator: np.random.Generator,
    plant_on: PlantOn,
) -> tuple[Drive, Array, float, Reference | None]:  # fmt: skip
    """(the drive, its first state [6], where on the path [m], the reference) of one kind."""
    shake = dither(duration, generator)
    if kind == "hold":
        radius, side = float(generator.integers(16, 25)), float(generator.choice([-1.0, 1.0]))
        drift = drift_equilibrium(parameters, side * radius, -side * 0.1 * float(generator.integers(4, 8)))
        drifting = wander(duration, generator, np.array([0.03, 10.0]), 0.3)
        holder = HoldDriver(parameters, drift, drifting)
        state = np.array([drift.r, drift.v, drift.beta, drift.omega_r, 0.0, 0.0])
        state[:4] += STATE_SCATTER[:4] * generator.standard_normal(4)
        drive = Drive(parameters, holder, 1, ROW_PERIOD, shake, holder.initial_command(), effects, plant=plant_on(None))
        return drive, state, 0.0, None
    if kind == "manual":
        script = manual_script(parameters, duration, generator)
        source = ConstantVectorSource(Plan(0.0, script).vector())
        speed = float(generator.uniform(8.0, 18.0))
        start_at = (script[0, 0], script[0, 1])
        drive = Drive(parameters, source, len(script) - 1, DT, shake, start_at, effects, plant=plant_on(None))
        return drive, np.array([0.0, speed, 0.0, speed, 0.0, 0.0]), 0.0, None
    believed = _true_parameters(parameters, effects) if kind == "mpc_true" else parameters
    reference = _reference(kind, believed, generator)
    start = generator.uniform(0.0, 25.0) if kind == "mpc_loops" else generator.uniform(0.0, reference.path.length)
    state = reference.state(start) + STATE_SCATTER * generator.standard_normal(6)
    steering, torque = (float(value) for value in reference.input(start))
    mpc = Mpc(NominalStepModel(believed), parameters, reference, HORIZON, delay=PERIOD,
              initial_command=(steering, torque))  # fmt: skip
    drive = Drive(parameters, MpcController(mpc, PERIOD), HORIZON, DT, shake, (steering, torque), effects, reference,
                  plant=plant_on(reference.path))  # fmt: skip
    return drive, state, float(start), reference


def _reference(kind: str, believed: VehicleParameters, generator: np.random.Generator) -> Reference:
    """A manoeuvre of a random size that the believed car can drive."""
    for _ in range(20):
        radius, sideslip = float(generator.integers(16, 23)), 0.1 * float(generator.integers(4, 8))
        transition = float(generator.choice([20.0, 25.0, 30.0]))
        try:
            if kind == "mpc_loops":
                return loops(believed, radius, sideslip, count=2, transition=transition)
            return figure_8(believed, radius, sideslip, transition)
        except ValueError:  # no such equilibrium or transition: another size
            continue
    return figure_8(VehicleParameters())


def _true_parameters(parameters: VehicleParameters, effects: Effects) -> VehicleParameters:
    """What of the true vehicle fits into the nominal car's parameters (not its lags, drag or load transfer)."""
    return parameters.with_constants(changed_constants(parameters.constants(), effects))


def all_phases(parts: list[list[Samples]]) -> Samples:
    """One table of all ten ways to take every tenth row, the phases one after the other, each a drive of its own.

    Args:
        parts: [phase][drive].
    """
    numbered, drives = [], 0
    for drives_of_phase in parts:
        for samples in drives_of_phase:
            numbered.append(samples._replace(drive=np.full(len(samples.x), drives)))
            drives += 1
    return concatenate(numbered)


if __name__ == "__main__":
    run_command(main, DrivesConfig)
