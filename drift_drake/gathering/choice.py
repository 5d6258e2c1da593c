"""Which model may drive a car at its limits: asked of the logs of its informative drives, before it drifts.

Both the learnt model and the car that the drives identify (`identified`) predict the drives half a second ahead, from
each fifth of a second. The identified car is believed where it predicts better than the learnt model, and no worse than
on nearly all cars that follow its equations (little more than the sensors' noise is left): as it is, with one thing
more that a controller plans with (`identified.ONE_MORE`), or as a double-track car. The learnt model is believed where
it predicts no worse than on nearly all vehicles that it was made for (`Usual`); of a car that it knows, the identified
one is believed if it is twice as near. Where neither does, no model knows the car: the prior of the model that is
trained on more kinds of cars (`model.checkpoint.broad_checkpoint`) then adapts while it drives, since what a lane has
taught the learnt one of such a car leads it astray in a drift. Nor is any model believed on logs that contradict
themselves, on drives too gentle to ask by, or on a car of another size than those that the limits were measured on
(`doubts`).

A lane tells the learnt model of drifts what its training vehicles had in common. The nominal car's equations with
effects of the catalogue, fitted to the same drives, carry over from a lane to a drift for any car that follows them.
"""

import json
import math
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import stdtrit

from drift_drake.arrays import Array
from drift_drake.estimation.windows import HORIZONS, WindowedRun, forecast_error, windowed
from drift_drake.gathering.identified import ONE_MORE, IdentifiedCar, identified, identified_double_track
from drift_drake.logs.screening.suspicions import suspicions
from drift_drake.logs.table import Run
from drift_drake.model.bayesian_step import BayesianStepModel
from drift_drake.model.checkpoint import BayesianModel
from drift_drake.model.command_lag import lagged_commands
from drift_drake.model.features import STATE_COUNT
from drift_drake.model.out_of_distribution import squared_distance
from drift_drake.model.posterior import Posterior
from drift_drake.model.quality import learn, predicted_windows, step_model
from drift_drake.model.samples import Samples
from drift_drake.run_folder import write_json
from drift_drake.standard_output import Progress
from drift_drake.vehicle.effect import wheelbase
from drift_drake.vehicle.parameters import VehicleParameters

SHIPPED = "lane_trust.json"  # by the hash of a checkpoint's numbers
LIVELY = 95  # [%] of a drive's rows; informative drives exceed the grip in more than 5 %, by 1.1 to 2.5 times
OTHER_SIZE = 1.5  # ratio of wheelbases
NEARER = 0.5  # of another's forecast error, from which on a model is far nearer
REFUSED = 0.005  # share of the training distribution's vehicles that are refused

Believed = Literal["learnt", "identified", "neither"]


class Findings(NamedTuple):
    """What drives say of two models of a car."""

    car: IdentifiedCar | None  # that they identify
    learnt: float  # how far off the learnt model is half a second ahead (`forecast_error`)
    identified: float  # and the identified car; infinite without one
    doubts: tuple[str, ...] = ()  # why the drives are no ground to believe either
    hint: str = ""  # which one thing more would bring the identified car far nearer, though not near enough
    as_it_is: float = math.inf  # how far off the identified car is without one thing more


class Choice(NamedTuple):
    """How far off half a second ahead two models of a car are, and what is usual."""

    found: Findings
    learnt_limit: float
    identified_limit: float

    @property
    def beyond(self) -> tuple[str, ...]:
        """What the identified car has that a controller does not plan with."""
        return self.found.car.beyond if self.found.car else ()

    @property
    def believed(self) -> Believed:
        """Which of them knows the car, and can be planned with."""
        if self.found.doubts:
            return "neither"
        if self._identified and not self.beyond:
            return "identified"
        return "learnt" if self.found.learnt <= self.learnt_limit else "neither"

    @property
    def _identified(self) -> bool:
        learnt, car = self.found.learnt, self.found.identified
        as_usual = car <= min(learnt, self.identified_limit)
        return as_usual or (learnt <= self.learnt_limit and car < NEARER * learnt)

    def sentence(self) -> str:
        """What follows from it."""
        found = self.found
        if found.doubts:
            return f"no model is believed on these drives: {'; '.join(found.doubts)}"
        follow = {
            "learnt": "drive with the learnt model",
            "identified": f"drive with {found.car.name if found.car else 'the identified car'}",
            "neither": "let the model of more kinds of cars adapt as it drives (drift-drake drive --model broad)",
        }[self.believed]
        if self._identified and self.beyond:
            beyond = ", ".join(self.beyond)
            follow = (
                f"the car is identified with {beyond}, which a controller does not plan with: mend that, or {follow}"
            )
        elif self.believed == "neither":
            follow = f"no model knows this car: {follow}, or gather more"
        car = "no car was identified"
        if math.isfinite(found.identified):
            rule = f"as a rule at most {self.identified_limit:.3g}{found.hint}"
            car = f"{found.identified:.3g} for the identified car ({rule})"
        return (
            f"{follow}: forecast errors half a second ahead are {found.learnt:.3g} for the learnt model "
            f"(as a rule at most {self.learnt_limit:.3g}); {car}"
        )


def learnt_errors(model: BayesianStepModel, runs: Sequence[WindowedRun]) -> Array:
    """Errors of the learnt model's predictions [windows, HORIZONS, 4], each from a smoothed measurement on."""
    return np.concatenate([_run_errors(model, run) for run in runs])


