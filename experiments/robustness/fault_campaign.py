"""Faulted closed loops by the hundred: faults by vehicles by models, each with and without what guards the loop.

    python -m experiments.robustness.fault_campaign --loops 1000

Each loop drifts on the figure-8 for some seconds with one fault in it, once guarded (readings are screened, and a car
without valid plans is stopped) and once not. What comes out is named, and the share of loops in which the car stays on
its lane is reported by fault. Broken off, it goes on where it was (give --out).
"""

import dataclasses
import json
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import INPUTS
from drift_drake.car.step_model import NominalStepModel, StepModel
from drift_drake.common.run_folder import is_done, make_run_folder, write_versions
from drift_drake.common.safe_files import write_table
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.lag_bank import BANK
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.faults import parse_fault
from drift_drake.drive.reference.trajectory import Reference, figure_8
from drift_drake.view.colours import RUNS
from drift_drake.view.style import new_figure, save, styled
from experiments.benchmarks.intervals import binomial
from experiments.benchmarks.vehicles import draw_effects
from experiments.made import RunConfig, SpreadConfig, tabulated, write_report
from experiments.settings import keep_settings, run_kept

FAULTS = {  # begins after one second, in a drift
    "none": "",
    "no reading, 0.3 s": "dropout:1:0.3",
    "no reading any more": "dropout:1:99",
    "one channel missing": "nan:1:99:0:beta",
    "frozen, 0.6 s": "freeze:1:0.6",
    "spikes of 1e6": "spike:1:0.2:1e6:r",
    "spikes of 2 rad/s": "spike:1:0.15:2:r",
    "position 20 m off, 0.15 s": "spike:1:0.15:20:s",
    "speed negative": "bias:1:1:-30:v",
    "sideslip 0.05 rad off": "bias:1:99:0.05:beta",
    "readings 50 ms late": "delay:1:99:0.05",
    "readings jitter, 60 ms": "jitter:1:99:0.06",
    "solver fails, 0.3 s": "solver_failure:1:0.3",
    "solver fails for good": "solver_failure:1:99",
    "plans lost for good": "lost_plans:1:99",
    "plans 0.2 s late": "late_plans:1:99:0.2",
    "clock 20 % fast": "clock_drift:1:99:0.2",
    "half the actuator's range, 0.5 s": "saturated:1:0.5:0.5",
    "friction -30 %, 0.3 s": "friction_patch:1:0.3:-0.3",
    "speed stays at its value, 3 s": "hold:1:3:0:v",
    "sideslip stays at its value, 3 s": "hold:1:3:0:beta",
    "speed 3 m/s off, 3 s": "bias:1:3:3:v",
    "yaw rate 0.5 rad/s off, 3 s": "bias:1:3:0.5:r",
    "lateral position drifts, 1 m/s": "drift:1:3:1:e",
    "steering sticks, 0.3 s": "steering_stuck:1:0.3",
    "steering sticks for good": "steering_stuck:1:99",
    "torque sticks for good": "torque_stuck:1:99",
    "torque lost, 0.5 s": "torque_lost:1:0.5",
    "torque lost for good": "torque_lost:1:99",
    "no reading, 1 s": "dropout:1:1",
    "no reading, 3 s": "dropout:1:3",
    "yaw rate missing, 3 s": "nan:1:3:0:r",
    "speed missing, 3 s": "nan:1:3:0:v",
    "steering sticks, 1 s": "steering_stuck:1:1",
    "torque sticks, 1 s": "torque_stuck:1:1",
}
ON_THE_LANE = ("completed", "stopped safely", "time is up")
OUTCOMES = {"completed": "completed", "stopped safely": "stopped", "time is up": "ran out of time",
            "left the lane": "left the lane", "spin": "spun", "simulation failed": "failed"}  # fmt: skip
Model = Literal["nominal", "prior", "online"]


@dataclasses.dataclass(frozen=True)
class CampaignConfig(SpreadConfig, RunConfig):
    """How many loops, of what."""

    loops: int = 1000
    """Half of them guarded, or all (see `bare`)."""
    vehicles: int = 9
    """Drawn from the held-out population; number 0 is without effects."""
    first_vehicle: int = 0
    """Number of the first one: settings are tuned on some and reported on others."""
    bare: bool = True
    """Each loop once without the guard, too."""
    models: tuple[Model, ...] = ("nominal", "prior", "online")
    """What the controller believes."""
    distance: float = 60.0
    """[m] along the figure-8."""
    seed: int = 0
    control: ControlConfig = dataclasses.field(
        default_factory=lambda: ControlConfig(horizon=15, period=0.02, delay=0.02)
    )


@dataclasses.dataclass(frozen=True)
class Job:
    """One loop."""

    fault: str
    vehicle: int
    model: Model
    guarded: bool
    noise_seed: int
    distance: float
    control: ControlConfig

    @property
    def name(self) -> str:
        """Of its file."""
        guarded = "guarded" if self.guarded else "bare"
        return f"{list(FAULTS).index(self.fault):02d}-{self.vehicle}-{self.model}-{self.noise_seed}-{guarded}"


@cache
def course(distance: float) -> Reference:
    """The first metres of the figure-8."""
    return dataclasses.replace(figure_8(VehicleParameters()), distance=distance)


