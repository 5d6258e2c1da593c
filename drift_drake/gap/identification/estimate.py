"""The most likely car: the filter's likelihood over all unknowns, its noise scaled to what the innovations show."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE, wheelbase
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import Linearised, minimise, prior_precision
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.problem import NUISANCES, TOLERANCES, Problem, flat
from drift_drake.gap.estimation.unknowns import BROAD

PARAMETERS = NUISANCES[: TOLERANCES - 1]  # those of the vehicle itself; the rim speed's scale is the sensor's
LONGEST_LAG = 0.5  # [s]
RETARDATION = 0.3  # of the weight: the largest drag and rolling resistance
LARGEST_SPLIT = 0.5
KEEPS = 0.025  # of the practical range, below which an effect is left out
FIRST_SHARE = 0.1  # of its range that an effect starts from where the vehicle file has none
ROUNDS = 5  # of fits, each with the noise that the last one's innovations ask for
SETTLED = 0.02  # of the noise's scale
ITERATIONS = 8  # of a fit
ENOUGH = 0.5  # [nats] of a step that is not worth another
NEAR = 20.0  # mean square up to which a fit by likelihood may still make innovations white


def check_effect_names(known: Sequence[str], effects: Sequence[str]) -> None:
    """Raises InvalidVehicleError, with the names to choose from, where one is none of a parameter or an effect."""
    for name in known:
        if name not in PARAMETERS:
            raise InvalidVehicleError(f"{name} is no parameter to be held; there are {', '.join(PARAMETERS)}")
    for name in effects:
        if name not in Effects._fields:
            raise InvalidVehicleError(f"{name} is no effect; the catalogue has {', '.join(Effects._fields)}")


def widened(vehicle: VehicleParameters, known: Sequence[str]) -> VehicleParameters:
    """The vehicle with broad priors for tolerances, but for the `known` parameters and where its own are broader."""
    changes = {}
    for name in PARAMETERS:
        if name not in known:
            broad = getattr(BROAD, name) * (wheelbase(vehicle) if name == "front_axle_distance" else 1.0)
            changes[name] = max(broad, getattr(vehicle.tolerance, name))
    return vehicle.replace(tolerance=dataclasses.replace(vehicle.tolerance, **changes))


def shown_effects(effects: Sequence[str], runs: Sequence[Run]) -> list[str]:
    """Effects that the logs' columns can show."""
    torque = all(run.tau_cmd is not None for run in runs)
    return [name for name in effects if torque or not (CATALOGUE[name].resists or "tau_cmd" in CATALOGUE[name].needs)]


def effect_ranges(
    names: Sequence[str], vehicle: VehicleParameters, runs: Sequence[Run], effects: Effects = Effects()
) -> dict[str, tuple[float, float]]:
    """Flat priors of the effects, on the car's own scale; the diagnosis's ranges are a full-size car's.

    effects: of the first guess, whose lags may be twice as long.
    """
    top = max(float(np.max(np.abs(run.v))) for run in runs)
    weight = vehicle.mass * vehicle.gravity
    retardation = {"N s^2/m^2": weight / top**2, "-": 1.0, "N m": weight * vehicle.wheel_radius, "N": weight}
    own: dict[str, tuple[float, float]] = {}
    for name in names:
        info = CATALOGUE[name]
        if info.resists and info.unit in retardation:
            own[name] = 0.0, RETARDATION * retardation[info.unit]
        elif info.share and info.signed:
            own[name] = -LARGEST_SPLIT, LARGEST_SPLIT
        elif info.unit == "s" and info.stage in ("command", "actuator"):
            longest = max(LONGEST_LAG, 2.0 * abs(float(getattr(effects, name))))
            own[name] = -longest if info.signed else 0.0, longest
    return own


def first_magnitude(name: str, effects: Effects, low: float, high: float, share: float = FIRST_SHARE) -> float:
    """Where an effect starts: at the vehicle file's magnitude, else a share of its range from its least."""
    given = float(getattr(effects, name))
    if given != 0.0:
        return float(np.clip(given, low, high))
    return max(low, 0.0) + (share * (high - low) if low >= 0.0 else 0.0)


