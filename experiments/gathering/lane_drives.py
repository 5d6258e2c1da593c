"""Makes the short lane drives that meta-training takes its contexts from: what a drive shows before the car must drift.

    python -m experiments.gathering.lane_drives
    python -m experiments.gathering.lane_drives --round 1 --checkpoint runs/bayesian_model.npz

Information gathering teaches the model on a straight lane and asks it to drift. So that the prior learns how the one
tells of the other, each training vehicle is driven along the same lane: slaloms of random sizes, Info-OCP's plans from
random first guesses under random weights and bounds, random steering, and Info-OCP's plans for that very vehicle, from
what the drives before have shown of it. Written: one table of samples for each population, every tenth row
(`train_lane.npz`) and all ten phases of that (`train_lane_phases.npz`). What a model plans depends on its features:
rounds after the first are planned by the checkpoint that the rounds before have trained, and join their tables.
"""

import dataclasses
import json
from pathlib import Path

import numpy as np

from diagrams.command import run_command
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.executors import results_of
from drift_drake.common.run_folder import is_done
from drift_drake.common.safe_files import write_text
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import execution
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_again, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.learnt.quality import learn
from drift_drake.drive.learnt.samples import DECIMATION, Samples, concatenate, samples_from_log, save_samples
from drift_drake.drive.learnt.training_config import LANE_ROUND
from drift_drake.drive.mpc.plan import DT
from experiments.benchmarks.drifters import wander
from experiments.benchmarks.vehicles import POPULATIONS, Population, draw_effects
from experiments.made import SpreadConfig
from experiments.model.drives import all_phases, join_vehicles

# A vehicle's drives: information gathering's first plan, a plan out of the pool of all vehicles, such a plan with its
# inputs shaken, or a plan of its own, made with what has been learnt since the last one that was not.
SCHEDULE = ("first", "own", "own", "pool", "own", "pool", "shaken", "shaken")
assert len(SCHEDULE) == LANE_ROUND
PLANS = 48  # in the pool
RENEWED = 25  # jobs after which a worker is replaced: Drake keeps Python systems for ever
ITERATIONS = 40  # of the SQP: what is worth training on need not be a plan to the last digit


@dataclasses.dataclass(frozen=True)
class LaneDrivesConfig(SpreadConfig):
    """What to drive; a cluster's machines must share the output folder."""

    seed: int = 0
    round: int = 0  # of planning and training; the tables hold all rounds up to this one
    first: int = 0  # of the training vehicles: a round may leave some out
    train: int = 360  # vehicles, up to this one
    validation: int = 20
    checkpoint: Path | None = None  # whose information the plans seek; the shipped one without
    output: Path = Path("runs/drives")


def stream(number: int) -> int:
    """Of a vehicle's random numbers: a round's (others are for its effects and its drifting)."""
    return 2 + 100 * number


def round_name(number: int) -> str:
    """Of the files of a round's drives in a vehicle's folder."""
    return "lane" if number == 0 else f"lane_{number}"


def random_lane(generator: np.random.Generator) -> GatheringConfig:
    """Speeds and bounds of a plan."""
    return GatheringConfig(
        v_start=float(generator.uniform(7.0, 9.0)),
        v_end=float(generator.uniform(12.0, 22.0)),
        max_sideslip=float(generator.uniform(0.15, 0.5)),
        max_slip=float(generator.uniform(4.0, 10.0)),
        alpha=float(generator.choice([2.0, 4.0, 8.0, 16.0])),
        starts=2,
        max_iterations=ITERATIONS,
    )


def lane_plan(job: tuple[LaneDrivesConfig, int]) -> Trajectory | None:
    """Plan number `index` of the pool; None where none is feasible.

    The first is information gathering's own; the others are slaloms and Info-OCP's plans of random sizes.
    """
    options, index = job
    model = load_model(options.checkpoint)
    if index == 0:
        return plan_drive(model, model.prior(), GatheringConfig(), GatheringConfig().alpha)
    generator = np.random.default_rng([options.seed, stream(options.round), index])
    config = random_lane(generator)
    try:
        if index % 3 == 0:
            t = DT * np.arange(config.steps + 1)
            size, period = generator.uniform(0.2, 2.0), generator.uniform(1.2, 4.0)
            lateral = size * np.sin(2.0 * np.pi * t / period + generator.uniform(0.0, 2.0 * np.pi))
            return plan_drive(model, model.prior(), config, 0.0, lateral=lateral * np.minimum(t, 1.0))
        return plan_drive(model, model.prior(), config, config.alpha, seed=index)
    except InfeasiblePlanError:
        return None


