"""What the gathering of each attempt has taught, in a file an attempt: beliefs, lags, the first drive's surprise, and
the car that both informative drives identify. Plans are made with what is believed of a car of typical lags."""

import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.equations import KINDS_BY_KEY
from drift_drake.car.log.cases import runs_of
from drift_drake.car.parameters import CarParameters, VehicleParameters, read_plain
from drift_drake.car.path_plant import PathPlant
from drift_drake.car.vehicle_file import key_of
from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.executors import ExecutorConfig, run_jobs
from drift_drake.common.run_folder import is_done
from drift_drake.common.safe_files import write_arrays
from drift_drake.drive.gathering.config import GatheringConfig, lane
from drift_drake.drive.gathering.gather import (
    check_steering,
    drive_samples,
    gather,
    learn_drive,
    learn_drives,
    with_steering,
)
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_again, plan_drive
from drift_drake.drive.gathering.rehearsed_plan import boldest
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.learnt.quality import squared_distances
from drift_drake.gap.choose.choice import Findings, ask
from drift_drake.gap.choose.identified import IdentifiedCar
from experiments.other_worlds.true_cars import TrueCar, true_plant

Attempt = tuple[int, int]  # vehicle, noise seed

ASKED = {"identified_once": 1, "identified": 2}  # of how many of the informative drives the car is asked
SECOND_ROUND, CHECK = 1000, 2000  # added to the noise seed of the second gathering drive, of the steering's check


class OtherVersionError(DriftDrakeError, ValueError):
    """A folder of an older version; the message names the file and the remedy."""


@dataclasses.dataclass(frozen=True)
class Taught:
    """Of one attempt."""

    beliefs: dict[str, Posterior]  # "once_ocp", "once_info", "twice_info", as far as wanted and found
    surprise: (
        float | None
    )  # mean squared distance of the first informative drive (`gap.choose.choice`); None without one
    findings: dict[str, Findings] = dataclasses.field(default_factory=dict)  # by which of `ASKED` were wanted
    lags: dict[str, Array] = dataclasses.field(default_factory=dict)  # [s] of steering and torque, with each belief

    def after(self, learnt: BayesianModel, wanted: str = "twice_info") -> tuple[BayesianModel, Posterior]:
        """(the model with the lags that were found, what it believes) after a kind of gathering.

        After the first informative drive where no second plan was feasible, and the prior without any.
        """
        for name in (wanted, "once_info"):
            if name in self.beliefs:
                return learnt.with_lag(self.lags.get(name, learnt.lag)), self.beliefs[name]
        return learnt, learnt.prior()


@dataclasses.dataclass(frozen=True)
class GatherJob:
    """The information gathering of one vehicle; the first plans are the same for all vehicles."""

    attempt: Attempt
    wanted: frozenset[str]  # of `Taught.beliefs` and of `ASKED`
    learnt: BayesianModel
    effects: Effects
    ocp: Trajectory
    info: Trajectory
    config: GatheringConfig
    car: TrueCar = "single_track"
    first_guess: CarParameters | None = None  # that an identification begins with, in place of the model's vehicle


class Driven(NamedTuple):
    """Informative drives on the lane."""

    model: BayesianModel  # with the lag of the car's steering
    config: GatheringConfig  # with the steering
    logs: list[tuple[pd.DataFrame, str]]  # and how each ended (`gather`)

    @property
    def tables(self) -> list[pd.DataFrame]:
        """The logs."""
        return [table for table, _ in self.logs]


def informative_drives(
    learnt: BayesianModel, first: Trajectory, effects: Effects, config: GatheringConfig, seed: int,
    car: TrueCar = "single_track", rounds: int = 2,
) -> Driven:  # fmt: skip
    """Drives of the first plan, and of one with what that has taught.

    None where no plan keeps to the lane, and one where no second plan was feasible. Where a slow drive before them
    shows a steering that is not as usual, both are planned and tracked with it, and the first is repeated where no
    second one keeps to the lane.
    """

    def plant() -> PathPlant | None:
        return true_plant(car, effects, lane(config).path)

    parameters = VehicleParameters()
    if config.checks:
        steering = check_steering(effects, parameters, config, CHECK + seed, plant())
        learnt, config = with_steering(learnt, config, steering)
    belief, logs, usual = learnt.prior(), list[tuple[pd.DataFrame, str]](), config.steering.usual

    def planned(share: float) -> Trajectory:
        if logs:
            return plan_again(learnt, belief, first, config, share=share)
        return first if usual else plan_drive(learnt, belief, config, share * config.alpha)

    for drive_seed in (seed, SECOND_ROUND + seed)[:rounds]:
        try:
            plan = boldest(planned, parameters, config)
        except InfeasiblePlanError:
            if usual or not logs:
                break
            plan = first
        logs.append(gather(plan, effects, parameters, config, drive_seed, plant()))
        belief = learn_drive(learnt, belief, logs[-1][0], config)
        first = plan if len(logs) == 1 else first
    return Driven(learnt, config, logs)


