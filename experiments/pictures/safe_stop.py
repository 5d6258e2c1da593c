"""A drift whose sideslip sensor falls silent for good: the last plan is followed, then the supervisor stops the car."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.loop.faults import parse_fault
from drift_drake.drive.reference.trajectory import Reference, figure_8
from drift_drake.view.style import BOUND, DEGREES
from experiments.pictures.drive_time_series import PANELS, panels
from experiments.pictures.look import for_pages

FAULTS = ("nan:2:100:0:beta", "spike:1:0.1:2:r")  # the sideslip from 2 s on, spikes of the yaw rate at 1 s
RATE = ("yaw rate r [deg/s]", "r", ("state", 0), DEGREES)
SHOWN = (PANELS[0], RATE, *PANELS[1:4])


def drive() -> tuple[pd.DataFrame, Reference]:
    """The log of the drive, and the reference that it follows."""
    car = VehicleParameters()
    reference = figure_8(car)
    loop = ClosedLoop(car, reference, NominalStepModel(car), faults=[parse_fault(text) for text in FAULTS])
    return loop.run(loop.initial_context(seed=1), RunLimits()).table, reference


@for_pages
def draw() -> Figure:
    """The panels, with the readings that were rejected, and the time in which the car is stopped."""
    log, reference = drive()
    figure = panels(log, reference, SHOWN)
    t = log["t"].to_numpy(dtype=float)
    rejected, stopping = t[log["reading"] > 0.0], t[log["stopping"] > 0.0]
    for axes in figure.axes:
        axes.axvspan(stopping[0], t[-1], color=BOUND, alpha=0.12, linewidth=0.0, label="being stopped")
        axes.plot(rejected, np.full(len(rejected), 0.03), "|", color=BOUND, markersize=5.0, label="reading rejected",
                  transform=axes.get_xaxis_transform())  # fmt: skip
    figure.legends[0].remove()
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, handlelength=1.6, columnspacing=1.0)
    return figure
