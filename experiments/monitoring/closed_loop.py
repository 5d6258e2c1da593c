"""The closed loop with and without what follows from the monitor, on drives during which the car changes.

    python -m experiments.monitoring.closed_loop OUT --seeds 4
    python -m experiments.monitoring.closed_loop OUT --plants double_track --first 100 --seeds 4
    python -m experiments.monitoring.closed_loop OUT --plants double_track --calibrated --modes off slow
    python -m experiments.monitoring.closed_loop OUT --draw wide --first 100 --seeds 20 --modes off correct_or_slow

Each drive is a figure-8 under MPC that believes the simulator's car; the change comes at a moment that depends on the
seed. With `--calibrated`, controller and monitor believe a car that was calibrated by prediction on normal drives of
the plant (OUT/PLANT.yaml and .json), and it is watched by windows. With `--draw` each seed is another vehicle of a
population, which controller and monitor know until it changes. A file a drive; drives that are there are not made
again. Prints one table, and writes it to OUT/report.md.
"""

import dataclasses
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np
import pandas as pd
import tyro

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.given_vehicle import vehicle_given
from drift_drake.car.internal_states import on_the_motion
from drift_drake.car.log.table import Run, make_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import NominalStepModel, StepModel
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.executors import ExecutorConfig
from drift_drake.common.run_folder import is_done, write_json, write_versions
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.lag_bank import BANK
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.loop.faults import Change, Fault
from drift_drake.drive.reference.trajectory import Reference, figure_8
from drift_drake.gap.identification.identify import identify
from drift_drake.gap.monitoring.baselines import baseline_given, calibrated_watcher, with_baseline_scores
from drift_drake.gap.monitoring.events import Watcher
from drift_drake.gap.monitoring.in_loop import CORRECTING, GapWatch, Policy, events_of
from drift_drake.gap.monitoring.monitor import make_monitor
from drift_drake.gap.monitoring.watch import WATCHED
from experiments.benchmarks.intervals import binomial
from experiments.benchmarks.vehicles import Population, draw_effects
from experiments.made import tabulated, write_report
from experiments.other_worlds.true_cars import OwnCar, double_track_of, true_plant
from experiments.settings import run_kept

Mode = Literal["off", "watch", "correct", "slow", "correct_or_slow", "online", "online_forget"]
MODES: tuple[Mode, ...] = get_args(Mode)
POLICIES: dict[Mode, Policy] = {
    "watch": "watch", "correct": "correct", "slow": "slow", "correct_or_slow": "correct_or_slow",
    "online_forget": "forget",
}  # fmt: skip
"""Of the others, `off` and `online`, the car is not watched."""

CHANGES: dict[str, dict[str, float]] = {
    "none": {},
    "friction drop": {"friction_level": -0.3},
    "friction patch": {"friction_level": -0.35},
    "friction fade": {"friction_level": -0.06},  # a second
    "steering rate limit": {"steering_rate_limit": 0.45},
    "torque loss": {"torque_gain_error": -0.8},
    "sideslip sensor": {"sideslip_bias": 0.25},
}
PATCH = 2.0  # [s]
FADE, STEP = 8.0, 0.25  # [s] of a fade as tyres' heat makes it, and of its steps
EARLIEST, LATEST = 3.0, 8.0  # [s]
END = 1000.0  # [s], beyond a drive's
LAPS = 0.75
DRAWN = 291203  # seed of the vehicles of `--draw`
NORMAL_SEEDS = (900, 901, 902)  # of the double-track car's normal drives, which the monitor learns


@dataclasses.dataclass(frozen=True)
class Job:
    """One drive."""

    plant: OwnCar
    change: str
    mode: Mode
    seed: int
    calibration: Path | None = None  # folder of the files of calibrated cars
    draw: Population = "nominal"  # that the seed draws the vehicle from

    @property
    def name(self) -> str:
        drawn = "" if self.draw == "nominal" else f"-{self.draw}"
        return f"{self.plant}-{self.change.replace(' ', '_')}-{self.mode}{drawn}-{self.seed:03d}"

    @property
    def own(self) -> Effects:
        """The vehicle's effects before it changes."""
        return draw_effects(self.draw, self.seed, DRAWN)


@dataclasses.dataclass(frozen=True)
class Config:
    """Which drives."""

    out: Annotated[Path, tyro.conf.Positional]
    first: int = 0
    """The first seed."""
    seeds: int = 2
    plants: tuple[OwnCar, ...] = ("single_track", "double_track")
    calibrated: bool = False
    """The car is calibrated by prediction on normal drives, and watched by windows."""
    draw: Population = "nominal"
    """Population that each seed draws a single-track vehicle from."""
    changes: tuple[str, ...] = tuple(CHANGES)
    modes: tuple[Mode, ...] = ("off", "correct", "slow", "correct_or_slow")
    executor: ExecutorConfig = dataclasses.field(default_factory=lambda: ExecutorConfig(workers=1))


