"""What a diagnosis believes under each hypothesis, kept in the answer: enough to plan the next drive from."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drift_drake.diagnosis.fit import Fit
from drift_drake.diagnosis.posterior import NONE, hypothesis_name
from drift_drake.diagnosis.problem import NUISANCES, Problem

MOST, LEAST_PROBABILITY = 5, 1e-4  # hypotheses that are kept
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
    """What the logs' sensors are like."""

    noise: np.ndarray  # [9] standard deviations, in the order of `filter.CHANNELS`
    used: np.ndarray  # [9] bool
    process: np.ndarray  # [9] variances a second of the first nine filter states


def beliefs_as_data(
    problem: Problem, hypotheses: Sequence[tuple[Fit, float]], probabilities: Mapping[str, float]
) -> dict[str, Any]:
    """The most probable hypotheses and the sensors as plain data; empty where no torque is logged."""
    if problem.rim_fed:
        return {}
    ranked = sorted((f for f, _ in hypotheses), key=lambda f: -probabilities[hypothesis_name(f.names)])
    kept = [f for f in ranked[:MOST] if probabilities[hypothesis_name(f.names)] >= LEAST_PROBABILITY]
    return {
        "noise": problem.noise.tolist(),
        "used": np.all([run.used for run in problem.runs], axis=0).tolist(),
        "process": problem.process.tolist(),
        "hypotheses": {hypothesis_name(f.names): _moments(f) for f in kept},
    }


def _moments(fit: Fit) -> dict[str, Any]:
    kept = [*range(len(NUISANCES)), *range(fit.nuisances, len(fit.theta))]
    covariance = fit.covariance[np.ix_(kept, kept)]
    sigma = np.sqrt(np.diag(covariance))
    alike = covariance / np.outer(sigma, sigma) + ROUNDING * np.eye(len(kept))
    return {"theta": fit.theta[kept].tolist(), "root": (sigma[:, None] * np.linalg.cholesky(alike)).tolist()}


def beliefs_from_data(data: Mapping[str, Any], probabilities: Mapping[str, float]) -> tuple[Sensing, list[Belief]]:
    """The sensors, and the beliefs, most probable first."""
    sensing = Sensing(np.array(data["noise"]), np.array(data["used"], dtype=np.bool_), np.array(data["process"]))
    beliefs = [
        Belief(
            () if name == NONE else tuple(name.split("+")),
            probabilities[name],
            np.array(moments["theta"]),
            np.array(moments["root"]),
        )
        for name, moments in data["hypotheses"].items()
    ]
    return sensing, sorted(beliefs, key=lambda b: -b.probability)
