"""What a drive could show: for each effect the least magnitude that would be detected and named in a given time."""

from typing import NamedTuple

import numpy as np

from drift_drake.gap.estimation.prior import SURE
from drift_drake.gap.monitoring.evidence import HAZARD, EvidenceProblem, Sums, residual_scores


class Limit(NamedTuple):
    """Of one node, as amplitudes."""

    detected: float  # the least amplitude that is distinguished from none with 95 %
    named: float  # and from every other effect


def limits(problem: EvidenceProblem, recent: Sums, older: Sums, seconds: float, alarm: float) -> list[Limit]:
    """Limits of each node.

    Args:
        recent: sums of the `seconds` after a change; older: of all before it, without a leading axis;
        alarm: probability of none below which a change is reported.
    """
    _, covariance = residual_scores(problem, *(Sums(*(a[None] for a in sums)) for sums in (recent, older)))
    root = np.linalg.cholesky(covariance[0])
    shift = np.linalg.solve(root, recent.information)  # of the whitened scores, by amplitudes [n, n]
    size = np.linalg.norm(shift, axis=0)
    prior = np.log(HAZARD * seconds) + problem.log_prior + np.log(alarm)
    occam = 0.5 * np.log1p((size * problem.deviation) ** 2)
    nats = np.maximum(occam - np.where(np.isfinite(prior), prior, 0.0), 0.0)
    detected = (SURE + np.sqrt(SURE**2 + 2.0 * nats)) / np.maximum(size, 1e-12)
    unit = shift / np.maximum(size, 1e-12)
    cosine = np.abs(unit.T @ unit)
    same = (problem.member @ problem.member.T > 0.0) | (problem.member.sum(axis=1) == 0.0)
    nearest = np.max(np.where(same, 0.0, cosine), axis=1)
    apart = 2.0 * SURE / np.maximum(size * np.sqrt(np.maximum(1.0 - nearest**2, 1e-12)), 1e-12)
    return [Limit(float(d), float(max(d, a))) for d, a in zip(detected, apart, strict=True)]
