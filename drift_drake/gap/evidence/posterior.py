"""From evidences to a posterior over `none`, singles, pairs and `unknown`."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import numpy as np
import yaml

from drift_drake.gap.estimation.fit import Fit
from drift_drake.gap.estimation.problem import TOLERANCES

HELD = 0.95  # of the posterior, by the ambiguity set
NONE, UNKNOWN = "none", "unknown"
CALIBRATION_FILE = Path(__file__).parent / "calibration.yaml"


@dataclasses.dataclass(frozen=True)
class PosteriorConstants:
    """Constants of the posterior, fitted on simulated cases by `python -m experiments.gap.blind calibrate`."""

    temperature: float = 1.0  # log evidences are divided by it (of a change log posteriors: no order changes)
    prior_none: float = 0.3
    prior_single: float = 0.4  # shared by all single effects
    prior_pair: float = 0.15  # shared by all pairs
    prior_unknown: float = 0.15
    unknown_cost: float = 10.0  # [nats] that what is left unexplained must be worth, beyond chance
    unknown_share: float = 0.003  # and this share of what the best hypothesis explains
    implausible: float = 10.0  # tolerances that a deviation may be off where nothing catalogued explains the gap
    interval_factor: float = 1.0  # on the standard deviations of magnitudes


class _Named(Protocol):
    """A hypothesis of either diagnosis."""

    @property
    def names(self) -> tuple[str, ...]: ...


H = TypeVar("H", bound=_Named)


@dataclasses.dataclass(frozen=True)
class Ranked(Generic[H]):
    """Probabilities by name ("none", "unknown", "effect", "effect+effect"), most probable first, and what they say."""

    probabilities: dict[str, float]
    ambiguity: list[str]
    verdict: str  # effect, none or unknown
    leading: H  # of the hypotheses other than unknown

    @property
    def causes(self) -> tuple[str, ...]:
        """That the verdict names."""
        return self.leading.names if self.verdict == "effect" else ()


def read_constants(path: Path = CALIBRATION_FILE) -> PosteriorConstants:
    """The constants that the package ships, or those of another file."""
    return PosteriorConstants(**yaml.safe_load(path.read_text()))


def hypothesis_name(names: Sequence[str]) -> str:
    """Two causes are joined by '+' in alphabetical order."""
    return "+".join(sorted(names)) if names else NONE


def log_prior(count: int, catalogue: int, c: PosteriorConstants) -> float:
    """Log prior of one hypothesis with `count` effects out of a catalogue of that size."""
    if count == 0:
        return float(np.log(c.prior_none))
    if count == 1:
        return float(np.log(c.prior_single / catalogue))
    return float(np.log(c.prior_pair / max(catalogue * (catalogue - 1) / 2, 1)))


def implausibility(fit: Fit, c: PosteriorConstants) -> float:
    """Log evidence that deviations gain if they may be `implausible` tolerances off instead of one."""
    n = fit.theta[:TOLERANCES] / fit.exactness
    width = c.implausible
    gains = 0.5 * n**2 * (1.0 - 1.0 / width**2) - np.log(width)
    return float(np.sum(np.maximum(gains, 0.0)))


def probabilities_of(
    evidence: dict[tuple[str, ...], float], gain: float, catalogue: int, c: PosteriorConstants
) -> dict[str, float]:
    """Probabilities by name, largest first.

    Args:
        evidence: log evidence of each fitted hypothesis by its effects; the empty tuple is among them.
        gain: log evidence that goes unexplained by the best of them [nats].
        catalogue: number of effects that were considered.
    """
    scores = {hypothesis_name(n): e / c.temperature + log_prior(len(n), catalogue, c) for n, e in evidence.items()}
    best = max(evidence.values())
    cost = c.unknown_cost + c.unknown_share * (best - evidence[()])
    scores[UNKNOWN] = (best + max(gain, 0.0) - cost) / c.temperature + float(np.log(c.prior_unknown))
    names, values = list(scores), np.array(list(scores.values()))
    weights = np.exp(values - np.max(values))
    weights /= np.sum(weights)
    return {names[i]: float(weights[i]) for i in np.argsort(-weights, kind="stable")}


def ambiguity_set(probabilities: Mapping[str, float]) -> list[str]:
    """The smallest set of hypotheses that holds 95 %, of probabilities largest first."""
    out, held = [], 0.0
    for name, p in probabilities.items():
        out.append(name)
        held += p
        if held >= HELD:
            break
    return out


def ranked_by(probabilities: dict[str, float], hypotheses: Iterable[H]) -> Ranked[H]:
    """What probabilities, largest first, say of the hypotheses that are known."""
    leader = next(iter(probabilities))
    by_name = {hypothesis_name(h.names): h for h in hypotheses}
    known = by_name[next(name for name in probabilities if name != UNKNOWN)]
    verdict = leader if leader in (NONE, UNKNOWN) else "effect"
    return Ranked(probabilities, ambiguity_set(probabilities), verdict, known)


def make_posterior(
    hypotheses: Sequence[tuple[Fit, float]], unexplained: float, catalogue: int, c: PosteriorConstants
) -> Ranked[Fit]:
    """Probabilities of all fitted hypotheses and of `unknown`, and what they say.

    Args:
        hypotheses: (fit, log evidence), best first; the one with no effects is among them.
        unexplained: log evidence that forces gain over the best hypothesis [nats].
        catalogue: number of effects that were considered.
    """
    gain = max(unexplained, 0.0) + implausibility(hypotheses[0][0], c)
    probabilities = probabilities_of({f.names: e for f, e in hypotheses}, gain, catalogue, c)
    return ranked_by(probabilities, (f for f, _ in hypotheses))
