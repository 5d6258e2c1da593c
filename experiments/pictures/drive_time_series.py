"""Time series of a drive: the first half of a figure-8 drifted by a car whose tyres the controller has to learn."""

from collections.abc import Sequence

import pandas as pd
from matplotlib.figure import Figure

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.reference.trajectory import Reference, figure_8
from drift_drake.view.colours import INK
from drift_drake.view.style import BOUND, DEGREES, KMH, TRANSITION, new_figure
from experiments.pictures.look import BLUE, WIDTH, for_pages

HEIGHT = 6.4  # [in]
EFFECTS = {"friction_level": -0.05, "front_stiffness_error": 0.15, "steering_lag": 0.05}
SHARE = 0.6  # of the reference's duration that is driven
Panel = tuple[str, str, tuple[str, int] | None, float]
LOCK = VehicleParameters().steering_limit  # [rad]
PANELS: tuple[
    Panel, ...
] = (  # title, column of the log, number of the reference's state or input, factor to the title's unit
    ("sideslip β [deg]", "beta", ("state", 2), DEGREES),
    ("speed v [km/h]", "v", ("state", 1), KMH),
    ("lateral error e [m]", "e", None, 1.0),
    ("road-wheel angle δ [deg]", "delta", ("input", 0), DEGREES),
    ("engine torque τ [N m]", "tau", ("input", 1), 1.0),
)


def drive(share: float = SHARE) -> tuple[pd.DataFrame, Reference]:
    """The log of the drive, and the reference that it follows."""
    car, learnt = VehicleParameters(), load_model()
    reference = figure_8(car)
    loop = ClosedLoop(car, reference, step_model(learnt, learnt.prior()), adapter=BayesianAdapter(learnt),
                      effects=make_effects(EFFECTS))  # fmt: skip
    run = loop.run(loop.initial_context(seed=1), RunLimits(time_factor=share))
    return run.table, reference


@for_pages
def draw(share: float = SHARE) -> Figure:
    """The panels, one above the other."""
    return panels(*drive(share), PANELS)


def panels(log: pd.DataFrame, reference: Reference, wanted: Sequence[Panel]) -> Figure:
    """A log's columns over time, one above the other, with their references; transitions in grey."""
    t, s = log["t"].to_numpy(dtype=float), log["s"].to_numpy(dtype=float)
    of_reference = {"state": reference.state(s), "input": reference.input(s)}
    inside = reference.transition(s)
    figure = new_figure(WIDTH, HEIGHT)
    grid = figure.subplots(len(wanted), 1, sharex=True)
    for axes, (title, column, place, factor) in zip(grid, wanted, strict=True):
        axes.fill_between(t, 0.0, 1.0, where=inside, color=TRANSITION, linewidth=0.0, zorder=0.5,
                          transform=axes.get_xaxis_transform(), label="transition")  # fmt: skip
        axes.plot(t, log[column] * factor, color=BLUE, label="car")
        if place is None:
            axes.axhline(0.0, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
        else:
            axes.plot(t, of_reference[place[0]][:, place[1]] * factor, color=INK, linewidth=1.0,
                      linestyle=(0, (4, 3)), label="reference")  # fmt: skip
        if column == "delta":
            for bound in (-LOCK, LOCK):
                axes.axhline(bound * factor, color=BOUND, linewidth=1.0)
        axes.set_title(title)
        axes.margins(x=0.0)
        axes.locator_params(axis="y", nbins=4)
    grid[-1].set_xlabel("time [s]")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, handlelength=1.6)
    return figure
