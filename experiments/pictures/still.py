"""A moment of the figure-8 in three dimensions: one held-out vehicle with four models in the controller.

Drake's renderer needs OpenGL (Mesa's does, without a screen).
"""

from pathlib import Path

from matplotlib.figure import Figure

from drift_drake.car.parameters import VehicleParameters
from experiments.drifting import figure_8
from experiments.drifting.runs import Model, ModelsConfig, reference
from experiments.drifting.still import StillConfig, read_runs
from experiments.pictures.figure_8 import HELD_OUT
from experiments.pictures.rendered import still

MODELS: tuple[Model, ...] = ("twice_info", "nominal", "prior", "oracle")  # the first is drawn solid
VEHICLE = 0  # of the held-out ones: the nominal car of the controller spins there
FOLDER = Path("runs/still_picture")
TIME = 20.8  # [s] since the start
SIZE = (4.0, 2.5)  # [in]: its letters are readable where it is 390 px wide


def draw(source: Path | None = None) -> Figure:
    """A moment at which the others have left the car behind that has spun.

    Args:
        source: a folder of `experiments.drifting.figure_8` with these models of this vehicle; without, the drives that
            `runs/still_picture` lacks are made, which takes some minutes.
    """
    if source is None:
        figure_8.main(
            ModelsConfig(vehicle_seed=HELD_OUT, first=VEHICLE, vehicles=1, noise_seeds=1, models=MODELS, out=FOLDER)
        )
    config = StillConfig(source or FOLDER, VEHICLE, MODELS)
    runs = read_runs(config)
    return still(runs, TIME, reference("figure_8"), VehicleParameters(), config.distance, SIZE)