def _run_errors(model: BayesianStepModel, run: WindowedRun) -> Array:
    commands = np.stack([run.delta, run.tau], axis=1)
    lagged = lagged_commands(run.period * np.arange(len(commands)), commands, model.lag)
    x = np.concatenate([run.start_y[run.starts, :STATE_COUNT], np.zeros((len(run.starts), 2)), lagged[run.starts]], 1)
    out = np.empty((len(x), HORIZONS, STATE_COUNT))
    for h, ahead in enumerate(predicted_windows(model, x, commands, run.starts, run.stride_rows, HORIZONS)):
        out[:, h] = run.y[run.starts + (h + 1) * run.stride_rows, :STATE_COUNT] - ahead[:, :STATE_COUNT]
    return out


def ask(
    model: BayesianModel,
    belief: Posterior,
    runs: Sequence[Run],
    first_guess: VehicleParameters,
    progress: Progress | None = None,
) -> Findings:
    """Asks the drives of a car: what they identify, and how well that and the learnt model predict them.

    Where the identified car predicts worse than is usual, it is identified again with each of `ONE_MORE`. The one
    that predicts best is taken if it is as good as usual. Where none is, a double-track car is identified, and taken if
    that is as good as usual.

    Args:
        belief: of the learnt model after these drives; runs: with torque, sideslip and rim speed.
        first_guess: of the car; progress: called with a stage and a share.

    Raises:
        InvalidLogError: a column that holds no number.
    """
    tell = progress or (lambda _stage, _share: None)
    tell("the car as it is", 0.0)
    found, usual = findings(model, belief, identified(runs, first_guess), runs, first_guess), usual_for(model)
    if usual is None or found.doubts or found.identified <= usual.identified.limit():
        tell("done", 1.0)
        return found
    judged, cars, stages = [windowed(run) for run in runs], list[IdentifiedCar | None](), 2 + len(ONE_MORE)
    for number, name in enumerate(ONE_MORE, 1):
        tell(f"with {name}", number / stages)
        cars.append(identified(runs, first_guess, (name,)))
    best = min(cars, key=lambda car: car_error(car, judged))
    if car_error(best, judged) > usual.identified.limit():
        tell("on two tracks", 1.0 - 1.0 / stages)
        best = min(best, identified_double_track(runs, first_guess), key=lambda car: car_error(car, judged))
    tell("done", 1.0)
    error = car_error(best, judged)
    if error <= usual.identified.limit():
        return found._replace(car=best, identified=error)
    if best is None or error > NEARER * found.identified:
        return found
    return found._replace(hint=f"; {error:.3g} for {best.name}")


def findings(
    model: BayesianModel,
    belief: Posterior,
    car: IdentifiedCar | None,
    runs: Sequence[Run],
    first_guess: VehicleParameters,
) -> Findings:
    """The same with the car that the drives identify, if they do."""
    judged = [windowed(run) for run in runs]
    learnt = forecast_error(learnt_errors(step_model(model, belief), judged))
    error = car_error(car, judged)
    return Findings(car, learnt, error, doubts(runs, first_guess, model.vehicle), as_it_is=error)


def car_error(car: IdentifiedCar | None, judged: Sequence[WindowedRun]) -> float:
    """How far off an identified car is half a second ahead (`forecast_error`); infinite without one."""
    return math.inf if car is None else forecast_error(car.errors(judged))


def doubts(runs: Sequence[Run], vehicle: VehicleParameters, made_for: VehicleParameters) -> tuple[str, ...]:
    """Why drives say nothing of which model may drive: columns that contradict the others, gentle drives, another size.

    Args:
        vehicle: first guess of the car; made_for: the car that the learnt model and the limits are about.
    """
    found = [doubt.sentence for doubt in suspicions(runs, vehicle) if doubt.column is not None]
    grip = vehicle.friction * vehicle.gravity
    if max(float(np.percentile(np.abs(run.v * run.r), LIVELY)) for run in runs) < grip:
        found.append(
            f"they are too gentle (yaw rate times speed stays below {grip:.1f} m/s^2 in {LIVELY} % of each): drive "
            "informative ones"
        )
    if not 1.0 / OTHER_SIZE < wheelbase(vehicle) / wheelbase(made_for) < OTHER_SIZE:
        found.append(
            f"the wheelbase is {wheelbase(vehicle):.2f} m, and the model and its limits are of cars of "
            f"{wheelbase(made_for):.2f} m: train a model on cars of this size"
        )
    return tuple(found)


class Familiar(NamedTuple):
    """What a statistic of informative drives is on vehicles that the model was made for: its logarithm, normal.

    Measured on validation vehicles (`experiments.gathering.lane_trust`), and shipped with the model.
    """

    mean: float
    deviation: float
    vehicles: int

    def limit(self, refused: float = REFUSED) -> float:
        """What a further such vehicle exceeds with a probability `refused`."""
        quantile = -float(stdtrit(self.vehicles - 1, refused))
        return math.exp(self.mean + quantile * self.deviation * math.sqrt(1.0 + 1.0 / self.vehicles))


class Usual(NamedTuple):
    """What is usual for a model."""

    surprise: Familiar  # mean squared distance of the first informative drive
    learnt: Familiar  # `forecast_error` of the model after two
    identified: Familiar  # the same of the car that these two identify

    def choice(self, found: Findings) -> Choice:
        """Which model is believed, by what a car's drives say (`ask`)."""
        return Choice(found, self.learnt.limit(), self.identified.limit())


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
