"""What another day's diagnosis believes, kept in the answer as `beliefs` says: what the next drive is planned from.

Beside the hypotheses of the posterior, effects that these logs could not have shown: those whose detection limit lies
beyond their practical range, or furthest up in it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from drift_drake.diagnosis.another_day.detection_limits import DetectionLimit
from drift_drake.diagnosis.another_day.hypotheses import Hypothesis, Search
from drift_drake.diagnosis.another_day.posterior import deviation
from drift_drake.diagnosis.likelihood.beliefs import (
    LEAST_PROBABILITY,
    MOST_FITTED,
    MOST_UNSEEN,
    Belief,
    Sensing,
    as_data,
)
from drift_drake.diagnosis.shared.posterior import PosteriorConstants, Ranked, hypothesis_name, log_prior
from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.estimation.problem import NUISANCES, PROCESS_NOISE
from drift_drake.estimation.scores import BETWEEN_DAYS
from drift_drake.estimation.windows import PREDICTED
from drift_drake.vehicle.catalogue import CATALOGUE

INDEPENDENT = 0.5  # [s] after which prediction errors of such a car are independent, roughly
PERIOD = 0.01  # [s] of a planned drive's rows


def day_beliefs(
    search: Search, found: Ranked[Hypothesis], hypotheses: Sequence[Hypothesis], limits: Mapping[str, DetectionLimit],
    constants: PosteriorConstants,
) -> dict[str, Any]:  # fmt: skip
    """The sensors and the hypotheses as plain data; empty where no torque is logged.

    A row is noisy by the calibrated car's own errors a tenth of a second ahead, and weighs what independent ones are
    worth, between days.
    """
    runs = search.day.runs
    if any(run.fed for run in runs):
        return {}
    measured = np.all([run.used for run in runs], axis=0)
    noise, used = np.ones(len(CHANNELS)), np.zeros(len(CHANNELS), dtype=bool)
    for i, name in enumerate(PREDICTED):
        at = CHANNELS.index(name)
        used[at] = measured[i]
        noise[at] = search.normal.scales[0, i] if measured[i] else 1.0
    by_name = {hypothesis_name(h.names): h for h in hypotheses}
    leading = hypothesis_name(found.leading.names)
    known = [name for name in found.probabilities if name in by_name][:MOST_FITTED]
    beliefs = [
        belief(h.names, found.probabilities[name], h.magnitudes, [deviation(h, i) for i in range(len(h.names))])
        for name in known
        for h in [by_name[name]]
        if found.probabilities[name] >= LEAST_PROBABILITY or name == leading
    ]
    if not found.leading.names:
        likely = max(found.probabilities.get("none", 0.0), LEAST_PROBABILITY)
        odds = float(np.exp(log_prior(1, len(search.ranges), constants) - log_prior(0, len(search.ranges), constants)))
        there = [b.name for b in beliefs]
        unseen = [name for name in hidden(search, limits)[:MOST_UNSEEN] if name not in there]
        beliefs += [unseen_belief(search, name, likely * odds) for name in unseen]
    row_weight = PERIOD / (INDEPENDENT * BETWEEN_DAYS)
    return as_data(Sensing(noise, used, PROCESS_NOISE**2, row_weight, search.day.own), beliefs)


def hidden(search: Search, limits: Mapping[str, DetectionLimit]) -> list[str]:
    """Effects that the logs could not have shown within their practical range, the most usual first."""

    def usual(name: str) -> float:
        return max(abs(q) for q in CATALOGUE[name].range_for(search.vehicle))

    names = [name for name, limit in limits.items() if limit.least is None or limit.least > usual(name)]
    return sorted(names, key=lambda name: -CATALOGUE[name].daily)


def belief(names: tuple[str, ...], probability: float, magnitudes: ArrayLike, deviations: Sequence[float]) -> Belief:
    """One hypothesis: the calibrated car's own parameters within their tolerances, and the magnitudes."""
    theta, root = np.append(np.zeros(len(NUISANCES)), magnitudes), np.diag([*np.ones(len(NUISANCES)), *deviations])
    return Belief(names, probability, theta, root)


def unseen_belief(search: Search, name: str, probability: float) -> Belief:
    """An effect of half its practical range, which went unseen."""
    low, high = search.ranges[name].usual
    size = 0.5 * max(abs(low), abs(high))
    magnitude = max(size, search.ranges[name].least) * (1.0 if high >= -low else -1.0)
    return belief((name,), probability, [magnitude], [0.5 * size])
