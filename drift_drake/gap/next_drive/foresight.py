"""What a drive would tell: by how much each hypothesis would stay behind if another were true, by the filter itself."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri  # the normal's quantiles; scipy.stats takes half a second to import

from drift_drake.car.actuated import without_actuators
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import measured
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion_with_effects import settled_internal_states
from drift_drake.common.errors import one_line
from drift_drake.gap.diagnosis.answers.answer import Answer, InvalidAnswerError, UnplannableError
from drift_drake.gap.diagnosis.likelihood.beliefs import Belief, Sensing, beliefs_from_data
from drift_drake.gap.estimation.filter_state import CHANNELS, MEASURED, SIZE
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import parameter_limits, sensitivity
from drift_drake.gap.estimation.problem import NUISANCES, Problem, car, flat, run_commands, tolerance_deviations
from drift_drake.gap.estimation.roll_outs import roll_out
from drift_drake.gap.estimation.run_data import SETTLING_TIME, RunData
from drift_drake.gap.estimation.variants import Variant, ready

LARGEST = 1e6  # of any number in beliefs, in parameters' own scales
PERIOD = 0.01  # [s]
REFITS = 3  # Gauss-Newton steps of a rival's fit
CERTAIN = 1e6  # [nats] at most, where a rival's filter cannot follow at all
CHANCE = ndtri((np.arange(15) + 0.5) / 15)  # draws of what noise does to a log evidence


def beliefs_of(answer: Answer) -> tuple[Sensing, list[Belief]]:
    """The sensors of an answer's logs, and two or more rival hypotheses, most probable first.

    Raises:
        UnplannableError: the answer holds no two hypotheses.
        InvalidAnswerError: what it holds is damaged.
    """
    data = answer.details.get("beliefs") or {}
    if not data:
        raise UnplannableError(
            f"{answer.case}: the answer holds no rival hypotheses (an older answer, or logs without torque commands); "
            "diagnose logs with the column tau_cmd anew"
        )
    try:
        sensing, beliefs = beliefs_from_data(data)
        _check(sensing, beliefs)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InvalidAnswerError(
            f"{answer.case}: details.beliefs of the answer is damaged ({one_line(error)}); diagnose anew"
        ) from None
    if not beliefs:
        raise UnplannableError(
            f"{answer.case}: no catalogued hypothesis explains the gap, so that there are no rivals for a drive "
            "to distinguish; see 'nearest' in the answer, or look for a cause that the catalogue lacks"
        )
    if len(beliefs) < 2:
        raise UnplannableError(
            f"{answer.case}: {beliefs[0].name} has no rival left that a drive could distinguish it from; "
            "there is nothing to plan"
        )
    return sensing, beliefs


def _check(sensing: Sensing, beliefs: Sequence[Belief]) -> None:
    for name, array in (("noise", sensing.noise), ("used", sensing.used), ("process", sensing.process)):
        if array.shape != (len(CHANNELS),):
            raise ValueError(f"{name} has the shape {array.shape}, not {(len(CHANNELS),)}")
    noise, process = sensing.noise[sensing.used], sensing.process
    if not (np.isfinite(noise) & (noise > 0.0)).all() or not (np.isfinite(process) & (process >= 0.0)).all():
        raise ValueError("noise must be above 0, process 0 or more")
    weight = sensing.tempering
    if isinstance(weight, bool) or not isinstance(weight, (int, float)) or not 0.0 < weight <= 1.0:
        raise ValueError("tempering must be above 0, up to 1")
    if not np.isfinite(np.array(sensing.own, dtype=float)).all():
        raise ValueError("own holds no finite number")
    for belief in beliefs:
        unknown = [name for name in belief.names if name not in CATALOGUE]
        if unknown or list(belief.names) != sorted(set(belief.names)):
            raise ValueError(f"no hypothesis is called '{belief.name[:60]}'")
        size = len(NUISANCES) + len(belief.names)
        if belief.theta.shape != (size,) or belief.root.shape != (size, size):
            raise ValueError(f"theta and root of {belief.name} must be of {size} numbers")
        numbers = np.concatenate([belief.theta, belief.root.ravel()]).astype(float)
        if not (np.abs(numbers) < LARGEST).all() or not (np.diag(belief.root) > 0.0).all():
            raise ValueError(f"theta and root of {belief.name} must be finite, root's diagonal above 0")
        if isinstance(belief.probability, bool) or not 0.0 <= belief.probability <= 1.0:
            raise ValueError(f"the probability of {belief.name} is none")


@dataclasses.dataclass(frozen=True)
class Commands:
    """A drive to be: commands at 100 Hz from a start straight on."""

    delta: np.ndarray  # [rows] [rad]
    tau: np.ndarray  # [rows] [N m]
    speed: float  # [m/s] at the start
    heading: float = 0.0  # [rad] in the fixed frame of the logs


def problem_of(vehicle: VehicleParameters, sensing: Sensing, drive: Commands, y: np.ndarray) -> Problem:
    """A drive with measurements y [rows, 9] as the estimator wants it."""
    counted = np.arange(len(y)) * PERIOD >= SETTLING_TIME
    run = RunData("planned", PERIOD, y, sensing.used, drive.delta, drive.tau, counted)
    return Problem(
        [run], vehicle, vehicle.constants(), tolerance_deviations(vehicle), sensing.noise, sensing.process,
        own=sensing.own, tempering=sensing.tempering,
    )  # fmt: skip


def parameters_of(belief: Belief) -> np.ndarray:
    """Its parameters with those of one run's first commands, zero, in their place."""
    return np.concatenate([belief.theta[: len(NUISANCES)], np.zeros(2), belief.theta[len(NUISANCES) :]])