class Believed(NamedTuple):
    """What controller and monitor believe in."""

    vehicle: VehicleParameters
    effects: Effects
    monitor: Watcher


def simulator(plant: OwnCar) -> VehicleParameters:
    """The single-track car that is nearest to a plant."""
    car = double_track_of(plant)
    return VehicleParameters() if car is None else car.single_track()


@cache
def reference(plant: OwnCar) -> Reference:
    """What is driven."""
    return figure_8(simulator(plant), laps=LAPS)


def closed_loop(
    plant: OwnCar, faults: Sequence[Fault] = (), believed: Believed | None = None, policy: Policy | None = None,
    online: bool = False, true: Effects = Effects(),
) -> ClosedLoop:  # fmt: skip
    """The loop of a plant, a single-track one with its true effects, which may change. Without a policy it is not
    watched."""
    vehicle, own = (believed.vehicle, believed.effects) if believed else (simulator(plant), Effects())
    plain = policy not in CORRECTING and own == Effects()
    model: StepModel = NominalStepModel(vehicle) if plain else EffectsStepModel(vehicle, on_the_motion(own))
    adapter = None
    if online:
        learnt = load_model()
        model, adapter = step_model(learnt, learnt.prior()), BayesianAdapter(learnt, lags=BANK)
    effects, car = Effects(aero_drag=1e-9) if true == Effects() else true, None
    if plant != "single_track":
        effects, car = Effects(), true_plant(plant, Effects(), reference(plant).path)
    watch = GapWatch(believed.monitor, policy) if believed and policy else None
    return ClosedLoop(vehicle, reference(plant), model, effects, faults=faults, plant=car, adapter=adapter, watch=watch)


@cache
def believed_of(plant: OwnCar, calibration: Path | None, own: Effects = Effects()) -> Believed:
    """The simulator's car with what is known of its effects, watched by a bank of filters (of a double-track car one
    that has learnt its normal drives); or the calibrated car, watched by windows."""
    if calibration is not None:
        given, files = vehicle_given(calibration / f"{plant}.yaml"), calibration / f"{plant}.json"
        monitor = calibrated_watcher(baseline_given(files), normal_drives(plant, NORMAL_SEEDS[:1])[0], given)
        return Believed(given.parameters.single_track(), given.effects, monitor)
    filters = make_monitor(simulator(plant), own, used=WATCHED)
    if plant != "single_track":
        filters = with_baseline_scores(filters, normal_drives(plant))
    return Believed(simulator(plant), own, filters)


def normal_drives(plant: OwnCar, seeds: Sequence[int] = NORMAL_SEEDS, believed: Believed | None = None) -> list[Run]:
    """Drives of a plant under a controller that believes the simulator's car, or another one."""
    loop = closed_loop(plant, believed=believed)
    return [as_log(loop.run(loop.initial_context(seed)).table) for seed in seeds]


def calibrate(plant: OwnCar, folder: Path) -> None:
    """Writes the calibrated car of a plant, if it is not there: from drives by the simulator's car, then from drives by
    the car that is found of these, since what is driven with it is driven harder."""
    if is_done(folder / f"{plant}.json"):
        return
    runs = normal_drives(plant)
    first = identify(runs, simulator(plant), case=plant, criterion="prediction", car="single-track", watching=False)
    believed = Believed(first.vehicle.single_track(), first.effects, make_monitor(simulator(plant)))
    runs += normal_drives(plant, believed=believed)
    found = identify(runs, simulator(plant), case=plant, criterion="prediction", car="single-track")
    write_vehicle(folder / f"{plant}.yaml", found.vehicle, found.effects)
    write_json(folder / f"{plant}.json", found.calibration)


def as_log(table: pd.DataFrame) -> Run:
    """What was measured during a run, in the log format."""
    columns = {name: table[f"measured_{name}"].to_numpy() for name in ("r", "v", "beta", "omega_r", "psi", "ax", "ay")}
    commands = {"delta_cmd": table["delta"].to_numpy(), "tau_cmd": table["tau"].to_numpy()}
    places = {name: table[name].to_numpy() for name in ("t", "x", "y")}
    return make_run(Path("run_0.csv"), places | columns | commands)


def drive(job: Job) -> dict[str, Any]:
    """How one drive ended, and what the monitor reported."""
    effects, own = make_effects(CHANGES[job.change]), job.own
    onset = round(float(np.random.default_rng([job.seed, 3]).uniform(EARLIEST, LATEST)), 2)
    faults, change = disturbances(job.change, effects, onset)
    if change is not None:
        change = Change(onset, Effects(*(before + q for before, q in zip(own, effects, strict=True))))
    believed, policy = believed_of(job.plant, job.calibration, own), POLICIES.get(job.mode)
    loop = closed_loop(job.plant, faults, believed, policy, online=job.mode.startswith("online"), true=own)
    run = loop.run(loop.initial_context(job.seed), change=change)
    events = events_of(believed.monitor, run.table) if policy else []
    slow = float(run.table["slow"].mean()) if "slow" in run.table else 0.0
    return dataclasses.asdict(job) | {"onset": onset, "events": events, "slow": slow,
                                      "metrics": dataclasses.asdict(run.metrics())}  # fmt: skip


