"""A fleet of cars with one effect that all share and some of their own: are they all named?

    python -m experiments.monitoring.fleets OUT --cars 30 --own 5
    python -m experiments.monitoring.fleets OUT --cars 6 --own 2 --days 3 --drift 1

Each car has deviations within its file's tolerances too, and two drives a day. Writes the logs, truth.json and what
the fleet's model finds, found.json; a cluster's machines (`--executor.executor dask`) share the folder OUT.
"""

import dataclasses
import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.given_vehicle import GivenVehicle
from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.cli.fleet import day_folders
from drift_drake.common.executors import ExecutorConfig
from drift_drake.common.run_folder import is_done, write_json
from drift_drake.gap.monitoring.fleet import FleetFindings, fleet_findings
from drift_drake.gap.monitoring.fleet_days import Judge, days_of, shared_columns
from drift_drake.gap.monitoring.fleet_page import lines
from experiments.benchmarks.truths import drawn_deviations
from experiments.monitoring.drives import changed_drive

SHARED = {"aero_drag": 1.2}
OWN: tuple[dict[str, float], ...] = (
    {"rear_stiffness_error": -0.2}, {"steering_delay": 0.04}, {"torque_gain_error": -0.12}, {"mass_error": 0.1},
    {"sideslip_bias": 0.02},
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Config:
    """A fleet."""

    out: Annotated[Path, tyro.conf.Positional]
    cars: int = 30
    own: int = 5
    """Cars with an effect of their own, at most 5."""
    days: int = 1
    drift: float = 0.0
    """Share of the effect that all have that comes between the first day and the last."""
    duration: float = 8.0
    """[s] of a drive."""
    seed: int = 0
    executor: ExecutorConfig = dataclasses.field(default_factory=ExecutorConfig)


def main(config: Config) -> None:
    """Writes the fleet, if it is not there, and what is found of it."""
    if not is_done(config.out / "truth.json"):
        write_fleet(config)
    truth = json.loads((config.out / "truth.json").read_text())
    folders = day_folders(config.out)
    judge = Judge(GivenVehicle(VehicleParameters(), Effects()), shared_columns(folders))
    found = fleet_findings(judge.problem(), days_of(folders, judge, config.executor))
    write_json(config.out / "found.json", found)
    print("\n".join([*lines(found), verdict(found, truth)]))


def verdict(found: FleetFindings, truth: dict[str, Any]) -> str:
    """How many of the true effects are named, and how many others are."""
    true = {("", name) for name in truth["shared"]}
    true |= {(car, name) for car, effects in truth["own"].items() for name in effects}
    named = {(term.owner, term.effect) for term in found.terms}
    return f"{len(true & named)} of {len(true)} named, {len(named - true)} others"


def write_fleet(config: Config) -> None:
    """The logs and what is true of them."""
    vehicle = VehicleParameters()
    rng = np.random.default_rng([config.seed, 9])
    odd = rng.choice(config.cars, size=config.own, replace=False)
    own = {f"car_{car:02d}": OWN[i] for i, car in enumerate(odd)}
    for car in range(config.cars):
        name = f"car_{car:02d}"
        deviations = drawn_deviations(rng, vehicle.tolerance)
        for day in range(config.days):
            there = 1.0 - config.drift * (1.0 - day / max(config.days - 1, 1))
            effects = make_effects({effect: there * q for effect, q in SHARED.items()} | own.get(name, {}))
            for i, kind in enumerate(("slalom", "power")):
                seed = 1000 * config.seed + 100 * car + 10 * day + i
                run = changed_drive(kind, effects, 0.0, seed, config.duration, vehicle, deviations)
                folder = config.out / name / f"day_{day}"
                folder.mkdir(parents=True, exist_ok=True)
                write_run(run, folder / f"run_{i}.csv")
    vehicle.to_yaml(config.out / "vehicle.yaml")
    write_json(config.out / "truth.json", {"shared": SHARED, "own": own})


if __name__ == "__main__":
    run_command(main, Config, __doc__)
