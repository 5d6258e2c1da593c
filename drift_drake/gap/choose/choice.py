"""Which model may drive a car at its limits: asked of the logs of its informative drives, before it drifts.

The car that the drives identify (`identified`) predicts them half a second ahead, from each fifth of a second. It is
believed where it predicts no worse than on nearly all cars that follow its equations (`Familiar`: little more than the
sensors' noise is left): as it is, with an additional fault that a controller plans with (`identified.ONE_MORE`), or as
a double-track car. It then carries over from a lane to a drift. Of other cars the single-track car is near enough where
what it leaves over is as usual of cars of other structures: a hybrid model then learns that while it drives
(`drive.learnt.hybrid_step`). Of any other car no model is known to hold: the learnt model whose prior is of cars of
many structures then adapts while it drives, since what a lane has taught a model, or what it identifies of physics
that are not the car's, leads astray in a drift. Nor is a car believed on logs that contradict themselves, on drives too
gentle to ask by, or of another size than those that the limit was measured on (`doubts`).
"""

import json
import math
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from drift_drake.car.car_file import plant_of
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.effects.record import wheelbase
from drift_drake.car.given_vehicle import Vehicle, label_of, vehicle_given
from drift_drake.car.log.cases import Logs, logs_given
from drift_drake.car.log.table import COLUMNS, Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.common.standard_output import Progress
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.hybrid_step import hybrid_samples, load_hybrid
from drift_drake.drive.learnt.quality import squared_distances
from drift_drake.drive.learnt.samples import Samples, concatenate
from drift_drake.drive.manoeuvres.steering_check import USUAL_STEERING, Steering
from drift_drake.gap.choose.identified import BIASES, ONE_MORE, IdentifiedCar, identified, identified_with_own_states
from drift_drake.gap.choose.usable_drives import LIVELY, asked_parts, check_drives, liveliness
from drift_drake.gap.estimation.windows import WindowedRun, forecast_error, windowed
from drift_drake.gap.logs.screening.suspicions import suspicions

SHIPPED = "lane_trust.json"
IDENTIFIED, SURPRISE = "identified", "surprise"  # its keys; the latter's entries are by the hash of a checkpoint
OTHER_SIZE = 1.5  # ratio of wheelbases
NEARER = 0.5  # of another's forecast error, from which on a car is far nearer
SURPRISED = 0.005  # share of a model's cars whose drives refuse it
REFUSED = 0.001  # share of cars that follow their equations which are not believed

Believed = Literal["identified", "hybrid", "adapting"]


class Findings(NamedTuple):
    """What drives say of a car."""

    car: IdentifiedCar | None  # that they identify
    error: float = math.inf  # how far off it is half a second ahead (`forecast_error`); infinite without one
    doubts: tuple[str, ...] = ()  # why the drives are no ground to believe it
    hint: str = ""  # which other car would be far nearer, though not near enough
    as_it_is: float = math.inf  # how far off the identified car is without an additional fault, on one track
    surprise: float = math.inf  # of what that one leaves over: mean squared distance from the hybrid model's prior


class Choice(NamedTuple):
    """What drives say of a car, and what is usual."""

    found: Findings
    limit: float  # of the forecast error
    surprise_limit: float = 0.0
    remarks: tuple[str, ...] = ()  # which parts of long logs were asked

    @property
    def beyond(self) -> tuple[str, ...]:
        """What the identified car has that a controller does not plan with."""
        return self.found.car.beyond if self.found.car else ()

    @property
    def believed(self) -> Believed:
        """Whether the identified car is the car, and can be planned with, or is near to it; else a learnt model
        adapts."""
        if self.found.doubts or (self._as_usual and self.beyond):
            return "adapting"
        if self._as_usual:
            return "identified"
        return "hybrid" if self.found.surprise <= self.surprise_limit else "adapting"

    @property
    def _as_usual(self) -> bool:
        return self.found.error <= self.limit

    def sentence(self) -> str:
        """What follows from it."""
        found = self.found
        adapt = (
            "let the learnt model adapt as it drives (drift-drake drive figure_8 --model varied; then again, or the "
            "loops, with --after)"
        )
        if found.doubts:
            return f"no model is believed on these drives: {'; '.join(found.doubts)}"
        if self.believed == "identified":
            follow = f"drive with {found.car.name if found.car else 'the identified car'}"
        elif self._as_usual:
            beyond = ", ".join(self.beyond)
            follow = f"the car is identified with {beyond}, which a controller does not plan with: fix that, or {adapt}"
        elif self.believed == "hybrid":
            follow = (
                "drive with the identified car and learn what it leaves over (HybridStepModel), which is as usual of "
                "cars of other structures"
            )
        else:
            follow = f"no model is known to hold for this car: {adapt}, or gather more"
        if not math.isfinite(found.error):
            return f"{follow}; no car was identified"
        return (
            f"{follow}: half a second ahead the identified car is off by {found.error:.3g} (as a rule at most "
            f"{self.limit:.3g}{found.hint})"
        )


