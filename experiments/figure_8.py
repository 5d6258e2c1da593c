"""Drifts the figure-8 with each of the controllers' models on vehicles that no model was trained on.

    python -m experiments.figure_8 --vehicles 20 --models nominal prior once_ocp once_info twice_info online oracle

Models: `nominal` (the nominal car), `prior` (the learnt model, not adapted), `once_ocp`, `once_info` and `twice_info`
(adapted beforehand on one drive planned by OCP, on one and on two planned by Info-OCP), `online` (the prior, adapting
while it drives) and `oracle` (the true car with its true effects). Only `online` adapts during the run. All else, the
MPC's weights too, is the same for all of them. A run starts in the drift, as the paper's hand-brake start does. Broken
off, the experiment goes on where it was.
"""

import concurrent.futures
import dataclasses
import json
import multiprocessing
from functools import cache
from pathlib import Path
from typing import Literal

import pandas as pd
import tyro
from tqdm import tqdm

from diagrams.closed_loop import ClosedLoop, ControlConfig
from diagrams.information_gathering import GatheringConfig, Trajectory, gather, plan, round_alpha
from drift_drake.control.effects_step import EffectsStepModel
from drift_drake.control.step_model import NominalStepModel, StepModel
from drift_drake.drives.vehicles import Population, draw_effects
from drift_drake.model.adapter import BayesianAdapter
from drift_drake.model.checkpoint import BayesianModel, load
from drift_drake.model.posterior import Posterior
from drift_drake.model.quality import learn, step_model
from drift_drake.pictures.overhead import overhead
from drift_drake.pictures.time_series import time_series
from drift_drake.reference.trajectory import Reference, figure_8
from drift_drake.run_folder import make_run_folder, write_json, write_versions
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters

Model = Literal["nominal", "prior", "once_ocp", "once_info", "twice_info", "online", "oracle"]


SECOND_ROUND = 1000  # added to the noise seed of the second gathering drive


@dataclasses.dataclass(frozen=True)
class Figure8Config:
    """Which vehicles, how often, with which models."""

    vehicles: int = 20
    first: int = 0  # index of the first vehicle of the population
    population: Population = "held_out"
    noise_seeds: int = 1  # runs of each vehicle and model
    models: tuple[Model, ...] = ("nominal", "prior", "online", "oracle")
    vehicle_seed: int = 0  # of the draw of the vehicles
    checkpoint: Path | None = None  # the shipped one without
    control: ControlConfig = dataclasses.field(default_factory=ControlConfig)
    gathering: GatheringConfig = dataclasses.field(default_factory=GatheringConfig)
    workers: int = 2
    out: Path | None = None


@dataclasses.dataclass(frozen=True)
class Job:
    """One run."""

    config: Figure8Config
    folder: Path
    model: Model
    vehicle: int
    noise_seed: int

    @property
    def name(self) -> str:
        """Of its files."""
        return f"{self.model}-{self.vehicle:03d}-{self.noise_seed}"


def build(job: Job, reference: Reference) -> ClosedLoop:
    """The closed loop of one vehicle with one of the models."""
    config, parameters = job.config, VehicleParameters()
    effects = draw_effects(config.population, job.vehicle, config.vehicle_seed)
    adapter: BayesianAdapter | None = None
    model: StepModel
    if job.model == "nominal":
        model = NominalStepModel(parameters)
    elif job.model == "oracle":
        model = EffectsStepModel(parameters, effects)
    else:
        learnt = load(config.checkpoint)
        model = step_model(learnt, believed(job, learnt, effects), "trapezoid")
        if job.model == "online":
            adapter = BayesianAdapter(learnt)
    return ClosedLoop(parameters, reference, model, effects=effects, control=config.control, adapter=adapter)


@cache
def prior_plan(learnt: Path | None, config: GatheringConfig, informative: bool) -> Trajectory:
    """The first drive's plan: the same for all vehicles, since nothing is known of them yet."""
    model = load(learnt)
    return plan(model, model.prior(), config, config.alpha if informative else 0.0)


def believed(job: Job, learnt: BayesianModel, effects: Effects) -> Posterior:
    """What is believed of the vehicle before the run: the prior, or what information gathering has taught."""
    belief, config, parameters = learnt.prior(), job.config.gathering, VehicleParameters()
    if job.model not in ("once_ocp", "once_info", "twice_info"):
        return belief
    first = prior_plan(job.config.checkpoint, config, job.model != "once_ocp")
    samples, _, _ = gather(first, effects, parameters, config, job.noise_seed)
    belief = learn(learnt, belief, samples)
    if job.model == "twice_info":
        second = plan(learnt, belief, config, round_alpha(learnt, belief, first, config))
        samples, _, _ = gather(second, effects, parameters, config, SECOND_ROUND + job.noise_seed)
        belief = learn(learnt, belief, samples)
    return belief


