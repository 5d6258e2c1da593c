"""The figure-8 of 24 held-out vehicles with four models in the controller, one panel a model."""

from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from drift_drake.car.parameters import VehicleParameters
from experiments.drifting import figure_8
from experiments.drifting.report import overhead_of, pictured_models, pictured_vehicle
from experiments.drifting.runs import Model, ModelsConfig, reference
from experiments.pictures.look import WIDTH, for_pages
from experiments.pictures.overhead_panels import plain_panels

MODELS: tuple[Model, ...] = ("nominal", "once_ocp", "twice_info", "oracle")
FOLDER = Path("runs/figure_8_picture")
HELD_OUT = 46029  # seed of the vehicles of docs/results.md


def draw(source: Path | None = None) -> Figure:
    """The panels.

    Args:
        source: a folder of `experiments.drifting.figure_8` with these models; without, the drives that
            `runs/figure_8_picture` lacks are made, which takes half an hour of CPU.
    """
    if source is None:
        figure_8.main(ModelsConfig(vehicle_seed=HELD_OUT, vehicles=24, noise_seeds=1, models=MODELS, out=FOLDER))
    return panels(source or FOLDER)


@for_pages
def panels(folder: Path) -> Figure:
    """The panels of the runs of a folder."""
    runs = pd.read_csv(folder / "runs.csv")
    runs = runs[runs["model"].isin(MODELS)]
    panels = overhead_of(folder, runs, pictured_vehicle(runs, pictured_models(runs, MODELS)))
    return plain_panels(panels, reference("figure_8"), VehicleParameters(), WIDTH, 1)
