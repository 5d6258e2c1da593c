"""From evidences to a posterior over `none`, singles, pairs and `unknown`."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.diagnosis.fit import Fit
from drift_drake.diagnosis.problem import TOLERANCES

NONE, UNKNOWN = "none", "unknown"


@dataclasses.dataclass(frozen=True)
class Calibration:
    """Constants of the posterior, fitted on simulated cases by `experiments.gap_blind calibrate`."""

    temperature: float = 1.0  # log evidences are divided by it
    prior_none: float = 0.3
    prior_single: float = 0.4  # shared by all single effects
    prior_pair: float = 0.15  # shared by all pairs
    prior_unknown: float = 0.15
    unknown_cost: float = 10.0  # [nats] that what is left unexplained must be worth, beyond chance
    unknown_share: float = 0.003  # and this share of what the best hypothesis explains
    implausible: float = 10.0  # tolerances that a deviation may be off where nothing catalogued explains the gap
    interval_factor: float = 1.0  # on the standard deviations of magnitudes


@dataclasses.dataclass(frozen=True)
class Posterior:
    """Probabilities by name ("none", "unknown", "effect", "effect+effect"), largest first, and what they say."""

    probabilities: dict[str, float]
    ambiguity: list[str]
    verdict: str  # effect, none or unknown
    causes: tuple[str, ...]
    fit: Fit  # of the leading hypothesis other than unknown


def hypothesis_name(names: Sequence[str]) -> str:
    """Two causes are joined by '+' in alphabetical order."""
    return "+".join(sorted(names)) if names else NONE


def log_prior(count: int, catalogue: int, c: Calibration) -> float:
    """Log prior of one hypothesis with `count` effects out of a catalogue of that size."""
    if count == 0:
        return float(np.log(c.prior_none))
    if count == 1:
        return float(np.log(c.prior_single / catalogue))
    return float(np.log(c.prior_pair / max(catalogue * (catalogue - 1) / 2, 1)))


def implausibility(fit: Fit, c: Calibration) -> float:
    """Log evidence that deviations gain if they may be `implausible` tolerances off instead of one."""
    n = fit.theta[:TOLERANCES] / fit.exactness
    width = c.implausible
    gains = 0.5 * n**2 * (1.0 - 1.0 / width**2) - np.log(width)
    return float(np.sum(np.maximum(gains, 0.0)))


def make_posterior(
    hypotheses: Sequence[tuple[Fit, float]], unexplained: float, catalogue: int, c: Calibration
) -> Posterior:
    """Probabilities of all fitted hypotheses and of `unknown`.

    Args:
        hypotheses: (fit, log evidence), best first; the one with no effects is among them.
        unexplained: log evidence that forces gain beside the best hypothesis [nats].
        catalogue: number of effects that were considered.
    """
    scores = {
        hypothesis_name(f.names): e / c.temperature + log_prior(len(f.names), catalogue, c) for f, e in hypotheses
    }
    best, evidence = hypotheses[0]
    nothing = next(e for f, e in hypotheses if not f.names)
    gain = max(unexplained, 0.0) + implausibility(best, c)
    cost = c.unknown_cost + c.unknown_share * max(evidence - nothing, 0.0)
    scores[UNKNOWN] = (evidence + gain - cost) / c.temperature + float(np.log(c.prior_unknown))
    values = np.array(list(scores.values()))
    weights = np.exp(values - np.max(values))
    weights /= np.sum(weights)
    order = np.argsort(-weights, kind="stable")
    names = list(scores)
    probabilities = {names[i]: float(weights[i]) for i in order}
    ambiguity, held = [], 0.0
    for name, p in probabilities.items():
        ambiguity.append(name)
        held += p
        if held >= 0.95:
            break
    leader = next(iter(probabilities))
    by_name = {hypothesis_name(f.names): f for f, _ in hypotheses}
    known = next(name for name in probabilities if name != UNKNOWN)
    verdict = leader if leader in (NONE, UNKNOWN) else "effect"
    causes = by_name[leader].names if verdict == "effect" else ()
    return Posterior(probabilities, ambiguity, verdict, causes, by_name[known])
