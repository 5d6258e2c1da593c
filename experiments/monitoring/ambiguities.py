"""Which causes the monitor could mistake for the one that leads 3 s after a change of the double-track car.

    python -m experiments.monitoring.ambiguities OUT --first 6000 --count 14

The drives are as the comparison's. Prints one line a drive, and how often the true cause leads or is in its group.
"""

import dataclasses
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.gap.monitoring.monitor import after_row
from drift_drake.gap.monitoring.watch import mistakable, rows_of
from experiments.monitoring.cars import Simulator, double_track_simulator
from experiments.monitoring.comparison import ONSETS, PLANTS, SECONDS, Job, drawn_change, drive, traced


@dataclasses.dataclass(frozen=True)
class Config:
    """Which drives."""

    out: Annotated[Path, tyro.conf.Positional]
    """Folder of the calibrated simulator, made where it is missing."""
    first: int = 0
    count: int = 8


def leading(job: Job) -> tuple[str, str, tuple[str, ...]]:
    """(the true cause, the one that leads, those that look like it) of one drive."""
    for attempt in range(20):
        seeds = [job.seed, PLANTS.index(job.plant), 1, attempt]
        onset = float(np.random.default_rng([*seeds, 1]).uniform(*ONSETS))
        run = drive(job, np.random.default_rng(seeds), Effects(), onset, attempt)
        if run.t[-1] < onset + SECONDS:
            continue
        monitor = job.simulator.monitor(run)
        change = drawn_change(monitor, traced(monitor, run), onset, job.plant, np.random.default_rng([*seeds, 2]))
        if change is None:
            continue
        run = drive(job, np.random.default_rng(seeds), make_effects({change[0]: change[1]}), onset, attempt)
        if run.t[-1] >= onset + SECONDS:
            break
    else:
        raise RuntimeError(f"{job.name}: no drive in 20 attempts")
    monitor = job.simulator.monitor(run)
    state = monitor.start()
    for row in rows_of(run):
        if row.t <= onset + SECONDS:
            state = after_row(monitor, state, row.y, row.command, row.t)
    name = monitor.labels[1 + int(np.argmax(state.verdict[1:-4]))]
    at = monitor.at_edge(state)
    return change[0], name, () if at is None else mistakable(monitor.problem, *at, name)


def main(config: Config) -> None:
    """Prints the table."""
    config.out.mkdir(parents=True, exist_ok=True)
    simulator: Simulator = double_track_simulator(config.out)
    found = [leading(Job("double_track", True, seed, simulator))
             for seed in range(config.first, config.first + config.count)]  # fmt: skip
    for true, name, group in found:
        print(f"{true}: {name}{' or ' if group else ''}{', '.join(group)}")
    right = sum(true == name for true, name, _ in found)
    within = sum(true in (name, *group) for true, name, group in found)
    alone = [true == name for true, name, group in found if not group]
    print(
        f"{right} of {len(found)} lead, {within} lead or are in the group; {len(alone)} stand alone, {sum(alone)} right"
    )


if __name__ == "__main__":
    run_command(main, Config, __doc__)
