"""When the newest rows say otherwise: the change is over, or the car has changed once more.

A verdict is about all rows since a change. Once those of the last moments are normal, though the effect that was
named would have shown in them, the change is over. Where all rows since have no single cause, but the last moments
have one, those alone count from then on.
"""

import numpy as np

from drift_drake.diagnosis.shared.ranges import RATE_LIMIT
from drift_drake.monitoring.evidence import EvidenceProblem, Verdict, verdict_of, whitened
from drift_drake.monitoring.history import History, newest, since, until

RECENT = 1.5  # [s]
TRUSTED = 0.5  # probability of none, from which on the simulator may be believed
ALARM = 0.05  # probability of none, below which a change is reported
NAMED = 0.8  # probability, from which on a cause is
REFUTED = -5.0  # [nats] of an effect against none, below which it has ended


def renewed(problem: EvidenceProblem, history: History, verdict: Verdict, block: float) -> tuple[History, Verdict]:
    """The history that counts, and the verdict on it, after a verdict that the car has changed."""
    recent = newest(history, RECENT / block, verdict.edge)
    if not recent.lengths.any() or verdict.edge * block <= RECENT:
        return history, verdict
    now = verdict_of(problem, recent, block)
    unknown = verdict.probabilities[-1] >= verdict.probabilities[1:-1].max()
    if now.probabilities[0] >= TRUSTED and (unknown or _nats(problem, recent, verdict) < REFUTED):
        return recent, now
    if unknown and now.probabilities[1:-1].max() >= NAMED:
        return recent, now
    return history, verdict


def _nats(problem: EvidenceProblem, recent: History, verdict: Verdict) -> float:
    """Log likelihood of the leading effect with its magnitude against none, of a recent history."""
    _, sums = since(recent)
    w, m = (a[-1] for a in whitened(problem, sums, until(recent)))
    out = []
    for i in np.flatnonzero(problem.member[:, int(np.argmax(verdict.probabilities[1:-1]))]):
        node = problem.nodes[i]
        ratio = node.magnitude / verdict.magnitude if node.name == RATE_LIMIT else verdict.magnitude / node.magnitude
        if ratio > 0.0 or node.signed:
            out.append(float(ratio * (m[:, i] @ w) - 0.5 * ratio**2 * (m[:, i] @ m[:, i])))
    return max(out, default=0.0)