def gather_beliefs(job: GatherJob) -> Taught:
    """What is believed of a vehicle after each kind of gathering, as far as its drives could be planned."""
    learnt, config, prior = job.learnt, job.config, job.learnt.prior()
    seed, beliefs, lags = job.attempt[1], dict[str, Posterior](), dict[str, Array]()
    if "once_ocp" in job.wanted:
        plant = true_plant(job.car, job.effects, lane(config).path)
        table, _ = gather(job.ocp, job.effects, VehicleParameters(), config, seed, plant)
        beliefs["once_ocp"] = learn_drive(learnt, prior, table, config)
    if not job.wanted & {"once_info", "twice_info", *ASKED}:
        return Taught(beliefs, None)
    rounds = 2 if job.wanted & {"twice_info", "identified"} else 1
    driven = informative_drives(learnt, job.info, job.effects, config, seed, job.car, rounds)
    learnt, config, tables, once = driven.model, driven.config, driven.tables, driven.model.prior()
    for count, name in enumerate(("once_info", "twice_info")[: len(tables)], 1):
        once = beliefs[name] = learn_drive(learnt, once, tables[count - 1], config)
        if config.learn_lags:
            found, beliefs[name] = learn_drives(learnt, tables[:count], config)
            lags[name] = found.lag
    counts = {name: count for name, count in ASKED.items() if name in job.wanted and count <= len(tables)}
    findings = {
        name: ask(runs_of(tables[:count]), job.first_guess or learnt.vehicle, steering=config.steering).found
        for name, count in counts.items()
    }
    surprise = None
    if tables:
        surprise = float(np.mean(squared_distances(learnt, learnt.prior(), drive_samples(tables[0], config))))
    return Taught(beliefs, surprise, findings, lags)


def gather_all(
    attempts: Sequence[Attempt], effects_of: Callable[[int], Effects], wanted: frozenset[str], learnt: BayesianModel,
    gathering: GatheringConfig, folder: Path, run_on: ExecutorConfig,
    car_of: Callable[[int], TrueCar] = lambda _: "single_track", first_guess: CarParameters | None = None,
) -> dict[Attempt, Taught]:  # fmt: skip
    """What each attempt's gathering has taught, kept in the folder's `beliefs-*.npz`.

    Args:
        attempts: (vehicle, noise seed) of each; effects_of: what is true of a vehicle; wanted: of `Taught.beliefs`;
        car_of: what the effects are put on; first_guess: that an identification begins with, by default the learnt
            model's vehicle.
    """
    if not wanted:
        return {}
    files = {attempt: folder / f"beliefs-{attempt[0]:03d}-{attempt[1]}.npz" for attempt in attempts}
    missing = [attempt for attempt, file in files.items() if not wanted <= _read(file)[0]]
    if missing:
        ocp = plan_drive(learnt, learnt.prior(), gathering, 0.0)
        info = plan_drive(learnt, learnt.prior(), gathering, gathering.alpha)
        jobs = [
            GatherJob(attempt, wanted, learnt, effects_of(attempt[0]), ocp, info, gathering, car_of(attempt[0]),
                      first_guess)
            for attempt in missing
        ]  # fmt: skip

        def write(job: GatherJob, taught: Taught) -> None:
            arrays: dict[str, Any] = {
                f"{name}.{field}": value
                for name, belief in taught.beliefs.items()
                for field, value in belief._asdict().items()
            }
            arrays |= {f"{name}.lag": lag for name, lag in taught.lags.items()}
            arrays["surprise"] = np.nan if taught.surprise is None else taught.surprise
            arrays["findings"] = json.dumps({name: _plain(found) for name, found in taught.findings.items()})
            write_arrays(files[job.attempt], wanted=sorted(job.wanted), **arrays)

        run_jobs(run_on, gather_beliefs, jobs, write, "gathering")
    return {attempt: _read(file)[1] for attempt, file in files.items()}


def _read(path: Path) -> tuple[frozenset[str], Taught]:
    """(what was wanted, what was found) by the gathering that wrote a file."""
    if not is_done(path):
        return frozenset(), Taught({}, None)
    with np.load(path) as stored:
        if "findings" not in stored.files or not str(stored["findings"]):
            raise OtherVersionError(f"{path}: written by an older version; give another --out, or remove this file")
        names = {key.split(".")[0] for key in stored.files if "." in key}
        beliefs = {name: Posterior(*(stored[f"{name}.{field}"] for field in Posterior._fields)) for name in names}
        lags = {key.split(".")[0]: stored[key] for key in stored.files if key.endswith(".lag")}
        surprise, text = float(stored["surprise"]), str(stored["findings"])
        wanted = frozenset(str(name) for name in stored["wanted"])
    findings = {name: _findings(found, path) for name, found in json.loads(text).items()}
    return wanted, Taught(beliefs, surprise if np.isfinite(surprise) else None, findings, lags)


def _plain(findings: Findings) -> dict[str, Any]:
    car = findings.car
    if car is None:
        return findings._asdict()
    return findings._asdict() | {"car": {"vehicle": car.vehicle.to_dict(), "effects": car.effects._asdict()}}


def _findings(stored: dict[str, Any], path: Path) -> Findings:
    if not isinstance(stored, dict) or "error" not in stored:
        raise OtherVersionError(f"{path}: written by an older version; give another --out, or remove this file")
    car, found = None, stored["car"]
    if found:
        numbers = found["vehicle"]
        key = key_of(numbers)
        kind = KINDS_BY_KEY[key].parameters if key else VehicleParameters
        vehicle = read_plain(kind, numbers[key] if key else numbers, str(path))
        car = IdentifiedCar(vehicle, make_effects(found["effects"]))
    error, surprise = stored["error"], stored.get("surprise", math.inf)
    return Findings(car, error, tuple(stored["doubts"]), stored["hint"], stored["as_it_is"], surprise)
