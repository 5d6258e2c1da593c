"""Chooses the weight of the information in the paper's recipe, which the paper does not state.

    python -m experiments.gathering.alpha
    python -m experiments.gathering.alpha --alphas 1 2 3 4 --vehicles 20

By convergence and information alone, on validation vehicles: of the weights under which fewest plans fail, the one
whose two drives tell most in the median; of weights within a fiftieth of the most, the least. No drift is driven.
Written: a file each weight and vehicle, numbers.json, report.md. Broken off, it goes on where it was (give --out).
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import make_run_folder
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import taught
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_again, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model, paper_checkpoint
from drift_drake.drive.learnt.posterior import covariance_norms
from experiments.benchmarks.vehicles import Population, draw_effects
from experiments.gathering.recipe import as_in_paper
from experiments.made import RunConfig, SpreadConfig, tabulated, write_results
from experiments.settings import keep_settings, run_kept

AS_MUCH = 0.98  # of the most information, from which on a weight tells as much


@dataclasses.dataclass(frozen=True)
class AlphaConfig(SpreadConfig, RunConfig):
    """Which weights, on which vehicles."""

    alphas: tuple[float, ...] = (1.0, 2.0, 3.0, 4.0)
    """Weights [1/nat] to choose from."""
    population: Population = "validation"
    vehicles: int = 20
    first: int = 0
    """Index of the first vehicle of the population."""
    vehicle_seed: int = 0
    """Of the draw of the vehicles."""
    seeds: int = 10
    """Draws of the first plan's guesses, to see how often it converges."""


Job = tuple[AlphaConfig, float, int]  # of a weight and a vehicle; of the first plans where that is negative


def first_plan(model: BayesianModel, alpha: float, seed: int) -> Trajectory | None:
    """The first round's plan under a weight; None where none converged."""
    try:
        return plan_drive(model, model.prior(), as_in_paper(GatheringConfig(), alpha), alpha, seed)
    except InfeasiblePlanError:
        return None


def _bounds(plans: Sequence[Trajectory]) -> dict[str, float]:
    """The slowest speed [m/s] and the greatest sideslip [rad] that plans ask for."""
    states = np.concatenate([plan.x for plan in plans])
    return {"slowest": float(states[:, 1].min()), "sideslip": float(np.abs(states[:, 2]).max())}


def found_of(job: Job) -> dict[str, Any]:
    """How many first plans converged, or what two drives of a vehicle have gained."""
    options, alpha, vehicle = job
    model, config = load_model(paper_checkpoint()), as_in_paper(GatheringConfig(), alpha)
    if vehicle < 0:
        converged = [first_plan(model, alpha, seed) is not None for seed in range(options.seeds)]
        return {"tried": options.seeds, "converged": sum(converged)}
    plan = first_plan(model, alpha, 0)
    if plan is None:
        return {"plans": 0, "obtained": []}
    belief, plans, obtained = model.prior(), [plan], list[float]()
    effects = draw_effects(options.population, vehicle, options.vehicle_seed)
    for seed in range(2):
        drive = taught(model, belief, plans[-1], effects, VehicleParameters(), config, seed)
        belief = drive.belief
        obtained.append(drive.obtained)
        if seed == 0:
            try:
                plans.append(plan_again(model, belief, plan, config, 1))
            except InfeasiblePlanError:
                break
    before, after = covariance_norms(model.prior())[1], covariance_norms(belief)[1]
    return {"plans": len(plans), "obtained": obtained, "norm_ratio": float(before / after)} | _bounds(plans)


def summarise(options: AlphaConfig, found: Mapping[tuple[float, int], dict[str, Any]]) -> dict[str, Any]:
    """By weight: plans that failed, and what the drives have gained; and which weight is chosen."""
    weights = {}
    for alpha in options.alphas:
        of_vehicles = [entry for (weight, vehicle), entry in found.items() if weight == alpha and vehicle >= 0]
        figures = np.array([[*entry["obtained"], 0.0, 0.0][:2] for entry in of_vehicles])
        driven = [entry for entry in of_vehicles if entry["plans"]]
        weights[alpha] = {
            "first plans": found[alpha, -1],
            "failed": sum(2 - entry["plans"] for entry in of_vehicles),
            "first": float(np.median(figures[:, 0])),
            "second": float(np.median(figures[:, 1])),
            "both": float(np.median(figures.sum(axis=1))),
            "norm_ratio": float(np.median([entry["norm_ratio"] for entry in driven])) if driven else None,
            "slowest": min((entry["slowest"] for entry in driven), default=None),
            "sideslip": max((entry["sideslip"] for entry in driven), default=None),
        }
    return {"vehicles": options.vehicles, "weights": weights, "chosen": chosen(weights)}


def chosen(weights: Mapping[float, Mapping[str, Any]]) -> float:
    """The rule of this experiment."""
    fewest = min(entry["failed"] for entry in weights.values())
    left = {alpha: entry["both"] for alpha, entry in weights.items() if entry["failed"] == fewest}
    return min(alpha for alpha, both in left.items() if both >= AS_MUCH * max(left.values()))


def report(summary: Mapping[str, Any]) -> str:
    """A row a weight, as Markdown."""
    heads = ("alpha [1/nat]", "first plans converged", f"plans failed, of {2 * summary['vehicles']}",
             "information of the first drive, of the second, of both, median [nat]",
             "prior's total norm over Twice-Info's, median", "slowest speed planned [m/s]",
             "most sideslip planned [rad]")  # fmt: skip
    rows = []
    for alpha, entry in summary["weights"].items():
        tried = entry["first plans"]
        figures = ", ".join(f"{entry[name]:.1f}" for name in ("first", "second", "both"))
        planned = ["-" if entry[name] is None else f"{entry[name]:.2f}" for name in ("slowest", "sideslip")]
        ratio = "-" if entry["norm_ratio"] is None else f"{entry['norm_ratio']:.0f}"
        converged = f"{tried['converged']} of {tried['tried']} draws of guesses"
        rows.append((f"{alpha:g}", converged, entry["failed"], figures, ratio, *planned))
    return "\n".join([*tabulated(heads, rows), "", f"Chosen: {summary['chosen']:g}."])


def main(config: AlphaConfig) -> None:
    """Plans and drives what the folder lacks, and chooses."""
    folder = make_run_folder("alpha", config.out)
    keep_settings(folder, dataclasses.asdict(config), ("alphas", "vehicles", "first", "run_on", "out"))
    vehicles = range(config.first, config.first + config.vehicles)
    jobs: list[Job] = [(config, alpha, vehicle) for alpha in config.alphas for vehicle in (-1, *vehicles)]

    def file(job: Job) -> Path:
        return folder / (f"plans-{job[1]:g}.json" if job[2] < 0 else f"vehicle-{job[1]:g}-{job[2]:03d}.json")

    found = run_kept(config.run_on, found_of, jobs, file, "drive", 20)
    summary = summarise(config, {job[1:]: entry for job, entry in zip(jobs, found, strict=True)})
    write_results(folder, config, summary, report(summary))


if __name__ == "__main__":
    run_command(main, AlphaConfig)
