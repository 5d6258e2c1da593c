"""The whole of it on one page: gather, adapt and drift one held-out vehicle, then diagnose a log that hides something.

    python -m experiments.demo    # some minutes on two cores; `make demo` calls it

Nobody has trained on the vehicle. The log is the repository's own (`experiments.demo_log`): four runs of a car drawn by
chance, whose truth is read for the page's last section alone.
"""

import dataclasses
import json
import logging
import time
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.car.log.table import read_case
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import write_json
from drift_drake.common.worker_pool import worker_processes
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import Gathered, taught
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_again, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.posterior import Posterior, covariance_norms
from drift_drake.drive.learnt.quality import standardized_errors
from drift_drake.drive.learnt.samples import samples_from_log
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.gap.diagnosis.likelihood.diagnose import Diagnosis, diagnose
from experiments.benchmarks.vehicles import draw_effects
from experiments.demo_log import FOLDER, TRUTH
from experiments.demo_page import write_page
from experiments.drifting.runs import DriveJob, DriveResult, Learnt, Model, drive, reference
from experiments.gathering.beliefs import SECOND_ROUND
from experiments.made import RunConfig, begun

MODELS: tuple[Model, ...] = ("nominal", "prior", "once_ocp", "once_info", "twice_info", "online", "oracle")


@dataclasses.dataclass(frozen=True)
class DemoConfig(RunConfig):
    """What is shown."""

    vehicle: int = 15
    """Which of the held-out vehicles."""
    seed: int = 0
    """Of the sensors' noise."""
    log: Path = FOLDER
    """The log that is diagnosed."""
    workers: int = 2
    """Processes."""
    gathering: GatheringConfig = dataclasses.field(default_factory=GatheringConfig)
    control: ControlConfig = dataclasses.field(default_factory=ControlConfig)


def gathering(config: DemoConfig, learnt: BayesianModel, bar: "tqdm[Any]") -> dict[str, Gathered]:
    """The drives that teach: planned without information, with it, and with it again."""
    effects, settings = draw_effects("held_out", config.vehicle, 0), config.gathering
    parameters, prior = VehicleParameters(), learnt.prior()

    def drive_on(planned: Trajectory, before: Posterior, seed: int) -> Gathered:
        driven = taught(learnt, before, planned, effects, parameters, settings, seed)
        bar.update()
        return driven

    bar.set_description("gathering information")
    ocp = drive_on(plan_drive(learnt, prior, settings, 0.0), prior, config.seed)
    informative = plan_drive(learnt, prior, settings, settings.alpha)
    first = drive_on(informative, prior, config.seed)
    rounds = {"once_ocp": ocp, "once_info": first}
    try:
        planned = plan_again(learnt, first.belief, informative, settings)
    except InfeasiblePlanError:  # no feasible second plan: Twice-Info is what Once-Info is, and the page says so
        bar.update()
        return rounds
    return rounds | {"twice_info": drive_on(planned, first.belief, SECOND_ROUND + config.seed)}


def drift_job(config: DemoConfig, kind: Model, learnt: BayesianModel, belief: Posterior) -> DriveJob:
    """The figure-8 with one model."""
    effects = draw_effects("held_out", config.vehicle, 0)
    believes = kind if kind in ("nominal", "oracle") else Learnt(learnt, belief, adapting=kind == "online")
    return DriveJob(kind, {"model": kind}, "figure_8", effects, config.seed, believes, config.control)


def drift(job: DriveJob) -> tuple[str, DriveResult]:
    """The run of a job, by its name."""
    return job.name, drive(job)


def diagnosed(log: Path) -> Diagnosis:
    """The diagnosis of the log, which knows the vehicle file and nothing else."""
    return diagnose(read_case(log), VehicleParameters(), case=log.name, workers=1)


def one_step_errors(
    learnt: BayesianModel, beliefs: dict[str, Posterior], table: pd.DataFrame
) -> dict[str, list[float]]:
    """RMS errors [4] of 0.1 s steps of each belief on a drive of the vehicle."""
    rows = table.rename(columns={"delta": "delta_cmd", "tau": "tau_cmd"})
    samples = samples_from_log(rows, reference("figure_8").path, 0, 0)
    errors = {name: standardized_errors(learnt, belief, samples)[0] for name, belief in beliefs.items()}
    return {name: np.sqrt(np.mean(error**2, axis=0)).tolist() for name, error in errors.items()}


def main(config: DemoConfig) -> None:
    """Makes the page."""
    logging.getLogger("drake").setLevel(logging.WARNING)
    began = time.perf_counter()
    folder = begun("demo", config)
    learnt = load_model()
    drifts: dict[str, DriveResult] = {}
    with (
        tqdm(total=len(MODELS) + 5, bar_format="{desc:<28}{percentage:3.0f}%|{bar}| {elapsed}") as bar,
        worker_processes(config.workers) as submit,
    ):
        diagnosing = submit(diagnosed, config.log)  # the longest job comes first
        rounds = gathering(config, learnt, bar)
        beliefs = {"prior": learnt.prior()} | {name: one.belief for name, one in rounds.items()}
        beliefs.setdefault("twice_info", beliefs["once_info"])
        bar.set_description("drifting the figure-8")
        jobs = [drift_job(config, kind, learnt, beliefs.get(kind, beliefs["prior"])) for kind in reversed(MODELS)]
        for done in as_completed([submit(drift, job) for job in jobs]):
            name, driven = done.result()
            drifts[name] = driven
            bar.update()
        bar.set_description("diagnosing the log")
        diagnosis = diagnosing.result()
        bar.update()
        bar.set_description("drawing")
        runs = {kind: drifts[kind] for kind in MODELS}
        errors = one_step_errors(learnt, beliefs, runs["oracle"].table)
        truth = json.loads((config.log / TRUTH).read_text())
        norms = {name: covariance_norms(belief) for name, belief in beliefs.items()}
        numbers = {
            "norms": {name: [*by_state, total] for name, (by_state, total) in norms.items()},
            "information": {name: [one.expected, one.obtained] for name, one in rounds.items()},
            "one_step_errors": errors,
            "figure_8": {kind: run.metrics for kind, run in runs.items()},
            "answer": json.loads(diagnosis.answer.to_json()),
            "truth": truth,
        }
        page = write_page(folder, config, numbers, rounds, runs, diagnosis, time.perf_counter() - began)
        bar.update()
    write_json(folder / "numbers.json", numbers | {"seconds": time.perf_counter() - began})
    print(f"the page: {page}")


if __name__ == "__main__":
    run_command(main, DemoConfig)