def readings(vehicle: VehicleParameters, sensing: Sensing, truth: Belief, drive: Commands) -> np.ndarray:
    """What the sensors would read [rows, 9] without noise if a hypothesis were true; NaN or wild where it diverges."""
    rows = len(drive.delta)
    problem, theta = problem_of(vehicle, sensing, drive, np.zeros((rows, MEASURED))), parameters_of(truth)
    constants, effects = car(problem, theta, truth.names)
    delta, torque = run_commands(problem, 0, theta, effects)
    states = np.zeros((rows, SIZE))
    states[0, [1, 3]], states[0, 4] = drive.speed, drive.heading
    dynamic = without_actuators(effects)
    states[0, 7:] = settled_internal_states(*states[0, :4], delta[0], torque[0], constants, dynamic, drive.heading)[2:]
    y = np.zeros((rows, MEASURED))
    y[0, :4] = measured(*states[0, :4], effects)
    y[0, CHANNELS.index("psi")] = drive.heading
    driven = ready(problem, 0, Variant(theta, truth.names))
    y[1:] = roll_out(driven, PERIOD, states, np.array([0]), np.arange(1, rows))[0]
    return y


def nats_behind(
    vehicle: VehicleParameters, sensing: Sensing, rival: Belief, drive: Commands, y: np.ndarray, refits: int = REFITS
) -> float:
    """Log evidence [nats] that a hypothesis loses on noiseless readings, its parameters fitted anew from its belief.

    With `refits` zero the fit is one linearised solution, whose loss is predicted, not evaluated.
    """
    problem, theta = problem_of(vehicle, sensing, drive, y), parameters_of(rival)
    first = len(NUISANCES)
    free = np.array([*range(first), *range(first + 2, len(theta))])
    low, high = (bound[free] for bound in parameter_limits(problem, rival.names))
    whiten = np.linalg.inv(rival.root)
    gains = filter_case(problem, theta, rival.names)

    def residual(theta: np.ndarray, innovations: Sequence[np.ndarray]) -> np.ndarray:
        return np.concatenate([flat(problem, innovations), whiten @ (theta[free] - rival.theta)])

    at = residual(theta, gains.innovations)
    for _ in range(max(refits, 1)):
        jacobian = np.concatenate([sensitivity(problem, gains, theta, rival.names).dense()[:, free], whiten])
        if not (np.isfinite(at).all() and np.isfinite(jacobian).all()):
            return CERTAIN
        step = np.clip(theta[free] - np.linalg.lstsq(jacobian, at, rcond=None)[0], low, high) - theta[free]
        if refits == 0:
            at = at + jacobian @ step
            break
        trial = theta.copy()
        trial[free] += step
        trial_gains = filter_case(problem, trial, rival.names)
        there = residual(trial, trial_gains.innovations)
        if not there @ there < at @ at:
            break
        gained, theta, gains, at = at @ at - there @ there, trial, trial_gains, there
        if gained < 0.1:
            break
    return min(0.5 * float(at @ at), CERTAIN)


def foresee(
    vehicle: VehicleParameters, sensing: Sensing, beliefs: Sequence[Belief], drive: Commands, refits: int = REFITS
) -> np.ndarray:
    """Nats [truths, rivals] that each hypothesis would lose if another were true; see `nats_behind`."""
    out = np.zeros((len(beliefs), len(beliefs)))
    for i, truth in enumerate(beliefs):
        y = readings(vehicle, sensing, truth, drive)
        for j, rival in enumerate(beliefs):
            if i != j and np.isfinite(y).all():
                out[i, j] = nats_behind(vehicle, sensing, rival, drive, y, refits)
    return out


def probability_of_truth(probabilities: np.ndarray, nats: np.ndarray) -> float:
    """Expected probability of the true hypothesis after a drive; with nats of zero, before it.

    A log evidence that is ahead by T in the mean has variance 2 T (both are that of a Gaussian's likelihood ratio).
    """
    p = np.asarray(probabilities) / np.sum(probabilities)
    ahead = nats[..., None] + np.sqrt(2.0 * nats)[..., None] * CHANCE
    weights = np.sum(p[None, :, None] * np.exp(-np.minimum(ahead, 700.0)), axis=1)
    return float(np.mean(np.sum(p[:, None] ** 2 / weights, axis=0)))
