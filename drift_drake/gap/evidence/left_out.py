"""A baseline's own recordings, left out in turn and asked what a diagnosis asks: has the car a gap?

To first order: what a magnitude takes off the scores is its column of the information. No window is predicted anew.
"""

import numpy as np

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.baseline import Scatter, scale_of
from drift_drake.gap.estimation.learn_normal import Learnt
from drift_drake.gap.estimation.prior import range_of
from drift_drake.gap.evidence.constants import PRIORS
from drift_drake.gap.evidence.hypotheses import Hypothesis, unusual
from drift_drake.gap.evidence.left_over import left_over
from drift_drake.gap.evidence.ranking import DayRanked, ranked

GRID = 81  # magnitudes of an effect


def asked_in_turn(learnt: Learnt, vehicle: VehicleParameters) -> list[DayRanked]:
    """What each recording of a baseline says relative to the others, at the scale of scatter that these show.

    Args:
        learnt: what the baseline shows; vehicle: the calibrated car.
    """
    normal, out = learnt.normal, []
    for k, part in enumerate(learnt.left_out):
        scatter = part.at(scale_of(np.delete(normal.left_out, k)))
        scores = part.stretches.scores.sum(axis=0) - scatter.mean
        out.append(ranked_to_first_order(scores, scatter, normal.names, normal.units, vehicle))
    return out


def ranked_to_first_order(
    scores: np.ndarray, scatter: Scatter, names: tuple[str, ...], units: np.ndarray, vehicle: VehicleParameters
) -> DayRanked:
    """What scores less their normal mean [m] say, of single effects alone."""

    def hypothesis(causes: tuple[str, ...], x: np.ndarray, log_evidence: float) -> Hypothesis:
        rest = left_over(x, scatter, names, np.zeros((len(x), 0)))
        nats, k = 0.5 * float(x @ scatter.inverse @ x), len(causes)
        return Hypothesis(causes, np.zeros(k), np.eye(k), nats, log_evidence, scores=len(x), left_over=rest)

    found = [hypothesis((), scores, -0.5 * float(scores @ scatter.inverse @ scores))]
    for i, name in enumerate(names):
        r = range_of(name, vehicle)
        q = np.linspace(r.low, r.high, GRID)
        q = q[r.allows(q)]
        if len(q) < 2:
            continue
        x = scores + q[:, None] / units[i] * scatter.information[:, i]
        nats = 0.5 * np.einsum("ki,ij,kj->k", x, scatter.inverse, x)
        log_density = -nats - unusual(q, r) - np.log(r.width)
        best = int(np.argmax(log_density))
        top = float(log_density[best])
        evidence = top + float(np.log(np.trapezoid(np.exp(log_density - top), q)))
        found.append(hypothesis((name,), x[best], evidence))
    return ranked(found, len(names), PRIORS)
