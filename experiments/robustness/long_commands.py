"""Commands that take a while and can be given again, each in a size of some seconds, and how their inputs are made."""

import dataclasses
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import write_json
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth

FEW = ("rear_stiffness_error", "mass_error")  # effects that a diagnosis considers
CASES = 3
ONE_STEP_EACH = ("--control.period", "0.1", "--control.delay", "0.1", "--control.horizon", "8")


def _nothing(*_: Path) -> None:
    pass


@dataclasses.dataclass(frozen=True)
class LongCommand:
    """A command that takes a while and can be given again."""

    arguments: Callable[[Path, Path], list[str]]  # of python, from the folder of inputs and that of results
    prepare: Callable[[Path], None] = _nothing  # makes its inputs in a folder
    begin: Callable[[Path, Path], None] = _nothing  # from inputs: what the folder of results holds at first


def _cases(inputs: Path) -> None:
    """Short cases of one car, and its vehicle file."""
    parameters = VehicleParameters()
    parameters.to_yaml(inputs / "vehicle.yaml")
    for index in range(CASES):
        truth = Truth({FEW[index % len(FEW)]: (-0.25, 0.1)[index % len(FEW)]}, {}, {})
        for i, run in enumerate(make_case(truth, parameters, np.random.default_rng(index), 2.5)):
            write_run(run, inputs / "cases" / f"case_{index}" / f"run_{i}.csv")


def _blind_cases(inputs: Path) -> None:
    """The same as a blind check has them: a manifest, and a catalogue that lacks all but a few effects."""
    _cases(inputs)
    without = [name for name in CATALOGUE if name not in FEW]
    write_json(inputs / "manifest.json", {"cases": {f"case_{i}": {"without": without} for i in range(CASES)}})


def _linked(inputs: Path, out: Path) -> None:
    for path in inputs.iterdir():
        (out / path.name).symlink_to(path.resolve())


def _drives(out: Path, population: str, vehicles: int, samples: int) -> list[str]:
    others = [name for name in ("train", "validation", "held-out", "wide") if name != population]
    none = [word for name in others for word in (f"--{name}", "0")]
    return ["-m", "experiments.model.drives", f"--{population}", str(vehicles), *none, "--samples", str(samples),
            "--output", str(out)]  # fmt: skip


def _made_drives(population: str, vehicles: int, samples: int) -> Callable[[Path], None]:
    def prepare(inputs: Path) -> None:
        arguments = _drives(inputs / "drives", population, vehicles, samples)
        subprocess.run([sys.executable, *arguments], check=True, capture_output=True)

    return prepare


COMMANDS = {
    "dataset": LongCommand(lambda _, out: _drives(out, "train", 3, 12)),
    "train": LongCommand(
        lambda inputs, out: [
            "-m", "drift_drake", "train", "--recipe", "windows", "--data", str(inputs / "drives/train_phases.npz"),
            "--validation", "None", "--lane", "None", "--epochs", "30", "--threads", "1", "--horizons", "5",
            "--no-temper", "--output", str(out / "model.npz"),
        ],
        _made_drives("train", 3, 12),
    ),
    "gathering": LongCommand(
        lambda inputs, out: [
            "-m", "experiments.gathering.information_gathering", "--drives", str(inputs / "drives"), "--vehicles", "2",
            "--rounds", "2", "--gathering.starts", "1", "--gathering.max-iterations", "20", "--workers", "1",
            "--out", str(out),
        ],
        _made_drives("held-out", 2, 160),
    ),
    "figure_8": LongCommand(
        lambda _, out: [
            "-m", "experiments.drifting.figure_8", "--models", "nominal", "--vehicles", "2", "--noise-seeds", "1",
            "--workers", "1", *ONE_STEP_EACH, "--out", str(out),
        ]
    ),
    "campaign": LongCommand(
        lambda _, out: [
            "-m", "experiments.robustness.fault_campaign", "--loops", "4", "--vehicles", "1", "--models", "nominal",
            "--distance", "8", "--out", str(out),
        ]
    ),
    "identify": LongCommand(
        lambda inputs, out: [
            "-m", "drift_drake", "identify", str(inputs / "cases/case_0"), "--vehicle", str(inputs / "vehicle.yaml"),
            "--effects", "steering_lag", "--criterion", "likelihood", "--out", str(out / "car.yaml"),
            "--json", str(out / "car.json"),
        ],
        _cases,
    ),
    "diagnose": LongCommand(
        lambda inputs, out: [
            "-m", "drift_drake", "diagnose", str(inputs / "cases"), "--vehicle", str(inputs / "vehicle.yaml"),
            "--effects", *FEW, "--json", str(out / "answers"),
        ],
        _cases,
    ),
    "blind": LongCommand(
        lambda _, out: ["-m", "experiments.gap.blind", "answer", "--out", str(out)], _blind_cases, _linked
    ),
}  # fmt: skip
