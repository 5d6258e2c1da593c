"""Information gathering on held-out vehicles: the paper's Table I, and whether informative drives teach drifting.

    python -m experiments.gathering.information_gathering --drives runs/drives

Each vehicle is driven for 4.5 s at a time along the same lane: the OCP's plan (Once-OCP), rounds of Info-OCP (the first
two are Once-Info and Twice-Info), and two baselines that need no information objective, random steering and a slalom by
hand. Every model is judged by its covariance norms and by
its error on the vehicle's own drifting drives, of which it has seen nothing. Broken off, the experiment goes on with
the vehicles that are missing (give --out).
"""

import dataclasses
import json
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.executors import run_jobs
from drift_drake.common.safe_files import write_arrays, write_table
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import taught
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_again, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.posterior import Posterior, covariance_norms, weighed
from drift_drake.drive.learnt.samples import load_samples
from drift_drake.drive.mpc.plan import DT
from experiments.benchmarks.drifters import wander
from experiments.benchmarks.vehicles import Population, draw_effects
from experiments.drifting.errors import drifting_errors, judged_by_halves
from experiments.gathering.pictures import draw_all
from experiments.gathering.recipe import Recipe
from experiments.gathering.summary import markdown, summarise, summarise_halves
from experiments.made import RunConfig, SpreadConfig, begun, write_results
from experiments.settings import kept

# The baselines: of the sizes tried on validation vehicles, those that gathered most without leaving the lane.
RANDOM_STEERING, RANDOM_PERIOD = 0.05, 0.4  # [rad], [s]
SLALOM_AMPLITUDE, SLALOM_PERIOD = 1.5, 1.5  # [m], [s]


@dataclasses.dataclass(frozen=True)
class InformationConfig(Recipe, SpreadConfig, RunConfig):
    """Which vehicles, how many rounds; a cluster's machines must share the output folder."""

    drives: Path = Path("runs/drives")  # made by `experiments.model.drives`: what the models are judged by
    population: Population = "held_out"
    vehicles: int = 20
    first: int = 0  # index of the first vehicle
    rounds: int = 5
    stop_below: float = 0.1  # a round's predicted gain over all gained so far, under which another is not worth it
    drives_seed: int = 0  # that the drives were made with
    seed: int = 0


class MissingDrivesError(DriftDrakeError, ValueError):
    """The drives to judge by are not there; the message says how to make them."""


def drives_file(config: InformationConfig) -> Path:
    """The population's table of samples.

    Raises:
        MissingDrivesError: names the file and the remedy.
    """
    path = config.drives / f"{config.population}.npz"
    if not path.exists():
        raise MissingDrivesError(
            f"{path}: no such file; make the drives with `python -m experiments.model.drives --output {config.drives}`"
        )
    return path


def full_weight_total(model: BayesianModel, belief: Posterior) -> float:
    """The sum of the covariances' norms had every sample counted in full, as in the paper's recursion."""
    before, after = np.linalg.inv(model.prior().covariance), np.linalg.inv(belief.covariance)
    precision = before + weighed(after - before, 1.0 / model.sample_weight)
    return float(covariance_norms(belief._replace(covariance=np.linalg.inv(precision).astype(float)))[1])


def slalom(model: BayesianModel, config: GatheringConfig) -> Trajectory:
    """A slalom by hand: the OCP follows a sine across the lane."""
    phase = 2.0 * np.pi * DT * np.arange(config.steps + 1) / SLALOM_PERIOD
    return plan_drive(model, model.prior(), config, 0.0, lateral=SLALOM_AMPLITUDE * np.sin(phase))


def random_steering(ocp: Trajectory, config: GatheringConfig, generator: np.random.Generator) -> Trajectory:
    """The OCP's drive with random steering added, while the feedback keeps to the OCP's line."""
    noise = wander(config.steps * DT, generator, np.array([RANDOM_STEERING, 0.0]), RANDOM_PERIOD)[: config.steps + 1]
    u = ocp.u + noise
    x = np.concatenate([ocp.x[:, :6], lagged_commands(DT * np.arange(len(u)), u)], axis=1)
    return ocp._replace(x=x, u=u, status="by hand")


@dataclasses.dataclass(frozen=True)
class Shared:
    """What all vehicles have in common: the plans made with the prior."""

    ocp: Trajectory
    info: Trajectory
    slalom: Trajectory
    seconds: dict[str, float]  # of this process's CPU time for each plan
    load_average: float


def make_shared(config: InformationConfig) -> Shared:
    """Plans with the prior.

    Raises:
        InfeasiblePlanError: there is no first plan.
    """
    model, gathering = load_model(config.checkpoint), config.gathering
    seconds = {}

    def timed(name: str, alpha: float, starts: int) -> Trajectory:
        start = time.process_time()
        result = plan_drive(model, model.prior(), dataclasses.replace(gathering, starts=starts), alpha, config.seed)
        seconds[name] = time.process_time() - start
        return result

    plan_drive(model, model.prior(), gathering, 0.0)  # compiles, which is not to be timed
    ocp = timed("OCP", 0.0, 1)
    with suppress(InfeasiblePlanError):  # it is not driven; where it fails, it has no time
        timed("Info-OCP, one start", gathering.alpha, 1)
    info = timed(f"Info-OCP, best of {gathering.starts} starts", gathering.alpha, gathering.starts)
    return Shared(ocp, info, slalom(model, gathering), seconds, os.getloadavg()[0])