@dataclasses.dataclass(frozen=True)
class Trust:
    """How far the filter trusts the sensors and the model: factors on both standard deviations."""

    noise: float
    process: float


def trusted(problem: Problem, trust: Trust) -> Problem:
    """The problem with its noise levels scaled."""
    return problem.replace(noise=problem.noise * trust.noise, process=problem.process * trust.process**2)


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A mode of the posterior, and the noise that goes with it."""

    names: tuple[str, ...]
    theta: np.ndarray  # as in `diagnosis.problem`
    at: Linearised
    problem: Problem  # scaled by `trust`
    trust: Trust

    @property
    def covariance(self) -> np.ndarray:
        """Of theta, as if the innovations were white and the model right [n, n]."""
        return np.linalg.inv(self.at.jacobian.information + np.diag(prior_precision(self.problem, len(self.theta))))


def mean_square(problem: Problem, theta: np.ndarray, names: Sequence[str]) -> float:
    """Of the innovations that count."""
    return float(np.mean(flat(problem, filter_case(problem, theta, names).innovations) ** 2))


def estimate(problem: Problem, names: Sequence[str], theta: np.ndarray, r_over_q: float) -> Estimate:
    """Fits under noise whose common scale is such that the innovations have mean square one.

    Args:
        problem: with noise as the logs and the process noise of a well modelled car have it.
        theta: to start from; r_over_q: noise of the sensors relative to that of the process, times as stated.
    """
    scale = 1.0
    for round_number in range(ROUNDS):
        trust = Trust(scale * r_over_q, scale)
        held = trusted(problem, trust)
        if round_number > 0:
            at = minimise(held, names, theta, ITERATIONS, ENOUGH)
            theta = at.theta
            found = float(np.mean(flat(held, at.filtered.innovations) ** 2))
        else:
            found = mean_square(held, theta, names)
        scale *= float(np.sqrt(found))
        if round_number > 0 and abs(np.sqrt(found) - 1.0) < SETTLED:
            break
    return Estimate(tuple(names), theta, at, held, trust)


@dataclasses.dataclass(frozen=True)
class Whiteness:
    """Of the innovations that count: the median over runs of their mean square, and their correlation row to row."""

    mean_square: float
    correlation: float  # the largest of all channels, in absolute value

    @property
    def may_be_white(self) -> bool:
        """Whether a fit by likelihood is worth a try."""
        return self.mean_square < NEAR

    def sentence(self) -> str:
        """Why prediction was the criterion."""
        if not np.isfinite(self.mean_square):
            return "calibrated by prediction: the filter of the nominal equations loses the car on these logs"
        return (
            f"calibrated by prediction: innovations are not white (mean square {self.mean_square:.3g}, correlation "
            f"from row to row {self.correlation:.2f})"
        )


def whiteness(
    runs: Sequence[Run], vehicle: VehicleParameters, effects: Effects, stated: Mapping[str, float] | None
) -> Whiteness:
    """Innovations of the car as it is: where they are white the likelihood is exact. A filter that diverges is not."""
    problem = make_problem(runs, vehicle, stated=stated, own=effects)
    gains = filter_case(problem, np.zeros(problem.nuisances), ())
    squares, tied = [], [0.0]
    for run, e in zip(problem.runs, gains.innovations, strict=True):
        kept = e[run.counted][:, run.used]
        if not np.isfinite(kept).all() or len(kept) < 3:
            return Whiteness(float("inf"), 1.0)
        squares.append(float(np.mean(np.median(kept**2, axis=0) / 0.4549)))
        spread = kept - kept.mean(axis=0)
        tied.append(float(np.max(np.abs(np.sum(spread[1:] * spread[:-1], axis=0) / np.sum(spread**2, axis=0)))))
    return Whiteness(float(np.median(squares)), float(np.median(tied[1:])) if len(tied) > 1 else 1.0)
