"""Scores and information of the stretches of a world's days, kept in files: what diagnoses to first order rest on."""

import json
import pickle
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from tqdm import tqdm

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.given_vehicle import single_track_of
from drift_drake.car.log.table import read_case
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle, stated_tolerances
from drift_drake.common.errors import DriftDrakeError
from drift_drake.gap.diagnosis.calibrated.diagnose_change import search_of
from drift_drake.gap.estimation.baseline import Seen, Stretches, seen_of, stretches_of
from drift_drake.gap.estimation.learn_normal import Learnt, learn_normal
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prediction_constants import LEFT_OF_FITTED, LEFT_OF_OTHERS, REGULAR
from drift_drake.gap.estimation.scores import flat_scores
from drift_drake.gap.estimation.usable import admit, seen_effects
from drift_drake.gap.evidence.posterior import NONE, UNKNOWN
from drift_drake.gap.identification import by_prediction
from drift_drake.gap.identification.identify import calibrate
from drift_drake.gap.identification.stated import Asked
from experiments.other_worlds.road import days_of

FACTORS = (0.5, 2.0)
REGULARS = (1.0, *FACTORS)  # times `REGULAR`, that scores are projected with


class KeptDay(NamedTuple):
    """One other day."""

    code: str
    truth: str  # name of the right hypothesis
    strange: bool
    stretches: dict[float, Stretches]  # by factor of `REGULAR`


class Calibrated(NamedTuple):
    """A calibrated car, and what learning its normal was given."""

    vehicle: VehicleParameters
    effects: Effects
    normal: Normal
    precisions: dict[float, np.ndarray]  # of errors in scales, by factor of `REGULAR`
    prior: np.ndarray  # standard deviations of the effects before the logs, in units [n]
    least_deviations: np.ndarray  # [n]
    fitted: np.ndarray  # [n] bool
    baseline: dict[float, Seen]


def calibrated(world: Path, folder: str) -> Calibrated:
    """The car of a world, calibrated by prediction on one of its folders.

    Raises:
        DriftDrakeError: its logs cannot be used.
    """
    given: list[tuple[Any, ...]] = []

    def learn(*asked: Any) -> Learnt:
        given.append(asked)
        return learn_normal(*asked)

    vehicle, effects = read_vehicle(world / "start.yaml")
    with patch.object(by_prediction, "learn_normal", learn):
        asked = Asked(
            vehicle, effects, world.name, criterion="prediction", force=True,
            tolerances=stated_tolerances(world / "start.yaml"), kind="single-track",
        )  # fmt: skip
        found = calibrate(read_case(world / folder), asked)
    day, _, _, prior, least_deviations, left = given[-1]  # a second fit is the one that counts
    normal = found.calibration.normal
    assert normal is not None
    f = flat_scores(day.errors, normal.scales)
    covariance = np.cov(f.T)
    precisions = {q: np.linalg.inv(covariance + q * REGULAR * np.eye(len(covariance))) for q in REGULARS}
    fitted = left > np.sqrt(LEFT_OF_FITTED * LEFT_OF_OTHERS) * prior
    seen = {q: seen_of(day, normal.scales, precision) for q, precision in precisions.items()}
    return Calibrated(
        single_track_of(found.vehicle), found.effects, normal, precisions, prior, least_deviations, fitted, seen
    )


def day_of(case: Path, car: Calibrated) -> dict[float, Stretches]:
    """Stretches of a later day, by factor of `REGULAR`.

    Raises:
        DriftDrakeError: its logs cannot be used.
    """
    runs = admit(read_case(case), car.vehicle).runs
    names, _ = seen_effects(runs, car.normal.names)
    day = search_of(runs, car.vehicle, car.normal, car.effects, names, case.name, 1).day
    return {
        q: stretches_of(day, car.normal.scales, precision, car.normal.slipping)
        for q, precision in car.precisions.items()
    }


def kept_world(world: Path, baseline: str, folder: Path) -> tuple[Calibrated, list[KeptDay]]:
    """A world's calibrated car and its other days from their files, or, where they are not there yet, from its logs;
    days that cannot be used are reported.

    Args:
        baseline: folder of the world to calibrate on; folder: of the files.
    """
    car: Calibrated = _kept(folder / "car.pkl", lambda: calibrated(world, baseline))
    labels, days = json.loads((world / "labels.json").read_text()), []
    for code in tqdm([code for code in days_of(world) if code in labels], unit="day", desc=world.name):
        try:
            stretches = _kept(folder / f"{code}.pkl", lambda code=code: day_of(world / code, car))
        except DriftDrakeError as error:
            print(f"left out: {error}", flush=True)
            continue
        strange = bool(labels[code].get("strange"))
        truth = UNKNOWN if strange else "+".join(sorted(labels[code]["effects"])) or NONE
        days.append(KeptDay(code, truth, strange, stretches))
    return car, days


def _kept(path: Path, make: Any) -> Any:
    """What a file of this experiment holds; made and written where it is not there."""
    if path.exists():
        return pickle.loads(path.read_bytes())
    made = make()
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_bytes(pickle.dumps(made))
    part.replace(path)
    return made
