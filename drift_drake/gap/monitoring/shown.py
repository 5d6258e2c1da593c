"""What a drive could have shown so far: for each effect the least magnitude that would have been reported."""

from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.gap.evidence.ranges import REACH, SURE
from drift_drake.gap.monitoring.evidence import HAZARD, NONE_OF_THE_CATALOGUE, EvidenceProblem

SAID = (
    "friction_level", "steering_ratio_error", "torque_gain_error", "steering_lag", "torque_lag", "steering_offset",
    "gyro_bias", "sideslip_bias",
)  # fmt: skip
"""Effects whose limits are put into words: a loss of friction, gains, lags, biases."""


def amplitude_shown(problem: EvidenceProblem, shown: np.ndarray, block: float, alarm: float) -> np.ndarray:
    """Amplitude [n] of each node from which on a change would be reported with 95 %.

    Args:
        shown: standard deviations that amplitudes of one shift the scores by [n]; block: between verdicts [s];
        alarm: probability of none below which a change is reported.
    """
    odds = np.log(HAZARD * block * (1.0 - NONE_OF_THE_CATALOGUE)) + problem.log_prior
    nats = np.log((1.0 - alarm) / alarm) - odds + 0.5 * np.log1p((shown * problem.deviation) ** 2)
    return np.asarray((SURE + np.sqrt(SURE**2 + 2.0 * np.maximum(nats, 0.0))) / np.maximum(shown, 1e-12))


def least_shown(problem: EvidenceProblem, shown: np.ndarray, block: float, alarm: float) -> dict[str, float | None]:
    """By effect the magnitude from which on a change would be reported, the more harmful sign's; of a rate limit the
    highest. None where it is beyond what is believed possible."""
    amplitude = amplitude_shown(problem, shown, block, alarm)
    out: dict[str, float | None] = {}
    for name in problem.names:
        own = [(node, float(amplitude[i])) for i, node in enumerate(problem.nodes) if node.name == name]
        found = [node.magnitude / q if name in LIMITS else node.magnitude * q for node, q in own]
        if name in LIMITS:
            found = [q for q, (node, _) in zip(found, own, strict=True) if q >= min(n.magnitude for n, _ in own)]
            out[name] = max(found, default=None)
            continue
        least = min(found, key=lambda q: q if name == "friction_level" else abs(q))
        least = min((q for q in found if q < 0.0), default=least, key=abs) if name == "friction_level" else least
        most = max(abs(node.magnitude) for node, _ in own)
        out[name] = least if abs(least) <= 2.0 * REACH * most else None
    return out


def sentence(limits: Mapping[str, float | None], said: Sequence[str] = SAID) -> str:
    """The limits in words; empty where none could be shown."""
    known = [f"{name} {q:.2g}{CATALOGUE[name].suffix}" for name in said if (q := limits.get(name)) is not None]
    hidden = [name for name in said if name in limits and limits[name] is None]
    parts = [f"a change would have been reported from {', '.join(known)} on"] if known else []
    parts += [f"none of {', '.join(hidden)} could have been seen"] if hidden else []
    return "; ".join(parts)
