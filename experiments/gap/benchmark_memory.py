"""What logs of all lengths take: the peak of memory and the CPU time of each command, and what it answers.

    python -m experiments.gap.benchmark_memory

Simulated runs of 12 s at 100 Hz by one car, with a hidden effect and without, its vehicle file off within
tolerance. Each command is a process of its own, after one that compiles.
"""

import dataclasses
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.benchmarks.compiled_cases import make_case
from drift_drake.benchmarks.drivers import MANOEUVRES
from drift_drake.benchmarks.truths import Truth
from drift_drake.logs.table import write_run
from drift_drake.run_folder import machine, make_run_folder
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.vehicle_file import write_vehicle
from experiments.made import write_benchmark

EFFECT = {"rear_stiffness_error": -0.15}
OFF = {"mass": 0.01, "torque": -0.02, "front_stiffness": 0.02}  # of the vehicle file
MB = 1024.0 if sys.platform == "linux" else 1024.0**2  # of `ru_maxrss`


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig:
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
    out: Path | None = None


def measured(arguments: Sequence[str | Path]) -> dict[str, float]:
    """Peak of memory [MB] and CPU time [s] of a command of `drift-drake`.

    Raises:
        RuntimeError: the command fails; the message is what it said.
    """
    words = [sys.executable, "-m", "drift_drake.cli", *map(str, arguments)]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        said = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(said)
    return {"memory": usage.ru_maxrss / MB, "cpu": usage.ru_utime + usage.ru_stime}


def make_logs(folder: Path, truth: Truth, runs: int, config: BenchmarkConfig) -> float:
    """Writes a case of so many runs; their length in all [s]."""
    folder.mkdir()
    manoeuvres = [MANOEUVRES[i % len(MANOEUVRES)] for i in range(runs)]
    rng = np.random.default_rng(config.seed)
    made = make_case(truth, VehicleParameters(), rng, config.duration, manoeuvres)
    for run in made:
        write_run(run, folder / f"{run.name}.csv")
    return sum(len(run) * run.period for run in made)


def diagnosed(folder: Path, vehicle: Path, config: BenchmarkConfig) -> dict[str, Any]:
    """What a diagnosis takes, and its answer in words."""
    answer = folder.parent / f"{folder.name}.json"
    options: list[str | Path] = ["--vehicle", vehicle, "--json", answer, "--workers", str(config.workers), "--quiet"]
    considered = ["--effects", *config.effects] if config.effects else []
    found: dict[str, Any] = measured(["diagnose", folder, *options, *considered])
    said = json.loads(answer.read_text())
    causes = [
        f"{name} {m['estimate']:.4g} ({m['low']:.4g} to {m['high']:.4g})" for name, m in said["magnitudes"].items()
    ]
    return found | {"answer": " and ".join(causes) or said["verdict"]}


def run(config: BenchmarkConfig, folder: Path) -> list[dict[str, Any]]:
    """Of each command and case: its runs, their length [s], peak of memory [MB], CPU time [s], the answer."""
    vehicle, most, rows = folder / "car.yaml", max(config.runs), []
    write_vehicle(vehicle, VehicleParameters())
    cases = [(runs, EFFECT) for runs in config.runs] + [(most, {})]
    for number, (runs, effect) in enumerate(cases):
        logs = folder / f"{runs}_{'effect' if effect else 'none'}"
        seconds = make_logs(logs, Truth(effect, {}, OFF), runs, config)
        if number == 0:
            diagnosed(logs, vehicle, dataclasses.replace(config, effects=tuple(EFFECT)))  # compiles
        case = {"runs": runs, "seconds": seconds}
        rows.append({"command": "diagnose", "hidden": bool(effect)} | case | diagnosed(logs, vehicle, config))
        if not effect:
            commands: dict[str, list[str | Path]] = {
                "check": ["check", logs, "--vehicle", vehicle],
                "identify": ["identify", logs, "--vehicle", vehicle, "--quiet"],
            }
            for name, words in commands.items():
                rows.append({"command": name, "hidden": False} | case | measured(words))
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The numbers as Markdown."""
    lines = [
        f"{machine()}; the hidden effect is {', '.join(f'{name} {q:g}' for name, q in EFFECT.items())}",
        "",
        "| command | runs | logs [s] | hidden effect | peak of memory [GB] | CPU [s] | answer |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        lines.append(
            f"| {row['command']} | {row['runs']} | {row['seconds']:,.0f} | {'yes' if row['hidden'] else 'no'} |"
            f" {row['memory'] / 1000.0:.2f} | {row['cpu']:.0f} | {row.get('answer', '')} |"
        )
    return "\n".join(lines)


def main(config: BenchmarkConfig) -> None:
    """Runs, prints and stores the benchmark."""
    folder = make_run_folder("benchmark_memory", config.out)
    rows = run(config, folder)
    write_benchmark(folder, config, rows, table(rows))


if __name__ == "__main__":
    run_command(main, BenchmarkConfig, __doc__)
