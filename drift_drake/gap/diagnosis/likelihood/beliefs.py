"""What a diagnosis believes under each hypothesis, kept in the answer: enough to plan the next drive from.

In addition to the hypotheses that were fitted, those that the logs do not show: an effect added to the leading one
whose signature is so weak in these logs that a magnitude of its usual size goes unseen. Their probability is their
prior's, times the share of their range that the logs leave open.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects, magnitudes_of, make_effects
from drift_drake.gap.diagnosis.likelihood.isolability import isolability
from drift_drake.gap.estimation.fit import Fit
from drift_drake.gap.estimation.prior import bounds
from drift_drake.gap.estimation.problem import NUISANCES, Problem
from drift_drake.gap.evidence.posterior import NONE, PosteriorConstants, hypothesis_name, log_prior

MOST_FITTED, MOST_UNSEEN = 3, 4  # hypotheses that are kept
LEAST_PROBABILITY = 1e-3
ROUNDING = 1e-9  # relative variance added, so that a root exists however alike two parameters are


@dataclasses.dataclass(frozen=True)
class Belief:
    """One hypothesis after the logs: N(theta, root root') of its NUISANCES and magnitudes."""

    names: tuple[str, ...]
    probability: float
    theta: np.ndarray  # [p]
    root: np.ndarray  # [p, p] lower triangular

    @property
    def name(self) -> str:
        """As in a posterior."""
        return hypothesis_name(self.names)


@dataclasses.dataclass(frozen=True)
class Sensing:
    """What the logs' sensors are like, and what the simulator of their car knew already."""

    noise: np.ndarray  # [9] standard deviations, in the order of `filter_state.CHANNELS`
    used: np.ndarray  # [9] bool
    process: np.ndarray  # [9] variances a second of the first nine filter states
    tempering: float = 1.0  # exponent of their likelihood
    own: Effects = dataclasses.field(default_factory=Effects)  # of the vehicle file; magnitudes add to them


def beliefs_as_data(
    problem: Problem,
    hypotheses: Sequence[tuple[Fit, float]],
    probabilities: Mapping[str, float],
    catalogue: Sequence[str],
    calibration: PosteriorConstants,
) -> dict[str, Any]:
    """The most probable hypotheses and the sensors as plain data; no hypotheses where all are improbable (`unknown`).

    Empty where no torque is logged.
    """
    if problem.rim_fed:
        return {}
    ranked = sorted((f for f, _ in hypotheses), key=lambda f: -probabilities[hypothesis_name(f.names)])
    fitted = [belief_of(f, probabilities[hypothesis_name(f.names)]) for f in ranked[:MOST_FITTED]]
    kept = [belief for belief in fitted if belief.probability >= LEAST_PROBABILITY]
    known = {hypothesis_name(f.names) for f in ranked}
    additional = unseen(problem, ranked[0], kept[0], catalogue, calibration) if kept else []
    hidden = [b for b in additional if b.name not in known]
    used = np.all([run.used for run in problem.runs], axis=0)
    sensing = Sensing(problem.noise, used, problem.process, problem.tempering, problem.own)
    return as_data(sensing, kept + hidden[:MOST_UNSEEN])


def as_data(sensing: Sensing, beliefs: Sequence[Belief]) -> dict[str, Any]:
    """Sensors and hypotheses as plain data, the inverse of `beliefs_from_data`; of each name the first."""
    return {
        "noise": sensing.noise.tolist(),
        "used": sensing.used.tolist(),
        "process": sensing.process.tolist(),
        "tempering": sensing.tempering,
        "own": magnitudes_of(sensing.own),
        "hypotheses": {
            b.name: {"probability": b.probability, "theta": b.theta.tolist(), "root": b.root.tolist()} for b in beliefs
        },
    }


def belief_of(fit: Fit, probability: float) -> Belief:
    """A fit without what it knows of its own runs' first commands."""
    kept = [*range(len(NUISANCES)), *range(fit.nuisances, len(fit.theta))]
    return Belief(fit.names, probability, fit.theta[kept], root_of(fit.covariance[np.ix_(kept, kept)]))


def root_of(covariance: np.ndarray) -> np.ndarray:
    """Lower triangular root of a covariance that rounding may have made singular."""
    sigma = np.sqrt(np.diag(covariance))
    alike = covariance / np.outer(sigma, sigma) + ROUNDING * np.eye(len(sigma))
    return np.asarray(sigma[:, None] * np.linalg.cholesky(alike))


def unseen(
    problem: Problem, fit: Fit, leading: Belief, catalogue: Sequence[str], calibration: PosteriorConstants
) -> list[Belief]:
    """Effects in addition to the leading hypothesis that the logs leave open, the most probable first."""
    others = [name for name in catalogue if name not in fit.names]
    if len(fit.names) > 1 or not others:
        return []
    prior = log_prior(len(fit.names) + 1, len(catalogue), calibration)
    odds = float(np.exp(prior - log_prior(len(fit.names), len(catalogue), calibration)))
    out = []
    for name, sigma in zip(others, isolability(problem, fit, others).deviation, strict=True):
        low, high = bounds(name, problem.vehicle)
        least = 0.0 if CATALOGUE[name].signed else low
        open_share = min(np.sqrt(2.0 * np.pi) * sigma / (high - low), 1.0) * np.exp(-0.5 * (least / sigma) ** 2)
        magnitude = float(np.clip(sigma, least, 0.5 * high))
        spread = min(float(sigma), 0.5 * high)
        out.append(_with_additional(leading, name, magnitude, spread, leading.probability * odds * float(open_share)))
    return sorted((b for b in out if b.probability >= LEAST_PROBABILITY), key=lambda b: -b.probability)


def _with_additional(leading: Belief, name: str, magnitude: float, spread: float, probability: float) -> Belief:
    names = tuple(sorted((*leading.names, name)))
    at = len(NUISANCES) + names.index(name)
    covariance = np.insert(np.insert(leading.root @ leading.root.T, at, 0.0, axis=0), at, 0.0, axis=1)
    covariance[at, at] = spread**2
    return Belief(names, probability, np.insert(leading.theta, at, magnitude), root_of(covariance))


def beliefs_from_data(data: Mapping[str, Any]) -> tuple[Sensing, list[Belief]]:
    """The sensors, and the beliefs, most probable first."""
    sensing = Sensing(
        np.array(data["noise"]),
        np.array(data["used"], dtype=np.bool_),
        np.array(data["process"]),
        data.get("tempering", 1.0),
        make_effects(data.get("own", {})),
    )
    beliefs = [
        Belief(
            () if name == NONE else tuple(name.split("+")),
            moments["probability"],
            np.array(moments["theta"]),
            np.array(moments["root"]),
        )
        for name, moments in data["hypotheses"].items()
    ]
    return sensing, sorted(beliefs, key=lambda b: -b.probability)
