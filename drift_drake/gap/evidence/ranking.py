"""From evidences of changes to probabilities, a verdict, and what kind of decision it is."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.gap.evidence.alarms import FALSE_ALARMS, threshold
from drift_drake.gap.evidence.constants import ALSO, ELSE, HALF, OPEN, SECOND, SURE_OF_NONE
from drift_drake.gap.evidence.hypotheses import Hypothesis
from drift_drake.gap.evidence.left_over import with_noise
from drift_drake.gap.evidence.posterior import (
    NONE,
    UNKNOWN,
    PosteriorConstants,
    Ranked,
    ambiguity_set,
    hypothesis_name,
    log_prior,
)

Decision = Literal["none", "cause", "cause_open", "undecided"]
TOO = f"+{UNKNOWN}"  # of a hypothesis' name: and an unknown cause


@dataclasses.dataclass(frozen=True)
class DayRanked(Ranked[Hypothesis]):
    """Probabilities and a verdict of a change from a calibrated baseline.

    A hypothesis named "X+unknown" is X and something else that the catalogue lacks. Where that leads, the probability
    of X is of both.
    """

    decision: Decision = "none"
    something_else: float = 0.0  # probability of an unknown cause in addition to the leading one, where that is said

    @property
    def most_like(self) -> str:
        """What a gap is most like, if there is one: a cause, with something else or not, or `unknown`."""
        return max((name for name in self.probabilities if name != NONE), key=lambda name: self.probabilities[name])


def ranked(
    hypotheses: Sequence[Hypothesis], catalogue: int, constants: PosteriorConstants, doubt: float = 0.0,
    false_alarms: float = FALSE_ALARMS, noise: float | None = None, factors: np.ndarray | float = 0.0,
) -> DayRanked:  # fmt: skip
    """Probabilities of hypotheses, of each with an unknown cause too, and of `unknown`.

    Args:
        hypotheses: `none` is among them; no other whose interval holds zero or that removes nothing;
        catalogue: number of effects that were considered;
        doubt: probability that no hypothesis can be judged at all, which is `unknown`'s;
        false_alarms: rate at which a day without an effect may be said to have a gap;
        noise: log evidence that the noise on readings has changed; None where it is not judged;
        factors: log probabilities of those on what equations lack from stretch to stretch [K] (`Normal.factors`).
    """
    values: dict[str, float] = {}
    best: dict[str, Hypothesis] = {}
    among: dict[str, float] = {}
    warm = constants.temperature  # of evidence alone: what logs say nothing of keeps its prior

    def mixed(evidence: np.ndarray | float) -> float:
        return float(np.logaddexp.reduce(np.atleast_1d(evidence / warm + factors)))

    for h in hypotheses:
        name, before, evidence = hypothesis_name(h.names), prior(h, catalogue, constants), h.log_evidence + h.by_factor
        value = before + mixed(evidence)
        if name not in best or value > values[name]:
            best[name], values[name] = h, value
        if h.among is not None and len(h.names) == 1:
            among[name] = max(before + mixed(h.among), among.get(name, -np.inf))
        if h.names and h.left_over is not None:
            both = before + np.log(ELSE) + mixed(evidence + with_noise(h.left_over.gain, noise))
            values[name + TOO] = max(both, values.get(name + TOO, -np.inf))
    values |= shared_out(values, among)
    none = best[NONE]
    if none.left_over is not None:
        evidence = none.log_evidence + none.by_factor + with_noise(none.left_over.gain, noise)
        values[UNKNOWN] = mixed(evidence) + float(np.log(constants.prior_unknown))
    return concluded_from(values, list(best.values()), doubt, false_alarms)


def shared_out(values: Mapping[str, float], among: Mapping[str, float]) -> dict[str, float]:
    """Log posteriors by name of causes that keep what they hold together and share it as log posteriors `among` say.

    That there is a gap is one question, and which of them it is another: a gap's shape is not exact in equations that
    do not follow the car, and the more there is of it the further off it may be.
    """
    if not among:
        return {}
    total = np.logaddexp.reduce([values[name] for name in among]) - np.logaddexp.reduce(list(among.values()))
    return {name: float(value + total) for name, value in among.items()}


def prior(h: Hypothesis, catalogue: int, constants: PosteriorConstants) -> float:
    """Log prior of a hypothesis, but for a constant."""
    names = (*h.names, *h.additional)
    daily = float(np.sum([np.log(CATALOGUE[name].daily) for name in names]))
    return log_prior(len(names), catalogue, constants) + daily - SECOND * (len(names) > 1)


def concluded_from(
    values: Mapping[str, float], hypotheses: Sequence[Hypothesis], doubt: float, false_alarms: float = FALSE_ALARMS
) -> DayRanked:
    """Probabilities and a verdict from log posteriors [-] by name, but for a constant.

    Args:
        hypotheses: that are known, `none` among them; doubt: probability of `unknown` besides what `values` give it.
    """
    names, v = list(values), np.array(list(values.values()))
    p = np.exp(v - np.max(v))
    p = (1.0 - doubt) * p / np.sum(p)
    probabilities = dict(zip(names, (float(q) for q in p), strict=True))
    probabilities[UNKNOWN] = probabilities.get(UNKNOWN, 0.0) + doubt
    by_name = {hypothesis_name(h.names): h for h in hypotheses}
    causes = {
        name: probabilities.get(name, 0.0) + probabilities.get(name + TOO, 0.0) for name in by_name if name != NONE
    }
    lead = max(causes, key=lambda name: causes[name], default=NONE)
    none = probabilities.get(NONE, 0.0)
    is_gap, too = none < threshold(false_alarms), [name for name in probabilities if name.endswith(TOO)]
    more = probabilities.get(lead + TOO, 0.0) / max(causes.get(lead, 1.0), 1e-300)
    asked = [lead + TOO]  # for an unknown cause in addition
    if more <= 0.5:  # which cause it is may be open, while each leaves something over
        further = sum(probabilities[name] for name in (*too, UNKNOWN)) / max(1.0 - none, 1e-300)
        more, asked = further if is_gap and too and further > ALSO else 0.0, too
    if more and explained(by_name[lead], by_name[NONE]) >= HALF:
        probabilities[lead] = causes[lead]
        probabilities.pop(lead + TOO, None)
    elif more:
        probabilities[UNKNOWN] += sum(probabilities.pop(name) for name in asked)
        causes[lead] = probabilities[lead]
    verdict: str = NONE
    decision: Decision = "none" if none >= SURE_OF_NONE else "undecided"
    if is_gap:
        cause = causes.get(lead, 0.0)
        verdict = "effect" if cause > probabilities[UNKNOWN] else UNKNOWN
        decision = "cause" if verdict == "effect" and cause >= OPEN * (1.0 - none) else "cause_open"
    probabilities = dict(sorted(probabilities.items(), key=lambda item: -item[1]))
    known = lead if verdict != NONE and lead != NONE else NONE
    if verdict == UNKNOWN and none > causes.get(lead, 0.0):
        known = NONE
    ambiguous = ambiguity_set(probabilities)
    # With something else or without it, a cause is among them.
    ambiguous += [name for name in causes if name + TOO in ambiguous and name not in ambiguous]
    return DayRanked(
        probabilities, ambiguous, verdict, by_name[known], decision,
        more if verdict == "effect" and lead + TOO not in probabilities else 0.0,
    )  # fmt: skip


def halfway(kept: DayRanked, every: DayRanked) -> DayRanked:
    """The verdict on hypotheses that were kept, with the mean of its probabilities and of those of every one.

    Of a short day: held-out blocks are few there, and may rule out the right cause.
    """
    names = dict.fromkeys((*kept.probabilities, *every.probabilities))
    means = {name: 0.5 * (kept.probabilities.get(name, 0.0) + every.probabilities.get(name, 0.0)) for name in names}
    probabilities = dict(sorted(means.items(), key=lambda item: -item[1]))
    lead = hypothesis_name(kept.leading.names)
    is_it = probabilities.get(lead, 0.0) + probabilities.get(lead + TOO, 0.0)
    sure = kept.decision == "cause" and is_it >= OPEN * (1.0 - probabilities.get(NONE, 0.0))
    return dataclasses.replace(kept, probabilities=probabilities, ambiguity=ambiguity_set(probabilities),
                               decision="cause" if sure else "cause_open")  # fmt: skip


def explained(h: Hypothesis, none: Hypothesis) -> float:
    """Share of a gap, as a squared distance from normal beyond what is usual, that a hypothesis explains."""
    usual = 0.5 * none.scores
    return 1.0 - max(h.nats - usual, 0.0) / max(none.nats - usual, 1e-9)
