"""A moment of the figure-8 in three dimensions: runs of `figure_8` or `loops` on one vehicle, side by side.

    python -m experiments.drifting.still FOLDER --vehicle 9 --out still.png

Drake's renderer needs OpenGL (Mesa's does, without a screen).
"""

import dataclasses
from pathlib import Path
from typing import Literal

import pandas as pd
import tyro

from diagrams.command import run_command
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import DriftDrakeError
from drift_drake.view.style import save
from experiments.drifting.report import LABELS
from experiments.drifting.runs import reference, run_name
from experiments.pictures.rendered import still


class MissingRunError(DriftDrakeError, FileNotFoundError):
    """A run that is not in the folder."""


@dataclasses.dataclass(frozen=True)
class StillConfig:
    """Which runs, and when."""

    folder: tyro.conf.Positional[Path]
    """That the experiment wrote."""
    vehicle: int = 0
    models: tuple[str, ...] = ("twice_info", "nominal", "prior", "oracle")
    """The first is drawn solid."""
    attempt: int = 0
    time: float | None = None
    """[s] since the start; the end of the first run to end without."""
    reference: Literal["figure_8", "loops"] = "figure_8"
    distance: float = 32.0
    """[m] from the cars to the camera; 0 sees all of the reference."""
    out: Path = Path("still.png")


def read_runs(config: StillConfig) -> dict[str, pd.DataFrame]:
    """The runs by model.

    Raises:
        MissingRunError: names the run that is not there.
    """
    runs = {}
    for model in config.models:
        path = config.folder / f"{run_name(model, config.vehicle, config.attempt)}.csv"
        if not path.exists():
            raise MissingRunError(f"{path}: no such run; give --models, --vehicle and --attempt of the experiment's")
        runs[LABELS.get(model, model)] = pd.read_csv(path)
    return runs


def main(config: StillConfig) -> None:
    """Draws the picture."""
    runs = read_runs(config)
    ends = {name: float(run["t"].iloc[-1]) for name, run in runs.items()}
    time = min(ends.values()) if config.time is None else config.time
    figure = still(runs, time, reference(config.reference), VehicleParameters(), config.distance or None)
    print(save(figure, config.out))


if __name__ == "__main__":
    run_command(main, StillConfig, __doc__)
