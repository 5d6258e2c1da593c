"""Models between the paper's recipe and the shipped one, one improvement more each, trained on the same vehicles.

    python -m experiments.model.ladder --output runs/ladder

Drives of the vehicles, and of held-out ones that judge; `plain`, `actuators`, `tyres` and `coupled` by the paper's
recipe with one change more each; a round of lane drives planned by the last of them; `tasks` with contexts, lane drives
among them, and weights of samples in place of windows, with as many gradient steps; errors of all of them and of both
shipped models (report.md). What is done is listed in build.json with its seconds and is not done again. The figure-8:
`python -m experiments.drifting.improvements --between runs/ladder/{plain,actuators,tyres,coupled,tasks}.npz`.
"""

import dataclasses
import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.car.step_model import NominalStepModel
from drift_drake.cli.train import Train, run_train
from drift_drake.common.run_folder import write_json
from drift_drake.drive.learnt.checkpoint import load_model, paper_checkpoint
from drift_drake.drive.learnt.quality import split_vehicle
from drift_drake.drive.learnt.samples import load_samples
from drift_drake.drive.learnt.training_config import Recipe, TrainingConfig, with_recipe
from experiments.benchmarks.intervals import bootstrap
from experiments.gathering import lane_drives
from experiments.made import SpreadConfig, tabulated, write_report
from experiments.model import drives
from experiments.model.build import UNLIMITED, Stage, do_stages
from experiments.model.judging import judge_stepper, quality_by_points

POINTS, STEPS = (0, 100), 20  # samples adapted to; steps of 0.1 s of a rollout
STEPS_OF_AN_EPOCH = 12  # gradient steps of the paper's recipe on 35 vehicles
WINDOWS: dict[str, dict[str, Any]] = {  # what each changes of the paper's recipe
    "plain": {},
    "actuators": {"physical_inputs": True, "tyres": False},
    "tyres": {"physical_inputs": True},
    "coupled": {"physical_inputs": True, "coupled": True},
}
WHAT = {
    "paper": "the shipped model of the paper's recipe",
    "plain": "the paper's recipe",
    "actuators": "+ the actuators' states as inputs",
    "tyres": "+ the nominal car's tyres as inputs",
    "coupled": "+ one belief of all states in place of four",
    "tasks": "+ contexts, lane drives and weights of samples in place of windows",
    "shipped": "the shipped model",
}


@dataclasses.dataclass(frozen=True)
class LadderConfig(SpreadConfig):
    """How large the models are made."""

    output: Path = Path("runs/ladder")  # one that holds some stages of the same ladder is gone on with
    seed: int = 0
    train: int = 35  # vehicles to train on
    held_out: int = 12  # vehicles that judge
    epochs: int = 1000  # of each model; the learning rate ends where it does after the recipe's own number


def trained(config: LadderConfig, name: str, recipe: Recipe = "paper", **changes: Any) -> None:
    """Trains a model by a recipe with changes; its checkpoint is `name`.npz."""
    tables = config.output / "drives"
    own = with_recipe(TrainingConfig(), recipe)
    run_train(Train(dataclasses.replace(
        own, data=tables / ("train.npz" if recipe == "paper" else "train_phases.npz"),
        lane=None if recipe == "paper" else tables / "train_lane_phases.npz",
        output=config.output / f"{name}.npz", validation=None, validation_lane=None, epochs=config.epochs,
        decay=own.decay ** (own.epochs / config.epochs), time_limit=UNLIMITED, seed=config.seed,
        threads=config.run_on.workers, **changes,
    )))  # fmt: skip


