"""The posterior over changes, where closed forms are known: no evidence at all, and one node's score."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from drift_drake.gap.monitoring.bank import Node
from drift_drake.gap.monitoring.evidence import (
    Sums,
    alarm_at,
    evidence_problem,
    no_sums,
    renewed,
    residual_scores,
    verdict_of,
)
from drift_drake.gap.monitoring.history import no_history, with_block

NODES = [Node("steering_lag", 0.1, 1.0, 0.6), Node("gyro_bias", 0.02, 0.0, 2.0, True), Node("aero_drag", 1.0, 0.0, 2.0)]
BLOCK = 0.5  # [s]


def history(blocks: int, before: float = 0.0, score: float = 0.0, information: float = 0.0):
    """Blocks that say the same of the first node, and nothing of the others."""
    found = no_history(no_sums(len(NODES)))
    found = found._replace(before=found.before._replace(rows=np.array(before)))
    return continued(found, blocks, score, information)


def continued(found, blocks: int, score: float, information: float):
    """A history with further blocks."""
    n = len(NODES)
    g, s = np.zeros((n, n)), np.zeros(n)
    g[0, 0], s[0] = information, score
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


def test_an_alarm_is_at_odds_of_the_hazard_over_the_rate_of_false_alarms():
    """Changes come six times an hour: at six false alarms an hour the odds are even, at three in ten hours 20 to 1."""
    assert alarm_at(6.0) == pytest.approx(0.5, rel=1e-9)
    assert alarm_at(0.3) == pytest.approx(1.0 / 21.0, rel=1e-9)


def test_before_the_first_block_there_is_no_change():
    found = verdict(0)
    np.testing.assert_array_equal(found.probabilities, [1.0, 0.0, 0.0, 0.0, 0.0])  # none, three effects, unknown
    assert np.isnan([found.magnitude, found.low, found.high]).all()


def test_what_tolerances_explain_is_the_score_to_expect_given_the_older_one():
    """Both scores are normal about information times the tolerances' amplitudes: one conditioned on the other."""
    rng, tolerance = np.random.default_rng(3), np.array([0.3, 0.0, 0.1])
    old, new = (a @ a.T for a in rng.normal(size=(2, 3, 3)) * [[[3.0]], [[2.0]]])
    older, recent = rng.normal(size=(2, 3))
    prior = np.diag(tolerance**2)
    gain = new @ prior @ old @ np.linalg.inv(old @ prior @ old + old)
    covariance = new @ prior @ new + new - gain @ old @ prior @ new
    sums = [
        no_sums(3, 1)._replace(score=score[None], information=information[None])
        for score, information in ((recent, new), (older, old))
    ]
    score, found = residual_scores(evidence_problem(NODES, tolerance), *sums)
    np.testing.assert_allclose(score[0], recent - gain @ older, rtol=1e-8)
    ridge = 1.0 + 1e-3 * np.eye(3)  # no signature is exact to more than that
    np.testing.assert_allclose(found[0], covariance * ridge, rtol=1e-7)


def test_the_interval_of_a_magnitude_is_that_of_the_posteriors_deviation():
    """By quadrature, of a likelihood that the signature's own error tempers."""
    information, score, node = 30.0, 24.0, NODES[0]
    spread = np.sqrt(information * 1.001)
    temper = 1.0 + 2.0 * 0.15**2 * 0.5 * (score / spread) ** 2 / len(NODES)

    def moment(power):
        def of(a):
            return a**power * norm.pdf(score, information * a, spread) ** (1.0 / temper) * norm.pdf(a, 1.0, 0.6)

        return quad(of, -1.0, 3.0, points=[score / information])[0]

    mean = moment(1) / moment(0)
    deviation = np.sqrt(moment(2) / moment(0) - mean**2)
    found, half = verdict(1, 50.0, score, information), norm.ppf(0.975) * deviation * node.magnitude
    assert (found.magnitude, found.low, found.high) == pytest.approx(
        (mean * node.magnitude, mean * node.magnitude - half, mean * node.magnitude + half), rel=1e-3
    )


@pytest.mark.parametrize(("information", "over"), [(6.0, False), (6.5, True)])
def test_a_change_is_over_once_the_last_moments_refute_it_by_the_rate_of_false_alarms(information, over):
    """Three quiet blocks speak against an amplitude of one by half their information; due is log(12 000) = 9.39."""
    problem = evidence_problem(NODES, np.zeros(len(NODES)))
    past = continued(history(24, 50.0, 20.0, 20.0), 3, 0.0, information)
    given = verdict_of(problem, past, BLOCK)._replace(magnitude=NODES[0].magnitude)
    assert problem.labels[int(np.argmax(given.probabilities))] == "steering_lag"
    found, now = renewed(problem, past, given, BLOCK)
    assert found.lengths.sum() == (3.0 if over else past.lengths.sum())
    assert (now.probabilities[0] > 0.5) == over
    assert (now is given) == (not over)
