"""Effects that do almost the same are one group; the others are not."""

import numpy as np

from drift_drake.gap.monitoring.bank import Node
from drift_drake.gap.monitoring.events import sentence
from drift_drake.gap.monitoring.evidence import evidence_problem
from drift_drake.gap.monitoring.watch import mistakable

NODES = [
    Node("steering_lag", 0.1, 1.0, 0.6), Node("steering_delay", 0.1, 1.0, 0.6), Node("gyro_bias", 0.02, 0.0, 2.0, True),
    Node("mass_error", 0.1, 0.0, 2.0, True), Node("aero_drag", 1.0, 0.0, 2.0),
]  # fmt: skip


def whitened_of(opposed: float) -> tuple[np.ndarray, np.ndarray]:
    """Scores of 300 rows with a lag; a delay that looks like it, and drag that looks like (-1) times the mass."""
    rng = np.random.default_rng(2)
    g = rng.normal(size=(300, len(NODES)))
    g[:, 1] = g[:, 0] + 0.1 * g[:, 1]
    g[:, 4] = opposed * g[:, 3] + 0.1 * g[:, 4]
    return g[:, 0] + rng.normal(size=300), g


def test_what_looks_alike_is_one_group():
    problem = evidence_problem(NODES, np.zeros(len(NODES)))
    assert mistakable(problem, *whitened_of(1.0), "steering_lag") == ("steering_delay",)
    assert mistakable(problem, *whitened_of(1.0), "gyro_bias") == ()
    assert mistakable(problem, *whitened_of(1.0), "unknown") == ()


def test_an_effect_of_one_sign_looks_like_its_like_alone():
    """A car that is lighter is what looks like drag, where they are opposed; drag is never like its own opposite."""
    problem = evidence_problem([*NODES[:3], Node("mass_error", 0.1, 0.0, 2.0), NODES[4]], np.zeros(len(NODES)))
    assert mistakable(problem, *whitened_of(-1.0), "aero_drag") == ()
    assert mistakable(problem, *whitened_of(1.0), "aero_drag") == ("mass_error",)


def test_a_group_is_in_the_sentence():
    event = {"t": 3.0, "event": "cause", "cause": "steering_lag", "onset": 1.0, "magnitude": 0.1,
             "low": 0.05, "high": 0.15, "unit": "s", "probability": 0.9, "or": ["steering_delay"]}  # fmt: skip
    assert sentence(event).endswith("since 1.0 s; or steering_delay, which would look alike")