def drive(job: Job) -> None:
    """One run; its table and numbers go into the folder, unless they are there already."""
    numbers = job.folder / f"{job.name}.json"
    if numbers.exists():
        return
    reference = figure_8(VehicleParameters())
    loop = build(job, reference)
    run = loop.run(loop.initial_context(seed=job.noise_seed))
    run.table.to_csv(job.folder / f"{job.name}.csv", index=False)
    which = {"model": job.model, "vehicle": job.vehicle, "noise_seed": job.noise_seed}
    write_json(numbers, which | dataclasses.asdict(run.metrics()))


def summarise(runs: pd.DataFrame) -> dict[str, dict[str, float]]:
    """By model: completions, and quartiles and extremes of the tracking errors over all runs, failures included."""
    summary = {}
    for model, group in runs.groupby("model", sort=False):
        entry = {"runs": float(len(group)), "completed": float(group["completed"].mean()),
                 "completion_median": float(group["completion"].median())}  # fmt: skip
        for name in ("rms_e", "rms_sideslip_error", "solve_ms_median"):
            for label, share in (("best", 0.0), ("lower", 0.25), ("median", 0.5), ("upper", 0.75), ("worst", 1.0)):
                entry[f"{name}_{label}"] = float(group[name].quantile(share))
        entry["solver_failures"] = float(group["solver_failures"].sum())
        summary[str(model)] = entry
    return summary


def main(config: Figure8Config) -> None:
    """Runs all jobs, then writes numbers and pictures."""
    folder = make_run_folder("figure_8", config.out)
    write_json(folder / "config.json", config)
    write_versions(folder)
    vehicles = range(config.first, config.first + config.vehicles)
    jobs = [
        Job(config, folder, model, vehicle, seed)
        for vehicle in vehicles
        for model in config.models
        for seed in range(config.noise_seeds)
    ]
    context = multiprocessing.get_context("spawn")
    # Workers live for all their runs: replacing them (max_tasks_per_child) can hang in Python 3.11. What Drake keeps of
    # each diagram, some megabytes, is affordable.
    with concurrent.futures.ProcessPoolExecutor(config.workers, context) as executor:
        futures = [executor.submit(drive, job) for job in jobs]
        for future in tqdm(concurrent.futures.as_completed(futures), total=len(jobs), unit="run"):
            future.result()
    runs = pd.DataFrame([json.loads((folder / f"{job.name}.json").read_text()) for job in jobs])
    runs.to_csv(folder / "runs.csv", index=False)
    summary = summarise(runs)
    write_json(folder / "numbers.json", summary)
    _pictures(folder, runs)
    print(table(summary))
    print(f"results in {folder}")


def table(summary: dict[str, dict[str, float]]) -> str:
    """The summary as Markdown."""
    lines = [
        "| model | runs | completed | RMS e best / median / worst [m] | RMS sideslip error [rad] |",
        "| --- | --- | --- | --- | --- |",
    ]
    for model, s in summary.items():
        e, b = (" / ".join(f"{s[f'{name}_{q}']:.{digits}f}" for q in ("best", "median", "worst"))
                for name, digits in (("rms_e", 2), ("rms_sideslip_error", 3)))  # fmt: skip
        lines.append(f"| {model} | {s['runs']:.0f} | {s['completed']:.0%} | {e} | {b} |")
    return "\n".join(lines)


def _pictures(folder: Path, runs: pd.DataFrame) -> None:
    """Each model's median run by RMS e, on the map and over the path."""
    tables = {}
    for model, group in runs.groupby("model", sort=False):
        ranked = group.sort_values("rms_e")
        median = ranked.iloc[len(ranked) // 2]
        name = f"{model}-{median['vehicle']:03d}-{median['noise_seed']}"
        tables[str(model)] = pd.read_csv(folder / f"{name}.csv")
    parameters = VehicleParameters()
    reference = figure_8(parameters)
    overhead(tables, reference, parameters).savefig(folder / "overhead.png")
    time_series(tables, reference, parameters).savefig(folder / "time_series.png")


if __name__ == "__main__":
    main(tyro.cli(Figure8Config))
