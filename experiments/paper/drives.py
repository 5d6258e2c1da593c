"""The informative drives of each vehicle: norms of the covariances, how bold they are, what they teach of one step.

Two rounds and a straight drive each, under the recipe and as shipped; for a few vehicles with other weights of the
information, with the total information along the horizon in place of eq. (9)'s sum, and with a lane that is narrowed by
what is not known of the car.
"""

import dataclasses
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import STATE_SCALE
from drift_drake.common.arrays import Array
from drift_drake.common.executors import ExecutorConfig
from drift_drake.common.run_folder import write_json
from drift_drake.common.safe_files import write_table
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import Gathered, taught
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_again, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.posterior import Posterior, covariance_norms
from experiments.benchmarks.vehicles import Population, draw_effects
from experiments.gathering.beliefs import SECOND_ROUND
from experiments.gathering.recipe import Recipe
from experiments.model.uncertainties import model_change, true_change
from experiments.settings import keep_settings, run_kept

STATES = ("r", "v", "beta", "omega_r")
MIRRORED = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, -1.0])  # a plan that steers the other way first is the same one
ALPHAS = (1.0, 2.0, 3.0)  # other weights than the recipe's
NARROWED = 1.0  # standard deviations of e
STEERING = np.linspace(-0.6, 0.6, 25)  # [rad] over which one step's predictions are judged


@dataclasses.dataclass(frozen=True)
class DrivesConfig:
    """Which vehicles; of the few, all variants."""

    recipe: Recipe
    shipped: Recipe
    vehicles: int
    few: int
    population: Population
    vehicle_seed: int
    run_on: ExecutorConfig
    out: Path


class Variant(NamedTuple):
    """A way to gather."""

    name: str
    checkpoint: Path | None
    gathering: GatheringConfig


class Job(NamedTuple):
    """One vehicle under one variant; the first plans are all vehicles'."""

    variant: Variant
    vehicle: int
    effects: Effects
    ocp: Trajectory
    info: Trajectory


def variants(config: DrivesConfig) -> list[Variant]:
    """The recipe and the shipped gathering, then those that a few vehicles are driven under."""
    change = dataclasses.replace
    paper, other = config.recipe, config.recipe.gathering
    total = change(other, objective="updated", objective_later="updated")
    return [
        Variant("recipe", paper.checkpoint, other),
        Variant("shipped", config.shipped.checkpoint, config.shipped.gathering),
        *(Variant(f"alpha {alpha:g}", paper.checkpoint, change(other, alpha=alpha)) for alpha in ALPHAS),
        Variant("total information", paper.checkpoint, total),
        Variant("narrowed lane", paper.checkpoint, change(other, tightening=NARROWED)),
    ]


def judged(model: BayesianModel, belief: Posterior, effects: Effects) -> dict[str, float]:
    """Norms by state and in all; RMS error and mean standard deviation of one step at the paper's point, by state."""
    norms, total = covariance_norms(belief)
    mean, deviation = model_change(model, belief, STEERING)
    error = np.sqrt(np.mean((mean - true_change(STEERING, model.vehicle.constants(), effects)) ** 2, axis=0))
    named = {"norm": norms, "error": error, "deviation": deviation.mean(axis=0)}
    return {"total": float(total)} | {
        f"{name}_{state}": float(value)
        for name, values in named.items()
        for state, value in zip(STATES, values, strict=True)
    }


def excursions(plan: Trajectory, drive: Gathered, config: GatheringConfig) -> dict[str, Any]:
    """How bold a plan and its drive are, and whether the drive kept to the lane."""
    table = drive.table
    return {
        "planned_r": float(np.abs(plan.x[:, 0]).max()),
        "planned_tau": float(plan.u[:, 1].max()),
        "status": plan.status,
        "max_r": float(table["r"].abs().max()),
        "max_tau": float(table["tau_cmd"].max()),
        "left": float(table["delta_cmd"].max()),
        "right": float(-table["delta_cmd"].min()),
        "max_beta": float(table["beta"].abs().max()),
        "max_e": float(table["e"].abs().max()),
        "kept": bool(drive.ending == "time" and table["e"].abs().max() <= config.half_width),
        "obtained": drive.obtained,
    }


