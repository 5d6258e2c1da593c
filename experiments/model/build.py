"""Makes the learnt model from nothing: drives, rounds of lane drives, and the training after each.

    python -m experiments.model.build --output runs/model

1. `drives`: the training vehicles' drives, and the validation and held-out vehicles' (`experiments.model.drives`).
2. `plain`: one plain training on windows of these. It plans the first round of lane drives; nothing else is left of it.
3. `lane_K`: lane drives of every vehicle, planned by the model so far (`experiments.gathering.lane_drives`).
4. `model_K`: meta-training on all drives (`drift-drake train`); after the first round from where the last one ended.
5. `quality`: compared with the shipped model on held-out vehicles (`experiments.model.quality`).

What is done is listed in build.json with its seconds and is not done again: start again to go on. The same seed gives
the same numbers on the same machine and library versions; elsewhere torch's sums round otherwise: compare the quality.
"""

import dataclasses
import json
import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from diagrams.command import run_command
from drift_drake.cli.train import Train, run_train
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.run_folder import is_done, write_json, write_versions
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.training_config import Recipe, TrainingConfig
from experiments.gathering import lane_drives
from experiments.made import SpreadConfig
from experiments.model import drives, quality

POINTS = "100"  # that the models that are compared have adapted to
STATES = ("r", "v", "beta", "omega_r")
UNLIMITED = 1e9  # [s] a limit of time would make the model depend on the machine


@dataclasses.dataclass(frozen=True)
class BuildConfig(SpreadConfig):
    """How large a model is made.

    A cluster's machines must share the output folder; torch takes as many threads as there are workers.
    """

    output: Path = Path("runs/model")
    """Run folder; one that holds some stages of the same build is gone on with."""
    seed: int = 0
    train: int = 360
    """Vehicles to train on."""
    validation: int = 20
    held_out: int = 20
    samples: int = 325
    """Of a vehicle, at 10 Hz."""
    rounds: int = 2
    """Of lane drives, each planned by the model that the rounds before have trained."""
    plain_epochs: int = 300
    first_epochs: int = 1200
    later_epochs: int = 420


class OtherBuildError(DriftDrakeError, ValueError):
    """A folder that holds another build; the message names it and what differs."""


@dataclasses.dataclass(frozen=True)
class Stage:
    """A part of the build that is done as a whole."""

    name: str
    work: Callable[[], Any]


def stages(config: BuildConfig) -> list[Stage]:
    """All stages, in order."""
    table = config.output / "drives"
    plain = config.output / "plain.npz"
    vehicles = {"train": config.train, "validation": config.validation}

    def drive() -> None:
        drives.main(drives.DrivesConfig(
            config.seed, held_out=config.held_out, wide=config.held_out, samples=config.samples, run_on=config.run_on,
            output=table, **vehicles,
        ))  # fmt: skip

    def trained(output: Path, recipe: Recipe = "transfer", **changes: Any) -> None:
        lanes = {"lane": table / "train_lane_phases.npz", "validation_lane": table / "validation_lane.npz"}
        tables: dict[str, Any] = {"data": table / "train_phases.npz", "validation": table / "validation.npz"}
        tables |= lanes if recipe == "transfer" else {"lane": None, "validation_lane": None}
        options = tables | {
            "output": output,
            "time_limit": UNLIMITED,
            "seed": config.seed,
            "threads": config.run_on.workers,
        }
        run_train(Train(TrainingConfig(**(options | changes)), recipe))

    before, trained_plainly = plain, partial(trained, plain, "windows", epochs=config.plain_epochs)
    out = [Stage("drives", drive), Stage("plain", trained_plainly)]
    for k in range(config.rounds):
        lane = lane_drives.LaneDrivesConfig(
            config.seed, round=k, checkpoint=before, run_on=config.run_on, output=table, **vehicles
        )
        first = {"epochs": config.first_epochs}
        later = {"epochs": config.later_epochs, "start": before, "learning_rate": 1e-3, "decay": 0.9925}
        model = config.output / f"model_{k}.npz"
        out += [
            Stage(f"lane_{k}", partial(lane_drives.main, lane)),
            Stage(f"model_{k}", partial(trained, model, **(later if k else first))),
        ]
        before = model
    return [*out, Stage("quality", lambda: write_json(config.output / "quality.json", compared(config, before)))]


def compared(config: BuildConfig, made: Path) -> dict[str, Any]:
    """Held-out one-step RMS errors by state after 100 samples, of the made and the shipped model, and their ratio."""
    out: dict[str, Any] = {"hash": load_model(made).content_hash(), "shipped_hash": load_model().content_hash()}
    for name, model in (("made", made), ("shipped", None)):
        found = quality.run(quality.QualityConfig(drives=config.output / "drives", model=model, plain=None, fixed=None))
        out[name] = dict(zip(STATES, found["held_out"]["Bayesian"][POINTS]["rms"], strict=True))
    out["ratio"] = {state: out["made"][state] / out["shipped"][state] for state in STATES}
    return out


def do_stages(config: Any, todo: Sequence[Stage]) -> dict[str, float]:
    """Does the stages that the folder `config.output` lacks; the seconds of each.

    Args:
        config: dataclass of what is made, all but its `output` and `run_on` the same whenever it is gone on with.

    Raises:
        OtherBuildError: the folder holds another build.
    """
    path = config.output / "build.json"
    asked = {key: value for key, value in dataclasses.asdict(config).items() if key not in ("output", "run_on")}
    asked = {key: str(value) if isinstance(value, Path) else value for key, value in asked.items()}
    record = json.loads(path.read_text()) if is_done(path) else {"config": asked, "seconds": {}}
    differ = [key for key, value in asked.items() if record["config"].get(key) != value]
    if differ:
        raise OtherBuildError(f"{config.output} holds a build with another {', '.join(differ)}; give another --output")
    config.output.mkdir(parents=True, exist_ok=True)
    write_versions(config.output)
    for number, stage in enumerate(todo):
        if stage.name in record["seconds"]:
            continue
        print(f"{stage.name}, {number + 1} of {len(todo)}", flush=True)
        began = time.monotonic()
        stage.work()
        record["seconds"][stage.name] = time.monotonic() - began
        write_json(path, record)
    return dict(record["seconds"])


def main(config: BuildConfig) -> None:
    """Does the stages that the folder lacks.

    Raises:
        OtherBuildError: the folder holds another build, or none can be made.
    """
    if config.rounds < 1:
        raise OtherBuildError(f"--rounds {config.rounds}: give 1 or more; without lane drives a model learns no drift")
    seconds = do_stages(config, stages(config))
    result = json.loads((config.output / "quality.json").read_text())
    ratios = ", ".join(f"{state} {ratio:.2f}" for state, ratio in result["ratio"].items() if math.isfinite(ratio))
    hours = sum(seconds.values()) / 3600.0
    print(f"{config.output / f'model_{config.rounds - 1}.npz'}: made in {hours:.2f} h; one-step errors on held-out "
          f"vehicles over the shipped model's: {ratios}")  # fmt: skip


if __name__ == "__main__":
    run_command(main, BuildConfig, __doc__)
