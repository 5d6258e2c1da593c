"""Makes the learnt models whose prior is of cars of many structures: `varied`, on its own, and `hybrid`.

    python -m experiments.model.varied --output runs/varied

1. `drives`: brush cars, double-track cars of four kinds and single-track ones, drawn one by one; none is a car of
   another program. Each drifts as the training vehicles do (`experiments.model.drives`) and drives twice on the lane by
   information gathering; the lane drives identify a single-track car.
2. `varied`, `hybrid`: meta-training from the shipped model on what the nominal car, or each vehicle's identified one,
   leaves over (`hybrid_step.left_over`), in two rounds, the first on fewer vehicles.
3. `usual`: what of brush cars' lane drives is usual for the hybrid model (`gap.choose`), on validation vehicles.

What is done is listed in build.json and is not done again. Some 75 minutes on two cores: drives 35, trainings 40.
"""

import dataclasses
from functools import cache, partial
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.cases import runs_of
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.executors import run_jobs
from drift_drake.common.run_folder import is_done, write_json
from drift_drake.drive.gathering.config import GatheringConfig, lane
from drift_drake.drive.gathering.gather import gather, learn_drive
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_again, plan_drive
from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model, shipped
from drift_drake.drive.learnt.hybrid_step import hybrid_samples
from drift_drake.drive.learnt.meta_training import train
from drift_drake.drive.learnt.quality import squared_distances
from drift_drake.drive.learnt.samples import (
    DECIMATION,
    PHASE_STRIDE,
    CurvatureLookup,
    Samples,
    concatenate,
    load_samples,
    samples_from_log,
    save_samples,
)
from drift_drake.drive.learnt.training_config import TrainingConfig
from drift_drake.gap.choose.identified import IdentifiedCar, identified
from experiments.benchmarks.vehicles import draw_effects
from experiments.gathering.familiar import familiar_from
from experiments.made import SpreadConfig
from experiments.model.build import UNLIMITED, Stage, do_stages
from experiments.model.drives import MIN_SAMPLES, TAKEOVER, all_phases, one_drive
from experiments.other_worlds.brush_drifters import draw_wide_drifter
from experiments.other_worlds.true_cars import TrueCar, World, effects_in, true_car, true_plant

Base = Literal["varied", "hybrid"]  # what is inside h: the nominal car, the identified one
WORLDS: tuple[World, ...] = ("brush", "double_track", "brush", "saloon", "brush", "roadster", "brush", "rear_engined",
                             "single_track", "brush")  # fmt: skip
DRIVING_STREAM = 91  # of a vehicle's random numbers
SAMPLES = 325  # of drifting, of a vehicle
BEYOND = np.array([8.0, 8.0, 3.0, 30.0])  # left over by a step of a car that has come to a stop or spun
ROUNDS: dict[Base, tuple[tuple[int, int, float], ...]] = {
    "varied": ((130, 300, 1e-3), (170, 220, 7e-4)),
    "hybrid": ((50, 150, 1e-3), (170, 280, 1e-3)),
}
"""Vehicles, epochs, learning rate at the start of each round."""
LAST_RATE = 0.02  # of the first


@dataclasses.dataclass(frozen=True)
class VariedConfig(SpreadConfig):
    """How many vehicles; a cluster's machines must share the output folder."""

    output: Path = Path("runs/varied")
    seed: int = 4711
    """Of the training vehicles; the next is the validation vehicles', the one after the wide brush cars'."""
    train: int = 130
    wide: int = 40
    """Brush cars drawn half as far again."""
    validation: int = 20
    epochs: float = 1.0
    """Share of the epochs of each round."""


Vehicle = tuple[Path, int, int, bool]  # folder, seed, index, whether it is a wide brush car


def vehicle_of(job: Vehicle) -> tuple[TrueCar, Effects]:
    """The car and its effects."""
    _, seed, index, wide = job
    world: World = "brush" if wide else WORLDS[index % len(WORLDS)]
    car = draw_wide_drifter(index, seed) if wide else true_car(world, index, seed)
    return car, effects_in(world, draw_effects("wide" if world == "single_track" else "train", index, seed))


def file_of(job: Vehicle, table: str) -> Path:
    """Where a vehicle's table of samples is."""
    return job[0] / f"{job[1]}-{job[2]:03d}-{table}.npz"


@cache
def first_plan() -> tuple[BayesianModel, Trajectory]:
    """The shipped model and information gathering's first plan."""
    model, config = load_model(), GatheringConfig()
    return model, plan_drive(model, model.prior(), config, config.alpha)


def drive_vehicle(job: Vehicle) -> None:
    """Drives one vehicle, and writes the samples that each base leaves over in its drifts and lane drives."""
    if is_done(file_of(job, "varied-lane")):
        return
    car, effects = vehicle_of(job)
    generator = np.random.default_rng([job[1], job[2], DRIVING_STREAM])
    drifts: list[tuple[pd.DataFrame, CurvatureLookup | None]] = []
    count, turn = 0, job[2]
    while count < SAMPLES:
        _, table, _, reference = one_drive(turn, effects, generator, partial(true_plant, car, effects))
        turn += 1
        if len(table) > MIN_SAMPLES * DECIMATION:
            table = table.iloc[: (SAMPLES - count + 1) * DECIMATION]
            count += len(table) // DECIMATION - 1
            drifts.append((table, None if reference is None else reference.path))
    lanes = lane_drives(car, effects, generator)
    found = identified(runs_of([table for table, _ in lanes]), VehicleParameters())
    for base in ("hybrid", "varied"):  # the last file says that a vehicle is done
        inside = found if base == "hybrid" else None
        if base == "varied" or found is not None:
            save_samples(samples_of(drifts, inside, TAKEOVER), file_of(job, f"{base}-drift"))
            save_samples(samples_of(lanes, inside, 0), file_of(job, f"{base}-lane"))


