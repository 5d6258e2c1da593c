"""What is usual of a model's first informative drive, and of the car that the drives identify: measured, and kept.

`gap.choose.choice` believes a car by the latter, which ships with the package; by the former the experiments say what a
model's surprise would refuse.
"""

from pathlib import Path

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.common.run_folder import write_json
from drift_drake.drive.learnt.bayesian_step import regression_points
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.posterior import Posterior, mahalanobis, predict
from drift_drake.drive.learnt.quality import learn
from drift_drake.drive.learnt.samples import Samples
from drift_drake.gap.choose.choice import IDENTIFIED, SURPRISE, Familiar, stored

SURPRISED = 0.005  # share of the training distribution's vehicles that the first drive refuses


def squared_distance(
    model: BayesianModel, belief: Posterior, x: Array, u: Array, u_next: Array, x_next: Array
) -> float:
    """Squared Mahalanobis distance of one sample from what a belief predicts (eq. 7), of four degrees of freedom.

    Args:
        x, x_next: states and lagged commands at both ends of a step [8]; u, u_next: commands there [2].
    """
    phi, y = regression_points(model, x, u, u_next, x_next)
    return float(mahalanobis(predict(belief, model.sigma, phi), y) ** 2)


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


def usual_surprise(model: BayesianModel, path: Path | None = None) -> Familiar | None:
    """Mean squared distance of the first informative drive (`squared_distances`) of a car that the model was made for.

    None for a model that nobody has asked this of.
    """
    found = stored(path)[SURPRISE].get(model.content_hash())
    return None if found is None else Familiar(**found)


def keep_usual(model: BayesianModel, error: Familiar, surprise: Familiar, path: Path) -> None:
    """Writes what is usual to a file, with what it holds of other models."""
    surprises = stored(path)[SURPRISE] | {model.content_hash(): surprise._asdict()}
    write_json(path, {IDENTIFIED: error._asdict(), SURPRISE: surprises})
