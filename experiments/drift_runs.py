"""Closed-loop runs of many vehicles with each of the controllers' models, spread over workers and resumable.

Models: `nominal` (the nominal car), `prior` (the learnt model, not adapted), `once_ocp`, `once_info` and `twice_info`
(adapted beforehand on one drive planned by OCP, on one and on two planned by Info-OCP), `online` (the prior, adapting
while it drives), `twice_online` (Twice-Info, adapting while it drives) and `oracle` (the true car with its true
effects). All else, the MPC's weights too, is the same for all of them. What is gathered of a vehicle is gathered once
for each noise seed, and shared by the models that need it.
"""

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
import pandas as pd
import tyro

from drift_drake.control.effects_step import EffectsStepModel
from drift_drake.control.step_model import NominalStepModel, StepModel
from drift_drake.drives.vehicles import Population, draw_effects
from drift_drake.errors import DriftDrakeError
from drift_drake.gathering.gather import gather, learn_drive
from drift_drake.gathering.plan import (
    GatheringConfig,
    InfeasiblePlanError,
    Trajectory,
    as_in_paper,
    plan_again,
    plan_drive,
)
from drift_drake.model.adapter import BayesianAdapter
from drift_drake.model.bayesian_step import PathStep
from drift_drake.model.checkpoint import BayesianModel, InvalidCheckpointError, load_model, paper_checkpoint
from drift_drake.model.posterior import Posterior
from drift_drake.model.quality import step_model
from drift_drake.reference.trajectory import Reference, figure_8, loops
from drift_drake.run_folder import is_done, plain, write_json
from drift_drake.safe_files import write_arrays, write_table
from drift_drake.simulation.closed_loop import ClosedLoop, ControlConfig
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters
from experiments.executors import ExecutorConfig, JobsFailedError, NoClusterError, run_jobs

Model = Literal["nominal", "prior", "once_ocp", "once_info", "twice_info", "online", "twice_online", "oracle"]
Maneuver = Literal["figure_8", "loops"]

BELIEFS: dict[str, str] = {"once_ocp": "once_ocp", "once_info": "once_info", "twice_info": "twice_info",
                           "twice_online": "twice_info"}  # fmt: skip
Attempt = tuple[int, int]  # vehicle, noise seed

ADAPTING = ("online", "twice_online")
SECOND_ROUND = 1000  # added to the noise seed of the second gathering drive
COLUMNS = ("t", "s", "x", "y", "psi", "r", "v", "beta", "omega_r", "e", "dphi", "delta", "tau")  # kept of a run


@dataclasses.dataclass(frozen=True)
class DriftConfig:
    """Which vehicles, how often, and how the controller is set up."""

    vehicles: int = 20
    first: int = 0  # index of the first vehicle of the population
    population: Population = "held_out"
    noise_seeds: int = 3  # attempts of each vehicle
    vehicle_seed: int = 0  # of the draw of the vehicles
    as_in_paper: bool = False
    """The paper's model (27,012 parameters, z alone, T = 10, four separate beliefs, 35 vehicles), its information
    gathering (eq. (8) with one weight, no added bounds) and Euler's path in the controller."""
    checkpoint: Path | None = None  # the shipped one without
    path_step: PathStep = "trapezoid"  # of the learnt model in the controller
    control: ControlConfig = dataclasses.field(default_factory=ControlConfig)
    gathering: GatheringConfig = dataclasses.field(default_factory=GatheringConfig)
    run_on: Annotated[ExecutorConfig, tyro.conf.arg(name="")] = dataclasses.field(default_factory=ExecutorConfig)
    out: Path | None = None
    """Folder for the results; one that holds some runs of the same experiment already is gone on with."""

    def resolved(self) -> Self:
        """The configuration with what `as_in_paper` stands for."""
        if not self.as_in_paper:
            return self
        return dataclasses.replace(
            self, checkpoint=paper_checkpoint(), path_step="euler", gathering=as_in_paper(self.gathering)
        )

    def attempts(self) -> list[Attempt]:
        """(vehicle, noise seed) of each attempt, every vehicle's first before any second."""
        return [(self.first + i, seed) for seed in range(self.noise_seeds) for i in range(self.vehicles)]

    def effects(self, vehicle: int) -> Effects:
        """What is true of a vehicle."""
        return draw_effects(self.population, vehicle, self.vehicle_seed)


@dataclasses.dataclass(frozen=True)
class ModelsConfig(DriftConfig):
    """An experiment that compares models."""

    models: tuple[Model, ...] = ("prior", "once_ocp", "once_info", "twice_info", "oracle")


class Learnt(NamedTuple):
    """A learnt model as a controller has it."""

    model: BayesianModel
    belief: Posterior  # that the run starts with
    adapting: bool = False
    path_step: PathStep = "trapezoid"


