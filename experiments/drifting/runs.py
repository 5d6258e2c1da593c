"""Closed-loop runs of many vehicles with each of the controllers' models, spread over workers and resumable.

Models: `nominal` (the nominal car), `prior` (the learnt model, not adapted), `once_ocp`, `once_info` and `twice_info`
(adapted beforehand on one drive planned by OCP, on one and on two planned by Info-OCP), `online` (the prior, adapting
while it drives, the actuators' lags too), `offset_free` (the same, and what is left over taken for an offset),
`twice_online` (Twice-Info, adapting while it drives), `identified` (the car that Twice-Info's two drives identify),
`varied` (as `offset_free`, with the prior of cars of many structures), `hybrid` (the identified car and, adapting
while it drives, what it leaves over), `chosen` (of identified, hybrid and varied what these drives allow,
`gap.choose`), `chosen_once` (the same after the first of the two drives) and `oracle` (the true car with its true
effects). All else, the MPC's weights too, is the same for all of them. What is gathered of a vehicle is gathered once
for each noise seed, and shared by the models that need it.
"""

import dataclasses
import json
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import pandas as pd

from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.internal_states import RememberingStepModel
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensor_errors import sensor_errors
from drift_drake.car.step_model import NominalStepModel, StepModel
from drift_drake.common.errors import InvalidOptionError, meant
from drift_drake.common.executors import ExecutorConfig, run_jobs
from drift_drake.common.run_folder import is_done, make_run_folder, write_json
from drift_drake.common.safe_files import write_table
from drift_drake.drive.learnt.adapter import DEFAULT_THRESHOLD, OFFSET_TIMES, BayesianAdapter, Beliefs
from drift_drake.drive.learnt.bayesian_step import PathStep
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model, load_varied
from drift_drake.drive.learnt.hybrid_step import HybridStepModel, load_hybrid
from drift_drake.drive.learnt.lag_bank import BANK
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop, ClosedLoopRun, ControlConfig
from drift_drake.drive.loop.earlier_drive import beliefs_after
from drift_drake.drive.reference.trajectory import Reference, figure_8, loops
from drift_drake.gap.choose.choice import (
    SURPRISED,
    Choice,
    Familiar,
    Findings,
    hybrid_limit,
    usual_error,
    usual_surprise,
)
from drift_drake.gap.choose.identified import IdentifiedCar
from experiments.benchmarks.vehicles import Population, draw_effects
from experiments.gathering.beliefs import ASKED, Attempt, Taught, gather_all
from experiments.gathering.recipe import Extra, Recipe
from experiments.made import RunConfig, SpreadConfig
from experiments.other_worlds.brush_drifters import COUPE
from experiments.other_worlds.true_cars import TrueCar, World, effects_in, oracle, true_car, true_plant
from experiments.settings import keep_settings

Model = Literal["nominal", "prior", "once_ocp", "once_info", "twice_info", "online", "offset_free",
                "twice_online", "varied", "hybrid", "identified", "chosen", "chosen_once", "oracle"]  # fmt: skip
Maneuver = Literal["figure_8", "loops", "gentle"]  # gentle: the figure-8 at `GENTLE`
GENTLE = 0.4  # [rad] of sideslip, in place of 0.6

BELIEFS: dict[str, str] = {
    "once_ocp": "once_ocp", "once_info": "once_info", "twice_info": "twice_info", "twice_online": "twice_info",
    "identified": "identified", "hybrid": "identified", "chosen": "identified", "chosen_once": "identified_once",
}  # fmt: skip
ADAPTING = ("online", "offset_free", "twice_online", "varied")
LEARNING_LAGS = ("online", "offset_free", "varied")  # while driving; the others have them from their gathering
OFF: dict[Extra, dict[str, Any]] = {
    "screening": {"screening": False}, "fresh_guesses": {"fresh_guesses": False}, "delay": {"delay": 0.0},
    "safe_stop": {"patience": 0.0}, "interior_point": {"qp": "osqp", "osqp_iterations": 200}, "gate": {},
}  # fmt: skip
"""How the paper's controller is set up where the recipe does not keep what it has not; the gate is the adapter's."""
EXTRAS = tuple(OFF)
COLUMNS = ("t", "s", "x", "y", "psi", "r", "v", "beta", "omega_r", "e", "dphi", "delta", "tau")  # kept of a run


