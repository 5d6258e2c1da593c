"""What logs of all lengths take: the peak of memory and the CPU time of each command, and what it answers.

    python -m experiments.gap.benchmark_memory

Simulated runs of 12 s at 100 Hz by one car, with a hidden effect and without, its vehicle file off within
tolerance. Each command is a process of its own, after one that compiles.
"""

import dataclasses
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.common.run_folder import machine
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.drivers import MANOEUVRES
from experiments.benchmarks.truths import Truth
from experiments.made import RunConfig, begun, tabulated, write_results

EFFECT = {"aero_drag": 0.6}
OFF = {"mass": 0.01, "torque": -0.02, "front_stiffness": 0.02}  # of the vehicle file
CAR, ANSWER = "car.yaml", "answer.json"
BYTES = 1024 if sys.platform == "linux" else 1  # in the unit of `ru_maxrss`

Words = tuple[str | Path, ...]


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig(RunConfig):
    """Size of the benchmark."""

    runs: tuple[int, ...] = (4, 24, 96, 300)
    """Of cases with a hidden effect; the largest is made without one, too, and checked and identified."""
    duration: float = 12.0
    """Of a run [s]."""
    seed: int = 0
    """Of the cases."""
    workers: int = 2
    """Threads of a diagnosis."""
    effects: tuple[str, ...] = ()
    """Effects to consider; all without any."""


@dataclasses.dataclass(frozen=True)
class Task:
    """A command and the case that it is given."""

    name: str  # the command and its first options
    runs: int
    hidden: bool  # whether the case has the effect
    words: Words  # that follow

    def logs(self, folder: Path) -> Path:
        """Where the case is."""
        return folder / f"{self.runs}_{'effect' if self.hidden else 'none'}"

    def command(self, folder: Path) -> list[str]:
        """The whole command."""
        first, *others = self.name.split()
        return [first, *map(str, (self.logs(folder), *others, *self.words))]


def tasks(config: BenchmarkConfig, folder: Path) -> list[Task]:
    """What is measured, in order."""
    most, car, calibrated, calibration = (
        max(config.runs),
        *(folder / n for n in ("car.yaml", "found.yaml", "found.json")),
    )
    considered = ("--effects", *config.effects) if config.effects else ()
    answer: Words = ("--json", folder / ANSWER, "--workers", str(config.workers), "--quiet", *considered)
    return [
        *(Task("diagnose", runs, True, ("--vehicle", car, *answer)) for runs in config.runs),
        Task("diagnose", most, False, ("--vehicle", car, *answer)),
        Task("check", most, False, ("--vehicle", car)),
        Task("identify", most, False, ("--vehicle", car, "--quiet")),
        Task("identify --criterion prediction", most, False,
             ("--vehicle", car, "--force", "--out", calibrated, "--json", calibration, "--quiet")),
        Task("diagnose --calibration", most, True, (calibration, "--vehicle", calibrated, *answer)),
    ]  # fmt: skip


# In a small process of its own: until it is replaced, a child counts its parent's memory as its own.
PROBE = """
import json, os, subprocess, sys
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
_, status, usage = os.wait4(process.pid, 0)
process.returncode = os.waitstatus_to_exitcode(status)
print(json.dumps([usage.ru_maxrss, usage.ru_utime + usage.ru_stime]))
sys.exit(process.returncode)
"""


def measured(words: Sequence[str]) -> dict[str, float]:
    """Peak of memory [MB] and CPU time [s] of a command of `drift-drake`.

    Raises:
        RuntimeError: the command fails; the message is what it said.
    """
    command = [sys.executable, "-c", PROBE, sys.executable, "-m", "drift_drake.cli.main", *words]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode:
        raise RuntimeError(ran.stderr)
    peak, cpu = json.loads(ran.stdout)
    return {"memory": peak * BYTES / 1e6, "cpu": cpu}


def make_logs(folder: Path, truth: Truth, runs: int, config: BenchmarkConfig) -> float:
    """Writes a case of so many runs; their length in all [s]."""
    folder.mkdir()
    manoeuvres = [MANOEUVRES[i % len(MANOEUVRES)] for i in range(runs)]
    rng = np.random.default_rng(config.seed)
    made = make_case(truth, VehicleParameters(), rng, config.duration, manoeuvres)
    for run in made:
        write_run(run, folder / f"{run.name}.csv")
    return sum(len(run) * run.period for run in made)


def said_by(answer: Path) -> str:
    """What an answer names, with intervals, or its verdict."""
    found = json.loads(answer.read_text())
    causes = [f"{n} {m['estimate']:.4g} ({m['low']:.4g} to {m['high']:.4g})" for n, m in found["magnitudes"].items()]
    return " and ".join(causes) or str(found["verdict"])


def run(config: BenchmarkConfig, folder: Path) -> list[dict[str, Any]]:
    """Of each command and case: its runs, their length [s], peak of memory [MB], CPU time [s], the answer."""
    write_vehicle(folder / CAR, VehicleParameters())
    seconds, rows = dict[Path, float](), list[dict[str, Any]]()
    for task in tasks(config, folder):
        logs = task.logs(folder)
        if logs not in seconds:
            seconds[logs] = make_logs(logs, Truth(EFFECT if task.hidden else {}, {}, OFF), task.runs, config)
        if not rows:
            measured(dataclasses.replace(task, words=(*task.words, "--effects", *EFFECT)).command(folder))  # compiles
        row = dataclasses.asdict(task) | {"seconds": seconds[logs]} | measured(task.command(folder))
        rows.append(row | {"answer": said_by(folder / ANSWER) if task.name.startswith("diagnose") else ""})
        del rows[-1]["words"]
        print(rows[-1], file=sys.stderr, flush=True)  # the last ones are long in coming
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The numbers as Markdown."""
    heads = ("command", "runs", "logs [s]", "hidden effect", "peak of memory [GB]", "CPU [s]", "answer")
    cells = [(row["name"], row["runs"], f"{row['seconds']:,.0f}", "yes" if row["hidden"] else "no",
              f"{row['memory'] / 1000.0:.2f}", f"{row['cpu']:.0f}", row["answer"]) for row in rows]  # fmt: skip
    effect = ", ".join(f"{name} {q:g}" for name, q in EFFECT.items())
    return "\n".join([f"{machine()}; the hidden effect is {effect}", "", *tabulated(heads, cells)])


def main(config: BenchmarkConfig) -> None:
    """Runs, prints and stores the benchmark."""
    folder = begun("benchmark_memory", config)
    rows = run(config, folder)
    write_results(folder, config, rows, table(rows))


if __name__ == "__main__":
    run_command(main, BenchmarkConfig, __doc__)
