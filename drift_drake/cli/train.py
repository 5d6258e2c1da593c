"""`drift-drake train`: the Bayesian vehicle model, meta-trained."""

import dataclasses
from pathlib import Path

import tyro

from drift_drake.common.errors import MissingExtraError
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import said_to, write_results
from drift_drake.drive.learnt.training_config import Recipe, TrainingConfig, check_training, with_recipe


@dataclasses.dataclass(frozen=True)
class Train:
    """Meta-train the Bayesian vehicle model on drives made by `python -m experiments.model.drives`.

    drift-drake train --output model.npz --seed 1
    """

    config: tyro.conf.OmitArgPrefixes[TrainingConfig] = dataclasses.field(default_factory=TrainingConfig)
    recipe: Recipe = "transfer"
    """What is minimised: errors in drifts after a context of other samples (transfer), the paper's objective over
    windows of mixed lengths (windows), all of the paper's recipe (paper), or errors of a network that never adapts
    (fixed)."""
    json: Path | None = None
    """Where to write the checkpoint's name and its training's record as JSON (-: standard output)."""


def run_train(command: Train) -> None:
    try:
        with ended_at_once():
            from drift_drake.drive.learnt.meta_training import train
    except ModuleNotFoundError as error:
        if error.name != "torch":
            raise
        raise MissingExtraError("training", "torch", "train") from None
    config = with_recipe(command.config, command.recipe)
    check_training(config)
    tables = (config.data, config.validation, config.lane, config.validation_lane, config.start, config.vehicle)
    outputs = {"--output": config.output, "--json": command.json}
    try_outputs(outputs, [table for table in tables if table is not None])
    model = train(config)
    print(f"{config.output}: {model.record['epochs']} epochs in {model.record['seconds']:.0f} s",
          file=said_to(command.json))  # fmt: skip
    write_results(command.json, {"out": config.output, "record": model.record})