def paper_control(control: ControlConfig, gate: float, keep: Sequence[Extra]) -> tuple[ControlConfig, float]:
    """The controller and the adapter's gate of the paper's recipe, with what is kept of what the paper has not."""
    off = {name: value for extra, change in OFF.items() if extra not in keep for name, value in change.items()}
    return dataclasses.replace(control, **off), gate if "gate" in keep else math.inf


@dataclasses.dataclass(frozen=True)
class DriftConfig(Recipe, SpreadConfig, RunConfig):
    """Which vehicles, how often, and how the controller is set up."""

    vehicles: int = 20
    first: int = 0  # index of the first vehicle of the population
    population: Population = "held_out"
    noise_seeds: int = 3  # attempts of each vehicle
    vehicle_seed: int = 0  # of the draw of the vehicles
    also: dict[str, float] = dataclasses.field(default_factory=dict)
    """Effects that every vehicle has besides: NAME SIZE, such as steering_delay 0.1."""
    path_step: PathStep = "trapezoid"  # of the learnt model in the controller; Euler's as in the paper
    gate: float = DEFAULT_THRESHOLD  # Mahalanobis distance from which on a sample does not adapt the model
    control: ControlConfig = dataclasses.field(default_factory=ControlConfig)

    def resolved(self) -> Self:
        """The configuration with what `as_in_paper` stands for, in the controller too."""
        config = super().resolved()
        if not self.as_in_paper:
            return config
        control, gate = paper_control(self.control, self.gate, self.keep)
        return dataclasses.replace(config, path_step="euler", control=control, gate=gate)

    def attempts(self) -> list[Attempt]:
        """(vehicle, noise seed) of each attempt, every vehicle's first before any second."""
        return [(self.first + i, seed) for seed in range(self.noise_seeds) for i in range(self.vehicles)]

    def effects(self, vehicle: int) -> Effects:
        """What is true of a vehicle.

        Raises:
            InvalidOptionError: an effect that the catalogue does not have.
        """
        for name in self.also:
            if name not in Effects._fields:
                raise InvalidOptionError(f"--also {name}: no such effect; {meant(name, Effects._fields)}")
        return draw_effects(self.population, vehicle, self.vehicle_seed)._replace(**self.also)

    def gathered(self, wanted: frozenset[str], learnt: BayesianModel, folder: Path) -> dict[Attempt, Taught]:
        """What each attempt's gathering has taught, made where the folder lacks it (`gathered_beliefs.gather_all`)."""
        return gather_all(self.attempts(), self.effects, wanted, learnt, self.gathering, folder, self.run_on)


@dataclasses.dataclass(frozen=True)
class ModelsConfig(DriftConfig):
    """An experiment that compares models."""

    models: tuple[Model, ...] = ("prior", "once_ocp", "once_info", "twice_info", "oracle")
    plant: World = "single_track"
    """What the effects are put on: the car of the controllers' equations, a double-track one (the coupe, or a car of
    another kind), which has load transfer, tyres and a differential of its own, or brush cars, drawn one by one, whose
    equations the oracle alone has."""
    own_equations: bool = False
    """Of brush cars: the drives identify a car with these equations, from the middle of all such cars."""

    def effects(self, vehicle: int) -> Effects:
        """What is true of a vehicle."""
        return effects_in(self.plant, super().effects(vehicle))

    def car(self, vehicle: int) -> TrueCar:
        """What they are put on."""
        return true_car(self.plant, vehicle, self.vehicle_seed)


class Learnt(NamedTuple):
    """A learnt model as a controller has it."""

    model: BayesianModel
    belief: Posterior  # that the run starts with
    adapting: bool = False
    path_step: PathStep = "trapezoid"
    offset_time: float | None = None  # [s] of the adapter's offset
    lags: bool = False  # the actuators' lags are learnt as it drives
    gate: float = DEFAULT_THRESHOLD  # of the adapter's samples
    car: IdentifiedCar | None = None  # inside h of a hybrid model
    earlier: Beliefs | None = None  # what an earlier drive has taught, that the run starts with in place of `belief`