def stages(config: LadderConfig) -> list[Stage]:
    """All stages, in order."""
    tables = config.output / "drives"
    seed, run_on = config.seed, config.run_on
    driven = drives.DrivesConfig(seed, config.train, 0, config.held_out, wide=0, run_on=run_on, output=tables)
    lane = lane_drives.LaneDrivesConfig(seed, train=config.train, validation=0, run_on=run_on, output=tables)
    lane = dataclasses.replace(lane, checkpoint=config.output / f"{list(WINDOWS)[-1]}.npz")
    return [
        Stage("drives", partial(drives.main, driven)),
        *(Stage(name, partial(trained, config, name, **changes)) for name, changes in WINDOWS.items()),
        Stage("lane", partial(lane_drives.main, lane)),
        Stage("tasks", partial(trained, config, "tasks", "transfer", epoch_batches=STEPS_OF_AN_EPOCH)),
        Stage("quality", lambda: write_json(config.output / "quality.json", judged(config))),
    ]


def judged(config: LadderConfig) -> dict[str, Any]:
    """By model and samples adapted to, one entry a held-out vehicle: one-step RMS errors and median sizes of the errors
    after 2 s by state [4], and the share of one-step errors within 3 standard deviations; the nominal car's errors."""
    samples = load_samples(config.output / "drives" / "held_out.npz")
    splits = [split_vehicle(samples.of_vehicle(vehicle), max(POINTS)) for vehicle in np.unique(samples.vehicle)]

    def of_vehicles(found: list[dict[str, Any]]) -> dict[str, Any]:
        out = {"one_step": [entry["rms"] for entry in found]}
        out["two_seconds"] = [entry[f"rollout_{STEPS}"]["median"][:4] for entry in found]
        return out | {"within": [np.mean(entry["coverage"][2]) for entry in found if "coverage" in entry]}

    files: dict[str, Path | None] = {name: config.output / f"{name}.npz" for name in WHAT}
    car = NominalStepModel(load_model().vehicle)
    result: dict[str, Any] = {"nominal": of_vehicles([judge_stepper(car, [split], (STEPS,)) for split in splits])}
    for name, path in (files | {"shipped": None, "paper": paper_checkpoint()}).items():
        found = [quality_by_points(load_model(path), [split], POINTS, (STEPS,)) for split in splits]
        result[name] = {str(count): of_vehicles([entry[str(count)] for entry in found]) for count in POINTS}
    return result


def relative(found: dict[str, Any], other: dict[str, Any], error: str) -> str:
    """How many times as large an error is as another's on the same vehicle: geometric mean over vehicles and states,
    with its interval over vehicles (bootstrap, 95 %)."""
    logs = np.log(np.array(found[error]) / np.array(other[error])).mean(axis=1)
    low, high = np.exp(bootstrap(logs, lambda draws: draws.mean(axis=1)))
    return f"{np.exp(logs.mean()):.2f} ({low:.2f} to {high:.2f})"


def markdown(result: dict[str, Any]) -> str:
    """Each model's errors over the nominal car's, and after the last number of samples over those of the one before."""
    heads = [f"{what}, {count}" for what in ("one step", "2 s", "within 3 s.d.") for count in POINTS]
    heads += ["one step, over the one before", "2 s, over the one before"]
    rows = []
    errors, before = ("one_step", "two_seconds"), None
    for name, what in WHAT.items():
        found, last = result[name], result[name][str(max(POINTS))]
        cells = [relative(found[str(count)], result["nominal"], error) for error in errors for count in POINTS]
        cells += [f"{100.0 * np.mean(found[str(count)]['within']):.1f} %" for count in POINTS]
        cells += ["" if before is None else relative(last, before, error) for error in errors]
        rows.append((what, *cells))
        before = last
    return "\n".join(tabulated(("", *heads), rows))


def main(config: LadderConfig) -> None:
    """Does the stages that the folder lacks, and writes the report."""
    seconds = do_stages(config, stages(config))
    text = markdown(json.loads((config.output / "quality.json").read_text()))
    write_report(config.output, f"{text}\n\nSeconds: {', '.join(f'{k} {v:.0f}' for k, v in seconds.items())}.", config)
    print(text)


if __name__ == "__main__":
    run_command(main, LadderConfig, __doc__)
