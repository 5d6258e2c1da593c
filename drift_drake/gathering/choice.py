"""Which model may drive a car at its limits: asked of the logs of its informative drives, before it drifts.

Both the learnt model and the car that the drives identify (`identified`) predict the drives half a second ahead, from
each fifth of a second. The identified car is believed where it predicts better than the learnt model, and no worse than
on nearly all cars that follow its equations (little more than the sensors' noise is left). The learnt model is believed
where it predicts no worse than on nearly all vehicles that it was made for (`Usual`). Where neither does, no
model knows the car: the learnt model's prior then adapts while it drives, since what a lane has taught it of such a car
leads it astray in a drift, and what its belief leaves over is taken for an offset.

A lane tells the learnt model of drifts what its training vehicles had in common. The nominal car's equations with
effects of the catalogue, fitted to the same drives, carry over from a lane to a drift for any car that follows them.
"""

import json
import math
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import t as student

from drift_drake.arrays import Array
from drift_drake.control.effects_step import EffectsStepModel
from drift_drake.estimation.windows import HORIZONS, WindowedRun, errors, forecast_error, windowed
from drift_drake.identification.identify import FURTHER, identify
from drift_drake.logs.table import COLUMNS, InvalidLogError, Run
from drift_drake.model.bayesian_step import BayesianStepModel
from drift_drake.model.checkpoint import BayesianModel
from drift_drake.model.command_lag import lagged_commands
from drift_drake.model.features import STATE_COUNT
from drift_drake.model.out_of_distribution import squared_distance
from drift_drake.model.posterior import Posterior
from drift_drake.model.quality import learn, predicted_windows
from drift_drake.model.samples import Samples
from drift_drake.run_folder import write_json
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters

# Beside the vehicle's own parameters: what a driven car may have that a step of its model can hold.
EFFECTS = (*FURTHER, "rolling_resistance", "drivetrain_friction", "differential_yaw_moment")
SHIPPED = "lane_trust.json"  # by the hash of a checkpoint's numbers
REFUSED = 0.005  # share of the training distribution's vehicles that are refused


class IdentifiedCar(NamedTuple):
    """A car as drives show it."""

    vehicle: VehicleParameters
    effects: Effects

    def step_model(self) -> EffectsStepModel:
        """What a controller plans with."""
        return EffectsStepModel(self.vehicle, self.effects)


def runs_of(tables: Sequence[pd.DataFrame]) -> list[Run]:
    """Drives' logs at 100 Hz as runs of the log format."""
    columns: list[dict[str, Any]] = [
        {name: table[name].to_numpy() for name in COLUMNS if name in table} for table in tables
    ]
    return [Run(name=f"drive_{k}", **found) for k, found in enumerate(columns)]


def identified(runs: Sequence[Run], first_guess: VehicleParameters) -> IdentifiedCar | None:
    """The car that fits the drives best, by the filter's likelihood; None where they are too short or the filter fails.

    Nothing is believed known but the equations: masses, inertias, stiffnesses, friction and the drive's gain have
    broad priors, and the effects that a driven car may have are fitted with them (`identify`).
    """
    try:
        found = identify(runs, first_guess, known=(), names=EFFECTS, criterion="likelihood")
    except (InvalidLogError, np.linalg.LinAlgError):
        return None
    return IdentifiedCar(found.vehicle, found.effects)


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


def learnt_errors(model: BayesianStepModel, runs: Sequence[WindowedRun]) -> Array:
    """Errors of the learnt model's predictions [windows, HORIZONS, 4], each from a smoothed measurement on."""
    return np.concatenate([_run_errors(model, run) for run in runs])


def _run_errors(model: BayesianStepModel, run: WindowedRun) -> Array:
    commands = np.stack([run.delta, run.tau], axis=1)
    lagged = lagged_commands(run.period * np.arange(len(commands)), commands)
    x = np.concatenate([run.start_y[run.starts, :STATE_COUNT], np.zeros((len(run.starts), 2)), lagged[run.starts]], 1)
    out = np.empty((len(x), HORIZONS, STATE_COUNT))
    for h, ahead in enumerate(predicted_windows(model, x, commands, run.starts, run.stride_rows, HORIZONS)):
        out[:, h] = run.y[run.starts + (h + 1) * run.stride_rows, :STATE_COUNT] - ahead[:, :STATE_COUNT]
    return out


def forecasts(model: BayesianStepModel, car: IdentifiedCar | None, runs: Sequence[Run]) -> tuple[float, float]:
    """The forecast errors of both models on the drives.

    Args:
        model: with what it has learnt of the drives; car: identified from them; none: its error is infinite.
    """
    judged = [windowed(run) for run in runs]
    other = float("inf") if car is None else forecast_error(errors(judged, car.vehicle.constants(), car.effects))
    return forecast_error(learnt_errors(model, judged)), other


class Familiar(NamedTuple):
    """What a statistic of informative drives is on vehicles that the model was made for: its logarithm, normal.

    Measured on validation vehicles (`experiments.gathering.lane_trust`), and shipped with the model.
    """

    mean: float
    deviation: float
    vehicles: int

    def limit(self, refused: float = REFUSED) -> float:
        """What a further such vehicle exceeds with a probability `refused`."""
        quantile = float(student.isf(refused, self.vehicles - 1))
        return math.exp(self.mean + quantile * self.deviation * math.sqrt(1.0 + 1.0 / self.vehicles))


class Usual(NamedTuple):
    """What is usual for a model."""

    surprise: Familiar  # mean squared distance of the first informative drive
    learnt: Familiar  # `windows.forecast_error` of the model after two
    identified: Familiar  # the same of the car that these two identify

    def choice(self, forecasts: tuple[float, float]) -> Choice:
        """Which model is believed, by `forecasts` on a car's drives."""
        return Choice(*forecasts, self.learnt.limit(), self.identified.limit())


def squared_distances(model: BayesianModel, belief: Posterior, samples: Samples) -> Array:
    """Squared Mahalanobis distances [n] of a drive's samples, each by the belief that has learnt those before it."""
    out = np.empty(len(samples.vehicle))
    for i in range(len(out)):
        out[i] = squared_distance(model, belief, samples.x[i], samples.u[i], samples.u_next[i], samples.x_next[i])
        belief = learn(model, belief, samples.where(np.array([i])))
    return out


def familiar_from(values: Array) -> Familiar:
    """From a statistic's values [vehicles] on vehicles in distribution.

    Raises:
        ValueError: fewer than three vehicles.
    """
    if len(values) < 3:
        raise ValueError(f"{len(values)} vehicles are too few to say what is usual; give three or more")
    logs = np.log(values)
    return Familiar(float(logs.mean()), float(logs.std(ddof=1)), len(logs))


def usual_for(model: BayesianModel, path: Path | None = None) -> Usual | None:
    """What is usual for a model, as measured before; None for a model that nobody has asked this of."""
    source = path or Path(str(files("drift_drake") / "data" / SHIPPED))
    stored = json.loads(source.read_text()) if source.is_file() else {}
    found = stored.get(model.content_hash())
    return None if found is None else Usual(**{name: Familiar(**values) for name, values in found.items()})


def keep_usual(model: BayesianModel, usual: Usual, path: Path) -> None:
    """Adds what is usual for a model to a file of such."""
    stored = json.loads(path.read_text()) if path.is_file() else {}
    write_json(path, stored | {model.content_hash(): {name: one._asdict() for name, one in usual._asdict().items()}})
