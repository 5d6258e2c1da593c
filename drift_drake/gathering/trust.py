"""May the learnt model be trusted on this car? Asked of the log of its first informative drive, before it drifts.

Each sample is predicted by what the belief has learnt from those before it. The mean squared Mahalanobis distance of
the innovations over the drive is compared with what vehicles of the training distribution give: log-normal over
vehicles, its mean and deviation measured on validation vehicles (`experiments.gathering.lane_trust`) and shipped with
the model. So is what is usual of its predictions after two drives, see `choice`.
"""

import json
import math
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from drift_drake.arrays import Array
from drift_drake.gathering.choice import Choice
from drift_drake.model.checkpoint import BayesianModel
from drift_drake.model.out_of_distribution import squared_distance
from drift_drake.model.posterior import Posterior
from drift_drake.model.quality import learn
from drift_drake.model.samples import Samples
from drift_drake.run_folder import write_json

SHIPPED = "lane_trust.json"  # by the hash of a checkpoint's numbers
REFUSED = 0.005  # share of the training distribution's vehicles that are refused


class Familiar(NamedTuple):
    """What a statistic of informative drives is on vehicles that the model was made for: its logarithm, normal."""

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
        """Which model is believed, by `choice.forecasts` on a car's drives."""
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