def ask(
    runs: Sequence[Run], first_guess: CarParameters, progress: Progress | None = None,
    steering: Steering = USUAL_STEERING,
) -> Choice:  # fmt: skip
    """Asks the drives of a car what they identify, and how well that predicts them.

    Where the identified car predicts worse than is usual, it is identified again with each of `ONE_MORE`. The one
    that predicts best is taken if it is as good as usual. Where none is, a car of four wheels is identified (of the
    first guess's kind, or double-track), then one whose sensors are off, and taken if that is as good as usual.

    Args:
        runs: with torque, sideslip and rim speed; of long ones pieces are asked (`asked_parts`);
        first_guess: of the car, of either kind; progress: called with a stage and a share.
        steering: that a slow drive showed (`drive.manoeuvres.steering_check`).

    Raises:
        InvalidLogError: a column that holds no number.
    """
    choice = _asked(runs, first_guess, progress, Effects() if steering.usual else steering.effects)
    car = choice.found.car
    return choice if car is None else choice._replace(found=choice.found._replace(car=car.with_limit(steering.rate)))


def _asked(
    runs: Sequence[Run], first_guess: CarParameters, progress: Progress | None, start: Effects
) -> Choice:  # fmt: skip
    """The same; start: of effects that a fit begins with."""
    tell = progress or (lambda _stage, _share: None)
    tell("the car without additional effects", 0.0)
    vehicle = first_guess.single_track()
    doubtful = doubts(runs, vehicle)
    runs, remarks = asked_parts(runs, vehicle)
    limit, judged = usual_error().limit(), [windowed(run) for run in runs]
    car = identified(runs, vehicle, start=start)
    error = car_error(car, judged)
    found = Findings(car, error, doubtful, as_it_is=error)
    if found.doubts or error <= limit:
        tell("done", 1.0)
        return Choice(found, limit, remarks=tuple(remarks))
    best = _another_car(runs, first_guess, limit, judged, tell, start)
    tell("done", 1.0)
    error = car_error(best, judged)
    if error <= limit:
        found = found._replace(car=best, error=error)
    elif best is not None and error < NEARER * found.error:
        found = found._replace(hint=f"; {error:.3g} for {best.name}")
    hybrid = load_hybrid()
    if car is not None and found.car is car:
        found = found._replace(surprise=surprise_of(runs, car, hybrid))
    return Choice(found, limit, hybrid_limit(hybrid), tuple(remarks))


def surprise_of(runs: Sequence[Run], car: IdentifiedCar, model: BayesianModel) -> float:
    """What a car leaves over in runs, as the mean squared distance from a hybrid model's prior, sample by sample."""
    step, samples = car.step_model(), list[Samples]()
    for number, run in enumerate(runs):
        table = pd.DataFrame({name: run.column(name) for name in COLUMNS if run.column(name) is not None})
        samples += hybrid_samples(table.assign(e=0.0, dphi=0.0), None, 0, number, step, model.vehicle)
    return float(np.mean(squared_distances(model, model.prior(), concatenate(samples))))


def _another_car(
    runs: Sequence[Run], first_guess: CarParameters, limit: float, judged: Sequence[WindowedRun], tell: Progress,
    start: Effects,
) -> IdentifiedCar | None:  # fmt: skip
    """The car that predicts best with an additional fault or, where that is beyond the limit, on four wheels."""
    cars, stages = list[IdentifiedCar | None](), 3 + len(ONE_MORE)
    for number, name in enumerate(ONE_MORE, 1):
        tell(f"with {name}", number / stages)
        cars.append(identified(runs, first_guess.single_track(), (name,), start))
    best = min(cars, key=lambda car: car_error(car, judged))
    if car_error(best, judged) <= limit:
        return best
    label = "double-track car" if isinstance(first_guess, VehicleParameters) else label_of(first_guess)
    tell(label, 1.0 - 2.0 / stages)
    double, near = identified_with_own_states(judged, first_guess) or (None, None)
    if car_error(double, judged) > limit:
        tell(f"{label} with sensor errors", 1.0 - 1.0 / stages)
        off, _ = identified_with_own_states(judged, first_guess, BIASES, near) or (None, None)
        # Two unknowns more are nearer, whatever is wrong with the logs; sensors that are off are far nearer.
        if car_error(off, judged) < NEARER * car_error(double, judged):
            double = off
    return min(best, double, key=lambda car: car_error(car, judged))