Believes = Literal["nominal", "oracle"] | Learnt | IdentifiedCar


def adapting(earlier: Beliefs | None = None) -> Learnt:
    """The model of many structures, beginning with its prior or with what an earlier drive has taught."""
    model = load_varied()
    return Learnt(model, model.prior(), adapting=True, offset_time=OFFSET_TIMES["varied"], lags=True, earlier=earlier)


def adapting_after(runs: Sequence[Run], maneuver: Maneuver, *others: Maneuver) -> Learnt:
    """The same for a manoeuvre, with what earlier drives of it, or of others, have taught.

    Raises: as `beliefs_after`.
    """
    courses = [reference(other) for other in others]
    return adapting(beliefs_after(load_varied(), runs, reference(maneuver), others=courses))


@dataclasses.dataclass(frozen=True)
class DriveJob:
    """One closed-loop run."""

    name: str  # of its files
    labels: dict[str, Any]  # what it is of; columns of the experiment's table
    maneuver: Maneuver
    effects: Effects
    noise_seed: int
    believes: Believes
    control: ControlConfig
    car: TrueCar = "single_track"


class DriveResult(NamedTuple):
    """A run's metrics, and a row each control period."""

    metrics: dict[str, Any]
    table: pd.DataFrame


@cache
def reference(maneuver: Maneuver) -> Reference:
    """What is driven."""
    if maneuver == "gentle":
        return figure_8(VehicleParameters(), sideslip=GENTLE)
    return (figure_8 if maneuver == "figure_8" else loops)(VehicleParameters())


def closed_loop(job: DriveJob) -> ClosedLoop:
    """The closed loop of one vehicle with what its controller believes."""
    parameters, believes, control, adapter = VehicleParameters(), job.believes, job.control, None
    errors = Effects()  # of the sensors, as far as they are known
    model: StepModel
    if isinstance(believes, Learnt):
        known: RememberingStepModel | None = None
        if believes.car is None:
            model = step_model(believes.model, believes.belief, believes.path_step)
        else:
            known = believes.car.step_model()
            model = HybridStepModel(believes.model, believes.belief.mean, known)
            errors, control = sensor_errors(believes.car.effects), dataclasses.replace(control, tightening=0.0)
        # A belief that stays as it is needs no adapter, unless its covariance is asked for.
        if believes.adapting or control.tightening > 0.0:
            lags = BANK if believes.lags else None
            adapter = BayesianAdapter(believes.model, believes.gate, believes.offset_time, lags, known)
    else:
        if isinstance(believes, IdentifiedCar):
            model, errors = believes.step_model(), sensor_errors(believes.effects)
        elif believes == "oracle":
            model, errors = oracle(job.car, parameters, job.effects), sensor_errors(job.effects)
        else:
            model = NominalStepModel(parameters)
        control = dataclasses.replace(control, tightening=0.0)  # none of these has any uncertainty
    driven = reference(job.maneuver)
    plant = true_plant(job.car, job.effects, driven.path)
    return ClosedLoop(parameters, driven, model, job.effects, control=control, adapter=adapter, plant=plant,
                      sensor_errors=errors)  # fmt: skip


def driven(job: DriveJob) -> ClosedLoopRun:
    """One run, from a start on the reference: the figure-8's is in a drift, as after the paper's hand-brake."""
    loop = closed_loop(job)
    context = loop.initial_context(seed=job.noise_seed)
    if loop.adapter is not None and isinstance(job.believes, Learnt):
        adapter_context = loop.adapter.GetMyMutableContextFromRoot(context)
        if job.believes.earlier is None:
            loop.adapter.set_posterior(adapter_context, job.believes.belief)
        else:
            loop.adapter.set_beliefs(adapter_context, job.believes.earlier)
        loop.adapter.set_frozen(adapter_context, not job.believes.adapting)
    return loop.run(context)


