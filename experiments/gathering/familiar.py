"""What is usual of a model's first informative drive, and of the car that the drives identify: measured, and kept.

`gap.choose.choice` believes a car by the latter, which ships with the package; by the former the experiments say what a
model's surprise would refuse.
"""

from pathlib import Path

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.common.run_folder import write_json
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.gap.choose.choice import IDENTIFIED, SURPRISE, Familiar, stored


def familiar_from(values: Array) -> Familiar:
    """From a statistic's values [vehicles] on vehicles in distribution.

    Raises:
        ValueError: fewer than three vehicles.
    """
    if len(values) < 3:
        raise ValueError(f"{len(values)} vehicles are too few to say what is usual; give three or more")
    logs = np.log(values)
    return Familiar(float(logs.mean()), float(logs.std(ddof=1)), len(logs))


def keep_usual(model: BayesianModel, error: Familiar, surprise: Familiar, path: Path) -> None:
    """Writes what is usual to a file, with what it holds of other models."""
    surprises = stored(path)[SURPRISE] | {model.content_hash(): surprise._asdict()}
    write_json(path, {IDENTIFIED: error._asdict(), SURPRISE: surprises})
