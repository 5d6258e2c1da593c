"""A baseline's own recordings, left out in turn and asked what a diagnosis asks: has the car a gap?

To first order: what a magnitude takes off the scores is its column of the information. No window is predicted anew.
"""

import numpy as np

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.baseline import Scatter
from drift_drake.gap.estimation.learn_normal import Learnt
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prediction_constants import FACTORS
from drift_drake.gap.estimation.prior import range_of
from drift_drake.gap.estimation.recordings_left_out import scale_of
from drift_drake.gap.evidence.constants import PRIORS
from drift_drake.gap.evidence.hypotheses import Hypothesis, integrated, unusual
from drift_drake.gap.evidence.left_over import left_over
from drift_drake.gap.evidence.ranking import DayRanked, ranked

GRID = 81  # magnitudes of an effect


def asked_in_turn(learnt: Learnt, vehicle: VehicleParameters) -> list[DayRanked]:
    """What each recording of a baseline says relative to the others, at the scale of scatter that these show.

    Args:
        learnt: what the baseline shows; vehicle: the calibrated car.
    """
    normal, out, main = learnt.normal, [], learnt.normal.main
    for k, part in enumerate(learnt.left_out):
        scatter = part.at(scale_of(np.delete(normal.left_out, k)), np.array(FACTORS) / FACTORS[main], main)
        out.append(ranked_to_first_order(part.scores(scatter), scatter, normal, normal.factors, vehicle))
    return out


def ranked_to_first_order(
    scores: np.ndarray, scatter: Scatter, normal: Normal, factors: np.ndarray, vehicle: VehicleParameters
) -> DayRanked:
    """What scores less their normal mean [m] say, of single effects alone; factors: their log probabilities [K]."""

    def hypothesis(causes: tuple[str, ...], x: np.ndarray, evidence: np.ndarray) -> Hypothesis:
        rest, main = left_over(x, scatter, normal.names, np.zeros((len(x), 0))), float(evidence[scatter.main])
        nats, k = 0.5 * float(x @ scatter.inverse @ x), len(causes)
        return Hypothesis(causes, np.zeros(k), np.eye(k), nats, main, scores=len(x), by_factor=evidence - main,
                          left_over=rest)  # fmt: skip

    found = [hypothesis((), scores, scatter.log_densities(scores))]
    for i, name in enumerate(normal.names):
        r = range_of(name, vehicle)
        q = np.linspace(r.low, r.high, GRID)
        q = q[r.allows(q)]
        if len(q) < 2:
            continue
        x = scores + q[:, None] / normal.units[i] * scatter.information[:, i]
        best = int(np.argmax(scatter.log_densities(x)[scatter.main] - unusual(q, r)))
        found.append(hypothesis((name,), x[best], integrated(q, x, r, scatter)))
    return ranked(found, len(normal.names), PRIORS, factors=factors)
