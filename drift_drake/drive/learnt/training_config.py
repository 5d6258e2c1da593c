"""What a meta-training run is asked to do; free of torch, so that the command line can show it without."""

import dataclasses
import math
from pathlib import Path
from typing import Any, Literal

from drift_drake.common.errors import InvalidOptionError, shown

Recipe = Literal["transfer", "windows", "paper", "fixed"]

LANE_ROUND = 8  # drives of a vehicle in a round of lane drives; the first follow each other as gathering's do


@dataclasses.dataclass(frozen=True)
class TrainingConfig:
    """Meta-train the features, the prior and the noise of the Bayesian vehicle model.

    By default the objective is over tasks: after a context of a vehicle's samples (lane drives, some drifting, or
    nothing) the model predicts other samples of its drifts (see `transfer_objective`). The paper's objective is over
    windows of consecutive samples.
    """

    data: Path = Path("runs/drives/train_phases.npz")
    """Table of samples of the training vehicles, made by `experiments.model.drives`."""
    output: Path = Path("runs/bayesian_model.npz")
    """Checkpoint to write."""
    validation: Path | None = Path("runs/drives/validation.npz")
    """Table of the validation vehicles: recorded, and used to choose the weight of a sample; never trained on."""
    lane: Path | None = Path("runs/drives/train_lane_phases.npz")
    """The same vehicles' lane drives, by `experiments.gathering.lane_drives`; without, windows are the objective."""
    validation_lane: Path | None = Path("runs/drives/validation_lane.npz")
    """Lane drives of the validation vehicles."""
    start: Path | None = None
    """Checkpoint to start from; random weights if not given."""
    epoch_batches: int = 25
    """Gradient steps of an epoch, where tasks are the objective."""
    batch_tasks: int = 32
    """Tasks of a gradient step."""
    gradient_clip: float | None = 10.0
    """Largest norm of a gradient step."""
    horizons: tuple[int, ...] = (10, 20, 50, 100, 200, 325)
    """Lengths of windows [samples]; each epoch draws one."""
    shuffled_share: float = 0.3
    """Share of epochs whose windows take a vehicle's samples in random order, across its drives."""
    epoch_samples: int | None = 22_750
    """Samples of a larger table that an epoch draws; if not given, all."""
    temper: bool = True
    """Choose the weight of a sample in the posterior on the validation vehicles; otherwise it is 1."""
    physical_inputs: bool = True
    """Give the network the slips and forces of the nominal car's tyres in addition to z, and the actuators' states."""
    tyres: bool = True
    """Without it, the physical inputs are the actuators' states (lagged commands) alone."""
    coupled: bool = False
    """Couple the weights of all four states in one prior for windows too, as tasks always do."""
    adaptive: bool = True
    """Without it, a network of the same size that never adapts."""
    epochs: int = 1200
    """Number of epochs."""
    learning_rate: float = 2e-3
    """Learning rate of Adam at the start."""
    decay: float = 0.9971
    """Factor on the learning rate after each epoch."""
    batch: int = 2048
    """Samples per gradient step."""
    weight_decay: float = 0.03
    """Decay of the network's weights (decoupled, as in AdamW)."""
    time_limit: float = 2400.0
    """Time of the whole training [s]; what has been reached by then is written."""
    stop_at: float | None = None
    """Stop once the validation vehicles' objective is at or below this."""
    threads: int = 2
    """Threads of torch."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to train; auto: on a GPU where torch finds one."""
    seed: int = 0
    """Seed of the first weights and of the windows."""
    vehicle: Path | None = None
    """Vehicle file of the nominal car inside the model; the default car without."""


def with_recipe(config: TrainingConfig, recipe: Recipe) -> TrainingConfig:
    """The configuration of a recipe.

    "transfer" is the configuration as it stands. "windows" has the paper's inputs (z alone) and objective, over windows
    of mixed lengths, up to all of a vehicle's samples with its drives in random order, and chooses the weight of a
    sample on the validation vehicles. "paper" is the paper's plain recipe: windows of 10 samples in the order driven,
    1000 epochs of Adam at 1e-3 with a decay of 0.9975, every sample at full weight (give it the table of every tenth
    row, train.npz). "fixed" is "windows" without adaptation. What the configuration has other than its defaults stays.

    Raises:
        InvalidOptionError: lane drives for a recipe whose objective is over windows.
    """
    if recipe == "transfer":
        return config
    default = TrainingConfig()
    if config.lane not in (None, default.lane):
        raise InvalidOptionError(f"--lane {config.lane}: --recipe {recipe} has no lane drives; leave one of both out")
    changes: dict[str, Any] = {
        "lane": None, "physical_inputs": False, "learning_rate": 1e-3, "decay": 0.9975, "gradient_clip": None,
    }  # fmt: skip
    if recipe == "paper":
        changes |= {"horizons": (10,), "shuffled_share": 0.0, "weight_decay": 0.0, "epochs": 1000}
        changes |= {"epoch_samples": None, "temper": False}
    elif recipe == "fixed":
        changes |= {"adaptive": False, "temper": False}
    given = {name for name in changes if name != "lane" and getattr(config, name) != getattr(default, name)}
    return dataclasses.replace(config, **{name: value for name, value in changes.items() if name not in given})


def check_training(config: TrainingConfig) -> None:
    """Raises InvalidOptionError, which names the option and its range, where a configuration cannot be trained with."""
    for name in ("epoch_batches", "batch_tasks", "epochs", "batch", "threads"):
        if getattr(config, name) < 1:
            raise InvalidOptionError(f"--{name.replace('_', '-')} {getattr(config, name)}: give 1 or more")
    if config.epoch_samples is not None and config.epoch_samples < 1:
        raise InvalidOptionError(f"--epoch-samples {config.epoch_samples}: give 1 or more, or None for all")
    if not config.horizons or min(config.horizons) < 1:
        raise InvalidOptionError(f"--horizons {shown(config.horizons)}: give windows of 1 sample or more")
    if config.seed < 0:
        raise InvalidOptionError(f"--seed {config.seed}: give 0 or more")
    ranges = {
        "gradient_clip": (0.0, math.inf), "shuffled_share": (-1e-12, 1.0), "learning_rate": (0.0, 1e3),
        "decay": (0.0, 1.0), "weight_decay": (-1e-12, 1e3), "time_limit": (0.0, math.inf),
    }  # fmt: skip
    for name, (low, high) in ranges.items():
        value = getattr(config, name)
        if value is not None and not low < value <= high:
            raise InvalidOptionError(
                f"--{name.replace('_', '-')} {value:g}: give a number above {low:.0f}, up to {high:g}"
            )