def make_jobs(config: CampaignConfig) -> list[Job]:
    """The loops, guarded and not side by side, in an order in which any first part is a fair sample."""
    generator = np.random.default_rng(config.seed)
    vehicles = range(config.first_vehicle, config.first_vehicle + config.vehicles)
    guards = (True, False) if config.bare else (True,)
    cells = [(f, v, m) for f in FAULTS for v in vehicles for m in config.models]
    jobs: list[Job] = []
    for noise_seed in range(-(-config.loops // (len(guards) * len(cells)))):
        for i in generator.permutation(len(cells)):
            fault, vehicle, model = cells[i]
            jobs += [Job(fault, vehicle, model, guarded, noise_seed, config.distance, config.control)
                     for guarded in guards]  # fmt: skip
    return jobs[: config.loops]


def run(job: Job) -> dict[str, Any]:
    """What the job is, and the metrics of its loop."""
    parameters, effects = VehicleParameters(), Effects()
    if job.vehicle > 0:
        effects = draw_effects("held_out", job.vehicle, 0)
    model: StepModel = NominalStepModel(parameters)
    adapter = None
    if job.model != "nominal":
        learnt = load_model()
        model = step_model(learnt, learnt.prior(), "trapezoid")
        adapter = BayesianAdapter(learnt, lags=BANK) if job.model == "online" else None
    control = job.control if job.guarded else dataclasses.replace(job.control, screening=False, patience=0.0)
    faults = [parse_fault(FAULTS[job.fault])] if FAULTS[job.fault] else []
    loop = ClosedLoop(parameters, course(job.distance), model, effects, control=control, adapter=adapter, faults=faults)
    made = loop.run(loop.initial_context(job.noise_seed))
    labels = {"fault": job.fault, "vehicle": job.vehicle, "model": job.model, "guarded": job.guarded,
              "noise_seed": job.noise_seed}  # fmt: skip
    commands = made.table[list(INPUTS)].to_numpy()
    return labels | dataclasses.asdict(made.metrics()) | {
        "error": made.error, "commands_not_finite": int((~np.isfinite(commands)).sum())
    }  # fmt: skip


def shares(runs: pd.DataFrame) -> pd.DataFrame:
    """By fault and guard: loops, how they ended, those that stayed on the lane, and that share's 95 % interval."""
    rows = []
    for (fault, guarded), group in runs.groupby(["fault", "guarded"], sort=False):
        stayed = int(group["outcome"].isin(ON_THE_LANE).sum())
        _, low, high = binomial(stayed, len(group), "wilson")
        rows.append({"fault": fault, "guarded": bool(guarded), "loops": len(group), "stayed": stayed, "low": low,
                     "high": high} | {short: int((group["outcome"] == outcome).sum())
                                      for outcome, short in OUTCOMES.items()})  # fmt: skip
    return pd.DataFrame(rows)


def table(found: pd.DataFrame) -> str:
    """The shares as Markdown."""
    rows = []
    for fault in [name for name in FAULTS if name in set(found["fault"])]:
        cells = []
        of = found[found["fault"] == fault]
        for guarded in (True, False):
            group = of[of["guarded"] == guarded]
            if group.empty:
                cells.append("-")
                continue
            g = group.iloc[0]
            ended = ", ".join(f"{g[short]} {short}" for short in OUTCOMES.values() if g[short])
            cells.append(f"{g['stayed']} of {g['loops']} ({ended})")
        rows.append((fault, int(of["loops"].sum()), *cells))
    heads = ("fault", "loops", "stays on its lane, guarded (how the loops ended)", "not guarded")
    return "\n".join(tabulated(heads, rows))


@styled
def picture(found: pd.DataFrame) -> Figure:
    """Shares that stay on the lane by fault, with their 95 % intervals."""
    names = [name for name in FAULTS if name in set(found["fault"])]
    figure = new_figure(6.5, 0.6 + 0.27 * len(names))
    axes = figure.subplots()
    for guarded, label, colour, marker in ((True, "guarded", RUNS[0], "o"), (False, "not guarded", RUNS[1], "s")):
        of = found[found["guarded"] == guarded].set_index("fault").reindex(names)
        share = of["stayed"] / of["loops"]
        y = np.arange(len(names)) + (-0.14 if guarded else 0.14)
        error = np.clip(np.array([share - of["low"], of["high"] - share]), 0.0, None)
        axes.errorbar(100.0 * share, y, xerr=100.0 * error, fmt=marker, color=colour, label=label, markersize=4.0)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlim(-3.0, 103.0)
    axes.set_xlabel("loops that stay on the lane [%]")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    return figure


def main(config: CampaignConfig) -> None:
    """Runs what is missing, then writes table and picture.

    Raises:
        OtherExperimentError: the folder holds loops made with other settings.
    """
    folder = make_run_folder("fault_campaign", config.out)
    write_versions(folder)
    keep_settings(
        folder,
        dataclasses.asdict(config),
        free=("loops", "vehicles", "first_vehicle", "bare", "models", "seed", "run_on", "out"),
    )
    loops = folder / "loops"
    loops.mkdir(exist_ok=True)
    jobs = make_jobs(config)
    try:
        run_kept(config.run_on, run, jobs, lambda job: loops / f"{job.name}.json", "loop")
    finally:
        report(folder, jobs, config)


def report(folder: Path, jobs: list[Job], config: CampaignConfig) -> None:
    """Writes what the loops that are there say."""
    paths = [folder / "loops" / f"{job.name}.json" for job in jobs]
    runs = pd.DataFrame([json.loads(path.read_text()) for path in paths if is_done(path)])
    if runs.empty:
        return
    write_table(runs, folder / "runs.csv", index=False)
    found = shares(runs)
    outcomes = ", ".join(f"{count} {name}" for name, count in runs["outcome"].value_counts().items())
    commands = int(runs["commands_not_finite"].sum())
    text = f"{len(runs)} loops: {outcomes}; {commands} commands that are no finite number\n\n{table(found)}\n"
    write_report(folder, text, config)
    save(picture(found), folder / "fault_campaign.png")


if __name__ == "__main__":
    run_command(main, CampaignConfig)
