"""How long meta-training takes to a stated objective, on the CPU and on a GPU where there is one.

    python -m experiments.model.benchmark_training --drives runs/model/drives --target -58

Each device trains the same model from the same numbers on the same tasks, one after the other, and stops at the first
look at the validation vehicles (every 25 epochs) that is at the target or below.
"""

import dataclasses
from pathlib import Path
from typing import Any

import torch

from diagrams.command import run_command
from drift_drake.common.run_folder import machine
from drift_drake.drive.learnt.meta_training import train
from drift_drake.drive.learnt.training_config import TrainingConfig
from experiments.made import RunConfig, begun, tabulated, write_results


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig(RunConfig):
    """What is trained, and how far."""

    drives: Path = Path("runs/drives")
    """Folder with train_phases.npz, train_lane_phases.npz, validation.npz and validation_lane.npz."""
    target: float = -58.0
    """Objective of the validation vehicles to reach."""
    epochs: int = 1200
    """At most."""
    threads: int = 2
    """Of the CPU."""
    devices: tuple[str, ...] = ("cpu", "cuda")
    """Those that are here are timed."""
    seed: int = 0


def timed(config: BenchmarkConfig, device: str, folder: Path) -> dict[str, Any]:
    """One device's training: seconds to the target (None where it is not reached), and in all."""
    files = {"data": "train_phases", "lane": "train_lane_phases", "validation": "validation",
             "validation_lane": "validation_lane"}  # fmt: skip
    options: dict[str, Any] = {name: config.drives / f"{file}.npz" for name, file in files.items()}
    options |= {"device": device, "seed": config.seed, "threads": config.threads, "epochs": config.epochs}
    record = train(
        TrainingConfig(**options, output=folder / f"{device}.npz", time_limit=1e9, stop_at=config.target)
    ).record
    last = record["history"][-1]
    return {
        "device": record["device"],
        "seconds to the target": last["seconds"] if last["validation"] <= config.target else None,
        "seconds": record["seconds"],
        "epochs": record["epochs"],
        "seconds an epoch": record["seconds"] / record["epochs"],
        "validation": last["validation"],
    }


def table(numbers: dict[str, Any]) -> str:
    """The summary as Markdown."""
    rows = []
    for found in numbers["devices"].values():
        reached = found["seconds to the target"]
        rows.append((found["device"], "not reached" if reached is None else f"{reached:.0f}", found["epochs"],
                     f"{found['seconds an epoch']:.2f}", f"{found['validation']:.2f}"))  # fmt: skip
    heads = ("device", "to the target [s]", "epochs", "an epoch [s]", "objective reached")
    lines = [f"{numbers['machine']}; {numbers['samples']}", "", *tabulated(heads, rows)]
    if "ratio" in numbers:
        lines += ["", f"The GPU takes 1/{numbers['ratio']:.1f} of the CPU's time an epoch."]
    return "\n".join(lines)


def main(config: BenchmarkConfig) -> None:
    """Trains on each device, prints and stores the times."""
    folder = begun("benchmark_training", config)
    there = [name for name in config.devices if name != "cuda" or torch.cuda.is_available()]
    found = {name: timed(config, name, folder) for name in there}
    numbers: dict[str, Any] = {
        "machine": machine(),
        "samples": f"target {config.target:g} on the validation vehicles, {config.threads} threads on the CPU",
        "devices": found,
    }
    if {"cpu", "cuda"} <= set(found):
        numbers["ratio"] = found["cpu"]["seconds an epoch"] / found["cuda"]["seconds an epoch"]
    write_results(folder, config, numbers, table(numbers))


if __name__ == "__main__":
    run_command(main, BenchmarkConfig, __doc__)