def unlike(one: Trajectory, other: Trajectory, straight: Trajectory) -> float:
    """RMS difference of two plans' states over that of the first from the straight drive, or its mirror image."""

    def apart(a: Array, b: Array) -> float:
        return float(np.sqrt(np.mean(((a - b)[:, :6] / STATE_SCALE) ** 2)))

    a, b = one.x[:, :6], other.x[:, :6]
    return min(apart(a, b), apart(a, MIRRORED * b)) / apart(a, straight.x[:, :6])


def of_vehicle(job: Job) -> list[dict[str, Any]]:
    """A row a model: prior, Once-OCP, Once-Info, Twice-Info as far as it was found."""
    variant, config = job.variant, job.variant.gathering
    model = load_model(variant.checkpoint)
    prior = model.prior()
    labels = {"variant": variant.name, "vehicle": job.vehicle, "alpha": config.alpha}
    rows: list[dict[str, Any]] = [labels | {"model": "prior"} | judged(model, prior, job.effects)]

    def drive(name: str, before: Posterior, plan: Trajectory, seed: int) -> Posterior:
        found = taught(model, before, plan, job.effects, VehicleParameters(), config, seed)
        row = judged(model, found.belief, job.effects) | excursions(plan, found, config)
        rows.append(labels | {"model": name} | row)
        return found.belief

    drive("Once-OCP", prior, job.ocp, 0)
    once = drive("Once-Info", prior, job.info, 0)
    try:
        second = plan_again(model, once, job.info, config)
        drive("Twice-Info", once, second, SECOND_ROUND)
        if variant.name == "recipe":
            total = dataclasses.replace(config, objective="updated", objective_later="updated")
            rows[-1]["total_unlike"] = unlike(second, plan_again(model, once, job.info, total), job.ocp)
    except InfeasiblePlanError:
        pass
    return rows


def first_plans(variant: Variant) -> tuple[Trajectory, Trajectory] | None:
    """(OCP's, Info-OCP's) with the prior; None where there is none."""
    model = load_model(variant.checkpoint)
    try:
        ocp, info = (
            plan_drive(model, model.prior(), variant.gathering, alpha) for alpha in (0.0, variant.gathering.alpha)
        )
    except InfeasiblePlanError:
        return None
    return ocp, info


def main(config: DrivesConfig) -> None:
    """Plans and drives what the folder lacks: drives.csv, plans.json."""
    folder = config.out
    folder.mkdir(parents=True, exist_ok=True)
    hashes = {name: load_model(getattr(config, name).checkpoint).content_hash() for name in ("recipe", "shipped")}
    free = ("vehicles", "few", "run_on", "out")
    keep_settings(folder, dataclasses.asdict(config) | {"hashes": hashes}, free)
    jobs: list[Job] = []
    plans: dict[str, tuple[Trajectory, Trajectory]] = {}
    for variant in variants(config):
        count = config.vehicles if variant.name in ("recipe", "shipped") else config.few
        first = first_plans(variant)
        if first is None:
            continue
        plans[variant.name] = first
        for vehicle in range(count):
            effects = draw_effects(config.population, vehicle, config.vehicle_seed)
            jobs.append(Job(variant, vehicle, effects, *first))
    write_json(folder / "plans.json", first_compared(plans))
    found = run_kept(config.run_on, of_vehicle, jobs, lambda job: _file(folder, job), "vehicle", 20)
    write_table(pd.DataFrame([row for rows in found for row in rows]), folder / "drives.csv", index=False)


def _file(folder: Path, job: Job) -> Path:
    return folder / f"{job.variant.name.replace(' ', '_')}-{job.vehicle:03d}.json"


def first_compared(plans: dict[str, tuple[Trajectory, Trajectory]]) -> dict[str, Any]:
    """Of the first plans: how bold each is, and how far that of the total information is from eq. (9)'s."""
    found: dict[str, Any] = {
        name: {
            "yaw_rate": float(np.abs(info.x[:, 0]).max()),
            "torque": float(info.u[:, 1].max()),
            "straight_torque": float(ocp.u[:, 1].max()),
            "e": float(np.abs(info.x[:, 4]).max()),
            "information": info.information,
            "status": info.status,
        }
        for name, (ocp, info) in plans.items()
    }
    if "total information" in plans and "recipe" in plans:
        found["total information"]["unlike"] = unlike(
            plans["recipe"][1], plans["total information"][1], plans["recipe"][0]
        )
    return found