def own_plan(
    model: BayesianModel, belief: Posterior, first: Trajectory, config: GatheringConfig, seed: int
) -> Trajectory | None:
    """Info-OCP's plan with what is believed of a vehicle after its drives so far; None where none is feasible."""
    try:
        return plan_again(model, belief, first, config, seed)
    except InfeasiblePlanError:
        return None


def lane_drives(job: tuple[LaneDrivesConfig, Population, int, list[Trajectory]]) -> dict[str, int]:
    """Drives one vehicle along the lane; its samples go into its folder, unless they are there. How drives ended."""
    options, population, index, pool = job
    folder = options.output / population / f"vehicle_{index:02d}"
    name = round_name(options.round)
    if is_done(folder / f"{name}.json"):
        return dict(json.loads((folder / f"{name}.json").read_text()))
    folder.mkdir(parents=True, exist_ok=True)
    parameters, model = VehicleParameters(), load_model(options.checkpoint)
    effects = draw_effects(population, index, options.seed)
    generator = np.random.default_rng([options.seed, POPULATIONS.index(population), index, stream(options.round)])
    chosen = iter(1 + generator.choice(len(pool) - 1, len(SCHEDULE), replace=False))
    phases: list[list[Samples]] = [[] for _ in range(DECIMATION)]
    endings: dict[str, int] = {}
    first, belief = pool[0], model.prior()
    for number, kind in enumerate(SCHEDULE):
        trajectory = None
        if kind == "own":
            asked = GatheringConfig(max_iterations=ITERATIONS) if first is pool[0] else random_lane(generator)
            trajectory = own_plan(model, belief, first, asked, int(generator.integers(2**31)))
        else:
            belief = model.prior()
        if trajectory is None:
            trajectory = first = pool[0 if kind == "first" else next(chosen)]
        config = GatheringConfig(v_start=float(trajectory.x[0, 1]), v_end=float(trajectory.x[-1, 1]))
        if kind == "shaken":
            shake = wander(config.steps * DT, generator, np.array([generator.uniform(0.0, 0.08), 30.0]), 0.4)
            low = [-parameters.steering_limit, parameters.torque_min]
            high = [parameters.steering_limit, parameters.torque_max]
            trajectory = trajectory._replace(u=np.clip(trajectory.u + shake[: config.steps + 1], low, high))
        drive = execution(trajectory, effects, parameters, config)
        table, ending = drive.run(trajectory.x[0, :6], 0.0, config.steps * DT, int(generator.integers(2**31)))
        endings[ending] = endings.get(ending, 0) + 1
        for phase in range(DECIMATION):
            phases[phase].append(samples_from_log(table, None, index, number, phase))
        belief = learn(model, belief, phases[0][-1])
    save_samples(all_phases(phases), folder / f"{name}_phases.npz")
    save_samples(concatenate(phases[0]), folder / f"{name}.npz")
    write_text(folder / f"{name}.json", json.dumps(endings))
    return endings


def join_rounds(folders: list[Path], rounds: int, ending: str) -> Samples:
    """One table of the vehicles' drives of all rounds, from the files of this ending; rounds may lack vehicles."""
    parts, numbered = [], 0
    for number in range(rounds):
        name = f"{round_name(number)}{ending}"
        driven = [folder for folder in folders if is_done(folder / f"{name}.npz")]
        if not driven:
            continue
        part = join_vehicles(driven, name, len(SCHEDULE))
        parts.append(part._replace(drive=part.drive + numbered))
        numbered += int(part.drive.max()) + 1
    return concatenate(parts)


def main(config: LaneDrivesConfig) -> None:
    """Makes the pool of plans and the populations' drives."""
    driven: list[tuple[Population, range]] = [
        ("train", range(config.first, config.train)),
        ("validation", range(config.validation)),
    ]
    jobs = [(config, index) for index in range(PLANS)]
    plans = [p for p in results_of(config.run_on, lane_plan, jobs, "plan", RENEWED) if p is not None]
    runs: list[tuple[LaneDrivesConfig, Population, int, list[Trajectory]]] = [
        (config, population, index, plans) for population, indices in driven for index in indices
    ]
    total: dict[str, int] = {}
    for endings in results_of(config.run_on, lane_drives, runs, "vehicle", RENEWED):
        for name, count in endings.items():
            total[name] = total.get(name, 0) + count
    for population, indices in driven:
        folders = sorted((config.output / population).glob("vehicle_*"))
        for ending in ("", "_phases") if indices else ():
            table = join_rounds(folders, config.round + 1, ending)
            save_samples(table, config.output / f"{population}_lane{ending}.npz")
    print(json.dumps({"plans": len(plans), "endings": total}))


if __name__ == "__main__":
    run_command(main, LaneDrivesConfig)
