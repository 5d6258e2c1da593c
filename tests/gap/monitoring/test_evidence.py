"""The posterior over changes, where closed forms are known: no evidence at all, and one node's score."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from drift_drake.gap.monitoring.bank import Node
from drift_drake.gap.monitoring.evidence import Sums, evidence_problem, no_sums, verdict_of
from drift_drake.gap.monitoring.history import no_history, with_block

NODES = [Node("steering_lag", 0.1, 1.0, 0.6), Node("gyro_bias", 0.02, 0.0, 2.0, True), Node("aero_drag", 1.0, 0.0, 2.0)]
BLOCK = 0.5  # [s]


def history(blocks: int, before: float = 0.0, score: float = 0.0, information: float = 0.0):
    """Blocks that say the same of the first node, and nothing of the others."""
    n = len(NODES)
    g, s = np.zeros((n, n)), np.zeros(n)
    g[0, 0], s[0] = information, score
    found = no_history(no_sums(n))
    found = found._replace(before=found.before._replace(rows=np.array(before)))
    for _ in range(blocks):
        found = with_block(found, Sums(np.array(50.0), np.array(0.0), np.array(100.0), s, g), 1.0, 0.0)
    return found


def verdict(*given: float):
    return verdict_of(evidence_problem(NODES, np.zeros(len(NODES))), history(*given), BLOCK)


@pytest.mark.parametrize(("blocks", "before"), [(1, 0.0), (1, 50.0), (40, 0.0), (40, 500.0)])
def test_without_evidence_the_posterior_is_the_prior(blocks, before):
    """A change comes once in ten minutes; one simulator in ten has a gap from the start, one gap in ten is unknown."""
    odds = blocks * BLOCK / 600.0 + (0.0 if before else 0.1)
    found = dict(zip(evidence_problem(NODES, np.zeros(3)).labels, verdict(blocks, before).probabilities, strict=True))
    assert found["none"] == pytest.approx(1.0 / (1.0 + odds), rel=1e-6)
    assert found["unknown"] == pytest.approx(0.1 * odds / (1.0 + odds), rel=1e-6)
    assert sum(found.values()) == pytest.approx(1.0)


def test_the_evidence_of_a_node_is_its_likelihoods_integral_over_the_cut_prior():
    """By quadrature: the score is normal about information times amplitude, the amplitude normal and not negative."""
    information, score = 30.0, 24.0
    node = NODES[0]
    spread = np.sqrt(information * 1.001)  # a thousandth of a score's variance is no signature's

    def likelihood(a):
        return norm.pdf(score, information * a, spread) * norm.pdf(a, node.mean, node.deviation)

    whole = quad(likelihood, 0.0, 6.0, points=[score / information])[0] / norm.cdf(node.mean / node.deviation)
    ratio = whole / norm.pdf(score, 0.0, spread)
    best = 0.5 * score**2 / (1.001 * information)
    temper = 1.0 + 2.0 * 0.15**2 * best / len(NODES)  # the signature's own error, of what it explains
    found = verdict(1, 50.0, score, information)
    p = dict(zip(("none", *(node.name for node in NODES), "unknown"), found.probabilities, strict=True))
    assert temper < 1.2
    assert np.log(p["steering_lag"] / p["gyro_bias"]) == pytest.approx(
        np.log(ratio) / temper + prior_odds("steering_lag", "gyro_bias"), abs=0.15
    )
    mean = quad(lambda a: a * likelihood(a), 0.0, 6.0, points=[0.8])[0] / (whole * norm.cdf(node.mean / node.deviation))
    assert found.magnitude == pytest.approx(mean * node.magnitude, rel=0.02)
    assert found.low < found.magnitude < found.high


def prior_odds(one: str, other: str) -> float:
    from drift_drake.car.effects.catalogue import CATALOGUE

    return float(np.log(CATALOGUE[one].daily / CATALOGUE[other].daily))