@dataclasses.dataclass(frozen=True)
class DriveJob:
    """One closed-loop run."""

    name: str  # of its files
    labels: dict[str, Any]  # what it is of; columns of the experiment's table
    maneuver: Maneuver
    effects: Effects
    noise_seed: int
    believes: Literal["nominal", "oracle"] | Learnt
    control: ControlConfig


class DriveResult(NamedTuple):
    """A run's metrics, and a row each control period."""

    metrics: dict[str, Any]
    table: pd.DataFrame


@cache
def reference(maneuver: Maneuver) -> Reference:
    """What is driven."""
    return (figure_8 if maneuver == "figure_8" else loops)(VehicleParameters())


def closed_loop(job: DriveJob) -> ClosedLoop:
    """The closed loop of one vehicle with what its controller believes."""
    parameters, believes, control, adapter = VehicleParameters(), job.believes, job.control, None
    model: StepModel
    if isinstance(believes, Learnt):
        model = step_model(believes.model, believes.belief, believes.path_step)
        # A belief that stays as it is needs no adapter, unless its covariance is asked for.
        adapter = BayesianAdapter(believes.model) if believes.adapting or control.tightening > 0.0 else None
    else:
        model = EffectsStepModel(parameters, job.effects) if believes == "oracle" else NominalStepModel(parameters)
        control = dataclasses.replace(control, tightening=0.0)  # neither has any uncertainty
    return ClosedLoop(parameters, reference(job.maneuver), model, job.effects, control=control, adapter=adapter)


def drive(job: DriveJob) -> DriveResult:
    """One run, from a start on the reference: the figure-8's is in a drift, as after the paper's hand-brake."""
    loop = closed_loop(job)
    context = loop.initial_context(seed=job.noise_seed)
    if loop.adapter is not None and isinstance(job.believes, Learnt):
        adapter_context = loop.adapter.GetMyMutableContextFromRoot(context)
        loop.adapter.set_posterior(adapter_context, job.believes.belief)
        loop.adapter.set_frozen(adapter_context, not job.believes.adapting)
    run = loop.run(context)
    return DriveResult(dataclasses.asdict(run.metrics()), run.table)


def run_drives(jobs: Sequence[DriveJob], folder: Path, run_on: ExecutorConfig) -> pd.DataFrame:
    """Makes the runs that the folder lacks; one row a run (labels and metrics), in the order of the jobs."""

    def write(job: DriveJob, result: DriveResult) -> None:
        write_table(result.table[list(COLUMNS)], folder / f"{job.name}.csv", index=False, float_format="%.6g")
        # Last: a run is done when its numbers are there.
        write_json(folder / f"{job.name}.json", job.labels | result.metrics)

    missing = [job for job in jobs if not is_done(folder / f"{job.name}.json")]
    run_jobs(run_on, drive, missing, write, "run")
    runs = pd.DataFrame([json.loads((folder / f"{job.name}.json").read_text()) for job in jobs])
    write_table(runs, folder / "runs.csv", index=False)
    return runs


def run_models(config: ModelsConfig, maneuver: Maneuver, folder: Path) -> pd.DataFrame:
    """All models on all vehicles: gathers and drives what the folder lacks; one row a run.

    Where no feasible second plan was found, Twice-Info drives with what Once-Info has taught (`second_plan` is false).
    """
    learnt = load_model(config.checkpoint)
    wanted = frozenset(BELIEFS[model] for model in config.models if model in BELIEFS)
    gathered = gather_all(config, wanted, learnt, folder)
    jobs = []
    for vehicle, seed in config.attempts():
        for model in config.models:
            labels: dict[str, Any] = {"model": model, "vehicle": vehicle, "noise_seed": seed}
            believes: Literal["nominal", "oracle"] | Learnt
            if model == "nominal" or model == "oracle":
                believes = model
            else:
                belief = learnt.prior()
                if model in BELIEFS:
                    found = gathered[vehicle, seed]
                    belief = found.get(BELIEFS[model], found.get("once_info", belief))
                    labels["second_plan"] = "twice_info" in found or BELIEFS[model] != "twice_info"
                believes = Learnt(learnt, belief, model in ADAPTING, config.path_step)
            name = run_name(model, vehicle, seed)
            jobs.append(DriveJob(name, labels, maneuver, config.effects(vehicle), seed, believes, config.control))
    return run_drives(jobs, folder, config.run_on)


def run_name(model: str, vehicle: int, noise_seed: int) -> str:
    """Of a run's files."""
    return f"{model}-{vehicle:03d}-{noise_seed}"


@dataclasses.dataclass(frozen=True)
class GatherJob:
    """The information gathering of one vehicle; the first plans are the same for all vehicles."""

    attempt: Attempt
    wanted: frozenset[str]  # of `gather_beliefs`'s keys
    learnt: BayesianModel
    effects: Effects
    ocp: Trajectory
    info: Trajectory
    config: GatheringConfig


