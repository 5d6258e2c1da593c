"""Predictions half a second ahead before and after learning: the learnt model on an unknown car's log."""

import dataclasses

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from drift_drake.car.log.table import Run, read_run
from drift_drake.cli.demo import SAMPLE_LOG
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.learnt.quality import learn, predicted_windows, step_model
from drift_drake.drive.learnt.samples import samples_from_log
from drift_drake.view.colours import CARS, INK
from drift_drake.view.style import DEGREES, TRANSITION, new_figure
from experiments.pictures.look import WIDTH, for_pages

HEIGHT = 5.6  # [in]
RUN = "run_3"  # of the package's sample log: a drift
SECONDS = 4.0  # that are learnt from
STEP, STEPS = 10, 5  # rows a step of the model (0.1 s), steps ahead
PANELS = (("yaw rate r", "deg/s", 0, DEGREES), ("rear rim speed ω", "m/s", 3, 1.0))
"""Title, unit, place in the state and factor to the unit."""
COLUMNS = ("t", "r", "v", "beta", "omega_r", "delta_cmd", "tau_cmd")


@dataclasses.dataclass(frozen=True)
class Predictions:
    """Times [n] of what is predicted, the measured states there [n, 4] (r, v, beta, omega_r in SI), and the predicted
    ones before and after learning."""

    t: Array
    measured: Array
    before: Array
    after: Array

    def rms(self, predicted: Array) -> Array:
        """Errors by state [4] of what was not learnt from: a prediction starts half a second earlier."""
        later = self.t - 0.1 * STEPS >= SECONDS
        return np.asarray(np.sqrt(np.mean((predicted - self.measured)[later] ** 2, axis=0)))


def table(run: Run) -> pd.DataFrame:
    """A run as samples are made of; the position relative to a path does not matter."""
    return pd.DataFrame({name: run.column(name) for name in COLUMNS}).assign(e=0.0, dphi=0.0, s=0.0)


def ahead(model: BayesianModel, belief: Posterior, rows: pd.DataFrame) -> tuple[np.ndarray, Array]:
    """Row numbers and states [n, 4] half a second after each start, every fifth of a second."""
    u = rows[["delta_cmd", "tau_cmd"]].to_numpy()
    states = rows[["r", "v", "beta", "omega_r", "e", "dphi"]].to_numpy()
    x = np.concatenate([states, lagged_commands(rows["t"].to_numpy(), u)], axis=1)
    starts = np.arange(20, len(x) - STEP * STEPS, 20)
    *_, last = predicted_windows(step_model(model, belief), x[starts], u, starts, STEP, STEPS)
    return starts + STEP * STEPS, last[:, :4]


def predictions() -> Predictions:
    """Of the run, by the prior and by the belief after its first seconds."""
    model, rows = load_model(), table(read_run(str(SAMPLE_LOG / f"{RUN}.csv.gz")))
    taught = samples_from_log(rows[rows["t"] <= SECONDS], None, 0, 0)
    at, before = ahead(model, model.prior(), rows)
    _, after = ahead(model, learn(model, model.prior(), taught), rows)
    measured = rows[["r", "v", "beta", "omega_r"]].to_numpy()[at]
    return Predictions(rows["t"].to_numpy()[at], measured, before, after)


@for_pages
def draw() -> Figure:
    """Measured and predicted yaw rate and rim speed, with the errors in the titles."""
    found = predictions()
    figure = new_figure(WIDTH, HEIGHT)
    grid = figure.subplots(len(PANELS), 1, sharex=True)
    later = found.t - 0.1 * STEPS >= SECONDS
    for axes, (title, unit, place, factor) in zip(grid, PANELS, strict=True):
        axes.axvspan(0.0, SECONDS, color=TRANSITION, linewidth=0.0, zorder=0.5, label=f"learnt from: {SECONDS:.0f} s")
        axes.plot(found.t, found.measured[:, place] * factor, color=INK, linewidth=4.5, alpha=0.35, label="measured")
        for states, shown, label, colour in (
            (found.before, found.t > 0.0, "predicted before", CARS["nominal"]),
            (found.after, later, "predicted after", CARS["corrected"]),
        ):
            axes.plot(found.t[shown], states[shown, place] * factor, "o-", color=colour, markersize=3.5,
                      linewidth=1.2, label=label)  # fmt: skip
        before, after = (found.rms(states)[place] * factor for states in (found.before, found.after))
        axes.set_title(f"{title} [{unit}]\nRMS error {before:.2g} before, {after:.2g} after")
        axes.margins(x=0.0)
    grid[-1].set_xlabel("time [s]")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, handlelength=1.6)
    return figure