class _Vehicle:
    """One vehicle's experiment."""

    def __init__(self, config: InformationConfig, index: int) -> None:
        self._config, self._index = config, index
        self._model = load_model(config.checkpoint)
        self._effects: Effects = draw_effects(config.population, index, config.drives_seed)
        self._judged = load_samples(drives_file(config)).of_vehicle(index)
        self._parameters = VehicleParameters()

    def judge(self, belief: Posterior) -> dict[str, Any]:
        """Norms and errors."""
        norms, total = covariance_norms(belief)
        return {
            "norms": norms,
            "total": total,
            "full_weight_total": full_weight_total(self._model, belief),
        } | drifting_errors(self._model, belief, self._judged)

    def drive(
        self, belief: Posterior, trajectory: Trajectory, seed: int
    ) -> tuple[Posterior, dict[str, Any], pd.DataFrame]:
        """Drives and learns: (the belief after, its entry in the results, the log)."""
        config = self._config.gathering
        drive = taught(self._model, belief, trajectory, self._effects, self._parameters, config, seed)
        table = drive.table
        entry = self.judge(drive.belief) | {
            "predicted": drive.expected,
            "obtained": drive.obtained,
            "ending": drive.ending,
            "driven_s": float(table["t"].iloc[-1]),
            "max_e": float(table["e"].abs().max()),
            "left_lane": bool(table["e"].abs().max() > config.half_width),
            "max_beta": float(table["beta"].abs().max()),
            "max_r": float(table["r"].abs().max()),
            "status": trajectory.status,
        }  # fmt: skip
        return drive.belief, entry, table

    def run(self, shared: Shared, folder: Path) -> dict[str, Any]:
        """All drives of the vehicle."""
        config, model, prior = self._config, self._model, self._model.prior()
        generator = np.random.default_rng([config.seed, self._index])
        result: dict[str, Any] = {"vehicle": self._index, "prior": self.judge(prior)}
        tables: dict[str, pd.DataFrame] = {}
        driven = {
            "Once-OCP": shared.ocp,
            "random steering": random_steering(shared.ocp, config.gathering, generator),
            "slalom": shared.slalom,
        }
        for name, trajectory in driven.items():
            _, result[name], tables[name] = self.drive(prior, trajectory, config.seed)
        belief, trajectory, result["rounds"] = prior, shared.info, []
        beliefs = {"prior": prior}
        for k in range(config.rounds):
            seconds = 0.0
            if k > 0:
                start = time.process_time()
                try:
                    trajectory = plan_again(model, belief, shared.info, config.gathering, config.seed + k)
                except InfeasiblePlanError as error:
                    result["stopped"] = str(error)
                    break
                seconds = time.process_time() - start
            belief, entry, tables[f"round {k + 1}"] = self.drive(belief, trajectory, config.seed + k)
            result["rounds"].append(entry | {"plan_seconds": seconds})
            if k < 2:
                name = ("once", "twice")[k]
                beliefs[f"{name.capitalize()}-Info"] = belief
                write_arrays(folder / f"belief-{name}-{self._index:03d}.npz", **belief._asdict())
        for name, table in tables.items():
            file = folder / f"{name.replace(' ', '_').lower()}-{self._index:03d}.csv"
            write_table(table.rename(columns={"delta_cmd": "delta", "tau_cmd": "tau"}), file, index=False)
        result["halves"] = judged_by_halves(model, beliefs, self._judged)
        return result


def run_vehicle(job: tuple[InformationConfig, Shared, Path, int]) -> None:
    """One vehicle; its numbers and logs go into the folder, unless they are there already."""
    config, shared, folder, index = job
    kept(folder / f"vehicle-{index:03d}.json", lambda: _Vehicle(config, index).run(shared, folder))


def main(config: InformationConfig) -> None:
    """Runs all vehicles, then writes numbers and pictures."""
    config = config.resolved()
    drives_file(config)  # asked for before anything is driven
    folder = begun("information_gathering", config)
    shared = make_shared(config)
    indices = range(config.first, config.first + config.vehicles)
    jobs = [(config, shared, folder, index) for index in indices]
    # Drake keeps Python systems for ever, so a worker is replaced after some vehicles.
    run_jobs(config.run_on, run_vehicle, jobs, lambda _job, _nothing: None, "vehicle", tasks_per_worker=5)
    results = [json.loads((folder / f"vehicle-{index:03d}.json").read_text()) for index in indices]
    summary = summarise(results, config.stop_below)
    summary["halves"] = summarise_halves([result["halves"] for result in results])
    summary["plan_seconds"] = shared.seconds | {"load average": shared.load_average}
    write_results(folder, config, summary, markdown(summary))
    model = load_model(config.checkpoint)
    draw_all(folder, results, model, config.population, config.drives_seed, config.gathering)


if __name__ == "__main__":
    run_command(main, InformationConfig)