def car_error(car: IdentifiedCar | None, judged: Sequence[WindowedRun]) -> float:
    """How far off an identified car is half a second ahead (`forecast_error`); infinite without one."""
    return math.inf if car is None else forecast_error(car.errors(judged))


def doubts(runs: Sequence[Run], vehicle: VehicleParameters) -> tuple[str, ...]:
    """Why drives say nothing of which model may drive: columns that contradict the others, gentle drives, another size.

    Args:
        vehicle: first guess of the car.
    """
    found = [doubt.sentence for doubt in suspicions(runs, vehicle) if doubt.column is not None]
    grip = vehicle.friction * vehicle.gravity
    if max(liveliness(run) for run in runs) < grip:
        found.append(
            f"they are too gentle (yaw rate times speed stays below {grip:.1f} m/s^2 in {LIVELY} % of each): drive "
            "informative ones"
        )
    usual = wheelbase(VehicleParameters())
    if not 1.0 / OTHER_SIZE < wheelbase(vehicle) / usual < OTHER_SIZE:
        found.append(
            f"the wheelbase is {wheelbase(vehicle):.2f} m, and the learnt model and the limit are of cars of "
            f"{usual:.2f} m: train a model on cars of this size"
        )
    return tuple(found)


class Familiar(NamedTuple):
    """What a statistic of informative drives is on vehicles that are as they should be: its logarithm, normal.

    Measured on validation vehicles (`experiments.gathering.lane_trust`), and shipped.
    """

    mean: float
    deviation: float
    vehicles: int

    def limit(self, refused: float = REFUSED) -> float:
        """What a further such vehicle exceeds with a probability `refused`."""
        quantile = -float(stdtrit(self.vehicles - 1, refused))
        return math.exp(self.mean + quantile * self.deviation * math.sqrt(1.0 + 1.0 / self.vehicles))


def usual_error(path: Path | None = None) -> Familiar:
    """How far off the identified car is half a second ahead, after two informative drives of a car that it follows."""
    return Familiar(**stored(path)[IDENTIFIED])


def usual_surprise(model: BayesianModel, path: Path | None = None) -> Familiar | None:
    """Mean squared distance of the samples of informative drives (`squared_distances`) of a car that a model was made
    for: of the first drive; of both, of a hybrid model. None for a model that nobody has asked this of.
    """
    found = stored(path)[SURPRISE].get(model.content_hash())
    return None if found is None else Familiar(**found)


def hybrid_limit(hybrid: BayesianModel) -> float:
    """The surprise up to which a hybrid model may drive; 0 where nobody has asked what is usual for it."""
    usual = usual_surprise(hybrid)
    return 0.0 if usual is None else usual.limit(SURPRISED)


def stored(path: Path | None) -> dict[str, dict[str, Any]]:
    """What is usual, as the shipped file or another holds it."""
    source = path or Path(str(files("drift_drake") / "data" / SHIPPED))
    found: dict[str, dict[str, Any]] = {IDENTIFIED: {}, SURPRISE: {}}
    return found | (json.loads(source.read_text()) if source.is_file() else {})


def choose(
    logs: Logs, vehicle: Vehicle | None = None, *, progress: Progress | None = None,
    steering: Steering = USUAL_STEERING,
) -> Choice:  # fmt: skip
    """Says which model may drive a car at its limits, by its logs: the car that they identify, or the learnt one.

    Examples:
        >>> found = choose("logs/monday", "car.yaml")  # doctest: +SKIP
        >>> print(found.believed, found.sentence())  # doctest: +SKIP

    Args:
        logs: path of a case folder or of a run's file, or runs at 100 Hz, with torque, sideslip and rim speed;
        vehicle: vehicle file's path or parameters: a first guess, whose effects are identified anew; the shipped
            coupe's without;
        progress: called with a stage and the share done;
        steering: that a slow drive showed (`steering_of`): its limit is the identified car's, whose own drives keep
            below it.

    Raises:
        InvalidLogError: a run cannot be asked; InvalidVehicleError: of the vehicle.
    """
    given = logs_given(logs)
    first_guess = VehicleParameters() if vehicle is None else plant_of(vehicle_given(vehicle).parameters)
    check_drives(given.runs, logs if isinstance(logs, str | Path) else given.case)
    return ask(given.runs, first_guess, progress, steering)