def disturbances(name: str, effects: Effects, onset: float) -> tuple[list[Fault], Change | None]:
    """What happens to the loop: a sensor's error begins behind the car's sensors, in all that sideslip goes into."""
    if effects.sideslip_bias != 0.0:
        return [Fault("bias", onset, END, effects.sideslip_bias, channel) for channel in ("beta", "dphi")], None
    if name == "friction patch":
        return [Fault("friction_patch", onset, PATCH, effects.friction_level)], None
    if name == "friction fade":
        return [
            Fault("friction_patch", onset + t, END, effects.friction_level * STEP) for t in np.arange(0.0, FADE, STEP)
        ], None
    return [], None if name == "none" else Change(onset, effects)


def table(results: Sequence[dict[str, Any]]) -> str:
    """What became of each kind of change, as a Markdown table; errors: median (quartiles) of completed drives."""
    heads = ("plant", "change", "monitor", "completed", "95 %", "RMS e [m]", "driven slowly", "reported after [s]",
             "named")  # fmt: skip
    rows = []
    keys = dict.fromkeys((r["plant"], r["change"], r["mode"]) for r in results)
    for key in sorted(keys, key=lambda k: (k[0] != "single_track", list(CHANGES).index(k[1]), MODES.index(k[2]))):
        some = [r for r in results if (r["plant"], r["change"], r["mode"]) == key]
        rows.append((*key, *row(some)))
    return "\n".join(tabulated(heads, rows))


def row(some: Sequence[dict[str, Any]]) -> list[str]:
    """The table's cells of drives of one kind."""
    completed = [r for r in some if r["metrics"]["outcome"] == "completed"]
    _, low, high = binomial(len(completed), len(some), "wilson")
    e = np.percentile([r["metrics"]["rms_e"] for r in completed], [50, 25, 75]) if completed else [np.nan] * 3
    cells = [f"{len(completed)} of {len(some)}", f"{low:.2f} to {high:.2f}", f"{e[0]:.2f} ({e[1]:.2f} to {e[2]:.2f})"]
    if some[0]["mode"] in ("off", "online"):
        return [*cells, "-", "-", "-"]
    delays = [next((e["t"] for e in r["events"] if e["t"] > r["onset"]), np.inf) - r["onset"] for r in some]
    right = sum(any(e.get("cause") in CHANGES[r["change"]] for e in r["events"]) for r in some)
    slow = np.median([r["slow"] for r in some])
    return [*cells, f"{slow:.0%}", f"{np.median(delays):.1f}".replace("inf", "-"), f"{right} of {len(some)}"]


def pairs(results: Sequence[dict[str, Any]]) -> str:
    """The same drives without the monitor and with a policy: how many it saves, and how many it loses."""
    drives: dict[str, dict[tuple[str, str, int], bool]] = {}
    for r in results:
        key = (r["plant"], r["change"], r["seed"])
        drives.setdefault(r["mode"], {})[key] = r["metrics"]["outcome"] == "completed"
    without, lines = drives.get("off", {}), []
    for mode in [mode for mode in POLICIES if mode in drives and mode != "online_forget"]:
        for plant in dict.fromkeys(key[0] for key in drives[mode]):
            both = [(without[key], done) for key, done in drives[mode].items() if key[0] == plant and key in without]
            lost, kept = ([done for before, done in both if before == which] for which in (False, True))
            lines.append(f"{plant}, {mode}: of {len(lost)} drives lost without it {sum(lost)} are completed, "
                         f"of {len(kept)} completed without it {len(kept) - sum(kept)} are lost")  # fmt: skip
    return "\n".join(lines)


def main(config: Config) -> None:
    """Makes the drives that are not there, and prints the table.

    Raises:
        InvalidOptionError: `--draw` with a plant that is not the single-track one.
    """
    if config.draw != "nominal" and (config.plants != ("single_track",) or config.calibrated):
        raise InvalidOptionError(
            "--draw is of single-track vehicles that are known: give --plants single_track, and no --calibrated"
        )
    calibration = config.out if config.calibrated else None
    for plant in config.plants if calibration else ():
        calibrate(plant, config.out)
    seeds = range(config.first, config.first + config.seeds)
    jobs = [Job(plant, change, mode, seed, calibration, config.draw) for seed in seeds
            for plant in config.plants for change in config.changes for mode in config.modes]  # fmt: skip
    config.out.mkdir(parents=True, exist_ok=True)
    write_versions(config.out)
    results = run_kept(config.executor, drive, jobs, lambda job: config.out / f"{job.name}.json", "drive")
    write_report(config.out, f"{table(results)}\n\n{pairs(results)}\n", config)


if __name__ == "__main__":
    run_command(main, Config, __doc__)