def lane_drives(
    car: TrueCar, effects: Effects, generator: np.random.Generator
) -> list[tuple[pd.DataFrame, CurvatureLookup | None]]:
    """Two informative drives, the second planned with what the first taught; one where that has no feasible plan."""
    config, (model, plan) = GatheringConfig(), first_plan()
    first, found, path = plan, list[tuple[pd.DataFrame, CurvatureLookup | None]](), lane(config).path
    while len(found) < 2:
        seed = int(generator.integers(2**31))
        table, _ = gather(plan, effects, VehicleParameters(), config, seed, true_plant(car, effects, path))
        found.append((table, path))
        if len(found) == 1:
            try:
                plan = plan_again(model, learn_drive(model, model.prior(), table, config), first, config)
            except InfeasiblePlanError:
                break
    return found


def samples_of(
    logs: list[tuple[pd.DataFrame, CurvatureLookup | None]], car: IdentifiedCar | None, first: int
) -> Samples:
    """What the nominal car, or an identified one, leaves over in drives: all ten phases, each a drive of its own.

    Args:
        first: sample of a drive that counts.
    """
    phases: list[list[Samples]] = [[] for _ in range(DECIMATION)]
    for number, (table, path) in enumerate(logs):
        if car is None:
            found = [samples_from_log(table, path, 0, number, phase) for phase in range(DECIMATION)]
        else:
            found = hybrid_samples(table, path, 0, number, car.step_model(), VehicleParameters(), DECIMATION)
        for phase, samples in enumerate(found):
            kept = np.arange(len(samples.x)) >= first
            if car is not None:
                left = residual(samples.x, samples.u, samples.x_next, VehicleParameters().constants())
                kept &= np.isfinite(left).all(axis=1) & (np.abs(left) < BEYOND).all(axis=1)
            if kept.any():
                phases[phase].append(samples.where(kept))
    count = min(len(drives) for drives in phases)
    joined = all_phases([drives[:count] for drives in phases])
    return joined._replace(vehicle=PHASE_STRIDE * (joined.drive // count))


def joined(jobs: list[Vehicle], base: Base, name: str) -> Samples:
    """One table of vehicles' tables."""
    parts, drives = [], 0
    for number, job in enumerate(jobs):
        path = file_of(job, f"{base}-{name}")
        if is_done(path):
            samples = load_samples(path)
            parts.append(samples._replace(vehicle=samples.vehicle + number, drive=samples.drive + drives))
            drives = int(parts[-1].drive.max()) + 1
    return concatenate(parts)


def stages(config: VariedConfig) -> list[Stage]:
    """All stages, in order."""
    folder = config.output / "drives"
    training = [(folder, config.seed, i, False) for i in range(config.train)]
    training += [(folder, config.seed + 2, i, True) for i in range(config.wide)]
    validation = [(folder, config.seed + 1, i, False) for i in range(config.validation)]

    def drive() -> None:
        folder.mkdir(parents=True, exist_ok=True)
        run_jobs(config.run_on, drive_vehicle, training + validation, lambda _job, _nothing: None, "vehicle",
                 tasks_per_worker=8)  # fmt: skip

    def made(base: Base) -> None:
        before = shipped("bayesian_model.npz")
        for number, (vehicles, epochs, rate) in enumerate(ROUNDS[base]):
            tables = {}
            for part, jobs in (("train", training[:vehicles]), ("validation", validation)):
                for name in ("drift", "lane"):
                    tables[f"{part}-{name}"] = config.output / f"{base}-{part}-{name}.npz"
                    save_samples(joined(jobs, base, name), tables[f"{part}-{name}"])
            epochs = max(1, round(config.epochs * epochs))
            after = config.output / f"{base}_{number}.npz"
            train(TrainingConfig(
                data=tables["train-drift"], lane=tables["train-lane"], validation=tables["validation-drift"],
                validation_lane=tables["validation-lane"], output=after, start=before, epochs=epochs,
                learning_rate=rate, decay=LAST_RATE ** (1.0 / epochs), threads=1, time_limit=UNLIMITED,
            ))  # fmt: skip
            before = after

    def usual() -> None:
        model = load_model(config.output / f"hybrid_{len(ROUNDS['hybrid']) - 1}.npz")
        brush = [job for job in validation if WORLDS[job[2] % len(WORLDS)] == "brush"]
        lanes = [load_samples(file_of(job, "hybrid-lane")) for job in brush]
        first = [samples.where(samples.vehicle < PHASE_STRIDE) for samples in lanes]
        values = np.array([np.mean(squared_distances(model, model.prior(), samples)) for samples in first])
        write_json(config.output / "usual.json", {model.content_hash(): familiar_from(values)._asdict()})

    return [Stage("drives", drive), *(Stage(base, partial(made, base)) for base in ROUNDS), Stage("usual", usual)]


def main(config: VariedConfig) -> None:
    """Makes what the folder lacks."""
    config.output.mkdir(parents=True, exist_ok=True)
    do_stages(config, stages(config))


if __name__ == "__main__":
    run_command(main, VariedConfig, __doc__)
