"""The closed loop with and without the monitor's correction, on drives during which the car changes.

    python -m experiments.monitoring.closed_loop OUT --seeds 2

Each drive is a figure-8 under MPC that believes the nominal car; the change comes at a moment that depends on the seed.
A file a drive; drives that are there are not made again.
"""

import dataclasses
import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from drift_drake.control.effects_step import EffectsStepModel
from drift_drake.control.step_model import NominalStepModel, StepModel
from drift_drake.monitoring.in_loop import events_of
from drift_drake.monitoring.monitor import make_monitor
from drift_drake.monitoring.watch import WATCHED
from drift_drake.reference.trajectory import figure_8
from drift_drake.run_folder import is_done, write_json, write_versions
from drift_drake.simulation.change import Change
from drift_drake.simulation.closed_loop import ClosedLoop
from drift_drake.simulation.faults import Fault
from drift_drake.vehicle.effects import Effects, make_effects
from drift_drake.vehicle.parameters import VehicleParameters
from experiments.executors import ExecutorConfig, run_jobs

CHANGES: dict[str, dict[str, float]] = {
    "friction drop": {"friction_level": -0.25},
    "steering rate limit": {"steering_rate_limit": 0.35},
    "torque loss": {"torque_gain_error": -0.3},
    "sideslip sensor": {"sideslip_bias": 0.15},
}
EARLIEST, LATEST = 3.0, 8.0  # [s]
END = 100.0  # [s], beyond a drive's


@dataclasses.dataclass(frozen=True)
class Job:
    """One drive."""

    change: str
    corrected: bool
    seed: int

    @property
    def name(self) -> str:
        return f"{self.change.replace(' ', '_')}-{'corrected' if self.corrected else 'nominal'}-{self.seed:02d}"


@dataclasses.dataclass(frozen=True)
class Config:
    """How many drives."""

    out: Annotated[Path, tyro.conf.Positional]
    seeds: int = 2
    executor: ExecutorConfig = dataclasses.field(default_factory=ExecutorConfig)


def drive(job: Job) -> dict[str, Any]:
    """How one drive ended, and what the monitor told."""
    vehicle, effects = VehicleParameters(), make_effects(CHANGES[job.change])
    onset = round(float(np.random.default_rng([job.seed, 3]).uniform(EARLIEST, LATEST)), 2)
    # A sensor's error cannot begin in the car's sensors: it is a fault behind them, in all that sideslip goes into.
    faults = [Fault("bias", onset, END, effects.sideslip_bias, channel) for channel in ("beta", "dphi")
              if effects.sideslip_bias != 0.0]  # fmt: skip
    model: StepModel = EffectsStepModel(vehicle, Effects()) if job.corrected else NominalStepModel(vehicle)
    loop = ClosedLoop(vehicle, figure_8(vehicle), model, Effects(aero_drag=1e-9), faults=faults,
                      monitor=make_monitor(vehicle, used=WATCHED), correct=job.corrected)  # fmt: skip
    change = None if faults else Change(onset, effects)
    run = loop.run(loop.initial_context(job.seed), change=change)
    assert run.monitor is not None
    events = events_of(run.monitor, run.table)
    return dataclasses.asdict(job) | {"onset": onset, "events": events, "metrics": dataclasses.asdict(run.metrics())}


def table(results: list[dict[str, Any]]) -> str:
    """What became of each kind of change, as a Markdown table."""
    lines = ["| change | controller | completed | RMS e after all [m] | told after [s] | named |", "| --- " * 6 + "|"]
    for change in CHANGES:
        for corrected in (False, True):
            some = [r for r in results if r["change"] == change and r["corrected"] == corrected]
            if not some:
                continue
            completed = sum(r["metrics"]["outcome"] == "completed" for r in some)
            told = [next((e["t"] for e in r["events"] if e["t"] > r["onset"]), np.inf) - r["onset"] for r in some]
            right = sum(any(e.get("cause") in CHANGES[change] for e in r["events"]) for r in some)
            e = np.median([r["metrics"]["rms_e"] for r in some])
            name = "corrected" if corrected else "nominal"
            lines.append(f"| {change} | {name} | {completed} of {len(some)} | {e:.2f} | {np.median(told):.1f} | "
                         f"{right} of {len(some)} |")  # fmt: skip
    return "\n".join(lines)


def main(config: Config) -> None:
    """Makes the drives that are not there, and prints the table."""
    jobs = [Job(change, corrected, seed) for seed in range(config.seeds) for change in CHANGES
            for corrected in (False, True)]  # fmt: skip
    paths = {job.name: config.out / f"{job.name}.json" for job in jobs}
    config.out.mkdir(parents=True, exist_ok=True)
    write_versions(config.out)
    run_jobs(config.executor, drive, [job for job in jobs if not is_done(paths[job.name])],
             lambda job, result: write_json(paths[job.name], result), "drive")  # fmt: skip
    print(table([json.loads(path.read_text()) for path in paths.values() if is_done(path)]))


if __name__ == "__main__":
    main(tyro.cli(Config, description=__doc__))