def drive(job: DriveJob) -> DriveResult:
    """The same, in numbers that a worker hands over."""
    run = driven(job)
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
    gathered = gather_all(config.attempts(), config.effects, wanted, learnt, config.gathering, folder, config.run_on,
                          config.car, COUPE if config.own_equations else None)  # fmt: skip
    surprise = usual_surprise(learnt)
    believing = Believing(learnt, config.path_step, surprise, config.gathering.learn_lags, config.gate)
    jobs = []
    for vehicle, seed in config.attempts():
        for model in config.models:
            labels, believes = believing(model, gathered.get((vehicle, seed)))
            labels = {"model": model, "vehicle": vehicle, "noise_seed": seed} | labels
            name = run_name(model, vehicle, seed)
            effects, car = config.effects(vehicle), config.car(vehicle)
            jobs.append(DriveJob(name, labels, maneuver, effects, seed, believes, config.control, car))
    return run_drives(jobs, folder, config.run_on)


class Believing(NamedTuple):
    """What a controller believes of a vehicle under each model."""

    learnt: BayesianModel
    path_step: PathStep
    surprise: Familiar | None  # what is usual of the first drive for the learnt model, if that was measured
    learn_lags: bool = True
    gate: float = DEFAULT_THRESHOLD

    def __call__(self, model: Model, taught: Taught | None) -> tuple[dict[str, Any], Believes]:
        """(columns of the experiment's table, what is believed) after what the gathering has taught."""
        if model == "nominal" or model == "oracle":
            return {}, model
        learnt, labels = load_varied() if model == "varied" else self.learnt, dict[str, Any]()
        belief = learnt.prior()
        if model in BELIEFS:
            assert taught is not None
            wanted = BELIEFS[model]
            twice = wanted in ("twice_info", "identified")
            labels["second_plan"] = "twice_info" in taught.beliefs or not twice
            if wanted in ASKED:
                return self._of_drives(model, taught, labels)
            learnt, belief = taught.after(learnt, wanted)
            if taught.surprise is not None and self.surprise is not None:
                labels["refused"] = taught.surprise > self.surprise.limit(SURPRISED)
        offset_time = OFFSET_TIMES.get(model)
        lags = self.learn_lags and model in LEARNING_LAGS
        return labels, Learnt(learnt, belief, model in ADAPTING, self.path_step, offset_time, lags, self.gate)

    def _of_drives(self, model: Model, taught: Taught, labels: dict[str, Any]) -> tuple[dict[str, Any], Believes]:
        """The same of a car that drives identify; `varied` where none was, or none is believed."""
        hybrid, found = load_hybrid(), taught.findings.get(BELIEFS[model], Findings(None))
        choice = Choice(found, usual_error().limit(), hybrid_limit(hybrid))
        car = choice.found.car
        labels |= {
            "identified_error": choice.found.error, "surprise": choice.found.surprise, "believed": choice.believed,
            "refused": choice.believed == "adapting", "one_more": ", ".join(car.one_more) if car else "",
            "double_track": car is not None and isinstance(car.vehicle, DoubleTrackParameters),
        }  # fmt: skip
        if car is not None and "hybrid" in (model, choice.believed) and model != "identified":
            return labels, Learnt(hybrid, hybrid.prior(), adapting=True, gate=self.gate, car=car)
        if car is not None and "identified" in (model, choice.believed):
            return labels, car
        return labels, self("varied", None)[1]


def run_name(model: str, vehicle: int, noise_seed: int) -> str:
    """Of a run's files."""
    return f"{model}-{vehicle:03d}-{noise_seed}"


def opened(name: str, config: DriftConfig) -> Path:
    """The run folder; more vehicles, seeds or models may join runs that are there, other settings may not.

    Raises:
        OtherExperimentError: the runs there were made with other settings or another checkpoint.
    """
    folder = make_run_folder(name, config.out)
    settings = dataclasses.asdict(config) | {"checkpoint": load_model(config.checkpoint).content_hash()}
    keep_settings(folder, settings, ("vehicles", "first", "noise_seeds", "models", "parts", "run_on", "out"))
    return folder
