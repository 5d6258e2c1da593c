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
from drift_drake.gap.monitoring.watch import mistakable, rows_of
from experiments.monitoring.cars import Simulator, double_track_simulator
from experiments.monitoring.comparison import SECONDS, Job, driven


@dataclasses.dataclass(frozen=True)
class Config:
    """Which drives."""

    out: Annotated[Path, tyro.conf.Positional]
    """Folder of the calibrated simulator, made where it is missing."""
    first: int = 0
    count: int = 8


def leading(job: Job) -> tuple[str, str, tuple[str, ...]]:
    """(the true cause, the one that leads, those that look like it) of one drive."""
    run, truth, _ = driven(job)
    monitor = job.simulator.monitor(run)
    state = monitor.start()
    for row in rows_of(run):
        if row.t <= truth["onset"] + SECONDS:
            state = monitor.after_row(state, row.y, row.command, row.t)
    name = monitor.labels[1 + int(np.argmax(state.verdict[1:-4]))]
    at = monitor.at_edge(state)
    return truth["effect"], name, () if at is None else mistakable(monitor.problem, *at, name)


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