def gather_beliefs(job: GatherJob) -> dict[str, Posterior]:
    """What is believed of a vehicle after each kind of gathering.

    Returns:
        "once_ocp", "once_info", "twice_info", as far as wanted; no "twice_info" where no second plan was feasible.
    """
    learnt, config, parameters, prior = job.learnt, job.config, VehicleParameters(), job.learnt.prior()
    seed = job.attempt[1]

    def taught(belief: Posterior, trajectory: Trajectory, drive_seed: int) -> Posterior:
        return learn_drive(learnt, belief, gather(trajectory, job.effects, parameters, config, drive_seed)[0])

    beliefs = {}
    if "once_ocp" in job.wanted:
        beliefs["once_ocp"] = taught(prior, job.ocp, seed)
    if job.wanted & {"once_info", "twice_info"}:
        beliefs["once_info"] = taught(prior, job.info, seed)
    if "twice_info" in job.wanted:
        once = beliefs["once_info"]
        try:
            second = plan_again(learnt, once, job.info, config)
        except InfeasiblePlanError:
            return beliefs
        beliefs["twice_info"] = taught(once, second, SECOND_ROUND + seed)
    return beliefs


def gather_all(
    config: DriftConfig, wanted: frozenset[str], learnt: BayesianModel, folder: Path
) -> dict[Attempt, dict[str, Posterior]]:
    """The wanted ones of `gather_beliefs`'s beliefs for each attempt, kept in the folder's `beliefs-*.npz`."""
    if not wanted:
        return {}
    files = {attempt: folder / f"beliefs-{attempt[0]:03d}-{attempt[1]}.npz" for attempt in config.attempts()}
    missing = [attempt for attempt, file in files.items() if not wanted <= _read_beliefs(file)[0]]
    if missing:
        prior, gathering = learnt.prior(), config.gathering
        ocp = plan_drive(learnt, prior, gathering, 0.0)
        info = plan_drive(learnt, prior, gathering, gathering.alpha)
        jobs = [
            GatherJob(attempt, wanted, learnt, config.effects(attempt[0]), ocp, info, gathering) for attempt in missing
        ]

        def write(job: GatherJob, beliefs: dict[str, Posterior]) -> None:
            arrays: dict[str, Any] = {
                f"{name}.{field}": value
                for name, belief in beliefs.items()
                for field, value in belief._asdict().items()
            }
            write_arrays(files[job.attempt], wanted=sorted(job.wanted), **arrays)

        run_jobs(config.run_on, gather_beliefs, jobs, write, "gathering")
    return {attempt: _read_beliefs(file)[1] for attempt, file in files.items()}


def _read_beliefs(path: Path) -> tuple[frozenset[str], dict[str, Posterior]]:
    """(what was wanted, what was found) by the gathering that wrote a file."""
    if not is_done(path):
        return frozenset(), {}
    with np.load(path) as stored:
        names = {key.split(".")[0] for key in stored.files if "." in key}
        beliefs = {name: Posterior(*(stored[f"{name}.{field}"] for field in Posterior._fields)) for name in names}
        return frozenset(str(name) for name in stored["wanted"]), beliefs


class OtherExperimentError(DriftDrakeError, ValueError):
    """A folder that holds runs of another experiment; the message names it and what differs."""


# Told in their one sentence.
REFUSALS = (OtherExperimentError, NoClusterError, JobsFailedError, InvalidCheckpointError, InfeasiblePlanError)


def open_folder(folder: Path, config: DriftConfig) -> None:
    """Writes config.json; more vehicles, seeds or models may join runs that are there, other settings may not.

    Raises:
        OtherExperimentError: the runs there were made with other settings or another checkpoint.
    """
    free = ("vehicles", "first", "noise_seeds", "models", "parts", "run_on", "out")
    path = folder / "config.json"
    entry = plain(dataclasses.asdict(config) | {"checkpoint": _content_hash(load_model(config.checkpoint))})
    before = json.loads(path.read_text()) if is_done(path) else {}
    differ = [name for name in before if name not in free and before[name] != entry.get(name)]
    if differ:
        raise OtherExperimentError(
            f"{folder} holds runs made with another {', '.join(differ)}; give another folder, or the settings of {path}"
        )
    write_json(path, entry)


def _content_hash(model: BayesianModel) -> str:
    """SHA-256 of a model's numbers."""
    digest = hashlib.sha256()
    for values in (*model.network, model.prior_mean, model.precision_factor, model.sigma, model.sample_weight):
        digest.update(np.ascontiguousarray(values, dtype=float).tobytes())
    return digest.hexdigest()
