"""Which model may drive a car at its limits: asked of the logs of its informative drives, before it drifts.

Both the learnt model and the car that the drives identify (`identified`) predict the drives half a second ahead, from
each fifth of a second. The identified car is believed where it predicts better than the learnt model, and no worse than
on nearly all cars that follow its equations (little more than the sensors' noise is left). The learnt model is believed
where it predicts no worse than on nearly all vehicles that it was made for (`trust.Usual`). Where neither does, no
model knows the car: the learnt model's prior then adapts while it drives, since what a lane has taught it of such a car
leads it astray in a drift, and what its belief leaves over is taken for an offset.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from drift_drake.arrays import Array
from drift_drake.estimation.windows import HORIZONS, WindowedRun, errors, forecast_error, windowed
from drift_drake.gathering.identified import IdentifiedCar
from drift_drake.logs.table import Run
from drift_drake.model.bayesian_step import BayesianStepModel
from drift_drake.model.command_lag import lagged_commands
from drift_drake.model.features import STATE_COUNT

Believed = Literal["learnt", "identified", "neither"]


class Choice(NamedTuple):
    """How far off half a second ahead two models of a car are (`forecast_error`), and what is usual."""

    learnt: float
    identified: float  # infinite where no car was identified
    learnt_limit: float
    identified_limit: float

    @property
    def believed(self) -> Believed:
        """Which of them knows the car."""
        if self.identified <= min(self.learnt, self.identified_limit):
            return "identified"
        return "learnt" if self.learnt <= self.learnt_limit else "neither"

    def sentence(self) -> str:
        """What follows from it."""
        follows = {
            "learnt": "drive with the learnt model",
            "identified": "drive with the identified car",
            "neither": "no model knows this car: let the learnt one adapt with an offset as it drives, or gather more",
        }
        limits = f"as a rule at most {self.learnt_limit:.3f}", f"as a rule at most {self.identified_limit:.3f}"
        return (
            f"{follows[self.believed]}: forecast errors half a second ahead are {self.learnt:.3f} for the learnt model "
            f"({limits[0]}) and {self.identified:.3f} for the identified car ({limits[1]})"
        )


def windows(runs: Sequence[Run]) -> list[WindowedRun]:
    """The drives as windows of half a second."""
    return [windowed(run) for run in runs]


def learnt_errors(model: BayesianStepModel, runs: Sequence[WindowedRun]) -> Array:
    """Errors of the learnt model's predictions [windows, HORIZONS, 4], each from a smoothed measurement on."""
    return np.concatenate([_run_errors(model, run) for run in runs])


def _run_errors(model: BayesianStepModel, run: WindowedRun) -> Array:
    commands = np.stack([run.delta, run.tau], axis=1)
    lagged = lagged_commands(run.period * np.arange(len(commands)), commands)
    x = np.concatenate([run.start_y[run.starts, :STATE_COUNT], np.zeros((len(run.starts), 2)), lagged[run.starts]], 1)
    out, straight = np.empty((len(x), HORIZONS, STATE_COUNT)), np.zeros(len(x))
    for h in range(HORIZONS):
        start, end = (run.starts + k * run.stride_rows for k in (h, h + 1))
        x = model.step(x, commands[start], commands[end], straight)
        out[:, h] = run.y[end, :STATE_COUNT] - x[:, :STATE_COUNT]
    return out


def identified_errors(car: IdentifiedCar, runs: Sequence[WindowedRun]) -> Array:
    """Errors of the identified car's predictions [windows, HORIZONS, 5]."""
    return errors(runs, car.vehicle.constants(), car.effects)


def forecasts(model: BayesianStepModel, car: IdentifiedCar | None, runs: Sequence[Run]) -> tuple[float, float]:
    """The forecast errors of both models on the drives.

    Args:
        model: with what it has learnt of the drives; car: identified from them; none: its error is infinite.
    """
    judged = windows(runs)
    other = float("inf") if car is None else forecast_error(identified_errors(car, judged))
    return forecast_error(learnt_errors(model, judged)), other
